"""Repeat the fits for a step record with coloured noise.

Generalised least squares [1]_; noise counts as coloured by its correlation time [2]_. Samples at
rest tell its autocovariance where there are enough; of a short rest that of a first-order
autoregression is taken if the residual is one. The thresholds are our own.

References
----------
.. [1] A. C. Aitken, On least squares and linear combination of observations, Proc. Roy. Soc.
   Edinburgh 55 (1935) 42-48.
.. [2] C. J. Geyer, Practical Markov chain Monte Carlo, Statist. Sci. 7 (1992) 473-483,
   doi:10.1214/ss/1177011137.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..arrays import FloatArray, IntArray
from ..constants import FAR_OUTLIER
from ..engine.descend import fit_batch
from ..engine.eliminate import eliminate
from ..engine.problem import Problem, Structure
from ..engine.static_gain import local_errors
from ..engine.structures import (
    Candidate,
    Scales,
    choose,
    converged,
    neighbour_starts,
    parameter_bounds,
)
from ..engine.window_fit import WindowFit
from ..rules import Rule
from ..signals.noise import correlation_time, mad_sigma
from ..signals.noise_model import noise_covariance, noise_lags, whitener, whitening_filter
from .step_data import StepData, settled_at

_COLOURED = 2.0  # samples at rest that count as one, from which on: white noise scatters to 1.5
_FEWEST = 100  # samples at rest, and
_ENOUGH = 100_000  # of a kind, where there are more: time
_TIMES = 8  # correlation times, that tell its colour. Ablation of all of them: noise made white
_NEAR = np.arange(-6, 6.5, 0.5)  # samples from the dead time of before, where it starts again
_ENDS = 4  # of these starts that are followed to the bottom: time
_UNLIKE = 3.0
"""Root mean square of the whitened residual, in that of the noise, from which on the response holds
something that the noise does not: plain least squares are safer. Ablation: unlike residual left
alone."""


def in_coloured_noise(fits: WindowFit, data: StepData) -> WindowFit:
    """Fit by generalised least squares if the noise is coloured; otherwise return `fits`.

    White baseline noise is not changed: correlation of the residual is then a misfit. Neither are
    records with gaps: an autoregression from the covariances of the pairs of samples that there are
    (Parzen 1963) need not be stable, and with 30 % missing its intervals were no narrower.
    Ablation: noise of a short rest made white.
    """
    bins = fits.window.bins
    if data.coarse or bins is None or fits.problem.segments is not None:
        return fits
    if np.ptp(np.diff(data.rows)) > 0:
        return fits
    error = fits.residual(fits.best)
    rest = error[: data.edge]
    samples = correlation_time(rest)
    told = rest.size >= max(_FEWEST, _TIMES * samples)
    if (samples if told else fits.correlation) < max(_COLOURED, 0.5 * fits.correlation):
        return fits
    # Not the pseudo-values of Huber's loss, which distort smooth noise.
    limit = FAR_OUTLIER * max(mad_sigma(error), fits.sigma)
    plain = fits.window.with_output(fits.window.output - error + np.clip(error, -limit, limit))
    quiet = _quiet(error.size, data) if told else np.arange(error.size)
    lags = 0 if told else whitening_filter(error, noise_lags(error.size)).size - 1
    if not told and (lags != 1 or not Rule.SHORT_REST.on):
        return fits
    covariance = noise_covariance(error[quiet], error.size, _followed(fits)[quiet])
    if covariance.size == 1 or not Rule.WHITENED.on:
        return fits
    problem = replace(plain, whitener=whitener(bins, covariance))
    candidates = _fitted_again(fits, problem)
    candidates = converged(problem, candidates, fits.scales, fits.sigma**2, fits.independent)
    refit = replace(fits, problem=problem, candidates=candidates, colour=1.0)
    chosen = candidates[choose(refit.criteria(candidates))]
    lost = 1 + chosen.structure.order + chosen.structure.zeros + fits.window.columns.shape[1]
    colour = chosen.cost / max(problem.data.size - lost, 1) / fits.sigma**2
    if colour > _UNLIKE**2 and Rule.UNLIKE.on:
        return fits
    slowness = 2 * float(np.sum(covariance)) - 1.0
    return refit.of(candidates, colour=max(colour, 1.0), correlation=max(slowness, 1.0))


def _fitted_again(fits: WindowFit, problem: Problem) -> dict[Structure, Candidate]:
    """Fit all structures, starting from the previous optima and those next to them."""
    found: dict[Structure, Candidate] = {}
    for structure in sorted(fits.candidates, key=lambda s: (s.order, s.zeros)):
        starts = _dead_times_near(problem, fits.candidates[structure], fits.scales)
        starts += neighbour_starts(structure, fits.scales, found)
        bounds = parameter_bounds(structure, fits.scales)
        parameters, cost = fit_batch(problem, structure, np.array(starts), bounds)
        order = np.argsort(cost)
        best = order[0]
        found[structure] = Candidate(
            structure, parameters[best], float(cost[best]), parameters[order[1:_ENDS]], True
        )
    return found


def _dead_times_near(problem: Problem, old: Candidate, scales: Scales) -> list[FloatArray]:
    """Previous parameters, and the same at the two best dead times around.

    With smooth noise the cost has a local minimum between every two samples.
    """
    starts = np.tile(old.parameters, (_NEAR.size, 1))
    starts[:, 0] = np.clip(old.dead_time + _NEAR * scales.dt, scales.earliest, scales.latest)
    cost = eliminate(problem, old.structure, starts).cost
    return [old.parameters, *starts[np.argsort(cost)[:2]]]


def _quiet(samples: int, data: StepData) -> IntArray:
    """Samples of the baseline, and of the later half of the settled response."""
    late = np.arange((settled_at(data) + samples) // 2, samples)
    return np.concatenate([np.arange(data.edge)[-_ENOUGH:], late[:_ENOUGH]])


def _followed(fits: WindowFit) -> FloatArray:
    """Derivatives (N, p) of the best model at every sample: what it may have followed of noise."""
    window, best = fits.window, fits.best
    problem = replace(
        fits.problem, data=window.output, root_weight=np.ones(window.output.size),
        drive=window.drive, regressors=window.columns,
    )  # fmt: skip
    numerator = eliminate(fits.problem, best.structure, best.parameters[None]).numerator[0]
    return local_errors(problem, best, numerator, fits.scales.length).columns
