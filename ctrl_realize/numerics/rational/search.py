"""All structures of a transfer function with dead time on one frequency response.

Structures are compared by BIC [1]_, [2]_. Where residuals are correlated along frequency the number
of points is divided by ``(1 + r) / (1 - r)``, the variance factor of the mean of a first-order
autoregression with correlation r between neighbours.

Errors of which nothing is known are a part of the response and a floor. An error in proportion to
the response would be none at an anti-resonance, whose few points then outweigh all others; a floor
is an error that is the same everywhere, as of a noisy sensor. Both are variances of the complex
error, estimated from residuals by maximum likelihood [3]_ (a regression of variances, [4]_).

References
----------
.. [1] G. Schwarz, Estimating the dimension of a model, Ann. Statist. 6 (1978) 461-464,
   doi:10.1214/aos/1176344136.
.. [2] L. Ljung, System Identification: Theory for the User, 2nd ed., Prentice Hall 1999, section
   16.4 (Comparing model structures).
.. [3] R. Pintelon and J. Schoukens, System Identification: A Frequency Domain Approach, 2nd ed.,
   Wiley 2012, chapter 9, doi:10.1002/9781118287422.
.. [4] M. Davidian and R. J. Carroll, Variance function estimation, J. Amer. Statist. Assoc. 82
   (1987) 1079-1091, doi:10.1080/01621459.1987.10478543.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np

from ..arrays import ComplexArray, FloatArray
from ..constants import VERY_STRONG
from ..engine.modal import parameters_from_poles
from ..engine.problem import Structure
from ..engine.structures import Candidate, settled
from ..families.equal_lags import LONGEST, SHORTEST, free_lags
from ..rules import Rule
from .frf_data import FRFData, refined
from .starts import delay_grid, grown_starts, starting_points

DEFAULT_ORDERS = range(5)
"""Default orders; larger ones are tried if the largest of these is the best."""
_LARGEST_ORDER = 10  # unless a larger one is asked for: time
_LARGEST_FROM_GRID = 3  # order up to which a linear problem finds the poles; see `starts`
MISSING = 0.1
"""Correlated residual over the response at which dynamics are missing, not details: three
resonances leave 0.35 to 0.9 up to order 5; a motor bench that is slightly nonlinear 0.03."""
_STEPS_OF_ONE = 8  # order up to which real poles are added too, which takes twice the time
_SETTLED = 10.0
"""Excess of the criterion up to which a structure is followed to its very minimum: it may be chosen
or widen the interval."""
_KEPT = 4  # starts followed to the end, and fits of every order that are extended: time
_TRIED = 100  # floors over the range of the response: 10 % apart over four decades


def dead_time_bound(response: ComplexArray, omega: FloatArray, sigma: FloatArray) -> float:
    """Upper bound of the dead time from the steepest slope of the phase, in s.

    Parameters
    ----------
    response : ndarray, shape (K,)
    omega : ndarray, shape (K,)
        Rising, in rad/s.
    sigma : ndarray, shape (K,)
        Standard deviation of the response; points with more than 30 % are left out.
    """
    clear = sigma < 0.3 * np.abs(response) if np.any(sigma < 0.3 * np.abs(response)) else sigma > 0
    if clear.sum() < 4:
        clear = np.ones(omega.size, dtype=bool)
    w, phase = omega[clear], np.unwrap(np.angle(response[clear]))
    slopes = [0.0]
    # From low frequencies upwards: unwrapping fails first where points are far apart, and lags add
    # to the slope there, so the steepest one is an upper bound of the dead time.
    for stop in [*(w[0] * 2.0 ** np.arange(1, 1 + np.log2(w[-1] / w[0]))), w[-1]]:
        for part in (w <= stop, (w <= stop) & (w >= 0.5 * stop)):
            if part.sum() >= 4:
                slopes.append(-float(np.polyfit(w[part], phase[part], 1)[0]))
    # Half a turn at the highest frequency for noise and for leading phases.
    return 1.1 * max(slopes) + np.pi / float(w[-1])


def fit_structures(
    data: FRFData, orders: Sequence[int] | None, degrees: Sequence[int] | None
) -> dict[Structure, Candidate]:
    """Fit every structure, each from its own starts and from its neighbours' solutions.

    Parameters
    ----------
    data : FRFData
    orders : sequence of int or None
        Increasing. None: from 0 on, until an order is no longer better than the one before.
    degrees : sequence of int or None
        Relative degrees, rising; None: 1 to the order, 0 of order 0. Where three poles and more are
        the best, four to eight lags without zeros are tried as well.

    Returns
    -------
    dict
        For relative degrees up to the order; those that may be chosen are at their minima.
    """
    ladder = _Ladder(data)
    fits: dict[Structure, Candidate] = {}
    for n in orders if orders is not None else DEFAULT_ORDERS:
        for r in degrees if degrees is not None else range(min(n, 1), n + 1):
            if r <= n:
                fits[Structure(n, r)] = _fit_one(data, ladder, fits, Structure(n, r))
    if orders is None:
        _with_larger_orders(data, ladder, fits, degrees)
    if Rule.CHAINS.on:
        _with_free_lags(data, fits, orders, degrees)
    # One zero more is never worse: if it is, it was caught beside the minimum.
    for structure in sorted(fits, key=lambda one: -one.relative_degree):
        fewer = fits.get(Structure(structure.order, structure.relative_degree + 1))
        if fewer is not None and fewer.cost < fits[structure].cost:
            there = Candidate(structure, fewer.parameters, fewer.cost)
            fits[structure] = replace(there, cost=float(data.at(there).cost[0]))
    criteria = information_criteria(data, fits)
    least = min(criteria.values())
    for structure, value in criteria.items():
        if value < least + _SETTLED:
            fits[structure] = settled(data.problem, fits[structure], data.scales)
    return fits


def _with_larger_orders(
    data: FRFData, ladder: _Ladder, fits: dict[Structure, Candidate], degrees: Sequence[int] | None
) -> None:
    """Add larger orders while the largest is the best, or dynamics are missing."""
    # An order is accepted if a larger one was tried and is no better. Where the response is not
    # explained, a single pole may be no better because a resonance is missing.
    points = data.s.size
    while fits:
        criteria = information_criteria(data, fits)
        best = min(criteria, key=lambda key: criteria[key])
        n, r = best.order, best.relative_degree or int(not best.order)
        largest = max(key.order for key in fits)
        closest = min(fits.values(), key=lambda fit: fit.cost)
        missing = unexplained(data, closest) > MISSING and correlation_cost(data, closest) > 1.0
        if (n < largest and not missing) or largest >= _LARGEST_ORDER or 4 * largest > points:
            break
        for near in range(max(r - 1, 0), min(r + 1, largest + 1) + 1):
            if near in (degrees if degrees is not None else range(1, largest + 2)):
                larger = Structure(largest + 1, near)
                fits[larger] = _fit_one(data, ladder, fits, larger)


def _with_free_lags(
    data: FRFData,
    fits: dict[Structure, Candidate],
    orders: Sequence[int] | None,
    degrees: Sequence[int] | None,
) -> None:
    """Fit four to eight lags without zeros from chains of nearly equal ones.

    From fewer lags, one more at a time, searches end at pairs and zeros that imitate them.
    """
    criteria = information_criteria(data, fits)
    best = fits[min(criteria, key=lambda key: criteria[key])]
    longest = min(LONGEST, data.s.size // 4) if best.structure.order >= SHORTEST - 1 else 0
    every = range(SHORTEST, longest + 1)
    wanted = [n for n in every if n in (orders or (n,)) and n in (degrees or (n,))]
    for start in free_lags(data.problem, data.scales, best, wanted):
        found = refined(data, start.structure, [start.parameters], 1)[0]
        known = fits.get(start.structure, found)
        fits[start.structure] = min(known, found, key=lambda fit: fit.cost)


def information_criteria(data: FRFData, fits: dict[Structure, Candidate]) -> dict[Structure, float]:
    """Return the Bayesian information criterion of each structure, for unknown noise variance."""
    count = independent_points(data, fits)
    return {key: information_criterion(data, fit, count) for key, fit in fits.items()}


def independent_points(data: FRFData, fits: dict[Structure, Candidate]) -> float:
    """Return how many real numbers the residual of the best fit counts for.

    It may be correlated along frequency, for instance for a slightly nonlinear plant; otherwise
    every higher order would be accepted.
    """
    best = min(fits.values(), key=lambda fit: fit.cost)
    return 2 * data.s.size / correlation_cost(data, best)


def information_criterion(data: FRFData, fit: Candidate, count: float, others: int = 0) -> float:
    """Return the criterion of a fit, which has so many other parameters than those of its own."""
    # Schwarz (1978), noise variance eliminated: N log(cost) + parameters log N.
    charge = (parameters(fit) + others) * np.log(count)
    return float(count * np.log(smallest_cost(data, fit)) + charge)


def parameters(fit: Candidate) -> int:
    """Return the number of parameters: dead time, poles, numerator."""
    return fit.structure.order + fit.structure.zeros + 2


def unexplained(data: FRFData, fit: Candidate) -> float:
    """Return the rms residual over the rms response, both weighted."""
    power = float(np.sum(np.abs(data.weight * data.response) ** 2))
    return float(np.sqrt(fit.cost / power))


def smallest_cost(data: FRFData, fit: Candidate) -> float:
    """Return the misfit, or the rounding error for exact data."""
    largest = float(np.max(np.abs(data.response) * data.weight))
    return max(fit.cost, 2 * data.s.size * (1e-13 * largest) ** 2)


def _fit_one(
    data: FRFData, ladder: _Ladder, fits: dict[Structure, Candidate], structure: Structure
) -> Candidate:
    n, r = structure.order, structure.relative_degree
    tried = list(ladder.starts(structure))
    if (freer := fits.get(Structure(n, r - 1))) is not None:
        tried.append(freer.parameters)
    if (smaller := fits.get(Structure(n - 1, r - 1))) is not None:
        poles = np.append(data.poles_to_grow(smaller), -3.0 * data.omega.max())
        tried.append(np.append(smaller.dead_time, parameters_from_poles(poles)))
    return refined(data, structure, tried, _KEPT)[0]


class _Ladder:
    """Starts for every order; beyond a few, those of each order are extensions of lower ones."""

    def __init__(self, data: FRFData) -> None:
        self._data = data
        # What several structures need is made once.
        self._from_grid = cache(lambda n: starting_points(data, n, delay_grid(data, n)))
        self._from_below, self._best = cache(self._extended), cache(self._apart)

    def starts(self, structure: Structure) -> list[FloatArray]:
        """Return the starts for a structure: of low order from a grid of dead times."""
        n = structure.order
        if n > _LARGEST_FROM_GRID:
            return self._from_below(n, max(n - 2, 1))
        # Beside a zero that nearly cancels it, one pole more is no other model than one fewer.
        extended = self._from_below(n, n - 1) if structure.zeros and n > 1 else []
        return [*self._from_grid(n), *extended]

    def _extended(self, order: int, lowest: int) -> list[FloatArray]:
        return [
            start
            for below in range(lowest, order)
            if order <= _STEPS_OF_ONE or below % 2 == order % 2
            for smaller in self._best(below)
            for start in grown_starts(self._data, smaller, order)
        ]

    def _apart(self, order: int) -> list[Candidate]:
        """Fit with a free numerator, the best first, of different dead times."""
        free = Structure(order, 1)
        fits = refined(self._data, free, self.starts(free), 2 * _KEPT)
        apart = np.pi / (4 * self._data.omega.max())
        kept: list[Candidate] = []
        for fit in fits:
            if all(abs(fit.dead_time - other.dead_time) > apart for other in kept):
                kept.append(fit)
        return kept[:_KEPT]


def residual_variance(data: FRFData, fit: Candidate, freedom: int, noise_known: bool) -> float:
    """Return the variance of the weighted residual, with the effect of its correlation.

    Correlated residuals count for fewer points. Known noise is never scaled down: a lucky fit is
    not more reliable.
    """
    scale = 2 * fit.cost / max(freedom, 1)
    if noise_known:
        scale = max(scale, 1.0)
    return scale * correlation_cost(data, fit)


def correlation_cost(data: FRFData, fit: Candidate) -> float:
    """Return how many neighbouring points count as one, by the correlation of the residuals."""
    return points_as_one(data.misfit(fit))


def points_as_one(residual: ComplexArray) -> float:
    """Return how many neighbours of weighted residuals (K,) count as one independent point."""
    power = float(np.sum(np.abs(residual) ** 2))
    neighbours = float(np.sum((residual[1:] * residual[:-1].conj()).real))
    correlation = float(np.clip(neighbours / power if power > 0 else 0.0, 0.0, 0.95))
    if correlation < 2 / np.sqrt(residual.size):
        return 1.0
    return (1 + correlation) / (1 - correlation)


def fits_with_unknown_errors(
    data: FRFData, orders: Sequence[int] | None, degrees: Sequence[int] | None
) -> list[tuple[FRFData, dict[Structure, Candidate]]]:
    """Fit all structures to points with relative, with uniform weights, and with a floor if seen.

    Each kind of weights has a fit in which few points outweigh all others where the errors are of
    the other kind: a floor is looked for in the residuals of both. The lowest information criterion
    tells.

    Returns
    -------
    list of FRFData, dict
        The best, and those against which there is no very strong evidence.
    """
    uniform = replace(data, weight=np.ones(data.s.size))
    ways = [(way, fit_structures(way, orders, degrees)) for way in (data, uniform)]
    for way, fits in ways[:2]:
        residual = way.misfit(_best(way, fits)) / way.weight
        if floor := error_floor(np.abs(way.response - residual), np.abs(residual)):
            between = replace(data, weight=1 / np.hypot(np.abs(data.response), floor))
            ways.append((between, fit_structures(between, orders, degrees)))
    values = [_criterion(*way, int(k > 1)) for k, way in enumerate(ways)]
    # A part of the response that the model does not follow is no noise.
    noise = [True, *(correlation_cost(way, _best(way, fits)) == 1.0 for way, fits in ways[1:])]
    taken = np.where(noise, values, np.inf)
    # Of few points a good model leaves as little by chance, as in an F test.
    part = max(parameters(_best(*way)) for way in ways) / (2 * data.s.size)
    reach = taken.min() + VERY_STRONG / (1 - part)
    return [ways[k] for k in np.argsort(taken) if taken[k] <= reach]


def _criterion(data: FRFData, fits: dict[Structure, Candidate], floors: int) -> float:
    """Information criterion of the best fit, for any weights: those of a density [3]_.

    The variance is that without bias: what a model with a parameter for every third number leaves
    in points of small errors is no sign of them.
    """
    best, count = _best(data, fits), 2 * data.s.size
    own = information_criterion(data, best, count, floors)
    return float(own - count * np.log(count - parameters(best)) - 4 * np.sum(np.log(data.weight)))


def _best(data: FRFData, fits: dict[Structure, Candidate]) -> Candidate:
    criteria = information_criteria(data, fits)
    return fits[min(criteria, key=lambda key: criteria[key])]


def error_floor(size: FloatArray, residual: FloatArray) -> float:
    """Estimate the floor of the error, over the part of the response that it is elsewhere.

    Parameters
    ----------
    size : ndarray, shape (K,)
        Magnitude of the response.
    residual : ndarray, shape (K,)
        Magnitude of the error.

    Returns
    -------
    float
        Size of the response at which both are equal; 0 if the data show no floor.

    Examples
    --------
    >>> import numpy as np
    >>> size = np.geomspace(1e-3, 1, 200)
    >>> error = np.abs(np.random.default_rng(0).standard_normal((200, 2)) @ [1, 1j])
    >>> print(f"{error_floor(size, error * np.hypot(size, 0.1)):.2f}")
    0.11
    >>> error_floor(size, error * size)
    0.0
    """
    power, square = size**2, residual**2
    least = max(float(power.min()), 1e-12 * float(power.max()))
    tried = np.concatenate([[0.0], np.geomspace(least, max(float(power.max()), least), _TRIED)])
    variance = np.maximum(power + tried[:, None], np.finfo(float).tiny)
    # Squares of complex Gaussian errors are exponential; the common factor is eliminated.
    cost = np.log(np.maximum(np.mean(square / variance, axis=1), np.finfo(float).tiny))
    cost = size.size * cost + np.log(variance).sum(axis=1)
    best = int(np.argmin(cost))
    return float(np.sqrt(tried[best])) if 2 * (cost[0] - cost[best]) > VERY_STRONG else 0.0
