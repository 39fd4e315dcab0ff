"""Sampling of continuous systems under a zero-order hold, and its inverse.

Sampling with and without dead time as in [1]_, both integrals from one exponential [2]_; the
inverse is the principal logarithm [3]_.

References
----------
.. [1] K. J. Astrom and B. Wittenmark, Computer-Controlled Systems, 3rd ed., Prentice Hall 1997,
   section 2.3.
.. [2] C. F. Van Loan, Computing integrals involving the matrix exponential, IEEE Trans. Automat.
   Control 23 (1978) 395-404, doi:10.1109/TAC.1978.1101743.
.. [3] N. J. Higham, Functions of Matrices, SIAM 2008, chapter 11 (Matrix logarithm),
   doi:10.1137/1.9780898717778.
.. [4] B. N. Parlett and C. Reinsch, Balancing a matrix for calculation of eigenvalues and
   eigenvectors, Numer. Math. 13 (1969) 293-304, doi:10.1007/BF02165404.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.linalg import expm, matrix_balance
from scipy.optimize import brentq, fminbound

from ..arrays import FloatArray, Matrices
from .matrix_logarithm import principal_logarithm

_EXPLAINED = 1e-9
"""Relative rounding of a feedthrough that a fraction of a sample explains."""


def state_units(A: FloatArray, B: FloatArray | None = None) -> FloatArray:
    """Find units of the states, powers of two, in which the entries of A are of similar size [4]_.

    Those of a companion form grow with powers of its speeds: for lags of 1e6 s, exponentials and
    Schur forms of four of them have no correct digits otherwise. The diagonal is left out: it has
    no units, and that of a sampled model, next to 1, is as large as all the rest. With B, states
    that A does not connect have similar units, too.
    """
    if B is not None:
        n, m = B.shape
        return state_units(np.block([[A, B], [np.zeros((m, n + m))]]))[:n]
    coupled, reach = A - np.diag(np.diag(A)), np.eye(A.shape[0]) + (A != 0)
    for _ in range(A.shape[0].bit_length()):
        reach = (reach @ reach > 0).astype(np.float64)
    within = reach * reach.T  # 1 for states of one part, which act on each other
    with np.errstate(invalid="ignore"):  # SciPy makes positions of the units, too
        scale = matrix_balance(coupled * within, permute=False, separate=True)[1][0]
    units = np.asarray(scale, np.float64)
    # What one part does to another, as a plant to the controller behind it, has no counterpart to
    # be similar to: in the units of the other the largest is as large as that part itself.
    into = np.abs(coupled * (1 - within))
    if not np.any(into):
        return units
    sizes = (within * np.abs(A * within * units / units[:, None]).max(axis=1)).max(axis=1)
    sizes[sizes == 0] = sizes.max() or 1.0
    for _ in sizes:
        entering = (within * (into * units / units[:, None]).max(axis=1)).max(axis=1) / sizes
        change = np.round(np.log2(np.where(entering > 0, entering, 1.0)))
        if not np.any(change):
            break
        units *= np.exp2(change)
    return units


def zero_order_hold(A: FloatArray, B: FloatArray, dt: float) -> tuple[FloatArray, FloatArray]:
    """Sample x' = A x + B u with u held over each sample.

    Parameters
    ----------
    A, B : ndarray, shapes (n, n), (n, m)
    dt : float
        Sample time in s.

    Returns
    -------
    Phi, Gamma : ndarray, shapes (n, n), (n, m)
        exp(A dt) and the integral of exp(A s) B over 0..dt.
    """
    n, m = B.shape
    block, units = np.zeros((n + m, n + m)), np.ones(n + m)
    block[:n, :n], block[:n, n:] = A * dt, B * dt
    units[:n] = state_units(A)
    # Inputs of a far larger size than A would cost digits, too: one for each squaring.
    size = np.abs(block[:n, n:] / units[:n, None]).max(axis=0, initial=0.0)
    units[n:] = 1 / np.where(size > 0, size, 1.0)
    # exp([[A, B], [0, 0]] dt) = [[Phi, Gamma], [0, I]] (Van Loan 1978).
    grown = expm(block * units / units[:, None]) * units[:, None] / units
    return grown[:n, :n], grown[:n, n:]


def split_dead_time(dead_time: float, dt: float) -> tuple[int, float]:
    """Split a dead time into whole samples and a fraction of dt in 0..1.

    A fraction that differs from a whole sample only by rounding becomes that whole sample.

    Examples
    --------
    >>> from ctrl_realize.numerics.state_space.sampling import split_dead_time
    >>> split_dead_time(0.3, 0.1)
    (3, 0.0)
    """
    samples = dead_time / dt
    whole = math.floor(samples)
    rest = samples - whole
    tolerance = 1e-9 * max(1.0, samples)
    if rest < tolerance:
        rest = 0.0
    elif rest > 1 - tolerance:
        whole, rest = whole + 1, 0.0
    return whole, rest


def sample_with_dead_time(
    A: FloatArray, B: FloatArray, C: FloatArray, D: FloatArray, dt: float, dead_time: float
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, int]:
    """Sample a continuous model with a hold and any dead time.

    With dead time (d + f) dt, 0 < f < 1, the held input that acts during a sample changes
    once, after f dt. With Gamma0 the integral of exp(A s) B over the rest (1-f) dt, the state
    x[k] - Gamma0 u[k-d-1] makes the model order n again, with feedthrough C Gamma0 and
    delay d + 1.

    Parameters
    ----------
    A, B, C, D : ndarray, shapes (n, n), (n, m), (p, n), (p, m)
        Continuous model; D must be zero when the dead time is no multiple of `dt`.
    dt, dead_time : float
        In s.

    Returns
    -------
    A, B, C, D : ndarray
        Sampled core.
    delay : int
        Whole samples of delay.
    """
    whole, rest = split_dead_time(dead_time, dt)
    if rest == 0.0:
        Phi, Gamma = zero_order_hold(A, B, dt)
        return Phi, Gamma, C, D, whole
    if np.any(D):
        raise AssertionError("a fractional delay of a direct term is no state-space model")
    # x[k+1] = Phi x[k] + Gamma1 u[k-d-1] + Gamma0 u[k-d] (Astrom and Wittenmark, section 2.3),
    # then x[k] - Gamma0 u[k-d-1] as the state.
    early, Gamma0 = zero_order_hold(A, B, (1 - rest) * dt)
    late, partial = zero_order_hold(A, B, rest * dt)
    Phi = late @ early
    Gamma1 = early @ partial
    return Phi, Phi @ Gamma0 + Gamma1, C, C @ Gamma0, whole + 1


def sample_ends(
    core: Matrices, dt: float, before: FloatArray, behind: FloatArray
) -> tuple[Matrices, tuple[int, ...], tuple[int, ...]]:
    """Sample a continuous model with a hold and a delay at every input and output.

    A fraction of a sample at an input is as in `sample_with_dead_time`. At an output, what is seen
    at a sample is the state (1-f) dt after the one d + 1 samples before.

    Parameters
    ----------
    core : tuple of ndarray, shapes (n, n), (n, m), (p, n), (p, m)
        Continuous.
    dt : float
    before, behind : ndarray
        Delays of inputs and outputs in s, with fractions of a sample at one of the ends only.

    Returns
    -------
    core : tuple of ndarray
        Sampled.
    before, behind : tuple of int
        Whole samples of delay.
    """
    A, B, C, D = core
    Phi, Gamma = zero_order_hold(A, B, dt)
    C_sampled, D_sampled = C.copy(), D.copy()
    splits = [split_dead_time(tau, dt) for tau in behind.tolist()]
    for i, (_, f) in enumerate(splits):
        if f:
            early, Gamma0 = zero_order_hold(A, B, (1 - f) * dt)
            C_sampled[i], D_sampled[i] = C[i] @ early, C[i] @ Gamma0
    entry = []
    for j, tau in enumerate(before.tolist()):
        one = slice(j, j + 1)
        part = sample_with_dead_time(A, B[:, one], C, D[:, one], dt, tau)
        Gamma[:, one] = part[1]
        if split_dead_time(tau, dt)[1]:
            D_sampled[:, one] = part[3]
        entry.append(part[4])
    sampled = Phi, Gamma, C_sampled, D_sampled
    return sampled, tuple(entry), tuple(d + (f > 0) for d, f in splits)


def continuous_ends(
    core: Matrices, dt: float, before: Sequence[int], behind: Sequence[int]
) -> tuple[Matrices, tuple[float, ...], tuple[float, ...]]:
    """Invert `sample_ends`: find the continuous core, and delays in s, of a sampled one.

    The principal logarithm is taken: of all models with the same samples, the one whose poles are
    below the Nyquist frequency. No eigenvalue of A may be zero or real and negative.

    A strictly proper model with a delay of (d + f) samples at an input has, when sampled, the delay
    d + 1 and, in the column of that input, the feedthrough C Gamma0, with Gamma0 the integral of
    exp(F s) G over the last (1 - f) dt of a sample. This determines f in 0...1; so it does for the
    row of an output. A feedthrough that no fraction explains stays one.

    Parameters
    ----------
    core : tuple of ndarray, shapes (n, n), (n, m), (p, n), (p, m)
        Sampled.
    dt : float
    before, behind : sequence of int
        Delays of inputs and outputs in samples.

    Returns
    -------
    core : tuple of ndarray
        Continuous.
    before, behind : tuple of float
        In s.
    """
    A, B, C, D = core
    late = np.array(before, dtype=np.float64), np.array(behind, dtype=np.float64)
    if D.shape[0] == 1:  # a fraction behind the only output is one of each input
        late = (late[0] + late[1], np.zeros(1))
    if not A.size:
        return core, tuple((late[0] * dt).tolist()), tuple((late[1] * dt).tolist())
    units = state_units(A)
    A, B, C = A * units / units[:, None], B / units[:, None], C * units
    F = principal_logarithm(A) / dt
    n = A.shape[0]

    def held(seconds: float) -> FloatArray:
        return zero_order_hold(F, np.eye(n), seconds)[1]

    def moved(f: float) -> FloatArray:
        # B = exp(F (1-f) dt) (integral over dt) G, and the same for C
        return np.asarray(expm(F * (1 - f) * dt), dtype=np.float64)

    whole = held(dt)
    G = np.asarray(np.linalg.solve(whole, B), dtype=np.float64)

    def inputs(f: float, columns: Any) -> FloatArray:
        return np.asarray(np.linalg.solve(moved(f) @ whole, B[:, columns]), dtype=np.float64)

    def fraction(rows: Any, columns: Any) -> float | None:
        """Fraction that explains a column or row of the feedthrough."""
        wanted = D[rows, columns].ravel()
        at = int(np.argmax(np.abs(wanted)))

        def jumps(f: float) -> FloatArray:
            return np.asarray(C[rows] @ held((1 - f) * dt) @ inputs(f, columns)).ravel()

        size = abs(float(wanted[at]))
        roots = _roots_in_unit_interval(lambda f: float(jumps(f)[at] - wanted[at]), size)
        roots = [f for f in roots if np.all(np.abs(jumps(f) - wanted) <= _EXPLAINED * size)]
        # Of several exact solutions the one whose response starts most smoothly is chosen.
        return min(
            roots, key=lambda f: float(np.abs(C[rows] @ inputs(f, columns)).max()), default=None
        )

    direct = np.flatnonzero(np.any(D, axis=0) & (late[0] > 0)).tolist()
    columns = {j: f for j in direct if (f := fraction(slice(None), [j])) is not None}
    G, C, D = G.copy(), C.copy(), D.copy()
    for j, f in columns.items():
        G[:, [j]], D[:, j] = inputs(f, [j]), 0.0
        late[0][j] -= 1 - f
    if D.shape[1] == 1 and not columns:
        late = (np.zeros(1), late[0] + late[1])
    direct = np.flatnonzero(np.any(D, axis=1) & (late[1] > 0)).tolist()
    rows = {} if columns else {i: fraction([i], slice(None)) for i in direct}
    for i, f in rows.items():
        if f is not None:
            C[i], D[i] = np.linalg.solve(moved(f).T, C[i]), 0.0
            late[1][i] -= 1 - f
    core = F * units[:, None] / units, G * units[:, None], C / units, D
    return core, tuple((late[0] * dt).tolist()), tuple((late[1] * dt).tolist())


def _roots_in_unit_interval(function: Callable[[float], float], scale: float) -> list[float]:
    """Roots in 0...1, including nearly double ones."""
    grid = np.linspace(0, 1, 33)
    values = np.array([function(float(x)) for x in grid])
    nodes = list(zip(grid.tolist(), values.tolist(), strict=True))
    size = np.pad(np.abs(values), 1, constant_values=np.inf)
    for i in np.flatnonzero((size[1:-1] <= size[:-2]) & (size[1:-1] <= size[2:])).tolist():
        sign = np.sign(values[i])
        low, high = float(grid[max(i - 1, 0)]), float(grid[min(i + 1, grid.size - 1)])
        least = float(fminbound(lambda x, s=sign: s * function(float(x)), low, high, xtol=1e-12))
        nodes.append((least, function(least)))
    nodes.sort()
    roots = []
    for (a, at_a), (b, at_b) in pairwise(nodes):
        if abs(at_a) <= _EXPLAINED * scale:
            roots.append(a)
        elif at_a * at_b < 0:
            roots.append(float(brentq(function, a, b, xtol=1e-15)))
    return roots
