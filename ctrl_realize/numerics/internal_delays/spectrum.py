r"""Right-most poles of continuous systems closed through delays.

A pure delay is the transport of its input along a line. On Chebyshev points of that line it becomes
an ordinary linear system, whose eigenvalues approach the poles faster than any power of the number
of points: those next to the origin first [1]_, [2]_. Each is then a start of Newton's method on the
characteristic function itself, and counts only where that converges.

Where direct terms close a loop of delays the system is of neutral type: its poles may crowd at a
vertical line far up. They stay to the left of the imaginary axis for all small changes of the
delays if the spectral radius of ``D22 diag(exp(j theta))`` is below 1 for all angles [3]_.

References
----------
.. [1] D. Breda, S. Maset and R. Vermiglio, Pseudospectral differencing methods for characteristic
   roots of delay differential equations, SIAM J. Sci. Comput. 27 (2005) 482-495,
   doi:10.1137/030601600.
.. [2] L. N. Trefethen, Spectral Methods in MATLAB, SIAM 2000, chapter 6,
   doi:10.1137/1.9780898719598.
.. [3] W. Michiels and S.-I. Niculescu, Stability, Control, and Computation for Time-Delay Systems,
   2nd ed., SIAM 2014, section 1.2, doi:10.1137/1.9781611973631.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import block_diag, eig

from ..arrays import ComplexArray, FloatArray
from .characteristic import each_loop, loops, newton_polished
from .dominant import RESIDUAL, apart, with_pairs, with_whole_pairs
from .form import DelayForm

FIRST_POINTS, MOST_POINTS = 16, 160
"""Chebyshev points of each delay, at first and at most."""

VANISHED = -36.0
"""Logarithm of the rounding error. Where exp(s tau) is smaller, the equation of a loop without
states can be zero to rounding without a root."""

ANGLES = 24
"""Angles of each delay at which the gain of a loop of direct terms is looked at."""


def discretised(form: DelayForm, points: int) -> DelayForm:
    """Replace each delay by a rational system of as many states as `points`.

    The states are the values on Chebyshev points of what is on its way.
    """
    slopes = _differences(points)
    # on [-tau, 0]: the first point holds z, the last one gives w
    lines = block_diag(*[slopes[1:, 1:] * (2 / tau) for tau in form.delays])
    entry = block_diag(*[slopes[1:, :1] * (2 / tau) for tau in form.delays])
    exit_ = block_diag(*[np.eye(1, points, points - 1)] * len(form.delays))
    m, p, B, C, D = form.inputs, form.outputs, form.B, form.C, form.D
    A = np.block([[form.A, B[:, m:] @ exit_], [entry @ C[p:], lines + entry @ D[p:, m:] @ exit_]])
    into, out = np.vstack([B[:, :m], entry @ D[p:, :m]]), np.hstack([C[:p], D[:p, m:] @ exit_])
    return DelayForm(A, into, out, D[:p, :m])


def _differences(points: int) -> FloatArray:
    """Chebyshev differentiation matrix on [-1, 1], from 1 down to -1."""
    k = np.arange(points + 1)
    x = np.cos(np.pi * k / points)
    c = np.where((k == 0) | (k == points), 2.0, 1.0) * (-1.0) ** k
    gaps = x[:, None] - x[None, :] + np.eye(points + 1)
    D = np.outer(c, 1 / c) / gaps
    return np.asarray(D - np.diag(D.sum(axis=1)), dtype=np.float64)


def rightmost_poles(form: DelayForm, count: int) -> ComplexArray:
    """Find the poles with the largest real parts.

    Parameters
    ----------
    form : DelayForm
        Continuous; delays in s.
    count : int
        How many; fewer where the system has fewer.

    Returns
    -------
    ndarray, shape (count,)
        Falling in real part; a pair is never split.
    """
    return in_order(each_loop(form, lambda part: _of_loop(part, count)), count)


def _of_loop(part: DelayForm, count: int) -> ComplexArray:
    """Refine the discretisation until the first poles stay as they are."""
    if not part.delays or (not part.states and not np.any(part.D)):
        return np.linalg.eigvals(part.A).astype(np.complex128)
    before = np.zeros(0, dtype=np.complex128)
    points = FIRST_POINTS + count
    while True:
        starts = np.linalg.eigvals(discretised(part, points).A).astype(np.complex128)
        # half of them are the discretisation's own
        starts = in_order(starts, starts.size)[: 6 * count + 30]
        roots, last = newton_polished(part, starts, discrete=False)
        near = np.abs(roots - starts) < 0.5 * (1 + np.abs(starts))
        with np.errstate(over="ignore"):  # of iterations that went to infinity
            near &= roots.real * max(part.delays) > VANISHED
        roots = in_order(with_pairs(apart(roots[(last < RESIDUAL) & near])), count)
        same = roots.size == before.size and np.allclose(roots, before, rtol=1e-8, atol=1e-10)
        if (same and roots.size) or points >= MOST_POINTS:
            return roots
        before, points = roots, min(2 * points, MOST_POINTS)


def rightmost_zeros(form: DelayForm, count: int) -> ComplexArray:
    """Find the zeros with the largest real parts, as those of the discretised system, corrected."""
    if form.inputs != form.outputs:
        return np.zeros(0, dtype=np.complex128)
    plain = discretised(form, FIRST_POINTS + count) if form.delays else form
    n, m = plain.states, plain.inputs
    pencil = np.block([[plain.A, plain.B], [plain.C, plain.D]])
    mass = block_diag(np.eye(n), np.zeros((m, m)))
    with np.errstate(divide="ignore", invalid="ignore"):
        starts = eig(pencil, mass, right=False)
    # those at infinity come out huge
    size = np.abs(plain.A).max(initial=1.0)
    starts = starts[np.isfinite(starts)]
    starts = in_order(starts[np.abs(starts) < 10 * size], 6 * count + 30)
    roots, last = newton_polished(form, starts, discrete=False, zeros=True)
    near = np.abs(roots - starts) < 0.5 * (1 + np.abs(starts))
    return in_order(with_pairs(apart(roots[(last < RESIDUAL) & near])), count)


def in_order(poles: ComplexArray, count: int) -> ComplexArray:
    """Sort by falling real part, and take the first ones; one more lest a pair be split."""
    scale = float(np.abs(poles).max(initial=0.0)) or 1.0
    real, turn = np.round(poles.real / scale, 11), np.round(np.abs(poles.imag) / scale, 11)
    order = np.lexsort((-poles.imag, turn, -real))
    return with_whole_pairs(poles[order], count)


def neutral_gain(form: DelayForm) -> float:
    """Largest spectral radius of the direct terms between delays, over all angles of the delays.

    0 for a system of retarded type. Up to three delays in a loop the angles are tried; for more the
    spectral radius of the absolute values is an upper bound.
    """
    largest = 0.0
    for part in loops(form):
        direct, q = part.D, len(part.delays)
        if not q or not np.any(direct):
            continue
        radius = float(np.abs(np.linalg.eigvals(np.abs(direct))).max())
        if 1 < q <= 3 and radius >= 1:
            turns = np.exp(2j * np.pi * np.arange(ANGLES) / ANGLES)
            grid = np.stack(np.meshgrid(*[turns] * (q - 1), indexing="ij"), axis=-1)
            angles = np.concatenate([np.ones((*grid.shape[:-1], 1)), grid], axis=-1)
            turned = direct * angles.reshape(-1, q)[:, None, :]
            radius = float(np.abs(np.linalg.eigvals(turned)).max())
        largest = max(largest, radius)
    return largest
