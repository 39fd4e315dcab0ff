"""Intervals and standard errors of a model with an actuator.

The interval of a parameter is that of the profile likelihood [1]_: at every value of it all others,
actuator, gain and lags, are fitted again. Errors of gain, lags and total delay by the delta method
[2]_ from the curvature of the sum of squares.

References
----------
.. [1] D. J. Venzon and S. H. Moolgavkar, A method for computing profile-likelihood-based confidence
   intervals, Appl. Statist. 37 (1988) 87-94, doi:10.2307/2347496.
.. [2] E. L. Lehmann and G. Casella, Theory of Point Estimation, 2nd ed., Springer 1998, section 1.8
   (the delta method), doi:10.1007/b98854.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..arrays import FloatArray
from ..constants import CHI2_95, Z_95
from ..engine.poles import lag_sum, poles_from_parameters
from ..engine.profile import bracket_ends, profile_limits, root_of
from ..engine.static_gain import LocalErrors, StaticGain
from ..families.physical import ProcessParameter, process_parameters
from .family import Member
from .search import cost_of

_MOST_WIDENED, _MOST_NARROWED = 8, 6  # steps to an end
_CLOSE = 0.04  # standard errors to which an end is sought
_CLIFF = 4.0  # times the excess at an end: it counts for no more in the search
_BEYOND = 1.1  # times the excess at an end: it counts for no more when ends are interpolated
_LEVEL = 0.2  # variances by which the misfit rises on what counts as level
_TURNS = 4  # iterations at every point of a profile
_LOWER = 0.02  # variances by which a profile must lead below the minimum to be followed
_MOST_ROUNDS = 3
_SMALLEST = 1e-3  # of a logarithm, or of a start: first step where the curvature tells none
_LONGEST = 0.5
_OF_GAIN = 1e-4  # part of a gain, for a difference


class Ends(NamedTuple):
    """95 % interval; at a bound of the search where the records do not tell an end."""

    low: float
    high: float


def profiled(
    member: Member, variance: float, *, dead_time_alone: bool = False
) -> tuple[Member, tuple[Ends, ...]]:
    """Intervals of the dead time and of the values of the actuator.

    Parameters
    ----------
    member : Member
        The best one.
    variance : float
        Of the noise, with its correlation.
    dead_time_alone : bool, optional
        Whether only the interval of the dead time is wanted.

    Returns
    -------
    member : Member
        A better one, if a profile has led to it.
    ends : tuple of Ends
        Of the dead time in s, and of every value of the actuator.
    """
    family = member.family
    values = () if dead_time_alone else range(family.values.start, family.values.stop)
    for _ in range(_MOST_ROUNDS):
        free = family.free()
        slopes, column = family.slopes(member.x, free)
        errors = np.full(free.size, np.inf)
        errors[free] = LocalErrors(slopes, column[:, None]).std(np.eye(free.sum()), variance)
        ends, best = [], member
        for index in (0, *values):
            found, lowest = _interval(member, index, errors[index], variance)
            best = min(best, lowest, key=cost_of)
            ends.append(found if index == 0 else Ends(*family.natural(np.array(found)).tolist()))
        if member.cost - best.cost <= _LOWER * variance:
            break
        member = family.improved(best.x)
    if family.jump is not None and values:
        member = _in_the_middle(member, family.jump, ends[-1], variance)
    return member, tuple(ends)


def _in_the_middle(member: Member, index: int, ends: Ends, variance: float) -> Member:
    """Put a slip jump in the middle of its interval, if the misfit is level there.

    Between two steps of the command, of which one moves the stem, all are as good.
    """
    x = member.family.moved(member.x, index, float(np.log((ends.low + ends.high) / 2)))
    middle = member.family.improved(x, fixed=[index], turns=_TURNS)
    return middle if middle.cost <= member.cost + _LEVEL * variance else member


def _interval(member: Member, index: int, error: float, variance: float) -> tuple[Ends, Member]:
    """Interval of one entry of x, and the best member that was met."""
    family, points = member.family, {float(member.x[index]): member}
    scales = family.scales
    shortest, longest = (
        (_SMALLEST * scales.dt, scales.rise) if index == 0 else (_SMALLEST, _LONGEST)
    )

    def excess_at(value: float) -> float:
        near = points[min(points, key=lambda at: abs(at - value))]
        # One step of a staircase more or less makes another slip.
        starts = {near, member} if family.properties.sticks else {near}
        moved = (family.moved(start.x, index, value) for start in starts)
        found = min((family.improved(x, fixed=[index], turns=_TURNS) for x in moved), key=cost_of)
        if index == 0 and found.cost > member.cost + CHI2_95 * variance:
            # Other lags belong to another dead time, and the way to them may be long.
            found = family.improved(found.x, fixed=[index])
        points[value] = found
        return excess(found)

    def excess(found: Member) -> float:
        # Where the misfit jumps, as at a slip more or less, ends are found by bisection.
        return min(max((found.cost - member.cost) / variance, 0.0), _CLIFF * CHI2_95)

    for side, bound in zip((-1.0, 1.0), family.bounds, strict=True):
        at, step = float(member.x[index]), float(np.clip(Z_95 * error, shortest, longest))
        for _ in range(_MOST_WIDENED):
            if side * (bound[index] - at) <= 0:
                break
            at = float(side * min(side * (at + side * step), side * bound[index]))
            root = np.sqrt(excess_at(at)) / Z_95
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
                excess_at(float(inside + share * (outside - inside)))
    values = np.array(sorted(points))
    # An end at which it jumps is the point beyond.
    every = np.minimum([excess(points[at]) for at in values.tolist()], _BEYOND * CHI2_95)
    return Ends(*profile_limits(values, every)), min(points.values(), key=cost_of)


def propagated(
    member: Member, variance: float, length: float
) -> tuple[StaticGain, tuple[ProcessParameter, ...]]:
    """Static response and parameters of the process, with their errors.

    Parameters
    ----------
    member : Member
    variance : float
        Of the noise, with its correlation.
    length : float
        Duration of the longest record in s.
    """
    family, order = member.family, member.family.order
    gain = float(family.residuals(member.x[None])[1][0])
    point = np.append(member.x[: 1 + order], gain)

    def named(at: FloatArray) -> tuple[ProcessParameter, ...]:
        """Parameters of the process, and the total delay last."""
        poles = poles_from_parameters(at[None, 1:-1])[0][0]
        numerator = at[-1:] * np.prod(-poles).real
        total = float(at[0]) + lag_sum(poles, numerator)
        found = process_parameters(poles, numerator, float(at[0]), length)
        return (*found, ProcessParameter("total_delay", total))

    here = named(point)
    gradient = np.empty((len(here), point.size))
    steps = np.append(family.steps[: 1 + order], _OF_GAIN * abs(gain))
    for k, step in enumerate(steps.tolist()):
        moved = named(point + step * (np.arange(point.size) == k))
        gradient[:, k] = [(b.value - a.value) / step for a, b in zip(here, moved, strict=True)]
    slopes, column = family.slopes(member.x, family.free())
    known = np.append(slopes[:, : 1 + order], column[:, None], axis=1)
    errors = LocalErrors(known, slopes[:, 1 + order :]).std(gradient, variance)
    parameters = tuple(one._replace(std=float(std)) for one, std in zip(here, errors, strict=True))
    static = StaticGain(
        gain=gain,
        gain_std=parameters[0].std,
        total=parameters[-1].value,
        total_std=parameters[-1].std,
        slowest=length * float(np.abs(member.poles.real).min()),
        integrates=False,
        reached=gain,
        sign_known=True,
    )
    return static, parameters[:-1]
