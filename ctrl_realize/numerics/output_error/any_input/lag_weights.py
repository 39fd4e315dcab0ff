"""Weights of numbers of lags: a posterior of the dead time from their profile likelihoods.

Every number of lags has its profile likelihood [1]_ over the same dead times, and a weight by its
best fit [2]_, with a charge for each lag and each initial value. A lag costs what one that is not
there gains in 5 % of records, so that criterion and likelihood-ratio test say the same [3]_.

References
----------
.. [1] S. A. Murphy and A. W. van der Vaart, On profile likelihood, J. Amer. Statist. Assoc. 95
   (2000) 449-465, doi:10.1080/01621459.2000.10474219.
.. [2] K. P. Burnham and D. R. Anderson, Model Selection and Multimodel Inference, 2nd ed., Springer
   2002, section 4.2 (model averaging).
.. [3] T. Soderstrom and P. Stoica, System Identification, Prentice Hall 1989, section 11.5.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.interpolate import PchipInterpolator

from ...arrays import FloatArray
from ...constants import CHI2_95, SMALLEST
from ...engine.eliminate import eliminate
from ...engine.plausible_models import CALIBRATED
from ...engine.profile import Points, profile_grid, profile_points
from ...engine.structures import Candidate
from ...engine.window_fit import WindowFit

_SHORTER = 0.3  # of the last lag: a further one, where a profile starts
_BETWEEN = 8  # dead times between two points of a profile
_TAIL = 0.025  # of the weight, beyond each end of an interval


def charged_misfit(fits: WindowFit, lags: Candidate) -> float:
    """Misfit and charges; one initial value more of a record lowers the misfit by one for noise."""
    free = CHI2_95 * (lags.parameters.size - 1)
    charge = free + fits.problem.local_count(lags.structure.order)
    return lags.cost / (CALIBRATED * fits.variance) + charge


def profiled(fits: WindowFit, fitted: Sequence[Candidate]) -> list[Points]:
    """Best models with given dead times, the same for every number of lags.

    A further lag that vanishes at the minimum has no grid of its own. Every profile starts from
    its minimum or from that of fewer lags, by what is closer at each dead time.
    """
    setting = fits.problem, fits.variance, fits.scales
    grids = [profile_grid(setting[0], one, *setting[1:]) for one in fitted]
    grid = np.unique(np.concatenate([*grids, [one.dead_time for one in fitted]]))
    found: list[Points] = []
    for one in fitted:
        starts = np.tile(one.parameters, (grid.size, 1))
        if found and starts.shape[1] > found[-1][float(grid[0])].parameters.size:
            fewer = np.stack([found[-1][float(at)].parameters for at in grid])
            more = np.arange(1, starts.shape[1] - fewer.shape[1] + 1)
            nested = np.hstack([fewer, fewer[:, -1:] + np.log(_SHORTER) * more])
            starts[:, 0] = grid
            own, theirs = (eliminate(setting[0], one.structure, x).cost for x in (starts, nested))
            starts = np.where((theirs < own)[:, None], nested, starts)
        starts[:, 0] = grid
        found.append(profile_points(setting[0], one, *setting[1:], starts))
    return found


def weighted(
    fits: WindowFit, profiles: Sequence[Points], larger: float = 1.0
) -> tuple[FloatArray, FloatArray]:
    """Dead times (G,), and the weights (S, G) of every number of lags; they sum to 1.

    Of an input that moves so many times further; what a model misses, beside the best, then grows
    with the square of that.
    """
    every = np.array(sorted(profiles[0]))
    values = np.array([[charged_misfit(fits, own[float(at)]) for at in every] for own in profiles])
    cost = np.array([[own[float(at)].cost for at in every] for own in profiles])
    values += (larger**2 - 1.0) * (cost - cost.min()) / (CALIBRATED * fits.variance)
    fine, density = _densities(every, values)
    least = values.min(axis=1, keepdims=True)
    weights = np.exp(-0.5 * (least - least.min()))
    return fine, weights / weights.sum() * density


def posterior_of(points: Points, variance: float) -> tuple[float, float, float]:
    """Mean dead time of one structure and the ends of its interval, by its profile likelihood."""
    every = np.array(sorted(points))
    values = np.array([[points[float(at)].cost / variance for at in every]])
    fine, density = _densities(every, values)
    return known_dead_time(fine, density[0])


def _densities(every: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Dead times (G,) and the weight (S, G) of each by profiles (S, K) at `every`."""
    part = np.arange(_BETWEEN) / _BETWEEN
    fine = np.append((every[:-1, None] + np.diff(every)[:, None] * part).ravel(), every[-1])
    between = PchipInterpolator(every, values, axis=1)(fine)
    density = np.exp(-0.5 * (between - values.min(axis=1, keepdims=True))) * np.gradient(fine)
    return fine, density / np.maximum(density.sum(axis=1, keepdims=True), SMALLEST)


def with_moves(
    fits: WindowFit, profiles: Sequence[Points], larger: float
) -> tuple[float, float, float]:
    """Mean dead time and the ends of its interval, had the input moved so many times further."""
    dead_times, shares = weighted(fits, profiles, larger)
    return known_dead_time(dead_times, shares.sum(axis=0))


def known_dead_time(dead_times: FloatArray, weights: FloatArray) -> tuple[float, float, float]:
    """Mean dead time and the ends of its interval."""
    ends = np.interp([_TAIL, 1.0 - _TAIL], np.cumsum(weights), dead_times).tolist()
    return float(weights @ dead_times), ends[0], ends[1]
