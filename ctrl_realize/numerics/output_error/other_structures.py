"""What is requested of a fit, and what structures that were not requested say of a record.

A structure is ruled out by a difference of criteria that [1]_ calls very strong.

References
----------
.. [1] R. E. Kass and A. E. Raftery, Bayes factors, J. Amer. Statist. Assoc. 90 (1995) 773-795,
   doi:10.1080/01621459.1995.10476572.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial

from ..constants import VERY_STRONG
from ..engine.problem import KnownFactor, Structure
from ..engine.profile import profile_limits
from ..engine.structures import (
    ALL_STRUCTURES,
    SLACK,
    Candidate,
    charged,
    converged,
    least_charge,
    needless_parameters,
    on_new_data,
    plausible,
    search,
    settled,
)
from ..engine.window_fit import WindowFit
from ..families.process_form import ProcessForm
from .interval import profile_of
from .result import OtherStructures, StructureFit

_MOST_ORDER = ALL_STRUCTURES[-1].order  # highest order that is tried


@dataclass(frozen=True, eq=False)
class Requested:
    """What is requested of a fit.

    Attributes
    ----------
    structures : tuple of Structure, optional
        The dead time is that of the best of them, adequate or not. Default: structures are chosen.
    forms : tuple of ProcessForm
        Process models to which the choice is limited; `structures` are theirs.
    latest, earliest : float, optional
        Largest and smallest dead time, in s.
    beyond : bool
        The dead time may be later than the visible onset.
    known : KnownFactor
        Dynamics in cascade that are not part of the plant.
    fastest : float, optional
        Fastest lag, in s.
    huber : bool
        Huber's loss (k = 1.345) instead of least squares.
    whiten : bool
        Prewhiten the data if the noise is coloured.
    simulates : bool
        But not if the model then simulates them worse than coloured noise explains.
    loop : bool
        The input is that of a controller: see `any_input.lags`.
    rested : bool
        Records of any input begin at rest: none has a free response or a drift that is not seen.
    compared : bool
        Look for structures that were not requested and fit better, or as well.
    """

    structures: tuple[Structure, ...] | None = None
    forms: tuple[ProcessForm, ...] = ()
    latest: float | None = None
    earliest: float = 0.0
    beyond: bool = False
    fastest: float | None = None
    known: KnownFactor = field(default_factory=KnownFactor)
    huber: bool = True
    whiten: bool = True
    simulates: bool = True
    loop: bool = False
    rested: bool = False
    compared: bool = True


@dataclass(frozen=True, eq=False)
class Compared:
    """A structure that rules out the requested ones, and a function for what is open beside them.

    That takes as long as a fit, and is of no use beside what is ruled out.
    """

    better: StructureFit | None = None
    not_ruled_out: Callable[[], OtherStructures] = OtherStructures

    def told(self, better: StructureFit | None) -> OtherStructures:
        """What they say of a model, where `better` rules it out."""
        return self.not_ruled_out() if better is None else OtherStructures(better)


def other_structures(fits: WindowFit, refit: Callable[[], WindowFit]) -> Compared:
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
    n, r = given.structure.order, given.structure.relative_degree
    # Beside an exact fit no other structure tells anything.
    if n >= _MOST_ORDER or not fits.variance > 0:
        return Compared()
    # Without Huber's clipping towards the given model, which may hide its errors.
    problem = fits.window.problem
    start = on_new_data(problem, {given.structure: given})
    richer = search(problem, (Structure(n + 1, r + 1), Structure(n + 1, r)), fits.scales, start)
    cost = richer.pop(given.structure).cost
    least = min(candidate.cost for candidate in richer.values())
    # Relative to the residual of the richer ones: that of the given one may be large and
    # correlated.
    variance = least / max(problem.data.size - 2 * n - 4, 1)
    better = better_than(given, refit()) if cost - least > VERY_STRONG * variance else None
    return Compared(better, partial(_not_ruled_out, fits, richer))


def better_than(given: Candidate, free: WindowFit) -> StructureFit | None:
    """The best of some structures, if it rules a model out."""
    best = free.best
    if best.structure == given.structure:
        return None
    here = on_new_data(free.problem, {given.structure: given})
    cost, values = here[given.structure].cost, free.criteria(here)
    excess = _charged(values, given.structure) - _charged(free.criterion, best.structure)
    # Too many poles are not excluded: their residual is as small.
    if excess <= VERY_STRONG or cost <= best.cost + VERY_STRONG * free.variance:
        return None
    return line_of(free, best, -excess)


def _not_ruled_out(fits: WindowFit, richer: dict[Structure, Candidate]) -> OtherStructures:
    """List structures of one pole more that the data do not rule out, the best first."""
    given, problem, scales = fits.best, fits.problem, fits.scales
    order = given.structure.order + 1
    more = [Structure(order, r) for r in range(order, 0, -1)]
    found = on_new_data(problem, richer) | fits.candidates
    found = search(problem, [s for s in more if s not in found], scales, found)
    found = converged(problem, found, scales, fits.variance, fits.independent, last=False)
    # Those that are ruled out by more than is left to their minima need not be followed there.
    for s in _kept(fits, found, SLACK):
        found[s] = settled(problem, found[s], scales) if s in more else found[s]
    free = fits.of(found)
    level = _charged(fits.criterion, given.structure)
    lines = [
        _without_interval(free, found[s], _charged(free.criterion, s) - level)
        for s in _kept(fits, found, 0.0)
        if s in more
    ]

    def ends(structure: Structure) -> tuple[float, float]:
        return profile_limits(*profile_of(free, found[structure]))

    lines.sort(key=lambda line: line.delta_bic)
    return OtherStructures(alike=tuple(lines), ends=ends)


def _kept(fits: WindowFit, found: dict[Structure, Candidate], slack: float) -> list[Structure]:
    """Structures that the data do not rule out beside the best of those requested."""
    given, values = fits.best, fits.criteria(found)
    level = _charged(fits.criterion, given.structure)
    least = level + (least_charge(fits.penalty) - fits.penalty) * given.structure.free
    return plausible(found, charged(values, fits.penalty), fits.variance, given, least, slack)


def _charged(criterion: dict[Structure, float], structure: Structure) -> float:
    return criterion[structure] + needless_parameters(structure)


def line_of(fits: WindowFit, candidate: Candidate, excess: float) -> StructureFit:
    """Line of a table of structures, with the interval in s of its profile."""
    line = _without_interval(fits, candidate, excess)
    return replace(line, interval=profile_limits(*profile_of(fits, candidate)))


def _without_interval(fits: WindowFit, candidate: Candidate, excess: float) -> StructureFit:
    static, dead_time = fits.static(candidate), candidate.dead_time
    values = dead_time, static.total, float(excess), None, candidate.poles, static.gain
    return StructureFit(candidate.structure, *values)
