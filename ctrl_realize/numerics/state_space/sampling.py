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
"""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq, minimize_scalar

from ..arrays import FloatArray
from .matrix_logarithm import principal_logarithm


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
    block = np.zeros((n + m, n + m))
    block[:n, :n] = A
    block[:n, n:] = B
    # exp([[A, B], [0, 0]] dt) = [[Phi, Gamma], [0, I]] (Van Loan 1978).
    grown = expm(block * dt)
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


def inverse_zero_order_hold(
    A: FloatArray, B: FloatArray, dt: float
) -> tuple[FloatArray, FloatArray]:
    """Find F, G with x' = F x + G u, held over `dt`, giving x[k+1] = A x[k] + B u[k].

    The principal logarithm is taken: of all models with the same samples, the one whose poles are
    below the Nyquist frequency. No eigenvalue of A may be zero or real and negative.

    Parameters
    ----------
    A, B : ndarray, shapes (n, n), (n, m)
    dt : float
        In s.

    Returns
    -------
    F, G : ndarray, shapes (n, n), (n, m)
    """
    n = A.shape[0]
    if n == 0:
        return A.copy(), B.copy()
    F = principal_logarithm(A) / dt
    _, spread = zero_order_hold(F, np.eye(n), dt)
    return F, np.asarray(np.linalg.solve(spread, B), dtype=np.float64)


def split_fraction(
    A: FloatArray, B: FloatArray, C: FloatArray, direct: float, dt: float
) -> tuple[FloatArray, FloatArray, float] | None:
    """Determine a fraction of a sample from the feedthrough of a sampled model.

    A strictly proper model with a dead time of (d + f) samples has, when sampled, the delay d + 1
    and the feedthrough C Gamma0, with Gamma0 the integral of exp(F s) G over the last (1 - f) dt of
    a sample. This determines f in 0...1.

    Parameters
    ----------
    A, B, C : ndarray, shapes (n, n), (n, 1), (1, n)
    direct : float
    dt : float

    Returns
    -------
    F, G, f
        None if no fraction explains the feedthrough.
    """
    n = A.shape[0]
    F = principal_logarithm(A) / dt

    def held(seconds: float) -> FloatArray:
        return zero_order_hold(F, np.eye(n), seconds)[1]

    def inputs(f: float) -> FloatArray:
        # B = exp(F (1-f) dt) (integral over dt) G
        moved = expm(F * (1 - f) * dt) @ held(dt)
        return np.asarray(np.linalg.solve(moved, B), dtype=np.float64)

    def misfit(f: float) -> float:
        return float((C @ held((1 - f) * dt) @ inputs(f))[0, 0]) - direct

    roots = _roots_in_unit_interval(misfit, abs(direct))
    if not roots:
        return None

    def direct_slope(f: float) -> float:
        # Of several exact solutions the one whose response starts most smoothly is chosen.
        return abs(float((C @ inputs(f))[0, 0]))

    best = min(roots, key=direct_slope)
    return F, inputs(best), best


def _roots_in_unit_interval(function: Callable[[float], float], scale: float) -> list[float]:
    """Roots in 0...1, including nearly double ones."""
    grid = np.linspace(0, 1, 33)
    values = np.array([function(float(x)) for x in grid])
    nodes = list(zip(grid.tolist(), values.tolist(), strict=True))
    size = np.abs(values)
    for i in np.flatnonzero((size[1:-1] <= size[:-2]) & (size[1:-1] <= size[2:])) + 1:
        sign = np.sign(values[i])
        low, high = float(grid[i - 1]), float(grid[i + 1])
        found = minimize_scalar(
            lambda x, s=sign: s * function(float(x)),
            bounds=(low, high),
            method="bounded",
            options={"xatol": 1e-12},
        )
        nodes.append((float(found.x), function(float(found.x))))
    nodes.sort()
    roots = []
    for (a, at_a), (b, at_b) in pairwise(nodes):
        if abs(at_a) <= 1e-13 * scale:
            roots.append(a)
        elif at_a * at_b < 0:
            roots.append(float(brentq(function, a, b, xtol=1e-15)))
    return roots
