"""Search of the best member of a family: a grid of actuators, then the best ones improved.

The misfit is a piecewise smooth function of stiction: which moves of the command set a stem in
motion changes at once. The slip jump is therefore searched without derivatives [1]_.

References
----------
.. [1] R. P. Brent, Algorithms for Minimization without Derivatives, Prentice Hall 1973, chapter 5.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import minimize_scalar

from ..arrays import FloatArray
from ..engine.poles import parameters_from_poles, poles_from_parameters
from ..engine.structures import Candidate, Scales, neighbour_starts, pattern_starts
from ..engine.varpro import Structure
from .family import Family, Member, Records, Task

_MOST_STARTS = 16
_FOLLOWED = 2  # starts that are followed to the bottom: time
_ROUGH = 6  # iterations in which starts are compared
_ACTUATORS = 3  # of a grid, that are tried with each linear part
_QUICK = 0.2
_SHORTEST, _LONG, _RISES = 3.0, 20.0, 5  # samples, parts of a record: lags behind what sticks
_QUICKLY = 3  # iterations beside a point that was followed to the bottom
_FINER = np.geomspace(0.02, 0.8, 26)
_FOLLOWED_FINER = 4
_AROUND = np.linspace(-0.24, 0.24, 17)  # of a logarithm, of S and of J
_PLACES = (-1.0, 0.0, 1.0)
_RESOLVED = 5e-3  # of a logarithm, to which a slip jump is searched
_BESIDE = 0.4  # of a logarithm: reach of the last search about the best slip jump
_POINTS = 13


def searched(
    records: Records, family: Family, scales: Scales, beside: Sequence[Member] = ()
) -> Member:
    """Find the best member of a family.

    Parameters
    ----------
    records : Records
    family : Family
    scales : Scales
        Initial guess of the response, see `structures`.
    beside : sequence of Member
        Models that were found already, as starts.
    """
    task = Task(records, family, scales)
    linear = _linear_starts(family, scales, beside)
    best = [x for start in linear for x in _best_actuators(task, start)]
    best = task.best(best, _MOST_STARTS)
    rough = sorted((task.improved(x, turns=_ROUGH) for x in best), key=_cost)
    slips = family.form.jump == 1  # behind the stick band
    if slips:
        finer = [x for one in rough[:_FOLLOWED] for x in _finer(task, one)]
        rough = sorted([*rough, *(task.improved(x, turns=_ROUGH) for x in finer)], key=_cost)
    found = min((task.improved(one.x) for one in rough[:_FOLLOWED]), key=_cost)
    found = _other_slips(task, found) if slips else found
    return found if family.jump is None else _jumped(task, found, family.jump)


def _best_actuators(task: Task, linear: FloatArray) -> list[FloatArray]:
    """Starts with these dead time and poles, and the best actuators of a grid."""
    starts = [np.clip(np.concatenate([linear, more]), *task.bounds) for more in _actuators(task)]
    return task.best(starts, 1 if task.family.form.own_lags else _ACTUATORS)


def _finer(task: Task, found: Member) -> list[FloatArray]:
    """Best starts of a finer grid of S and J, with the linear part that was found."""
    linear = found.x[: 1 + task.family.structure.order]
    starts = [found.starts, *(np.full(found.starts.size, place) for place in _PLACES)]
    sizes = np.log(_FINER * task.records.range)
    grid = [
        np.clip(np.concatenate([linear, [stick, jump], start]), *task.bounds)
        for i, stick in enumerate(sizes.tolist())
        for jump in sizes[: i + 1].tolist()
        for start in starts
    ]
    return task.best(grid, _FOLLOWED_FINER)


def _other_slips(task: Task, found: Member) -> Member:
    """Search S and J about a member: one step of a staircase more or less makes another slip."""
    at = 1 + task.family.structure.order
    grid = []
    for stick in _AROUND:
        for jump in _AROUND:
            x = found.x.copy()
            x[at : at + 2] += stick, jump
            if x[at + 1] <= x[at]:
                grid.append(x)
    best = [task.improved(x) for x in task.best(grid, _FOLLOWED_FINER)]
    return min([found, *best], key=_cost)


def with_other_lags(
    records: Records, found: Member, structures: Sequence[Structure], scales: Scales
) -> list[Member]:
    """Best members with the same actuator and other lags, from one that was found."""
    members = {found.family.structure: found}
    for structure in sorted(structures, key=lambda s: (s.order, s.zeros)):
        if structure in members:
            continue
        task = Task(records, replace(found.family, structure=structure), scales)
        own = {s: Candidate(s, m.x[: 1 + s.order], m.cost) for s, m in members.items()}
        starts = neighbour_starts(structure, scales, own)
        if not starts:
            poles = poles_from_parameters(found.theta[None])[0][0]
            slowest = poles[np.argsort(np.abs(poles))][: structure.order]
            if structure.order < poles.size and not slowest.imag.any():
                starts = [np.concatenate([found.x[:1], parameters_from_poles(slowest)])]
            else:
                starts = pattern_starts(structure, scales)
        rest = found.x[found.family.values.start :]
        tried = [task.improved(np.concatenate([start, rest])) for start in starts[:_FOLLOWED]]
        members[structure] = min(tried, key=_cost)
    return list(members.values())


def _linear_starts(family: Family, scales: Scales, beside: Sequence[Member]) -> list[FloatArray]:
    """Dead times and poles that are tried."""
    order = family.structure.order
    plain = Structure(order, order)
    every = pattern_starts(plain, scales)
    if family.kind == "none":
        return every
    # The lags of the response are longer than those of the plant.
    quick = pattern_starts(plain, replace(scales, rise=_QUICK * scales.rise))
    if family.form.limits_rate:
        return every + quick
    same = [one.x[: 1 + order] for one in beside if one.family.structure == family.structure]
    if family.form.static:
        return same + every
    # What sticks makes linear models find lags and dead times of any length.
    rises = np.geomspace(_SHORTEST * scales.dt, scales.length / _LONG, _RISES)
    return same + [
        pattern_starts(plain, replace(scales, rise=rise, onset=min(rise, scales.latest)))[0]
        for rise in rises.tolist()
    ]


def _actuators(task: Task) -> list[FloatArray]:
    """Entries of values, and starts, that are tried."""
    form, count = task.family.form, len(task.records.parts)
    at = [np.full(count, place) for place in _PLACES] if form.starts else [np.empty(0)]
    return [np.concatenate([entries, place]) for entries in form.grid(task.size) for place in at]


def _jumped(task: Task, found: Member, at: int) -> Member:
    """Search the slip jump, whose logarithm x has there, everything else following it."""
    best = [found]

    def cost(jump: float) -> float:
        x = task.moved(best[0].x, at, jump)
        member = task.improved(x, fixed=[at], turns=_QUICKLY)
        if member.cost < best[0].cost:
            best[0] = member
        return member.cost

    middle = float(found.x[at])
    for jump in np.linspace(middle - _BESIDE, middle + _BESIDE, _POINTS):
        cost(float(jump))
    middle, reach = float(best[0].x[at]), 2 * _BESIDE / (_POINTS - 1)
    minimize_scalar(
        cost,
        bounds=(middle - reach, middle + reach),
        method="bounded",
        options={"xatol": _RESOLVED, "maxiter": _POINTS},
    )
    return task.improved(best[0].x)


def _cost(member: Member) -> float:
    return member.cost
