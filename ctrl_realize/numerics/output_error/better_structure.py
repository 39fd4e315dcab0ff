"""Test whether another structure explains a record better than the requested ones.

A structure is ruled out by a difference of criteria that [1]_ calls very strong.

References
----------
.. [1] R. E. Kass and A. E. Raftery, Bayes factors, J. Amer. Statist. Assoc. 90 (1995) 773-795,
   doi:10.1080/01621459.1995.10476572.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..separable.profile_ends import profile_limits
from ..separable.structures import ALL_STRUCTURES, PLAUSIBLE, Candidate, needless_parameters, search
from ..separable.varpro import Structure, evaluate
from ..separable.window import WindowFit
from .profiles import profile_of
from .result import StructureFit

_MOST_ORDER = ALL_STRUCTURES[-1].order  # highest order that is tried


def better_structure(
    fits: WindowFit, given: Candidate, refit: Callable[[], WindowFit]
) -> StructureFit | None:
    """Find a structure that rules out the given one; None if there is none.

    One more pole is tried first, starting from the given optimum, which is cheap; only if it fits
    significantly better are all structures fitted again.

    Parameters
    ----------
    fits : WindowFit
        Of the requested structures.
    given : Candidate
        The best of them.
    refit : callable
        Fit of the default structures.
    """
    if not _lacks_a_pole(fits, given):
        return None
    free = refit()
    best = free.best
    if best.structure == given.structure:
        return None
    cost = _cost(free, given)
    own = free.criteria({given.structure: Candidate(given.structure, given.parameters, cost)})
    excess = own[given.structure] + needless_parameters(given.structure)
    excess -= free.criterion[best.structure] + needless_parameters(best.structure)
    # Too many poles are not excluded: their residual is as small.
    if excess <= PLAUSIBLE or cost <= best.cost + PLAUSIBLE * free.variance:
        return None
    static = free.static(best)
    interval = profile_limits(*profile_of(free, best))
    return StructureFit(
        best.structure,
        best.dead_time,
        static.total,
        -float(excess),
        interval,
        best.poles,
        static.gain,
    )


def _lacks_a_pole(fits: WindowFit, given: Candidate) -> bool:
    n, r = given.structure.order, given.structure.relative_degree
    if n >= _MOST_ORDER:
        return False
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
