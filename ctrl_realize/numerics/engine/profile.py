"""Profile-likelihood interval of the dead time of one structure.

Interval of the profile likelihood as in [1]_, ends by the method of [2]_ (Illinois). The misfit has
a kink where the dead time passes a sample; therefore points are also placed inside the sample
interval of the optimum.

References
----------
.. [1] D. J. Venzon and S. H. Moolgavkar, A method for computing profile-likelihood-based confidence
   intervals, Appl. Statist. 37 (1988) 87-94, doi:10.2307/2347496.
.. [2] M. Dowell and P. Jarratt, A modified regula falsi method for computing the root of an
   equation, BIT 11 (1971) 168-174, doi:10.1007/BF01934364.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from ..arrays import FloatArray
from ..constants import CHI2_95, Z_95
from ..rules import Rule
from .descend import descend
from .eliminate import evaluate
from .newton import solve_level
from .problem import Bounds, Problem
from .structures import Candidate, Scales, parameter_bounds

_SOLVED = 1e-3
"""Standard errors to which regula falsi solves for an end: its points are no closer to their
minima, so that more of them come no nearer."""
_MOST_TRIES = 12  # of regula falsi, each of which halves the bracket or does better

_NEAR = np.array([-3, -1.7, -1.2, -0.9, 0.9, 1.2, 1.7, 3])  # in half intervals, of a parabola
_FAR = 9  # points all over the range, where it is none
_SHORT = 0.1  # samples by which the optimum of a jump may lie before the sample that it belongs to
_LATE = 0.2  # samples before a jump is over; a lag of a twentieth of that fits noise of 1 %
_CHANCE = 0.02
"""Part of a jump by which it seems to begin a sample early, as noise makes it: intervals of a
thousandth of a sample before it were those of 2 in 32 plants with feedthrough."""
_INSIDE = np.array([-0.5, 0.02, 0.4, 1 - _LATE, 1.2])  # of the sample in which the optimum lies
JUMP = 4.0  # pole, in 1/samples, whose response is over within a sample
_NOTHING = 1e-9  # part of a sensitivity that is rounding
_NO_POINT_NEAR = 50.0
"""Variances of a point beyond an end above which none was laid near it: those near an end of the
interval that the curvature at the minimum tells reach three half intervals, 35 variances. Beside a
zero that takes the place of dead time there is no such curvature, and the profile is no parabola:
ends between its points were off by a factor of 5."""
_SWEEPS, _HIGH, _SAME = 3, 30.0, 1e-3
"""Rounds in which points start from those beside them: in single starts from the optimum, profiles
of structures with zeros were up to 6 variances too high near their ends. Points that are `_HIGH`
variances above the ends of an interval, and neighbours as high, are no part of it. Ablation:
profiles swept."""

Points: TypeAlias = dict[float, Candidate]
"""Best models with given dead times, by these, in s."""
Profile: TypeAlias = tuple[FloatArray, FloatArray]
"""Dead times, and the misfit at each; see `dead_time_profile`."""


def dead_time_profile(
    problem: Problem, candidate: Candidate, variance: float, scales: Scales
) -> tuple[FloatArray, FloatArray]:
    """Misfit of the best model for each of a range of fixed dead times.

    Parameters
    ----------
    problem : Problem
    candidate : Candidate
        The optimum of a structure.
    variance : float
        Variance of the noise.
    scales : Scales
        The profile covers ``scales.earliest`` ... ``scales.latest``, densest near the ends of the
        interval expected from the local curvature.

    Returns
    -------
    dead_time : ndarray, shape (G,)
        Sorted, in s; the ends of the 95 % interval are among them.
    excess : ndarray, shape (G,)
        Cost above the minimum, over the variance: chi-square of one degree of freedom.
    """
    points = profile_points(problem, candidate, variance, scales)
    points = with_ends(problem, points, variance, scales)
    return profile_curve(points, candidate, variance, scales)


def profile_grid(
    problem: Problem, candidate: Candidate, variance: float, scales: Scales
) -> FloatArray:
    """Dead times (G,) that bracket the ends of the interval of a structure."""
    half = Z_95 * dead_time_error(problem, candidate, variance)
    bounds = parameter_bounds(candidate.structure, scales)
    low, high = float(bounds.low[0]), float(bounds.high[0])
    grid = np.linspace(low, high, _FAR)
    if np.isfinite(half):
        grid = np.concatenate([candidate.dead_time + half * _NEAR, grid])
    if _jumps(candidate, scales):
        # Between the two samples of a jump nothing changes.
        within = (_jump_sample(candidate, scales) + _INSIDE) * scales.dt
        grid = np.concatenate([within, grid])
    return np.unique(np.clip(grid, low, high))


def profile_points(
    problem: Problem,
    candidate: Candidate,
    variance: float,
    scales: Scales,
    starts: FloatArray | None = None,
) -> Points:
    """Best models for the dead times of starts (G, k), by default those of `profile_grid`."""
    if starts is None:
        grid = profile_grid(problem, candidate, variance, scales)
        starts = np.tile(candidate.parameters, (grid.size, 1))
        starts[:, 0] = grid
    grid = starts[:, 0].copy()
    structure, bounds = candidate.structure, parameter_bounds(candidate.structure, scales)
    level = candidate.cost + CHI2_95 * variance

    def followed(starts: FloatArray) -> tuple[FloatArray, FloatArray]:
        return descend(
            problem, structure, starts, bounds, scales.dt, dead_time_fixed=True, level=level
        )

    fitted, cost = followed(starts)
    new_start = np.ones(grid.size, dtype=np.bool_)
    for _ in range(_SWEEPS):
        # Starting from the optimum may lead to a local minimum; the result at each point is used as
        # start for its neighbours.
        at = np.concatenate([np.arange(grid.size - 1), np.arange(1, grid.size)])
        near = np.concatenate([np.arange(1, grid.size), np.arange(grid.size - 1)])
        wanted = np.minimum(cost[at], cost[near]) < level + _HIGH * variance
        # A start that was followed before leads where it led before.
        wanted &= new_start[near]
        at, near = at[wanted], near[wanted]
        if not at.size or not Rule.SWEPT.on:
            break  # also where all of the grid lies outside of the interval
        starts = fitted[near]
        starts[:, 0] = grid[at]
        moved, new = followed(starts)
        before = cost.copy()
        new_start = np.zeros(grid.size, dtype=np.bool_)
        for row in np.argsort(-new):
            if new[row] < cost[at[row]]:
                fitted[at[row]], cost[at[row]] = moved[row], new[row]
                new_start[at[row]] = True
        if np.all(before - cost <= _SAME * variance):
            break
    points = {
        float(at): Candidate(structure, x, float(c))
        for at, x, c in zip(grid, fitted, cost, strict=True)
    }
    return points | {candidate.dead_time: candidate}


def with_ends(
    problem: Problem,
    points: Points,
    variance: float,
    scales: Scales,
    which: tuple[bool, bool] = (True, True),
) -> Points:
    """Add the ends of the 95 % interval, lower and upper, to the points of a profile."""
    found = dict(points)
    level = min(point.cost for point in points.values()), variance
    known = {at: (point.cost - level[0]) / variance for at, point in points.items()}
    for inside, outside in bracket_ends(known):
        if not which[int(outside > inside)]:
            continue
        pair = points[inside], points[outside]
        bounds = parameter_bounds(pair[0].structure, scales)
        found |= {point.dead_time: point for point in _end(problem, pair, level, bounds, scales.dt)}
    return found


def profile_curve(
    points: Points, candidate: Candidate, variance: float, scales: Scales
) -> tuple[FloatArray, FloatArray]:
    """Dead times (G,) and excess (G,) of points, as in `dead_time_profile`."""
    if _jumps(candidate, scales):
        # The later the jump begins, the faster it is, up to the sample at which it is complete.
        latest = float(parameter_bounds(candidate.structure, scales).high[0])
        end = min((_jump_sample(candidate, scales) + 1) * scales.dt, latest)
        late = end - _LATE * scales.dt
        dead_times = np.array(sorted(points))
        costs = np.array([points[at].cost for at in dead_times])
        cost = float(np.interp(late, dead_times, costs))
        # Part of a jump that is over at the sample before it, where the dead time ends just then.
        early = max(_jump_sample(candidate, scales) * scales.dt - candidate.dead_time, 0.0)
        if 0 < 1 - np.exp(-early * np.abs(candidate.poles).max()) < _CHANCE:
            cost = candidate.cost
        points = points | {end: replace(candidate, cost=cost)}
    dead_time = np.array(sorted(points))
    excess = np.array([points[at].cost for at in dead_time])
    return dead_time, (excess - excess.min()) / variance


def _jumps(candidate: Candidate, scales: Scales) -> bool:
    fastest = float(np.abs(candidate.poles).max(initial=0.0))
    return scales.bounds is None and fastest * scales.dt > JUMP


def _jump_sample(candidate: Candidate, scales: Scales) -> float:
    return float(np.floor(candidate.dead_time / scales.dt + _SHORT))


def _end(
    problem: Problem,
    ends: tuple[Candidate, Candidate],
    level: tuple[float, float],
    bounds: Bounds,
    dt: float,
) -> list[Candidate]:
    """Points of a profile that approach the end of an interval.

    `ends` are fits inside and outside, `level` the smallest cost and the variance. If the path of
    the conditional minima is too curved for Newton's method, it is followed by regula falsi
    (Illinois) in the root of the excess, which is linear for a quadratic misfit.
    """
    least, variance = level
    inside, outside = ends
    structure, goal = inside.structure, least + CHI2_95 * variance
    below, above = (root_of((end.cost - least) / variance) - Z_95 for end in ends)
    point = inside if -below < above else outside
    found: list[Candidate] = []
    side = 0
    for _ in range(_MOST_TRIES):
        first, last = sorted((inside.dead_time, outside.dead_time))
        solved = solve_level(problem, structure, point.parameters, bounds, dt, goal, variance)
        if solved is not None and first <= solved[0] <= last:
            return [*found, Candidate(structure, solved, goal)]
        starts = np.stack([inside.parameters, outside.parameters])
        starts[:, 0] = inside.dead_time + below / (below - above) * (
            outside.dead_time - inside.dead_time
        )
        x, cost = descend(problem, structure, starts, bounds, dt, dead_time_fixed=True)
        best = int(np.argmin(cost))
        point = Candidate(structure, x[best], float(cost[best]))
        found.append(point)
        root = root_of((point.cost - least) / variance) - Z_95
        if abs(root) <= _SOLVED:
            break
        if root < 0:
            above = above / 2 if side < 0 else above
            inside, below, side = point, root, -1
        else:
            below = below / 2 if side > 0 else below
            outside, above, side = point, root, 1
    return found


def dead_time_error(problem: Problem, candidate: Candidate, variance: float) -> float:
    """Standard error of the dead time in s from the local curvature; infinite if there is none."""
    state = evaluate(problem, candidate.structure, candidate.parameters[None])
    jacobian, free = state.jacobian[0], float(state.sensitivity[0, 0])
    size = np.sqrt((jacobian**2).sum(axis=0))
    if size[0] <= _NOTHING * free:
        return float("inf")
    moving = size > _NOTHING * state.sensitivity[0]
    columns: FloatArray = (jacobian / np.where(moving, size, 1.0))[:, moving]
    # The dead time comes last, so that the last diagonal element is its remainder.
    triangle = np.linalg.qr(columns[:, ::-1])[1]
    corner = float(np.abs(triangle[-1, -1])) * float(size[0])
    return float(np.sqrt(variance)) / corner if corner > _NOTHING * free else float("inf")


def bracket_ends(excess: Mapping[float, float]) -> list[tuple[float, float]]:
    """Pairs of neighbours, inside and outside, at the lower and upper end, if there are any."""
    dead_times = sorted(excess)
    inside = [i for i, at in enumerate(dead_times) if excess[at] <= CHI2_95]
    first, last = inside[0], inside[-1]
    found = [(dead_times[first], dead_times[first - 1])] if first > 0 else []
    return found + (
        [(dead_times[last], dead_times[last + 1])] if last < len(dead_times) - 1 else []
    )


def without_points(excess: Mapping[float, float]) -> tuple[bool, bool]:
    """Whether no point of a profile lies near its lower, and its upper end."""
    far = {at > near: excess[at] > _NO_POINT_NEAR for near, at in bracket_ends(excess)}
    return far.get(False, False), far.get(True, False)


def root_of(excess: float) -> float:
    """Square root of an excess that may be negative by rounding."""
    return float(np.sqrt(max(excess, 0.0)))


def profile_limits(dead_time: FloatArray, excess: FloatArray) -> tuple[float, float]:
    """Ends of the 95 % interval of dead times with an excess of misfit."""
    inside = np.flatnonzero(excess <= CHI2_95)[[0, -1]]
    # The first and the last dead time have no neighbour outside.
    outside = np.clip(inside + np.array([-1, 1]), 0, excess.size - 1)
    root, edge = np.sqrt(np.maximum(excess, 0.0)), np.sqrt(CHI2_95)
    low, high = (
        float(np.interp(edge, root[[*pair]], dead_time[[*pair]]))
        for pair in zip(inside, outside, strict=True)
    )
    return low, high
