"""Intervals of a model with an actuator.

The interval of a parameter is that of the profile likelihood [1]_: at every value of it all others,
actuator, gain and lags, are fitted again.

References
----------
.. [1] D. J. Venzon and S. H. Moolgavkar, A method for computing profile-likelihood-based confidence
   intervals, Appl. Statist. 37 (1988) 87-94, doi:10.2307/2347496.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..arrays import FloatArray
from ..constants import CHI2_95, Z_95
from ..engine.descend import descend, fit_batch
from ..engine.problem import Problem
from ..engine.profile import bracket_ends, profile_limits, root_of
from ..engine.static_gain import LocalErrors
from ..engine.structures import Candidate, pattern_starts
from .search import cost_of, family_of, minimum

_MOST_WIDENED, _MOST_NARROWED = 8, 6  # steps to an end
_CLOSE = 0.04  # standard errors to which an end is sought
_CLIFF = 4.0  # times the excess at an end: it counts for no more in the search
_BEYOND = 1.1  # times the excess at an end: it counts for no more when ends are interpolated
_LEVEL = 0.2  # variances by which the misfit rises on what counts as level
_LOWER = 0.02  # variances by which a profile must lead below the minimum to be followed
_MOST_ROUNDS = 3
_SMALLEST = 1e-3  # of a logarithm, or of a start: first step where the curvature tells none
_TURNS, _TOLERANCE = 4, 1e-5  # of a fit with a given actuator
_LONGEST, _OF_RISE = 0.5, 0.1  # of a logarithm, and of the rise for a dead time


class Ends(NamedTuple):
    """95 % interval; at a bound of the search where the records do not tell an end."""

    low: float
    high: float


def profiled(
    problem: Problem, found: Candidate, variance: float, *, dead_time_alone: bool = False
) -> tuple[Candidate, tuple[Ends, ...]]:
    """Intervals of the dead time and of the values of the actuator.

    Parameters
    ----------
    problem : Problem
    found : Candidate
        The best member of a family.
    variance : float
        Of the noise, with its correlation.
    dead_time_alone : bool, optional
        Whether only the interval of the dead time is wanted.

    Returns
    -------
    found : Candidate
        A better one, if a profile has led to it.
    ends : tuple of Ends
        Of the dead time in s, and of every value of the actuator.
    """
    family = family_of(found)
    values = () if dead_time_alone else range(family.values.start, family.values.stop)
    for _ in range(_MOST_ROUNDS):
        jacobian = family.evaluate(problem, found.parameters[None]).jacobian[0]
        errors = LocalErrors(jacobian, jacobian[:, :0]).std(np.eye(len(found.parameters)), variance)
        ends, best = [], found
        for index in (0, *values):
            here, low = _interval(problem, found, index, float(errors[index]), variance)
            best = min(best, low, key=cost_of)
            ends.append(here if index == 0 else Ends(*family.natural(np.array(here)).tolist()))
        if found.cost - best.cost <= _LOWER * variance:
            break
        found = minimum(problem, family, best.parameters[None])
    if family.jump is not None and values:
        # In the middle of its interval, if the misfit is level there: between two steps of the
        # command, of which one moves the stem, all slip jumps are as good.
        value = float(np.log((ends[-1].low + ends[-1].high) / 2))
        middle = _with_entry(problem, found, family.jump, value, found.cost, found.parameters)
        found = middle if middle.cost <= found.cost + _LEVEL * variance else found
    return found, tuple(ends)


def _with_entry(
    problem: Problem, found: Candidate, index: int, value: float, level: float, *near: FloatArray
) -> Candidate:
    """Best member with an entry of x that is given, from the x of others.

    The further from the `level`, a cost, the less closely it is followed.
    """
    family = family_of(found)
    held, dt = family.held(index, value), family.scales.dt
    starts = np.unique([family.moved(x, index, value) for x in near], axis=0)
    setting = problem, held, starts, held.bounds
    if index == 0:
        ends, costs = descend(*setting, dt, level=level)
    else:  # the way from one actuator to the next is short
        ends, costs = fit_batch(*setting, most_iterations=_TURNS, tolerance=_TOLERANCE)
    best = int(np.argmin(costs))
    return replace(found, parameters=ends[best], cost=float(costs[best]))


def _interval(
    problem: Problem, best: Candidate, index: int, error: float, variance: float
) -> tuple[Ends, Candidate]:
    """Interval of one entry of x, and the best member that was met."""
    family, x = family_of(best), best.parameters
    points, scales = {float(x[index]): best}, family.scales
    level = best.cost + CHI2_95 * variance
    shortest, longest = _SMALLEST, _LONGEST
    if index == 0:
        shortest, longest = _SMALLEST * scales.dt, _OF_RISE * scales.rise
    # One step of a staircase more or less makes another slip.
    always = [x] if family.properties.sticks else []
    if index == 0 and not always and np.abs(best.poles).max() * scales.dt > 1:
        # A lag that is shorter than a sample changes nothing, and takes long to come back.
        equal = pattern_starts(family.plain, scales)[0]
        always.append(np.append(equal, x[family.values.start :]))

    def excess_at(value: float, first: float, second: float) -> float:
        """Start on a line through two points."""
        near, part = points[first].parameters, (value - first) / ((second - first) or np.inf)
        start = near + part * (points[second].parameters - near)
        points[value] = _with_entry(problem, best, index, value, level, start, *always)
        return excess(points[value])

    def excess(found: Candidate) -> float:
        # Where the misfit jumps, as at a slip more or less, ends are found by bisection.
        return min(max((found.cost - best.cost) / variance, 0.0), _CLIFF * CHI2_95)

    for side, bound in ((-1.0, family.bounds.low), (1.0, family.bounds.high)):
        at = before = float(x[index])
        step = float(np.clip(Z_95 * error, shortest, longest))
        for _ in range(_MOST_WIDENED):
            if side * (bound[index] - at) <= 0:
                break
            last, at = at, float(side * min(side * (at + side * step), side * bound[index]))
            root = np.sqrt(excess_at(at, last, before)) / Z_95
            before = last
            if root > 1:
                break
            # As a parabola would have it, or twice as far.
            step = float(np.clip(step * (1.05 / max(root, 0.3) - 1), 0.3 * step, 2 * step))
    for _ in range(_MOST_NARROWED):
        known = {at: excess(one) for at, one in points.items()}
        for inside, outside in bracket_ends(known):
            below, above = (root_of(known[at]) - Z_95 for at in (inside, outside))
            if min(-below, above) > _CLOSE:
                # Regula falsi in the root, which is linear for a quadratic misfit.
                share = np.clip(below / (below - above), 0.15, 0.85)
                excess_at(float(inside + share * (outside - inside)), inside, outside)
    values = np.array(sorted(points))
    # An end at which it jumps is the point beyond.
    every = np.minimum([excess(points[at]) for at in values.tolist()], _BEYOND * CHI2_95)
    return Ends(*profile_limits(values, every)), min(points.values(), key=cost_of)
