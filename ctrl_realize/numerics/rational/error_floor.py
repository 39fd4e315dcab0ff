"""Errors of frequency points of which nothing is known: a part of the response and a floor.

An error in proportion to the response would be none at an anti-resonance, whose few points then
outweigh all others; a floor is an error that is the same everywhere, as of a noisy sensor. Both are
variances of the complex error, estimated from residuals by maximum likelihood [1]_ (a regression of
variances, [2]_).

References
----------
.. [1] R. Pintelon and J. Schoukens, System Identification: A Frequency Domain Approach, 2nd ed.,
   Wiley 2012, chapter 9, doi:10.1002/9781118287422.
.. [2] M. Davidian and R. J. Carroll, Variance function estimation, J. Amer. Statist. Assoc. 82
   (1987) 1079-1091, doi:10.1080/01621459.1987.10478543.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..arrays import FloatArray
from ..constants import VERY_STRONG
from ..engine.problem import Structure
from ..engine.structures import Candidate
from .frf_data import FRFData
from .search import (
    correlation_cost,
    fit_structures,
    information_criteria,
    information_criterion,
    parameters,
)

_TRIED = 100  # floors over the range of the response: 10 % apart over four decades


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
    """Information criterion of the best fit, for any weights: those of a density [1]_.

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
