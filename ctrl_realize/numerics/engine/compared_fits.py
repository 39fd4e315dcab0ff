"""Follow all structures that may be chosen, or not be ruled out, to their minima.

Criteria are defined at minima [1]_; the range within which searches are followed (`REACH`) was
determined by experiment.

References
----------
.. [1] K. P. Burnham and D. R. Anderson, Model Selection and Multimodel Inference, 2nd ed., Springer
   2002, doi:10.1007/b97636.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..arrays import FloatArray
from ..constants import VERY_STRONG
from ..rules import Rule
from .descend import descend
from .eliminate import eliminate
from .modal import parameters_from_poles
from .newton import settle
from .problem import Bounds, Family, Problem, Structure
from .structures import (
    Candidate,
    Scales,
    apart,
    charged,
    choose,
    criteria,
    needless_parameters,
    neighbour_starts,
    parameter_bounds,
    parameter_charge,
    pattern_starts,
    plausible,
)

REACH = 3 * VERY_STRONG
"""Excess of the criterion up to which structures are followed to their minima. Of measured records
searches ended up to 21 above them; what is not ruled out is within 10, charges aside."""
_SLOWEST, _FASTEST, _RATES = 0.01, 10.0, 8
"""Poles that are tried, over length and rise. Ablation: pole tried anywhere."""
CLOSE, _OTHERS = 1.0, 2
"""Variances by which ends differ that are both followed down, and how many others: time."""
_STARTS, _PROMISING = 3, 10.0
"""Starts that are followed beside the best end of a search, and variances that they may be above
it. With free initial states of records all are: there valleys are many, and flat."""
SLACK = 2.0  # variances that may be left to a minimum where steps of Gauss and Newton end
_SAME = 1e-12  # of the cost, by which another pairing of poles may differ
_ALL = 6  # structures that are few enough for each to matter: those of up to three poles


def on_new_data(
    problem: Problem, candidates: dict[Structure, Candidate]
) -> dict[Structure, Candidate]:
    """Find the costs of models for changed data: all of them must be computed again."""
    return {
        s: replace(c, cost=float(eliminate(problem, s, c.parameters[None]).cost[0]))
        for s, c in candidates.items()
    }


def converged(
    problem: Problem,
    candidates: dict[Structure, Candidate],
    scales: Scales,
    variance: float,
    samples: float,
    *,
    last: bool = True,
    floor: float = 0.0,
) -> dict[Structure, Candidate]:
    """Follow structures within reach of the best criterion to their minima.

    Parameters
    ----------
    problem : Problem
    candidates : dict of Structure to Candidate
        From a search on this problem, or on slightly different data.
    scales : Scales
    variance, samples : float
        See `criteria`.
    last : bool, optional
        Whether the data are final. Otherwise it suffices to be near the minimum, and the best ends
        of every structure are kept.
    floor : float, optional
        Of the standard deviation of a residual: far below the noise it is rounding.

    Notes
    -----
    Each starts from all ends of its search, not only from the lowest, which has not converged, and
    from the optima of neighbouring structures.
    """
    found = dict(candidates)
    for structure in sorted(candidates, key=lambda s: (s.order, s.zeros)):
        value = criteria(found, variance, samples)
        if len(found) > _ALL and value[structure] > min(value.values()) + REACH:
            continue
        found[structure] = _near_minimum(problem, structure, scales, found, floor)
    if not last:
        return found
    return found | {
        s: settled(problem, found[s], scales)
        for s in _that_matter(found, variance, samples)
        if not found[s].searched
    }


def _that_matter(
    found: dict[Structure, Candidate], variance: float, samples: float
) -> list[Structure]:
    """Structures that may be chosen or not be ruled out, at their minima."""
    if len(found) <= _ALL:
        return list(found)
    values = charged(criteria(found, variance, samples), parameter_charge(samples))
    chosen = choose(values)
    level = values[chosen] + needless_parameters(chosen)
    return plausible(found, values, variance, found[chosen], level, SLACK)


def settled(problem: Problem, candidate: Candidate, scales: Scales) -> Candidate:
    """Follow a candidate to its minimum, from all its ends."""
    structure = candidate.structure
    starts = [candidate.parameters]
    if candidate.ends is not None:
        starts += [*candidate.ends]
    bounds = parameter_bounds(structure, scales)
    fits = [settle(problem, structure, start, bounds, scales.dt) for start in starts]
    parameters, cost = min(fits, key=lambda fit: fit[1])
    return _in_order(problem, Candidate(structure, parameters, cost, searched=False), bounds)


def _in_order(problem: Problem, candidate: Candidate, bounds: Bounds) -> Candidate:
    """Pair real poles by their size, because the pairing by a search is arbitrary.

    Otherwise a fit that starts here, of a profile for instance, would depend on it.
    """
    if isinstance(candidate.structure, Family):
        return candidate
    x = np.append(candidate.dead_time, parameters_from_poles(candidate.poles))
    if np.any(x < bounds.low) or np.any(x > bounds.high):
        return candidate
    cost = float(eliminate(problem, candidate.structure, x[None]).cost[0])
    # Coincident poles are separated in another way.
    return (
        candidate
        if cost > candidate.cost * (1 + _SAME)
        else replace(candidate, parameters=x, cost=cost)
    )


def _near_minimum(
    problem: Problem, structure: Structure, scales: Scales, found: dict[Structure, Candidate],
    floor: float,
) -> Candidate:  # fmt: skip
    old = found[structure]
    bounds = parameter_bounds(structure, scales)
    starts = [old.parameters] if old.ends is None else [old.parameters, *old.ends]
    if old.searched:
        more = np.array(
            [
                *starts[1:],
                *neighbour_starts(structure, scales, found),
                *_with_a_pole_more(structure, scales, found),
            ]
        ).reshape(-1, old.parameters.size)
        if problem.segments is None and len(more):
            cost = eliminate(problem, structure, more).cost
            promising = np.argsort(cost)[:_STARTS]
            near = cost[promising] <= old.cost * (1 + _PROMISING / problem.data.size)
            more = more[promising[near]]
        starts = [old.parameters, *more]
    ends, costs = descend(problem, structure, np.array(starts), bounds, scales.dt, floor=floor)
    order = np.argsort(costs)
    close = order[costs[order] <= costs[order[0]] * (1 + CLOSE / problem.data.size)]
    others = apart(ends[close])[:_OTHERS]
    best = order[0]
    return Candidate(structure, ends[best], float(costs[best]), others, searched=False)


def at_dead_time(
    problem: Problem, candidate: Candidate, scales: Scales, dead_time: float
) -> Candidate:
    """Best model of the same structure with a given dead time.

    Far from the optimum other poles are best, and starting from the optimum may lead to a local
    minimum: the initial poles of a search are followed as well.
    """
    structure, bounds = candidate.structure, parameter_bounds(candidate.structure, scales)
    starts = np.array([candidate.parameters, *pattern_starts(structure, scales)])
    starts[:, 0] = dead_time
    fixed, costs = descend(problem, structure, starts, bounds, scales.dt, dead_time_fixed=True)
    near = fixed[costs <= costs.min() * (1 + CLOSE / problem.data.size)]
    fits = [
        settle(problem, structure, start, bounds, scales.dt, dead_time_fixed=True) for start in near
    ]
    return Candidate(structure, *min(fits, key=lambda fit: fit[1]))


def _with_a_pole_more(
    structure: Structure, scales: Scales, found: dict[Structure, Candidate]
) -> list[FloatArray]:
    """Optimum of the structure with one pole and one zero fewer, with an additional pole anywhere.

    The zero can cancel it, so that none of them is worse: the best one does not depend on the
    course of a search.
    """
    smaller = found.get(Structure(structure.order - 1, structure.relative_degree))
    if smaller is None or not Rule.POLE.on:
        return []
    rates = np.geomspace(_SLOWEST / scales.length, _FASTEST / scales.rise, _RATES)
    poles = [np.append(smaller.poles, -rate) for rate in rates]
    return [np.append(smaller.dead_time, parameters_from_poles(each)) for each in poles]
