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
from ..constants import SMALLEST
from ..engine.descend import fit_batch
from ..engine.modal import parameters_from_poles
from ..engine.problem import Problem, Structure
from ..engine.structures import Candidate, neighbour_starts, pattern_starts
from ..families.shaped import lowest
from .family import ActuatedFamily, actuated_family, sizes

_QUICK = 0.2  # of the visible rise: the lags of the response are longer than those of the plant
_SHORTEST, _LONG, _RISES = 3.0, 20.0, 5  # samples, parts of a record: lags behind what sticks
_PLACES = (-1.0, 0.0, 1.0)
_MOST_STARTS = 8
_EACH = 2  # actuators of a grid that are improved with each dead time and poles
_ROUGH = 6  # iterations in which starts are compared
_ROUGHLY = 1e-3  # of the sum of squares: what an iteration gains that is the last of these
_FOLLOWED = 3  # starts that are followed to the bottom: time
_AROUND = np.linspace(-0.24, 0.24, 17)  # of a logarithm, of S and of J
_ROUNDS = 3
_AT_ONCE = 2_000_000  # samples of responses
_ALIKE = 12  # decimals of sums of squares over that of the data
_NEAR = 0.0  # sum of squares that is enough: differences for derivatives serve no Newton's method
_FINE = np.linspace(-0.4, 0.4, 81)  # of the logarithm of a slip jump, with S - J kept


def searched(
    problem: Problem, family: ActuatedFamily, linear: Mapping[Structure, Candidate]
) -> list[Candidate]:
    """Find the best member of a family, and others at which the misfit has a minimum.

    `linear` are linear models of the same records.
    """
    actuators, bounds = _actuators(family), family.bounds
    best = []
    for start in _linear_starts(family, linear):
        rows = np.concatenate([np.tile(start, (len(actuators), 1)), actuators], axis=1)
        best.append(_best(problem, family, np.clip(rows, bounds.low, bounds.high), _EACH))
    starts = _best(problem, family, np.concatenate(best), _MOST_STARTS)
    rough = _improved(problem, family, starts)[:_FOLLOWED]
    found = [minimum(problem, family, one.parameters[None]) for one in rough]
    if family.jump is not None:
        found = [_other_slips(problem, one) for one in found]
    first, *others = sorted(found, key=cost_of)
    apart = [one for one in others if abs(one.dead_time - first.dead_time) > family.scales.dt]
    # Another minimum is another model, and a key of its own.
    return [first, *(replace(one, structure=replace(family)) for one in apart)]


def minimum(problem: Problem, family: ActuatedFamily, starts: FloatArray) -> Candidate:
    """Lowest member that is reached from starts (B, k)."""
    return lowest(problem, family, starts, family.scales.dt, _NEAR)


def _improved(problem: Problem, family: ActuatedFamily, starts: FloatArray) -> list[Candidate]:
    """Members a few steps from starts (B, k), the best first."""
    ends, costs = fit_batch(
        problem, family, starts, family.bounds, most_iterations=_ROUGH, tolerance=_ROUGHLY
    )
    return [Candidate(family, ends[i], float(costs[i])) for i in np.argsort(costs)]


def _best(problem: Problem, family: ActuatedFamily, xs: FloatArray, count: int) -> FloatArray:
    """Best `count` of xs; the first of those that are alike, as rates that limit nothing."""
    basis = np.linalg.qr(problem.weighted_regressors)[0]
    data = problem.data - basis @ (basis.T @ problem.data)
    power, parts = max(float(data @ data), SMALLEST), []
    for piece in np.array_split(xs, 1 + len(xs) * data.size // _AT_ONCE):
        unit = family.unit(piece)
        unit -= (unit @ basis) @ basis.T
        square = np.sum(unit**2, axis=1)
        parts.append(1 - (unit @ data) ** 2 / np.where(square > 0, power * square, 1.0))
    _, first = np.unique(np.round(np.concatenate(parts), _ALIKE), return_index=True)
    return np.asarray(xs[first[:count]])


def _actuators(family: ActuatedFamily) -> FloatArray:
    """Values, and places within play at the beginning, that are tried."""
    size = sizes(family.records, family.scales, family.levels)
    grid, parts = family.properties.grid(size), len(family.records.parts)
    if not family.properties.starts:
        return grid
    places = [np.full((len(grid), parts), place) for place in _PLACES]
    return np.concatenate([np.concatenate([grid, place], axis=1) for place in places])


def _linear_starts(
    family: ActuatedFamily, linear: Mapping[Structure, Candidate]
) -> list[FloatArray]:
    """Dead times and poles that are tried."""
    structure, scales = family.plain, family.scales
    starts = [linear[structure].parameters] if structure in linear else []
    if not family.properties.sticks:
        quick = replace(scales, rise=_QUICK * scales.rise)
        return starts + pattern_starts(structure, scales) + pattern_starts(structure, quick)
    # What sticks makes linear models find lags and dead times of any length.
    for rise in np.geomspace(_SHORTEST * scales.dt, scales.length / _LONG, _RISES).tolist():
        quick = replace(scales, rise=rise, onset=min(rise, scales.latest))
        starts += pattern_starts(structure, quick)[:1]
    return starts


def _other_slips(problem: Problem, found: Candidate) -> Candidate:
    """Search S and J about a member: one step of a staircase more or less makes another slip."""
    family = family_of(found)
    first, jump = family.values.start, family.jump
    assert jump is not None
    for _ in range(_ROUNDS):
        x = found.parameters
        grid = [family.moved(x, jump, x[jump] + step) for step in _FINE]
        if jump > first:
            pairs = x + np.zeros((_AROUND.size, _AROUND.size, 1))
            pairs[:, :, first] += _AROUND[:, None]
            pairs[:, :, jump] += _AROUND
            grid += [*pairs[pairs[:, :, jump] <= pairs[:, :, first]]]
        best = _best(problem, family, np.array(grid), _FOLLOWED)
        better = _improved(problem, family, best)[0]
        if better.cost >= found.cost:
            break
        found = better
    return minimum(problem, family, found.parameters[None])


def with_other_lags(
    problem: Problem, found: Candidate, orders: Sequence[int]
) -> dict[int, Candidate]:
    """Best members with the same actuator and other numbers of lags, from one that was found."""
    base = family_of(found)
    members = {base.order: found}
    for order in sorted(orders, key=lambda n: (abs(n - base.order), n)):
        if order in members:
            continue
        near = members[min(members, key=lambda n: (abs(n - order), n))]
        family = actuated_family(
            base.records, base.scales, order, base.kind, base.place, base.levels
        )
        plain, structure = near.structure.plain, family.plain
        linear = {plain: Candidate(plain, near.theta, near.cost)}
        starts = neighbour_starts(structure, family.scales, linear)
        starts += pattern_starts(structure, family.scales)[:1]
        slowest = near.poles[np.argsort(np.abs(near.poles))][:order]
        if slowest.size == order and not slowest.imag.any():
            starts.append(np.append(near.dead_time, parameters_from_poles(slowest)))
        remainder = near.parameters[near.theta.size :]
        tried = np.array([np.append(start, remainder) for start in starts])
        members[order] = minimum(problem, family, tried)
    return members


def family_of(found: Candidate) -> ActuatedFamily:
    """Family of a member."""
    assert isinstance(found.structure, ActuatedFamily)
    return found.structure


def cost_of(found: Candidate) -> float:
    """Sum of squares."""
    return found.cost
