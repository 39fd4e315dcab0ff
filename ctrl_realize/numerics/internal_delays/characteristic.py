r"""Poles of systems closed through delays, as roots of their characteristic function.

The poles are the points where ``P(x) = [[x I - A, -B2], [-C2, E(x)^-1 - D22]]`` is singular, E the
delays. Newton's step for det P is the reciprocal of ``trace(P^-1 P')`` (Jacobi's formula), so the
determinant itself is never formed. All poles of a discrete system, n + sum(d) in number, are found
at once by the method of Ehrlich [1]_ and Aberth [2]_, as in [3]_ for matrix polynomials.

References
----------
.. [1] L. W. Ehrlich, A modified Newton method for polynomials, Commun. ACM 10 (1967) 107-108,
   doi:10.1145/363067.363115.
.. [2] O. Aberth, Iteration methods for finding all zeros of a polynomial simultaneously, Math.
   Comput. 27 (1973) 339-344, doi:10.1090/S0025-5718-1973-0329236-7.
.. [3] D. A. Bini and V. Noferini, Solving polynomial eigenvalue problems by means of the
   Ehrlich-Aberth method, Linear Algebra Appl. 439 (2013) 1130-1149,
   doi:10.1016/j.laa.2013.02.024.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.sparse.csgraph import connected_components

from ..arrays import ComplexArray, FloatArray
from .form import DelayForm
from .recurrence import absorbed
from .response import CHUNK, characteristic_matrices, solve_each, turns

CONVERGED = 1e-13
"""Step, relative to the size of the root, at which a root counts as found."""

MAX_SWEEPS = 60
"""Sweeps of the simultaneous iteration; it usually takes 10 to 20."""

DENSE = 64
"""Order up to which the eigenvalues of the augmented matrix are as fast."""


def newton_steps(
    form: DelayForm, points: ComplexArray, *, discrete: bool, zeros: bool = False
) -> ComplexArray:
    """Compute det P / (det P)' at many points; 0 where P is singular.

    With `zeros` of Rosenbrock's system matrix, which is singular at the zeros of the system,
    instead.
    """
    n, d = form.states, np.asarray(form.delays, dtype=np.float64)
    out = np.empty(points.size, dtype=np.complex128)
    for start in range(0, points.size, CHUNK):
        x = points[start : start + CHUNK]
        matrices = characteristic_matrices(form, x, discrete=discrete, ends=zeros)
        held, _ = turns(form.delays, x, discrete=discrete)
        slopes = d * held
        if discrete:
            with np.errstate(divide="ignore", invalid="ignore"):
                slopes = np.where(x[:, None] == 0, d == 1, slopes / x[:, None])
        rates = np.zeros(matrices.shape[:2], dtype=np.complex128)
        rates[:, :n], rates[:, n : n + d.size] = 1.0, slopes
        out[start : start + CHUNK] = _reciprocal_traces(matrices, rates)
    return out


def _reciprocal_traces(matrices: ComplexArray, rates: ComplexArray) -> ComplexArray:
    inverses = solve_each(matrices, np.broadcast_to(np.eye(matrices.shape[1]), matrices.shape))
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        steps = 1 / np.einsum("kii,ki->k", inverses, rates)
    # a singular P is a root
    return np.asarray(np.where(np.isnan(steps) & ~np.isfinite(inverses).all(axis=(1, 2)), 0, steps))


def siso_zeros(form: DelayForm, degree: int) -> tuple[ComplexArray, bool]:
    """Find the zeros of a discrete system of one input and output, `degree` in number.

    Returns
    -------
    zeros : ndarray, shape (degree,)
    found : bool
        Whether all of them converged.
    """
    starts = _starts(form, form.states + int(sum(form.delays)))[:degree]
    return simultaneous_roots(form, starts, zeros=True)


def newton_polished(
    form: DelayForm, starts: ComplexArray, *, discrete: bool, steps: int = 12, zeros: bool = False
) -> tuple[ComplexArray, FloatArray]:
    """Improve poles, or zeros, by Newton's method, each by itself.

    Returns
    -------
    roots : ndarray, shape (K,)
    last : ndarray, shape (K,)
        Size of the last step, relative to 1 + size of the root.
    """
    roots = starts.astype(np.complex128)
    last = np.full(roots.size, np.inf)
    active = np.arange(roots.size)
    for _ in range(steps):
        if active.size == 0:
            break
        step = newton_steps(form, roots[active], discrete=discrete, zeros=zeros)
        good = np.isfinite(step)
        roots[active[good]] -= step[good]
        last[active] = np.where(good, np.abs(step) / (1 + np.abs(roots[active])), np.inf)
        active = active[good & (last[active] > 1e-15)]
    return roots, last


def discrete_poles(form: DelayForm) -> ComplexArray:
    """Compute all poles of a discrete system, n + sum(d) in number.

    Parts that are not in a loop with one another are solved apart, so the poles of a delay outside
    of every loop are exact zeros.

    Parameters
    ----------
    form : DelayForm
        Delays in whole samples.

    Returns
    -------
    ndarray, shape (n + sum(d),)
    """
    return each_loop(form, _loop_poles)


def each_loop(form: DelayForm, poles: Callable[[DelayForm], ComplexArray]) -> ComplexArray:
    """Join the poles of all loops."""
    return np.concatenate([np.zeros(0, dtype=np.complex128), *map(poles, loops(form))])


def loops(form: DelayForm) -> list[DelayForm]:
    """Split states and delays into the parts that are in a loop with one another.

    Returns
    -------
    list of DelayForm
        Without inputs and outputs; the poles of the system are those of the parts together.
    """
    n, m, p = form.states, form.inputs, form.outputs
    A, B, C, D = form.A, form.B[:, m:], form.C[p:], form.D[p:, m:]
    links = np.block([[A, B], [C, D]])
    count, label = connected_components(links != 0, directed=True, connection="strong")
    parts = []
    for k in range(count):
        (members,) = np.nonzero(label == k)
        x, w = members[members < n], members[members >= n] - n  # states and delays
        blocks = A[np.ix_(x, x)], B[np.ix_(x, w)], C[np.ix_(w, x)], D[np.ix_(w, w)]
        parts.append(DelayForm(*blocks, tuple(form.delays[i] for i in w)))
    return parts


def _loop_poles(part: DelayForm) -> ComplexArray:
    count = part.states + int(sum(part.delays))
    if not np.any(part.D) and not (np.any(part.B) and np.any(part.C)):
        zeros = np.zeros(count - part.states, dtype=np.complex128)
        return np.concatenate([np.linalg.eigvals(part.A), zeros])
    if count > DENSE and not part.states and len(part.delays) == 1:  # a gain and a delay: z^d = D
        turns = np.exp(2j * np.pi * np.arange(count) / count)
        return np.asarray(turns * complex(part.D[0, 0]) ** (1 / count), dtype=np.complex128)
    if count > DENSE:
        roots, found = simultaneous_roots(part, _starts(part, count))
        if found:
            return roots
    dense = absorbed(part, list(range(len(part.delays))))
    values = np.asarray(np.linalg.eigvals(dense.A), dtype=np.complex128)
    return values if count > DENSE else _improved(part, values)


def _improved(part: DelayForm, values: ComplexArray) -> ComplexArray:
    """Take Newton's correction where it is one: small, and to a point of its own."""
    better, last = newton_polished(part, values, discrete=True, steps=3)
    gaps = np.abs(values[:, None] - values[None, :]) + np.diag(np.full(values.size, np.inf))
    small = np.abs(better - values) < 1e-3 * np.minimum(gaps.min(axis=1, initial=np.inf), 1.0)
    return np.asarray(np.where(small & (last < 1e-10), better, values))


def _starts(part: DelayForm, count: int) -> ComplexArray:
    """Points near the unit circle for the delays' poles, and the core's own."""
    own = np.linalg.eigvals(part.A).astype(np.complex128)
    chain = count - own.size
    angles = 2 * np.pi * (np.arange(chain) + 0.37) / max(chain, 1)
    # Equal spacing leaves the points where most roots of z^d = M(z) are; the offset breaks the
    # symmetry to the real axis, in which the iteration would be caught.
    return np.concatenate([0.97 * own * np.exp(0.01j) + 0.003j, 0.99 * np.exp(1j * angles)])


def simultaneous_roots(
    part: DelayForm, starts: ComplexArray, *, zeros: bool = False
) -> tuple[ComplexArray, bool]:
    """Find all poles (or zeros) from as many starts by the Ehrlich-Aberth iteration.

    Returns
    -------
    roots : ndarray, shape (count,)
    found : bool
        Whether all of them converged.
    """
    roots = starts.copy()
    active = np.ones(roots.size, dtype=bool)
    for _ in range(MAX_SWEEPS):
        at = np.flatnonzero(active)
        if at.size == 0:
            break
        step = newton_steps(part, roots[at], discrete=True, zeros=zeros)
        pull = np.empty(at.size, dtype=np.complex128)
        rows = max(1, 4_000_000 // roots.size)
        for start in range(0, at.size, rows):
            some = at[start : start + rows]
            gaps = roots[some, None] - roots[None, :]
            gaps[np.arange(some.size), some] = np.inf
            with np.errstate(divide="ignore", invalid="ignore"):
                pull[start : start + rows] = (1 / gaps).sum(axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            change = step / (1 - step * pull)
        change = np.where(np.isfinite(change), change, 0.01 * np.exp(1j * at))
        far = np.abs(change) > 0.5
        change[far] *= 0.5 / np.abs(change[far])
        roots[at] -= change
        active[at] = np.abs(change) > CONVERGED * np.maximum(np.abs(roots[at]), 1e-3)
    return roots, not active.any()
