"""Structures that were fitted to a frequency response, compared, with profiles of the nearest.

Profile likelihoods as in [1]_, structures by their criteria as in [2]_.

References
----------
.. [1] D. J. Venzon and S. H. Moolgavkar, A method for computing profile-likelihood-based confidence
   intervals, Appl. Statist. 37 (1988) 87-94, doi:10.2307/2347496.
.. [2] K. P. Burnham and D. R. Anderson, Model Selection and Multimodel Inference, 2nd ed., Springer
   2002, chapter 4, doi:10.1007/b97636.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..numerics.constants import VERY_STRONG
from ..numerics.engine.problem import Structure
from ..numerics.engine.profile import Points, dead_time_error, profile_limits, profile_points
from ..numerics.engine.structures import Candidate, charged, plausible, settled
from ..numerics.engine.window_fit import WindowFit, window_of_rows, with_known_noise
from ..numerics.families.equal_lags import SHORTEST, LagChain, chain_limits, still_improving
from ..numerics.families.flow import DispersedFlow
from ..numerics.output_error.interval import LOWER, MOST_ROUNDS, charged_level, profile_of
from ..numerics.output_error.selection import Choice, choose_model, many_lags
from ..numerics.rational.frf_data import FRFData, dead_time_interval
from ..numerics.rational.search import (
    information_criteria,
    parameters,
    residual_variance,
    smallest_cost,
)
from .frf_fit import FRFStructure

_NEAR_BIC = 8.0
"""Difference to the best BIC below which a structure widens the interval; beyond, its weight is
below 2 %."""


@dataclass(frozen=True, eq=False)
class ManyLags:
    """What chains of lags, diffusion and dispersion say, in units of the data.

    `ends` are the 95 % intervals of those that are not ruled out; `unlimited`: chains fit the
    better the longer they are; `flow` is dispersion that fits better than all lags. If there are
    models that fit better than all structures, `better` is the difference of the criteria, and
    `choice` and `own` are the best of them and its interval.
    """

    ends: tuple[tuple[float, float], ...] = ()
    unlimited: bool = False
    flow: DispersedFlow | None = None
    better: float = 0.0
    choice: Choice | None = None
    own: tuple[float, float] | None = None


@dataclass(frozen=True, eq=False)
class ComparedFits:
    """Fits with rows, best first, residual variances of points, and profiles of the nearest."""

    fits: dict[Structure, Candidate]
    rows: list[FRFStructure]
    scales: dict[Structure, float]
    points: dict[Structure, Points]

    def near(self, better: float = 0.0) -> list[FRFStructure]:
        """Rows that come close to the best, the best first, or to what is so much better."""
        return [row for row in self.rows if row.bic - self.rows[0].bic < _NEAR_BIC - better]

    def of_many_lags(self, data: FRFData) -> ManyLags:
        """Fit chains of lags, diffusion and dispersion, and compare them with the structures."""
        key = key_of(self.rows[0])
        sigma = float(np.sqrt(_row_variance(data, self.fits[key], self.scales[key])))
        fits = with_known_noise(window_of_rows(data.problem), self.fits, data.scales, sigma)
        chains, flows = many_lags(fits)
        equal_lags = [chain for chain in chains if not chain.truncated]
        choice = choose_model(fits, equal_lags, flows)
        law, least = choice.chain or choice.flow, fits.criterion[key]
        better = max(least - choice.level, 0.0) if law else 0.0
        most = least - better + VERY_STRONG
        ends: dict[LagChain | DispersedFlow, tuple[float, float]] = {
            one: chain_limits(one, data.scales) for one in chains if one.criterion <= most
        }
        for one in flows:
            if one.criterion <= most:
                ends[one] = profile_limits(*profile_of(fits, one.fit))
        flow = min(flows, key=lambda flow: flow.delta_bic, default=None)
        flow = None if flow is None or flow.delta_bic >= 0 else flow
        of_lags = [self.interval(data, s, solved=True) for s in _many_lags(fits, choice)]
        unlimited = choice.flow is None and still_improving(equal_lags, least)
        found = ManyLags((*ends.values(), *of_lags), unlimited, flow)
        if law is None or not better:
            return found
        return replace(found, better=better, choice=choice, own=ends[law])

    def interval(self, data: FRFData, key: Structure, *, solved: bool) -> tuple[float, float]:
        """95 % interval of one structure, in units of the data."""
        fit, variance = self.fits[key], _row_variance(data, self.fits[key], self.scales[key])
        points = self.points.get(key) or profile_points(data.problem, fit, variance, data.scales)
        return dead_time_interval(data, fit, points, variance, solved=solved)


def _many_lags(fits: WindowFit, choice: Choice) -> list[Structure]:
    """Four and more lags without zeros that are not ruled out, up to one more than chosen."""
    values, level = charged(fits.criterion, fits.penalty), charged_level(fits, choice)
    kept = plausible(fits.candidates, values, fits.variance, choice.model, level)
    return [s for s in kept if s.zeros == 0 and s.order >= SHORTEST]


def compared_fits(
    data: FRFData, fits: dict[Structure, Candidate], unit: float, noise_known: bool
) -> ComparedFits:
    """Compare structures, and again where the profile of one leads below its minimum."""
    points: dict[Structure, Points] = {}
    for _ in range(MOST_ROUNDS):
        rows, scales = _structures(data, fits, unit, noise_known)
        near = [key_of(row) for row in rows if row.bic - rows[0].bic < _NEAR_BIC]
        lower = {}
        for key in near:
            variance = _row_variance(data, fits[key], scales[key])
            if key not in points:
                points[key] = profile_points(data.problem, fits[key], variance, data.scales)
            best = min(points[key].values(), key=lambda point: point.cost)
            if fits[key].cost - best.cost > LOWER * variance:
                lower[key] = settled(data.problem, best, data.scales)
        if not lower:
            break
        fits = fits | lower
        points = {key: found for key, found in points.items() if key not in lower}
    return ComparedFits(fits, rows, scales, points)


def _row_variance(data: FRFData, fit: Candidate, scale: float) -> float:
    # Exact data have no noise; a level that rounding can reach is needed all the same.
    return max(0.5 * scale, smallest_cost(data, fit) / data.problem.data.size)


def _structures(
    data: FRFData, fits: dict[Structure, Candidate], unit: float, noise_known: bool
) -> tuple[list[FRFStructure], dict[Structure, float]]:
    """List what was tried, best first, and the residual variance of each."""
    rows, scales = [], {}
    criteria = information_criteria(data, fits)
    for key, fit in fits.items():
        freedom = 2 * data.s.size - parameters(fit)
        scales[key] = residual_variance(data, fit, freedom, noise_known)
        dead_time, cost = fit.dead_time / unit, smallest_cost(data, fit)
        std = dead_time_error(data.problem, fit, 0.5 * scales[key]) / unit
        bic = criteria[key]
        rows.append(FRFStructure(key.order, key.relative_degree, dead_time, std, cost, bic))
    return sorted(rows, key=lambda row: row.bic), scales


def residual_ratio(data: FRFData, fit: Candidate) -> float:
    """Weighted rms residual, over the degrees of freedom."""
    return float(np.sqrt(fit.cost / (data.s.size - 0.5 * parameters(fit))))


def key_of(row: FRFStructure) -> Structure:
    """Order and relative degree of a row."""
    return Structure(row.order, row.relative_degree)
