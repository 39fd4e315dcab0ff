"""Fit many structures to one record: initial values, minima, selection, comparison.

The criterion is BIC [1]_, [3]_; a structure is not ruled out while the evidence against it is less
than very strong [2]_ (ablation: structures not ruled out). The penalty on zeros and poles beyond
the third, and the initial poles of a search, are our own rules.

Criteria are defined at minima [4]_, to which all structures are followed that may be chosen, or not
be ruled out; the range within which they are (`REACH`) was determined by experiment.

References
----------
.. [1] G. Schwarz, Estimating the dimension of a model, Ann. Statist. 6 (1978) 461-464,
   doi:10.1214/aos/1176344136.
.. [2] R. E. Kass and A. E. Raftery, Bayes factors, J. Amer. Statist. Assoc. 90 (1995) 773-795,
   doi:10.1080/01621459.1995.10476572.
.. [3] L. Ljung, System Identification: Theory for the User, 2nd ed., Prentice Hall 1999, section
   16.4 (Comparing model structures).
.. [4] K. P. Burnham and D. R. Anderson, Model Selection and Multimodel Inference, 2nd ed., Springer
   2002, doi:10.1007/b97636.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..arrays import ComplexArray, FloatArray
from ..constants import SMALLEST, VERY_STRONG
from ..rules import Rule
from .descend import descend, fit_batch
from .eliminate import eliminate
from .modal import parameters_from_poles, poles_from_parameters
from .newton import settle
from .problem import Bounds, Family, Problem, Structure

ALL_STRUCTURES = tuple(Structure(n, r) for n in range(1, 6) for r in range(n, 0, -1))
"""Further lags are those of a chain or a flow: free ones could not be distinguished."""
SIMPLE_STRUCTURES = tuple(s for s in ALL_STRUCTURES if s.order <= 3)  # for the delay estimates
NEEDLESS_ZERO, NEEDLESS_POLE = 6.0, 4.0
"""Charged for every zero, and for every pole beyond the third, when a structure is chosen: needless
ones lower the sum of squares by so many variances in one record of 70, and of 22. Ablation:
needless parameters."""

SLOWEST_PAIR, LEAST_DAMPING = 1e-2, 0.005  # of a pair: frequency, over the length; damping
SLOWEST = 1e-4
"""Smallest pole, over the length of the record: stands for an integrator."""
_DAMPING = 20.0
"""Largest damping of a pair: two lags with a ratio of 1600."""
FASTEST, SLOWER_WITH_ZEROS = 40.0, 2.0
"""Largest pole, in 1/samples. A response that jumps from one sample to the next needs it: with a
lag of half a sample at least, its dead time would be known better than to the sample. Ablation:
slower poles beside zeros."""

_ROUGHLY = 0.25  # variances by which an iteration lowers the cost where a search ends: time
_ENDS, _SAME_END = 5, 0.02  # of a search that are followed, and parts by which two are one: time

LEAST_CHARGE = 7.0
"""Least charge for a parameter where structures are ruled out. Few independent samples charge less,
and models with two zeros too many, in which a dead time has no information, would never be.
Ablation: least charge."""
REACH = 3 * VERY_STRONG
"""Excess of the criterion up to which structures are followed to their minima. Of measured records
searches ended up to 21 above them; what is not ruled out is within 10, charges aside."""
_SLOWEST_TRIED, _FASTEST_TRIED, _RATES = 0.01, 10.0, 8
"""Poles that are tried, over length and rise. Ablation: pole tried anywhere."""
CLOSE, _OTHERS = 1.0, 2
"""Variances by which ends differ that are both followed down, and how many others: time."""
_STARTS, _PROMISING = 3, 10.0
"""Starts that are followed beside the best end of a search, and variances that they may be above
it. With free initial states of records all are: there valleys are many, and flat."""
SLACK = 2.0  # variances that may be left to a minimum where steps of Gauss and Newton end
_SAME = 1e-12  # of the cost, by which another pairing of poles may differ
_ALL = 6  # structures that are few enough for each to matter: those of up to three poles


@dataclass(frozen=True)
class Scales:
    """Initial guess of a response, in s.

    `onset` is when it starts to move, `rise` the time from there to 63 % of its final value,
    `length` the duration of the record after the change of the input, `dt` the sample time.
    `latest` and `earliest` bound the dead time; `ringing` is an angular frequency that stands out
    of the residual of a first-order fit, or 0; `integrating`: the pole of that fit is far slower
    than the record. No pole is slower than `slowest`, in 1/s. `bounds` are those of the pole
    parameters of an order where there are no samples, as for points of a frequency response.
    """

    onset: float
    rise: float
    length: float
    dt: float
    latest: float
    earliest: float = 0.0
    ringing: float = 0.0
    integrating: bool = False
    slowest: float = 0.0
    bounds: Callable[[int], tuple[FloatArray, FloatArray]] | None = None


@dataclass(frozen=True, eq=False)
class Candidate:
    """Best fit of one structure: ``cost`` at ``parameters`` = [tau, pole parameters...].

    `ends` (B, 1 + n) are other end points of the search; `searched`: none of them has been followed
    further.
    """

    structure: Structure
    parameters: FloatArray
    cost: float
    ends: FloatArray | None = None
    searched: bool = False

    @property
    def dead_time(self) -> float:
        """Dead time in s."""
        return float(self.parameters[0])

    @property
    def poles(self) -> ComplexArray:
        """Poles in 1/s."""
        return np.asarray(poles_from_parameters(self.theta[None, 1:])[0][0])

    @property
    def theta(self) -> FloatArray:
        """Dead time and pole parameters, shape (1 + n,)."""
        return self.structure.theta(self.parameters)


def search(
    problem: Problem,
    structures: Iterable[Structure],
    scales: Scales,
    beside: dict[Structure, Candidate] | None = None,
    starts: Mapping[Structure, Sequence[FloatArray]] | None = None,
) -> dict[Structure, Candidate]:
    """Find the best fit of every structure.

    Each starts from two dead times for each of up to five sets of poles, and from the optima of the
    neighbouring structures (one zero fewer, one pole fewer).

    Parameters
    ----------
    problem : Problem
    structures : iterable of Structure
        Lower orders and larger relative degrees are fitted first.
    scales : Scales
    beside : dict of Structure to Candidate, optional
        Previous results, which are included.
    starts : mapping of Structure to sequences of ndarray, optional
        Models of other data of the plant, which take the place of those sets of poles.
    """
    found = dict(beside or {})
    for structure in sorted(structures, key=lambda s: (s.order, s.zeros)):
        tried = neighbour_starts(structure, scales, found)
        if starts is not None:
            tried += starts[structure]
        elif not tried or structure.order <= 3 or _worth_a_search(problem, structure, found):
            tried += pattern_starts(structure, scales, alone=not tried)
        bounds = parameter_bounds(structure, scales)
        done = float(np.clip(_ROUGHLY / problem.data.size, 1e-4, 1e-3))
        parameters, cost = fit_batch(problem, structure, np.array(tried), bounds, tolerance=done)
        order = np.argsort(cost)
        best, ends = order[0], apart(parameters[order[:_ENDS]])
        found[structure] = Candidate(structure, parameters[best], float(cost[best]), ends, True)
    return found


def apart(ends: FloatArray) -> FloatArray:
    """Leave out the first of some ends, and duplicates."""
    size = np.maximum(np.abs(ends).max(axis=0), 1e-300)
    kept = [ends[0]]
    for end in ends[1:]:
        if all(np.abs((end - other) / size).max() > _SAME_END for other in kept):
            kept.append(end)
    return np.array(kept[1:]).reshape(-1, ends.shape[1])


def _worth_a_search(
    problem: Problem, structure: Structure, found: dict[Structure, Candidate]
) -> bool:
    """Whether a rich structure may differ much from the neighbouring optima.

    Zeros are added to the optimum without them; and if the last pole did not lower the cost
    significantly, one more will not.
    """
    if structure.zeros:
        return not Rule.HOPELESS.on
    best = [
        min((c.cost for s, c in found.items() if s.order == order), default=np.inf)
        for order in (structure.order - 2, structure.order - 1)
    ]
    return not (best[1] > best[0] * (1 - 4 / problem.data.size) and Rule.HOPELESS.on)


def parameter_bounds(structure: Structure, scales: Scales) -> Bounds:
    """Bounds for dead time and poles: time constants up to (nearly) an integrator.

    With zeros they are at least half a sample: with more freedom such a model imitates an
    oscillation that was sampled too coarsely, as that of a measured circuit does at 0.93 of the
    Nyquist frequency.
    """
    if isinstance(structure, Family):
        return structure.bounds
    order = structure.order
    if scales.bounds is not None:
        least, most = scales.bounds(order)
        ends = np.append(scales.earliest, least), np.append(scales.latest, most)
        return Bounds(*ends, smooth=True)
    slower = structure.zeros and Rule.SLOWER.on
    fast = np.log((SLOWER_WITH_ZEROS if slower else FASTEST) / scales.dt)
    slow = np.log(max(SLOWEST / scales.length, scales.slowest))
    slow_pair = np.log(max(SLOWEST_PAIR / scales.length, scales.slowest))
    low, high = [scales.earliest], [scales.latest]
    if order % 2:
        low.append(slow)
        high.append(fast)
    for pair in range(order // 2):
        size, damping = fast, np.log(_DAMPING)
        if scales.integrating and pair == 0 and order % 2 == 0 and Rule.INTEGRATOR.on:
            # An integrator and a lag: the bounds of their sum and of its inverse, as of a pair.
            total = np.log(2 * _DAMPING) + fast
            size = (total + slow) / 2
            damping = (total - slow) / 2 - np.log(2.0)
        low += [slow_pair, np.log(LEAST_DAMPING)]
        high += [size, damping]
    return Bounds(np.array(low), np.array(high))


def criteria(
    candidates: dict[Structure, Candidate], variance: float, samples: float
) -> dict[Structure, float]:
    """Information criterion of every structure: cost / variance + parameters x log(samples).

    `variance` is that of the noise, including its correlation; `samples` the number of independent
    ones.
    """
    # Schwarz (1978) with known variance; parameters are dead time, poles, numerator (zeros + 1).
    penalty = parameter_charge(samples)
    # A constant record has no noise, and nothing to compare.
    variance = max(variance, SMALLEST)
    return {s: c.cost / variance + (s.free + 2) * penalty for s, c in candidates.items()}


def parameter_charge(samples: float) -> float:
    """Penalty on a parameter in the criterion: log of the number of independent samples."""
    return float(np.log(max(samples, 3.0)))


def choose(criterion: dict[Structure, float]) -> Structure:
    """Structure with the lowest criterion, with a penalty on zeros and a fourth pole."""
    return min(criterion, key=lambda s: criterion[s] + needless_parameters(s))


def plausible(
    candidates: dict[Structure, Candidate],
    criterion: dict[Structure, float],
    variance: float,
    chosen: Candidate,
    level: float,
    slack: float = 0.0,
) -> list[Structure]:
    """List the structures that the data cannot rule out.

    Those within 10 of the best criterion, or of `level`, that of the chosen one including its
    penalties; and lags without zeros that fit no worse, up to three of them or one more than
    chosen, because noise hides lags but does not remove them. `slack` is the remaining convergence
    error, in variances.
    """
    reach = VERY_STRONG + slack
    limit = min(*criterion.values(), level) + reach
    weighed = level + reach
    fits = chosen.cost + reach * variance
    own = chosen.structure
    lags = max(3, own.order + 1 if own.zeros == 0 else 0)
    return [
        s
        for s, value in criterion.items()
        if value <= limit
        or value + needless_parameters(s) <= weighed
        or candidates[s] is chosen
        or (s.zeros == 0 and s.order <= lags and candidates[s].cost <= fits and Rule.SIMPLER.on)
    ]


def charged(criterion: dict[Structure, float], penalty: float) -> dict[Structure, float]:
    """Criterion with at least the penalty per parameter used for ruling out."""
    more = least_charge(penalty) - penalty
    return {s: value + more * s.free for s, value in criterion.items()}


def least_charge(penalty: float) -> float:
    """Charge for a parameter where structures are ruled out: the penalty at least."""
    return LEAST_CHARGE if penalty < LEAST_CHARGE and Rule.LEAST_CHARGE.on else penalty


def needless_parameters(structure: Structure) -> float:
    """Penalty on zeros, and on poles beyond the third, when a structure is chosen."""
    charge = NEEDLESS_ZERO * structure.zeros + NEEDLESS_POLE * max(structure.order - 3, 0)
    return charge if charge and Rule.NEEDLESS.on else 0.0


def pattern_starts(structure: Structure, scales: Scales, alone: bool = False) -> list[FloatArray]:
    """Starts of a search for every set of poles, at two dead times, or at one beside others."""
    patterns = _pole_patterns(structure.order, scales)
    # With zeros, the optimum without them is a start as well: fewer sets suffice.
    dead_times = (0.4, 1.0) if structure.zeros == 0 or alone else (0.7,)
    return [
        np.concatenate([[part * scales.onset], parameters_from_poles(poles)])
        for part in dead_times
        for poles in patterns
    ]


def _pole_patterns(order: int, scales: Scales) -> list[ComplexArray]:
    """Equal lags; one slow; one very slow; an oscillatory pair; a pair at `ringing`."""
    rise = 1.0 / scales.rise
    patterns = [
        -np.linspace(0.8, 1.2, order) * order * rise,
        -np.concatenate([[1.2], np.geomspace(5, 8, order - 1)])[:order] * rise,
        -np.concatenate([[0.1], np.geomspace(1.2, 6, order - 1)])[:order] * rise,
    ]
    found = [pattern.astype(np.complex128) for pattern in patterns]
    if order >= 2:
        rest = -np.geomspace(3, 5, order - 2) * rise
        pair = 1.3 * rise * np.array([-0.2 + 0.98j, -0.2 - 0.98j])
        found.append(np.concatenate([pair, rest]))
        if scales.ringing > 0:
            pair = scales.ringing * np.array([-0.1 + 0.995j, -0.1 - 0.995j])
            found.append(np.concatenate([pair, rest]))
    return found


def neighbour_starts(
    structure: Structure, scales: Scales, found: dict[Structure, Candidate]
) -> list[FloatArray]:
    """Optima of the neighbouring structures: one zero fewer, one pole fewer."""
    n, r = structure.order, structure.relative_degree
    starts = []
    if Structure(n, r + 1) in found:
        starts.append(found[Structure(n, r + 1)].parameters)
    for smaller in (Structure(n - 1, r - 1), Structure(n - 1, r)):
        if smaller in found:
            old = found[smaller]
            poles = np.append(old.poles, -10.0 / scales.rise)
            starts.append(np.concatenate([[old.dead_time], parameters_from_poles(poles)]))
    return starts


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
    rates = np.geomspace(_SLOWEST_TRIED / scales.length, _FASTEST_TRIED / scales.rise, _RATES)
    poles = [np.append(smaller.poles, -rate) for rate in rates]
    return [np.append(smaller.dead_time, parameters_from_poles(each)) for each in poles]
