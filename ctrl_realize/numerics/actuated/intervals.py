"""Profile-likelihood intervals of every parameter of a model with an actuator.

The dead time's is that of the joint likelihood: at every dead time the actuator is fitted again,
together with gain and lags. Intervals as in [1]_.

References
----------
.. [1] D. J. Venzon and S. H. Moolgavkar, A method for computing profile-likelihood-based confidence
   intervals, Appl. Statist. 37 (1988) 87-94, doi:10.2307/2347496.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..arrays import FloatArray
from ..constants import CHI2_95
from .family import Member, Task

_EDGE = float(np.sqrt(CHI2_95))
_MOST_WIDENED, _MOST_NARROWED = 8, 7  # steps of an end
_CLOSE = 0.02  # of the root of the excess, to which an end is sought
_CLIFF = 0.2  # of the root of the excess, by which it is beyond the end of an interval at once
_LEVEL = 0.2  # variances by which the misfit rises on what counts as level
_TURNS = 4  # iterations at every point of a profile
_LOWER = 0.02  # variances by which a profile must lead below the minimum to be followed
_MOST_ROUNDS = 3
_SMALLEST = 1e-3  # of a logarithm, or of a start: first step where the curvature tells none
_LONGEST = 0.5


class Ends(NamedTuple):
    """95 % interval; infinite or at a bound of the search where the records do not tell an end."""

    low: float
    high: float


def profiled(task: Task, member: Member, variance: float) -> tuple[Member, tuple[Ends, ...]]:
    """Intervals of the dead time and of the values of the actuator.

    Parameters
    ----------
    task : Task
    member : Member
        The best one.
    variance : float
        Of the noise, with its correlation.

    Returns
    -------
    member : Member
        A better one, if a profile has led to it.
    ends : tuple of Ends
        Of the dead time in s, and of every value of the actuator.
    """
    family = task.family
    wanted = [0, *range(family.values.start, family.values.stop)]
    for _ in range(_MOST_ROUNDS):
        widths = _errors(task, member, variance)
        ends, best = [], member
        for index in wanted:
            found, lowest = _interval(task, member, index, widths[index], variance)
            best = min(best, lowest, key=lambda one: one.cost)
            ends.append(found if index == 0 else Ends(*family.natural(np.array(found)).tolist()))
        if member.cost - best.cost <= _LOWER * variance:
            break
        member = task.improved(best.x)
    if family.jump is not None:
        member = _in_the_middle(task, member, family.jump, ends[-1], variance)
    return member, tuple(ends)


def _in_the_middle(task: Task, member: Member, index: int, ends: Ends, variance: float) -> Member:
    """Put a slip jump in the middle of its interval, if the misfit is level there.

    Between two steps of the command, of which one moves the stem, all are as good.
    """
    x = task.moved(member.x, index, float(np.log((ends.low + ends.high) / 2)))
    middle = task.improved(x, fixed=[index], turns=_TURNS)
    return middle if middle.cost <= member.cost + _LEVEL * variance else member


def dead_time_ends(task: Task, member: Member, variance: float) -> Ends:
    """Interval of the dead time alone, in s."""
    width = _errors(task, member, variance)[0]
    return _interval(task, member, 0, width, variance)[0]


def _errors(task: Task, member: Member, variance: float) -> FloatArray:
    """Standard errors of x from the curvature; infinite where there is none."""
    free = np.ones(member.x.size, dtype=np.bool_)
    if task.family.form.stepwise:
        free[task.family.values] = False
    jacobian = task.slopes(member.x, task.residual(member.x)[0], free)
    size = np.zeros(free.size)
    size[free] = np.sqrt((jacobian**2).sum(axis=0))
    told = size > 0
    errors = np.full(size.size, np.inf)
    inverse = np.linalg.pinv((jacobian[:, told[free]] / size[told]), rcond=1e-10)
    errors[told] = np.sqrt(variance * (inverse**2).sum(axis=1)) / size[told]
    return errors


def _interval(
    task: Task, member: Member, index: int, width: float, variance: float
) -> tuple[Ends, Member]:
    """Interval of one entry of x, and the best member that was met."""
    best = member
    ends = []
    for side in (-1.0, 1.0):
        end, lowest = _end(task, member, index, side, width, variance)
        best = min(best, lowest, key=lambda one: one.cost)
        ends.append(end)
    return Ends(ends[0], ends[1]), best


def _end(
    task: Task, member: Member, index: int, side: float, width: float, variance: float
) -> tuple[float, Member]:
    """Follow the profile to where its root passes 1.96: wider steps first, then regula falsi."""
    bound = float(task.bounds[0 if side < 0 else 1][index])
    unit = task.scales.dt if index == 0 else 1.0
    largest = task.scales.rise if index == 0 else _LONGEST
    step = float(np.clip(_EDGE * width, _SMALLEST * unit, largest))
    best = inside = member
    root, outside, above = -_EDGE, None, np.inf

    def at(value: float, start: Member) -> tuple[Member, float]:
        x = task.moved(start.x, index, value)
        found = task.improved(x, fixed=[index], turns=_TURNS)
        if start is not member:
            x = task.moved(member.x, index, value)
            found = min(found, task.improved(x, fixed=[index], turns=_TURNS), key=_cost)
        if index == 0 and found.cost > member.cost + CHI2_95 * variance:
            # Other lags belong to another dead time, and the way to them may be long.
            found = task.improved(found.x, fixed=[index])
        excess = max((found.cost - member.cost) / variance, 0.0)
        return found, float(np.sqrt(excess)) - _EDGE

    for _ in range(_MOST_WIDENED):
        value = float(inside.x[index] + side * step)
        if side * (value - bound) > 0:
            value = bound
        point, there = at(value, inside)
        best = min(best, point, key=_cost)
        if there > 0:
            outside, above = point, there
            break
        inside, root = point, there
        if value == bound:
            return value, best
        # As a parabola would have it, or twice as far.
        done = (root + _EDGE) / _EDGE
        step = float(np.clip(step * (1.05 / max(done, 0.3) - 1), 0.3 * step, 2 * step))
    if outside is None:
        return bound, best
    for _ in range(_MOST_NARROWED):
        if min(abs(root), above) < _CLOSE * _EDGE:
            break
        low, high = float(inside.x[index]), float(outside.x[index])
        share = float(np.clip(root / (root - above), 0.15, 0.85))
        point, there = at(low + share * (high - low), inside)
        best = min(best, point, key=_cost)
        if there > 0:
            outside, above = point, there
        else:
            inside, root = point, there
    low, high = float(inside.x[index]), float(outside.x[index])
    if above > _CLIFF * _EDGE:
        return high, best  # which steps set a stem in motion changes at once
    return low + root / (root - above) * (high - low), best


def _cost(member: Member) -> float:
    return member.cost
