"""Profile-likelihood interval of the delay of one structure."""

from __future__ import annotations

import numpy as np

from .arrays import FloatArray
from .separable_fit import Problem, evaluate, fit_batch
from .structure_search import Candidate, Scales, parameter_bounds

_NEAR = np.array([-3, -1.7, -1.2, -0.9, 0.9, 1.2, 1.7, 3])
_FAR = 9
_SHORT = 0.1  # samples by which the optimum of a jump may lie before the sample that it belongs to
_LATE = 0.2  # samples before a jump is over; a lag of a twentieth of that fits noise of 1 %
_INSIDE = np.array([-0.5, 0.02, 0.4, 1 - _LATE, 1.2])  # of the sample in which the optimum lies
_JUMP = 4.0  # pole, in 1/samples, whose response is over within a sample
_NOTHING = 1e-9  # part of a sensitivity that is rounding


def delay_profile(
    problem: Problem, candidate: Candidate, variance: float, scales: Scales
) -> tuple[FloatArray, FloatArray]:
    """Misfit of the best model with each of a range of fixed delays.

    Parameters
    ----------
    problem : Problem
    candidate : Candidate
        The optimum of a structure.
    variance : float
        Of the noise.
    scales : Scales
        The profile covers ``scales.earliest`` ... ``scales.latest``, densest where the local
        curvature puts the ends of the interval.

    Returns
    -------
    delay : ndarray, shape (G,)
        Sorted, in s.
    excess : ndarray, shape (G,)
        Cost above the minimum, over the variance: chi-square of one degree of freedom.
    """
    half = np.sqrt(3.84) * delay_error(problem, candidate, variance)
    low, high = scales.earliest, scales.latest
    fastest = float(np.abs(candidate.poles).max()) * scales.dt
    grid = np.linspace(low, high, _FAR)
    if np.isfinite(half):
        grid = np.concatenate([candidate.delay + half * _NEAR, grid])
    if fastest > _JUMP:
        # Nothing changes while the jump stays between the same two samples.
        sample = np.floor(candidate.delay / scales.dt + _SHORT)
        grid = np.concatenate([(sample + _INSIDE) * scales.dt, grid])
    grid = np.unique(np.clip(grid, low, high))
    starts = np.tile(candidate.parameters, (grid.size, 1))
    starts[:, 0] = grid
    bounds = parameter_bounds(candidate.structure, scales)
    _, cost = fit_batch(
        problem, candidate.structure, starts, bounds, delay_fixed=True, most_iterations=40
    )
    delay = np.append(grid, candidate.delay)
    excess = np.append(cost, candidate.cost)
    if fastest > _JUMP:
        # The later the jump begins, the faster it is: up to the sample that sees it done.
        end = min((sample + 1) * scales.dt, high)
        delay = np.append(delay, end)
        excess = np.append(excess, np.interp(end - _LATE * scales.dt, grid, cost))
    order = np.argsort(delay)
    return delay[order], (excess[order] - excess.min()) / variance


def delay_error(problem: Problem, candidate: Candidate, variance: float) -> float:
    """Standard error of the delay from the local curvature (infinite if there is none), in s."""
    state = evaluate(problem, candidate.structure, candidate.parameters[None])
    jacobian, free = state.jacobian[0], float(state.sensitivity[0, 0])
    size = np.sqrt((jacobian**2).sum(axis=0))
    if size[0] <= _NOTHING * free:
        return float("inf")
    moving = size > _NOTHING * state.sensitivity[0]
    columns: FloatArray = (jacobian / np.where(moving, size, 1.0))[:, moving]
    # The delay comes last, so that the corner is what the others leave of it.
    triangle = np.linalg.qr(columns[:, ::-1])[1]
    corner = float(np.abs(triangle[-1, -1])) * float(size[0])
    return float(np.sqrt(variance)) / corner if corner > _NOTHING * free else float("inf")


def profile_limits(
    delay: FloatArray, excess: FloatArray, threshold: float = 3.84
) -> tuple[float, float]:
    """Ends of the set of delays with an excess below the threshold (95 %: 3.84)."""
    inside = np.flatnonzero(excess <= threshold)
    first, last = int(inside[0]), int(inside[-1])
    # The root of the excess is linear in the delay where the misfit is.
    root = np.sqrt(np.maximum(excess, 0.0))
    edge = float(np.sqrt(threshold))
    low = float(delay[0])
    if first > 0:
        low = float(np.interp(edge, root[[first, first - 1]], delay[[first, first - 1]]))
    high = float(delay[-1])
    if last < delay.size - 1:
        high = float(np.interp(edge, root[[last, last + 1]], delay[[last, last + 1]]))
    return low, high
