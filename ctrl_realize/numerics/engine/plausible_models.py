"""Draw models that the data do not rule out: of every such structure, and about its best fit.

A structure is drawn with its evidence [1]_. Dead time and poles about its best fit are drawn from
the normal distribution of their errors and resampled by their likelihood (sampling importance
resampling [2]_), or moved by it where few of them are likely [3]_, so that they follow a curved
valley of the misfit; the numerator is then drawn given these.

References
----------
.. [1] K. P. Burnham and D. R. Anderson, Model Selection and Multimodel Inference, 2nd ed., Springer
   2002, chapter 4 (Multimodel inference), doi:10.1007/b97636.
.. [2] D. B. Rubin, Using the SIR algorithm to simulate posterior distributions, in: Bayesian
   Statistics 3, Oxford University Press 1988, 395-402.
.. [3] J. Goodman and J. Weare, Ensemble samplers with affine invariance, Comm. Appl. Math. Comp.
   Sci. 5 (2010) 65-80, doi:10.2140/camcos.2010.5.65.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.interpolate import pade
from scipy.special import factorial

from ..arrays import ComplexArray, FloatArray
from ..blas_threads import one_blas_thread
from ..constants import SMALLEST, VERY_STRONG
from .eliminate import drawn_numerators, eliminate
from .modal import poles_from_parameters
from .problem import Bounds, Family, Structure
from .static_gain import local_errors
from .structures import Candidate, parameter_bounds
from .window_fit import WindowFit

COUNT = 39
"""Models that are drawn: a further one lies between the extremes of 39 with 95 % (2 / 40 on both
sides together)."""
CALIBRATED = 1.5
"""Variance of the models over that of the errors at a given structure, so that their envelope holds
the true response as often as it says. Measured: `benchmarks.verdicts`, seeds below 100. Weights of
dead times have it as well: `benchmarks.closed_loop`, seeds 500 to 502."""
_WIDER = 1.5  # standard deviations of the proposals, over those of the errors: tails are seen
_PROPOSED = 16  # for each model that is drawn
_EFFECTIVE = 0.7  # independent proposals for each, in effect, below which they are moved instead
_SWEEPS = 25  # of these moves
_PADE = 6
"""Order for the delay of a second path. With it Ms is 2.0, 8 and 50 to 100 for PIs that have 2.1,
14 and 36 on the plant itself; with ten equal lags in its place, 1.5, 1.7 and 7.5."""
_WIDEST = 1.5  # standard deviation of the log of a pole: a factor of twenty on each side


class PlausibleModel(NamedTuple):
    """Model exp(-L s) b(s) / a(s): dead time L in s, poles (n,), numerator, lowest power first."""

    dead_time: float
    poles: ComplexArray
    numerator: FloatArray


@dataclass(frozen=True, eq=False, repr=False)
class PlausibleDraw:
    """Structures that are not ruled out, of which models are drawn once somebody asks.

    They take a fifth of the time of a fit, and many who fit do not look at them.

    Attributes
    ----------
    fits : WindowFit
    evidence : mapping of Structure to float
        Of the structures that are not ruled out, on any scale.
    best : callable
        The fit of each: best(structure) -> Candidate.
    late : tuple of float, optional
        Gain of a second path that half of the models have, its delay and its lag in s.
    """

    fits: WindowFit
    evidence: Mapping[Structure, float]
    best: Callable[[Structure], Candidate]
    late: tuple[float, float, float] | None = None

    def __getstate__(self) -> dict[str, tuple[PlausibleModel, ...]]:
        """What is stored or sent: the models, which are far smaller than the fits."""
        return {"models": self.models}

    @cached_property
    def models(self) -> tuple[PlausibleModel, ...]:
        """`COUNT` equally likely models; the same for the same data."""
        rng = np.random.default_rng(COUNT)
        weights = np.array(list(self.evidence.values()))
        ends = np.round(np.cumsum(weights / weights.sum()) * COUNT - 1e-9)
        counts = np.diff(ends, prepend=0.0)  # of each, within one of its share
        models: list[PlausibleModel] = []
        with one_blas_thread():
            for structure, count in zip(self.evidence, counts, strict=True):
                if count:
                    models += _about(self.fits, self.best(structure), int(count), rng)
        if self.late is not None:
            models[::2] = [_with_late_path(model, *self.late) for model in models[::2]]
        return tuple(models)


def _with_late_path(model: PlausibleModel, gain: float, delay: float, lag: float) -> PlausibleModel:
    """Add a path of a gain, delay and lag; its delay behind that of the model by Pade."""
    scale = max(delay - model.dead_time, 1e-3 * lag) ** np.arange(_PADE, -1, -1.0)
    # exp(x) is about p(x) / q(x), and exp(-x) therefore q(x) / p(x).
    p, q = pade(1 / factorial(np.arange(2 * _PADE + 1)), _PADE)
    own, path = np.poly(model.poles).real, np.convolve(p.c * scale, [lag, 1.0])
    other = np.polymul(gain * q.c * scale, own)
    numerator = np.polyadd(np.polymul(model.numerator[::-1], path), other) / path[0]
    poles = np.concatenate([model.poles, np.roots(path)])
    return PlausibleModel(model.dead_time, poles, numerator[::-1])


def _about(
    fits: WindowFit, candidate: Candidate, count: int, rng: np.random.Generator
) -> list[PlausibleModel]:
    """Draw models of the structure of a fit."""
    problem, scales = fits.problem, fits.scales
    structure, theta = candidate.structure, candidate.theta
    numerator = eliminate(problem, structure, candidate.parameters[None]).numerator[0]
    errors = local_errors(problem, candidate, numerator, scales.length)
    variance = max(CALIBRATED * fits.error_variance, SMALLEST)
    covariance = variance * errors.covariance()
    n, free = theta.size, numerator.size
    widest = np.full(n + free, np.inf)
    widest[0], widest[1:n] = 0.5 * (scales.latest - scales.earliest), _WIDEST

    def models(drawn: FloatArray) -> list[PlausibleModel]:
        poles = poles_from_parameters(drawn[:, 1:])[0]
        own = drawn_numerators(problem, structure.plain, drawn, float(np.sqrt(variance)), rng)
        return [PlausibleModel(*one) for one in zip(drawn[:, 0].tolist(), poles, own, strict=True)]

    if isinstance(structure, Family):
        # Far from the fit, which is one of them, its tangent is no guide: what fits worse than it
        # says is left out, and numerators are those that fit.
        moves = rng.standard_normal((_PROPOSED * count, n))
        moves[0] = 0.0
        tried = theta + moves @ _directions(covariance[:n, :n], widest[:n])
        tried[:, 0] = np.clip(tried[:, 0], scales.earliest, scales.latest)
        found = eliminate(problem, structure.plain, tried)
        value = -0.5 * np.maximum(found.cost - candidate.cost, 0.0) / variance
        chances = np.cumsum(np.exp(np.minimum(value + 0.5 * np.sum(moves**2, axis=1), 0.0)))
        places = (np.arange(count) + rng.random()) / count * chances[-1]
        return models(tried[np.searchsorted(chances, places).clip(0, len(tried) - 1)])
    bounds = parameter_bounds(structure, scales)
    rows = _WIDER * _directions(covariance[:n, :n], widest[:n])

    def likelihood(at: FloatArray) -> FloatArray:
        cost = eliminate(problem, structure, at).cost
        return np.asarray(-0.5 * (cost - candidate.cost) / variance)

    # One of a few may lie anywhere: as many are drawn as tell a valley, and some of them kept.
    enough = max(count, 2 * n + 2)
    moves = rng.standard_normal((_PROPOSED * enough, n))
    tried = np.clip(theta + moves @ rows, bounds.low, bounds.high)
    value = likelihood(tried)
    weight = value + 0.5 * np.sum(moves**2, axis=1)
    weight = np.exp(weight - weight.max())
    if np.sum(weight) ** 2 < _EFFECTIVE * enough * np.sum(weight**2):
        first = np.argsort(value)[-enough:]
        # Errors without a tangent, as that of a zero at infinity, leave none of them near the fit.
        part = np.sqrt(VERY_STRONG / np.maximum(-value[first, None], VERY_STRONG))
        near = theta + part * (tried[first] - theta)
        drawn = _stretched(likelihood, bounds, near, rng)[-count:]
    else:
        places = (np.arange(count) + rng.random()) / count * weight.sum()
        drawn = tried[np.searchsorted(np.cumsum(weight), places).clip(0, len(tried) - 1)]
    return models(drawn)


def _stretched(
    likelihood: Callable[[FloatArray], FloatArray],
    bounds: Bounds,
    walkers: FloatArray,
    rng: np.random.Generator,
) -> FloatArray:
    """Move walkers (B, n) by stretches along lines through others [3]_, whatever their shape."""
    half, n, value = len(walkers) // 2, walkers.shape[1], likelihood(walkers)
    for turn in range(2 * _SWEEPS):
        moved, others = slice(0, half), walkers[half:]
        if turn % 2:
            moved, others = slice(half, None), walkers[:half]
        count = len(walkers[moved])
        # The density of [3]_, 1 / sqrt(z) between 1 / a and a, with a = 2.
        z = (1 + rng.random(count)) ** 2 / 2
        centre = others[rng.integers(len(others), size=count)]
        tried = centre + z[:, None] * (walkers[moved] - centre)
        inside = np.all((tried >= bounds.low) & (tried <= bounds.high), axis=1)
        there = np.where(inside, likelihood(np.clip(tried, bounds.low, bounds.high)), -np.inf)
        taken = np.log(rng.random(count)) < (n - 1) * np.log(z) + there - value[moved]
        walkers[moved] = np.where(taken[:, None], tried, walkers[moved])
        value[moved] = np.where(taken, there, value[moved])
    return walkers


def _directions(covariance: FloatArray, widest: FloatArray) -> FloatArray:
    """Rows (p, p) whose squares are a covariance, none longer than the widest deviations."""
    scale = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    scale[scale == 0] = 1.0
    values, vectors = np.linalg.eigh(covariance / scale / scale[:, None])
    rows = np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T * scale
    longest = np.max(np.abs(rows) / widest, axis=1)
    return np.asarray(rows / np.maximum(longest, 1.0)[:, None])
