"""Errors of frequency points of which nothing is known: a part of the response and a floor.

An error in proportion to the response would be none at an anti-resonance, whose few points then
outweigh all others; a floor is an error that is the same everywhere, as of a noisy sensor. Both are
variances of the complex error, estimated from residuals by maximum likelihood [1]_ (a regression of
variances, [2]_). There is a floor where the evidence for it is very strong.

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
    DEFAULT_ORDERS,
    MISSING,
    correlation_cost,
    fit_structures,
    information_criteria,
    information_criterion,
    unexplained,
)

_TRIED = 100  # floors over the range of the response: 10 % apart over four decades


def fit_with_floor(
    data: FRFData, orders: Sequence[int] | None, degrees: Sequence[int] | None
) -> tuple[FRFData, dict[Structure, Candidate]]:
    """Fit all structures to points with relative weights, and with a floor if the errors have one.

    Where relative weights explain little, or need many poles, the errors are seen in a fit with
    uniform ones. The floor is used where model and floor have the lower information criterion.

    Returns
    -------
    data : FRFData
        With the weights that were used.
    fits : dict
    """
    fits = fit_structures(data, orders, degrees)
    seen, best = data, _best(data, fits)
    if unexplained(data, best) > MISSING or best.structure.order > max(DEFAULT_ORDERS):
        seen = replace(data, weight=np.ones(data.s.size))
        best = _best(seen, fit_structures(seen, orders, degrees))
    residual = seen.misfit(best) / seen.weight
    floor = error_floor(np.abs(seen.response - residual), np.abs(residual))
    if floor == 0:
        return data, fits
    other = replace(data, weight=1 / np.hypot(np.abs(data.response), floor))
    again = fit_structures(other, orders, degrees)
    # A part of the response that the model does not follow is no noise.
    is_noise = correlation_cost(other, _best(other, again)) == 1.0
    less = _criterion(other, again, 1) < _criterion(data, fits, 0)
    return (other, again) if is_noise and less else (data, fits)


def _criterion(data: FRFData, fits: dict[Structure, Candidate], floors: int) -> float:
    """Information criterion of the best fit, for any weights: those of a density [1]_."""
    weights = 4 * float(np.sum(np.log(data.weight)))
    return information_criterion(data, _best(data, fits), 2 * data.s.size, floors) - weights


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
