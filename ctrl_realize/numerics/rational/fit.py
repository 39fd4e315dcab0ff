"""Search and refinement for transfer functions with dead time; see `rational`.

Damped Gauss-Newton steps on the variable projection functional [1]_ with the Jacobian of [2]_; the
damping is scaled by the diagonal of the normal matrix as in [3]_.

References
----------
.. [1] G. H. Golub and V. Pereyra, The differentiation of pseudo-inverses and nonlinear least
   squares problems whose variables separate, SIAM J. Numer. Anal. 10 (1973) 413-432,
   doi:10.1137/0710036.
.. [2] L. Kaufman, A variable projection method for solving separable nonlinear least squares
   problems, BIT 15 (1975) 49-57, doi:10.1007/BF01932995.
.. [3] D. W. Marquardt, An algorithm for least-squares estimation of nonlinear parameters, J. SIAM
   11 (1963) 431-441, doi:10.1137/0111030.
.. [4] J. Nocedal and S. J. Wright, Numerical Optimization, 2nd ed., Springer 2006, section 10.3
   (Levenberg-Marquardt), doi:10.1007/978-0-387-40065-5.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..arrays import ComplexArray, FloatArray
from ..regression.marquardt import Damping, damped_step, descend
from .model import Projection, project

_MAX_ITERATIONS = 60  # time; 147 of 165 fits of a valve and a motor ended before
_FIRST_ITERATIONS = 10  # after which the starts are compared, and the best ones go on
_DAMPING = Damping(rise=6.0, fall=8.0)  # usual factors: Marquardt (1963)
_STALLED = 1e-9  # of the cost: a gain that is none


@dataclass(frozen=True, eq=False)
class FRFData:
    """A frequency response with weights, scaled so that frequencies are around 1.

    Parameters
    ----------
    s : ndarray, shape (K,)
        ``j omega``.
    response : ndarray, shape (K,)
        Measured.
    weight : ndarray, shape (K,)
        One over the standard deviation of the complex response, up to a factor.
    max_dead_time : float
        Upper bound of the search.
    min_dead_time : float
        Lower bound; below 0 only to test whether the phase leads.
    """

    s: ComplexArray
    response: ComplexArray
    weight: FloatArray
    max_dead_time: float
    min_dead_time: float = 0.0

    @property
    def clear(self) -> NDArray[np.bool_]:
        """Points with a significant phase; all if there are no weights."""
        clear = np.asarray(np.abs(self.response) * self.weight > 1 / 0.3)
        return clear if clear.sum() >= 4 else np.ones(clear.size, dtype=np.bool_)

    @cached_property
    def pole_range(self) -> tuple[float, float]:
        """Logarithms of the slowest and fastest pole, two decades beyond the band."""
        omega = np.abs(self.s)
        return float(np.log(omega.min() / 100)), float(np.log(omega.max() * 100))


@dataclass(frozen=True, eq=False)
class RationalFit:
    """A local minimum of the weighted misfit.

    ``cost`` is the sum of ``|weight (response - model)|^2`` at pole parameters and dead time
    `theta` and the best `numerator`.
    """

    order: int
    theta: FloatArray
    numerator: FloatArray
    cost: float


@dataclass(frozen=True, eq=False)
class _Point:
    theta: FloatArray
    projected: Projection
    cost: float


def refine(
    data: FRFData,
    order: int,
    count: int,
    start: FloatArray,
    *,
    frozen_delay: bool = False,
    iterations: int = _MAX_ITERATIONS,
) -> RationalFit:
    """Minimise the misfit from one start by Levenberg-Marquardt on poles and dead time.

    Parameters
    ----------
    data : FRFData
    order, count : int
        Poles, and coefficients of the numerator.
    start : ndarray, shape (order + 1,)
    frozen_delay : bool
        Keep the dead time of the start.
    iterations : int
        Largest number of iterations.
    """

    def at(theta: FloatArray) -> _Point:
        projected = project(data.s, data.response, data.weight, theta, order, count)
        return _Point(theta, projected, float(projected.residual @ projected.residual))

    def linearised(here: _Point) -> Callable[[float], _Point]:
        residual, J = here.projected.residual, here.projected.jacobian.copy()
        if frozen_delay or _pinned(here.theta, float(J[:, order] @ residual), data, order):
            J[:, order] = 0.0
        gram, slope = J.T @ J, J.T @ residual

        def ahead(damping: float) -> _Point:
            step = damped_step(gram, -slope, damping)
            # A factor of e in one step is the limit of the linearisation.
            step[:order] = _within(step[:order], -1.0, 1.0)
            return at(inside_limits(here.theta + step, data, order))

        return ahead

    stalled = 0

    def finished(gain: float, here: _Point) -> bool:
        nonlocal stalled
        # Two small steps in a row: one alone may be a damped step in a narrow valley.
        stalled = stalled + 1 if gain <= _STALLED * here.cost else 0
        return stalled == 2

    best, _ = descend(
        at(inside_limits(start, data, order)), linearised, finished, _DAMPING, iterations
    )
    return RationalFit(order, best.theta, best.projected.numerator, best.cost)


def refine_best(
    data: FRFData, order: int, count: int, starts: list[FloatArray], kept: int
) -> list[RationalFit]:
    """Refine several starts: all of them a little, the best few to the end; the best first."""
    early = [refine(data, order, count, start, iterations=_FIRST_ITERATIONS) for start in starts]
    early.sort(key=lambda fit: fit.cost)
    late = [refine(data, order, count, fit.theta) for fit in early[:kept]]
    return sorted(late, key=lambda fit: fit.cost)


def inside_limits(theta: FloatArray, data: FRFData, order: int) -> FloatArray:
    """Keep poles near the band, dampings in a sensible range and the dead time in its range."""
    low, high = data.pole_range
    kept = theta.copy()
    pairs = order - order % 2
    if pairs:
        kept[0:pairs:2] = _within(kept[0:pairs:2], 2 * low, 2 * high)
        middle = 0.5 * kept[0:pairs:2] + np.log(2.0)
        kept[1:pairs:2] = _within(kept[1:pairs:2], middle + np.log(1e-4), middle + np.log(1e3))
    kept[pairs:order] = _within(kept[pairs:order], low, high)
    kept[order] = min(max(kept[order], data.min_dead_time), data.max_dead_time)
    return kept


def _within(values: FloatArray, low: float | FloatArray, high: float | FloatArray) -> FloatArray:
    # half the time of numpy.clip, which is called most often
    clipped: FloatArray = np.minimum(np.maximum(values, low), high)
    return clipped


def _pinned(theta: FloatArray, slope: float, data: FRFData, order: int) -> bool:
    at_zero = theta[order] <= data.min_dead_time and slope >= 0.0
    return bool(at_zero or (theta[order] >= data.max_dead_time and slope <= 0.0))
