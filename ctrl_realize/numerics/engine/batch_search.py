"""Improve a batch of starts of a separable fit by Levenberg-Marquardt steps [1]_.

The first, fast part of a search; `descend` and `newton` follow promising ones to their minimum.

References
----------
.. [1] D. W. Marquardt, An algorithm for least-squares estimation of nonlinear parameters, J. SIAM
   11 (1963) 431-441, doi:10.1137/0111030.
"""

from __future__ import annotations

import numpy as np

from ..arrays import BoolArray, FloatArray, IntArray
from .eliminate import compress
from .problem import Bounds, Problem, Structure

_LONGEST_STEP = 1.5  # of a logarithmic parameter, in one iteration
_MOST_FAILURES = 4  # in a row, before a start is given up
_TURNS_FOR_ALL = 8  # iterations after which starts that are far behind are given up
_HOPELESS = 1.5
_STEEPEST = 1e145  # slope of a residual: the sum of its squares is a number still


def fit_batch(
    problem: Problem,
    structure: Structure,
    starts: FloatArray,
    bounds: Bounds,
    *,
    most_iterations: int = 30,
    tolerance: float = 1e-4,
) -> tuple[FloatArray, FloatArray]:
    """Improve every start.

    Parameters
    ----------
    starts : ndarray, shape (B, 1 + n)
        Dead time in s and pole parameters.
    most_iterations : int
        Limit for all starts together.
    tolerance : float
        A start has converged if an iteration lowers its cost by less than this part.

    Returns
    -------
    parameters : ndarray, shape (B, 1 + n)
    cost : ndarray, shape (B,)
    """
    x = np.clip(starts, bounds.low, bounds.high)
    state = compress(problem, structure, x)
    residual, jacobian, cost = state.residual, state.jacobian, state.cost
    damping = np.full(x.shape[0], 1e-2)
    failures = np.zeros(x.shape[0], dtype=np.int64)
    active: IntArray = np.arange(x.shape[0])
    for turn in range(most_iterations):
        step, short = _damped_step(
            x[active], residual[active], jacobian[active], damping[active], bounds
        )
        trial = np.clip(x[active] + step, bounds.low, bounds.high)
        state = compress(problem, structure, trial)
        new = state.cost
        better = new < cost[active]
        settled = better & short & (cost[active] - new < tolerance * new)
        up, down = active[better], active[~better]
        x[up], cost[up] = trial[better], new[better]
        residual[up], jacobian[up] = state.residual[better], state.jacobian[better]
        damping[up] = np.maximum(0.2 * damping[up], 1e-9)
        damping[down] *= 8.0
        failures[up] = 0
        failures[down] += 1
        hopeless = (turn >= _TURNS_FOR_ALL) & (cost[active] > _HOPELESS * cost.min())
        active = active[~(settled | hopeless | (failures[active] >= _MOST_FAILURES))]
        if not active.size:
            break
    return x, cost


def _damped_step(
    x: FloatArray, residual: FloatArray, jacobian: FloatArray, damping: FloatArray, bounds: Bounds
) -> tuple[FloatArray, BoolArray]:
    """Levenberg-Marquardt steps in the free directions, and which of them were not limited."""
    # The dead time is relative to its range, so that the steps do not depend on the unit of time.
    unit = np.ones(x.shape[1])
    unit[0] = max(float(bounds.high[0] - bounds.low[0]), 1e-300)
    # A response of the size of rounding has derivatives whose squares overflow.
    jacobian = np.clip(jacobian * unit, -_STEEPEST, _STEEPEST)
    downhill = np.einsum("bmp,bm->bp", jacobian, residual)
    free = ~((x <= bounds.low) & (downhill < 0) | (x >= bounds.high) & (downhill > 0))
    normal = np.swapaxes(jacobian, 1, 2) @ jacobian
    normal = normal * (free[:, :, None] & free[:, None, :])
    diagonal = np.einsum("bii->bi", normal)
    scale = np.maximum(diagonal, 1e-9 * diagonal.max(axis=1, keepdims=True) + 1e-300)
    damped = normal + np.where(free, damping[:, None] * scale, 1.0)[:, :, None] * np.eye(x.shape[1])
    step = np.linalg.solve(damped, np.where(free, downhill, 0.0)[:, :, None])[:, :, 0] * unit
    longest = np.where(np.arange(x.shape[1]), _LONGEST_STEP, np.inf)
    return np.clip(step, -longest, longest), np.all(np.abs(step) <= longest, axis=1)
