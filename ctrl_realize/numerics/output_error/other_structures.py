"""What structures that were not requested say of a record.

A structure is ruled out by a difference of criteria that [1]_ calls very strong.

References
----------
.. [1] R. E. Kass and A. E. Raftery, Bayes factors, J. Amer. Statist. Assoc. 90 (1995) 773-795,
   doi:10.1080/01621459.1995.10476572.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..engine.profile_ends import profile_limits
from ..engine.structures import (
    ALL_STRUCTURES,
    LEAST_CHARGE,
    PLAUSIBLE,
    Candidate,
    charged,
    needless_parameters,
    plausible,
    search,
)
from ..engine.varpro import Structure, evaluate
from ..engine.window import WindowFit, extended
from .profiles import profile_of
from .result import OtherStructures, StructureFit

_MOST_ORDER = ALL_STRUCTURES[-1].order  # highest order that is tried


def other_structures(fits: WindowFit, refit: Callable[[], WindowFit]) -> OtherStructures:
    """Find structures that rule out the requested ones, or are not ruled out beside them.

    One more pole is tried first, starting from the given optimum, which is cheap; only if it fits
    significantly better are all structures fitted again.

    Parameters
    ----------
    fits : WindowFit
        Of the requested structures.
    refit : callable
        Fit of the default structures.
    """
    given = fits.best
    # Beside an exact fit no other structure tells anything.
    if given.structure.order >= _MOST_ORDER or not fits.variance > 0:
        return OtherStructures()
    better = _better(refit(), given) if _lacks_a_pole(fits, given) else None
    return OtherStructures(better, () if better is not None else _not_ruled_out(fits, given))


def _better(free: WindowFit, given: Candidate) -> StructureFit | None:
    best = free.best
    if best.structure == given.structure:
        return None
    cost = _cost(free, given)
    own = free.criteria({given.structure: Candidate(given.structure, given.parameters, cost)})
    excess = _charged(own, given.structure) - _charged(free.criterion, best.structure)
    # Too many poles are not excluded: their residual is as small.
    if excess <= PLAUSIBLE or cost <= best.cost + PLAUSIBLE * free.variance:
        return None
    return _line(free, best.structure, -excess)


def _not_ruled_out(fits: WindowFit, given: Candidate) -> tuple[StructureFit, ...]:
    """List structures of one pole more that the data do not rule out, the best first."""
    order = given.structure.order + 1
    more = tuple(Structure(order, r) for r in range(order, 0, -1))
    free = extended(fits, more)
    level = _charged(free.criterion, given.structure)
    least = level + max(LEAST_CHARGE - free.penalty, 0.0) * (order - 1 + given.structure.zeros)
    kept = plausible(
        free.candidates, charged(free.criterion, free.penalty), free.variance, given, least
    )
    lines = [_line(free, s, _charged(free.criterion, s) - level) for s in kept if s in more]
    return tuple(sorted(lines, key=lambda line: line.delta_bic))


def _charged(criterion: dict[Structure, float], structure: Structure) -> float:
    return criterion[structure] + needless_parameters(structure)


def _line(fits: WindowFit, structure: Structure, excess: float) -> StructureFit:
    candidate = fits.candidates[structure]
    static = fits.static(candidate)
    interval = profile_limits(*profile_of(fits, candidate))
    return StructureFit(
        structure,
        candidate.dead_time,
        static.total,
        float(excess),
        interval,
        candidate.poles,
        static.gain,
    )


def _lacks_a_pole(fits: WindowFit, given: Candidate) -> bool:
    n, r = given.structure.order, given.structure.relative_degree
    # Without Huber's clipping towards the given model, which may hide its errors.
    problem = fits.window.problem
    state = evaluate(problem, given.structure, given.parameters[None])
    start = Candidate(given.structure, given.parameters, float(state.cost[0]))
    richer = (Structure(n + 1, r + 1), Structure(n + 1, r))
    found = search(problem, richer, fits.scales, {given.structure: start})
    least = min(found[s].cost for s in richer)
    # Relative to the residual of the richer ones: that of the given one may be large and
    # correlated.
    variance = least / max(problem.data.size - 2 * n - 4, 1)
    return bool(start.cost - least > PLAUSIBLE * variance)


def _cost(free: WindowFit, given: Candidate) -> float:
    """Cost of the given structure for other data, starting from its optimum."""
    state = evaluate(free.problem, given.structure, given.parameters[None])
    return float(np.asarray(state.cost)[0])
