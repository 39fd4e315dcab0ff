"""Search of the best member of a family: a grid of actuators, then the best ones improved.

The misfit is a piecewise smooth function of stiction: which moves of the command set a stem in
motion changes at once. S and J are therefore searched on grids about the best ones as well.
Starts are those of the engine beside some of our own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ..arrays import FloatArray
from ..engine.poles import parameters_from_poles
from ..engine.problem import Structure
from ..engine.structures import Candidate, neighbour_starts, pattern_starts
from .family import ActuatedFamily, Member

_QUICK = 0.2  # of the visible rise: the lags of the response are longer than those of the plant
_SHORTEST, _LONG, _RISES = 3.0, 20.0, 5  # samples, parts of a record: lags behind what sticks
_PLACES = (-1.0, 0.0, 1.0)
_MOST_STARTS = 8
_EACH = 2  # actuators of a grid that are improved with each dead time and poles
_ROUGH = 6  # iterations in which starts are compared
_FOLLOWED = 3  # starts that are followed to the bottom: time
_AROUND = np.linspace(-0.24, 0.24, 17)  # of a logarithm, of S and of J
_ROUNDS = 3
_FINE = np.linspace(-0.4, 0.4, 81)  # of the logarithm of a slip jump, with S - J kept


def searched(family: ActuatedFamily, linear: Mapping[Structure, Candidate]) -> list[Member]:
    """Find the best member of a family, and others at which the misfit has a minimum.

    `linear` are linear models of the same records.
    """
    actuators = _actuators(family)
    best = []
    for start in _linear_starts(family, linear):
        rows = np.concatenate([np.tile(start, (len(actuators), 1)), actuators], axis=1)
        best += family.best(np.clip(rows, *family.bounds), _EACH)
    rough = [family.improved(x, turns=_ROUGH) for x in family.best(np.array(best), _MOST_STARTS)]
    found = [family.improved(one.x) for one in sorted(rough, key=cost_of)[:_FOLLOWED]]
    if family.jump is not None:
        found = [_other_slips(family, one) for one in found]
    first, *others = sorted(found, key=cost_of)
    return [first, *(one for one in others if abs(one.x[0] - first.x[0]) > family.scales.dt)]


def _actuators(family: ActuatedFamily) -> FloatArray:
    """Values, and places within play at the beginning, that are tried."""
    grid, parts = family.properties.grid(family.size), len(family.records.parts)
    if not family.properties.starts:
        return grid
    places = [np.full((len(grid), parts), place) for place in _PLACES]
    return np.concatenate([np.concatenate([grid, place], axis=1) for place in places])


def _linear_starts(
    family: ActuatedFamily, linear: Mapping[Structure, Candidate]
) -> list[FloatArray]:
    """Dead times and poles that are tried."""
    structure, scales = family.structure, family.scales
    starts = [linear[structure].parameters] if structure in linear else []
    if not family.properties.sticks:
        quick = replace(scales, rise=_QUICK * scales.rise)
        return starts + pattern_starts(structure, scales) + pattern_starts(structure, quick)
    # What sticks makes linear models find lags and dead times of any length.
    for rise in np.geomspace(_SHORTEST * scales.dt, scales.length / _LONG, _RISES).tolist():
        quick = replace(scales, rise=rise, onset=min(rise, scales.latest))
        starts += pattern_starts(structure, quick)[:1]
    return starts


def _other_slips(family: ActuatedFamily, found: Member) -> Member:
    """Search S and J about a member: one step of a staircase more or less makes another slip."""
    first, jump = family.values.start, family.jump
    assert jump is not None
    for _ in range(_ROUNDS):
        grid = [family.moved(found.x, jump, found.x[jump] + step) for step in _FINE]
        if jump > first:
            pairs = found.x + np.zeros((_AROUND.size, _AROUND.size, 1))
            pairs[:, :, first] += _AROUND[:, None]
            pairs[:, :, jump] += _AROUND
            grid += [*pairs[pairs[:, :, jump] <= pairs[:, :, first]]]
        best = family.best(np.array(grid), _FOLLOWED)
        better = min((family.improved(x, turns=_ROUGH) for x in best), key=cost_of)
        if better.cost >= found.cost:
            break
        found = better
    return family.improved(found.x)


def with_other_lags(found: Member, orders: Sequence[int]) -> list[Member]:
    """Best members with the same actuator and other numbers of lags, from one that was found."""
    members = {found.family.order: found}
    for order in sorted(orders, key=lambda n: (abs(n - found.family.order), n)):
        if order in members:
            continue
        near = members[min(members, key=lambda n: (abs(n - order), n))]
        family = replace(found.family, order=order)
        structure = near.family.structure
        linear = Candidate(structure, near.x[: near.family.values.start], near.cost)
        starts = neighbour_starts(family.structure, family.scales, {structure: linear})
        starts += pattern_starts(family.structure, family.scales)[:1]
        slowest = near.poles[np.argsort(np.abs(near.poles))][:order]
        if slowest.size == order and not slowest.imag.any():
            starts.append(np.append(near.x[0], parameters_from_poles(slowest)))
        remainder = near.x[near.family.values.start :]
        tried = [family.improved(np.append(start, remainder)) for start in starts]
        members[order] = min(tried, key=cost_of)
    return list(members.values())


def cost_of(member: Member) -> float:
    """Sum of squares."""
    return member.cost
