"""Maximum likelihood of a rounded output, where a step of the converter is more than the noise.

A sample tells that the output was within half a step of the converter of it; its probability is
that of the interval [1]_. The likelihood is maximised by the method of scoring [2]_, from the
least-squares fit of the same structure, for which rounding is noise.

References
----------
.. [1] F. Gustafsson and R. Karlsson, Statistical results for system identification based on
   quantized observations, Automatica 45 (2009) 2794-2801, doi:10.1016/j.automatica.2009.09.014.
.. [2] C. R. Rao, Linear Statistical Inference and its Applications, 2nd ed., Wiley 1973, section 5g
   (the method of scoring), doi:10.1002/9780470316436.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.special import log_ndtr

from ..arrays import FloatArray
from ..constants import Z_95
from ..engine.eliminate import evaluate
from ..engine.modal import respond
from ..engine.newton import units
from ..engine.problem import Structure
from ..engine.structures import Candidate, parameter_bounds
from ..engine.window_fit import WindowFit
from ..families.physical import fitted_parameters
from ..rules import Rule
from ..signals.noise import correlation_time
from .result import OutputErrorEstimate, followed_by

_ROUGH = 0.3
"""Noise in steps of the converter up to which rounding is not like noise: at 0.1 the error of the
dead time is halved, from 0.3 on it is the same. Ablation: likelihood of rounded data."""
_WHITE = 2.0  # correlation time of the scores up to which the noise counts as white
_LONGEST = 2**16  # samples; for time and memory
_LEAST, _MOST = 0.02, 1.0  # noise that is tried, in steps of the converter
_TURNS, _ENOUGH = 30, 1e-4  # at most, and gain of log likelihood at which it has converged
_DAMPING, _GIVEN_UP = 1e-3, 1e6  # of the first step, and at which none is better
_DIFFERENCE = 1e-4  # of a logarithmic parameter, or of a sample
_FAR = 6.0  # standard deviations from a sample to levels that can be read
_NOTHING, _LARGEST = 1e-16, 600.0  # for logarithms of small differences and exponentials


def in_rounded_data(
    found: OutputErrorEstimate, fits: WindowFit, step: float
) -> OutputErrorEstimate:
    """Take the model of the likelihood of rounded data, if the data are such.

    That is: the noise is much less than a step of the converter, and what is left is white. Not
    where the model has zeros: how much of the time before the onset is dead time is then not
    identifiable, from rounded samples neither. The interval is extended to that of the new dead
    time for its structure.
    """
    window, scales = fits.window, fits.scales
    many = found.distributed
    special = many.chain is not None or many.follows_flow or found.residual.whitened
    special |= found.structure.zeros > 0 or window.own is not None
    if special or window.output.size > _LONGEST or not Rule.ROUNDED.on:
        return found
    start = fits.candidates[found.structure]
    best = fit_rounded(fits, start, step)
    if best.noise > _ROUGH * step or best.correlation > _WHITE:
        return found
    dead_time, reach = best.candidate.dead_time, Z_95 * best.std
    numerator = best.linear[: start.structure.zeros + 1]
    setting = fits.problem, best.candidate, numerator, fits.variance, scales.length
    return replace(
        found,
        dead_time=dead_time,
        low=max(min(found.low, dead_time - reach), scales.earliest),
        high=min(max(found.high, dead_time + reach), scales.latest),
        poles=best.candidate.poles,
        numerator=numerator,
        fitted=best.model,
        static=fits.static(best.candidate),
        followed=followed_by(fits, best.candidate, numerator),
        residual=found.residual._replace(rounded=best.noise),
        process=replace(found.process, find=partial(fitted_parameters, *setting)),
    )


@dataclass(frozen=True, eq=False)
class Rounded:
    """Maximum of the likelihood.

    `linear` (q,) are the coefficients of the numerator and of the regressors, `model` (N,) the
    output without noise and rounding, `noise` its standard deviation, `std` the standard error of
    the dead time in s. `correlation` is the correlation time of the scores, 1 for white noise.
    """

    candidate: Candidate
    linear: FloatArray
    model: FloatArray
    noise: float
    std: float
    correlation: float


@dataclass(frozen=True, eq=False)
class _Likelihood:
    """Output (N,), a multiple of `step` beside a constant, and what makes a model of it."""

    fits: WindowFit
    structure: Structure
    step: float

    def terms(self, x: FloatArray) -> FloatArray:
        """Responses (N, q) to numerators of one power of s, and the regressors."""
        window, known = self.fits.window, self.fits.problem.known
        powers = np.eye(self.structure.zeros + 1)
        responses = (respond(window.drive, known, power, x) for power in powers)
        return np.column_stack([*responses, window.columns])

    def value(self, model: FloatArray, noise: float) -> float:
        """Log likelihood."""
        return float(np.sum(log_probability(self.fits.window.output - model, self.step, noise)))

    def noise(self, model: FloatArray) -> float:
        """Most likely standard deviation of the noise."""
        found = minimize_scalar(
            lambda log: -self.value(model, float(np.exp(log))),
            bounds=tuple(np.log([_LEAST * self.step, _MOST * self.step])),
            method="bounded",
        )
        return float(np.exp(found.x))

    def information(
        self, x: FloatArray, linear: FloatArray, terms: FloatArray, weight: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Derivatives (N, p) of the model, sizes (p,) of all, and the information scaled by them.

        Derivatives by dead time in samples, pole parameters, and linear terms.
        """
        moves, model = _DIFFERENCE * np.diag(units(x, self.fits.scales.dt)), terms @ linear
        slopes = [(self.terms(x + move) @ linear - model) / _DIFFERENCE for move in moves]
        jacobian = np.column_stack([*slopes, terms])
        size = np.sqrt(weight @ jacobian**2)
        size[size == 0] = 1.0
        scaled = jacobian / size
        return jacobian, size, scaled.T @ (weight[:, None] * scaled)


def fit_rounded(fits: WindowFit, start: Candidate, step: float) -> Rounded:
    """Maximise the likelihood of samples that are multiples of a step, beside a constant."""
    likelihood = _Likelihood(fits, start.structure, step)
    bounds = parameter_bounds(start.structure, fits.scales)
    state = evaluate(fits.problem, start.structure, start.parameters[None])
    x, linear = start.parameters, np.concatenate([state.numerator[0], state.regression[0]])
    terms = likelihood.terms(x)
    model = terms @ linear
    noise = likelihood.noise(model)
    best, damping = likelihood.value(model, noise), _DAMPING
    for _ in range(_TURNS):
        score, weight = scores(fits.window.output - model, step, noise)
        jacobian, size, normal = likelihood.information(x, linear, terms, weight)
        slope = score @ (jacobian / size)
        while damping < _GIVEN_UP:
            change = np.linalg.solve(normal + damping * np.eye(size.size), slope) / size
            moved = x + change[: x.size] * units(x, fits.scales.dt)
            tried = np.clip(moved, bounds.low, bounds.high)
            following, coefficients = likelihood.terms(tried), linear + change[x.size :]
            if likelihood.value(following @ coefficients, noise) > best:
                break
            damping *= 10
        else:
            break
        x, linear, terms = tried, coefficients, following
        model = terms @ linear
        noise = likelihood.noise(model)
        before, best = best, likelihood.value(model, noise)
        damping = max(damping / 10, _DAMPING**2)
        if best - before < _ENOUGH:
            break
    score, weight = scores(fits.window.output - model, step, noise)
    left = (score / np.sqrt(weight))[fits.window.start :]
    _, size, normal = likelihood.information(x, linear, terms, weight)
    std = np.sqrt(np.linalg.pinv(normal)[0, 0]) / size[0] * fits.scales.dt
    candidate = Candidate(start.structure, x, start.cost, searched=False)
    return Rounded(candidate, linear, model, noise, float(std), correlation_time(left))


def log_probability(error: FloatArray, step: float, noise: float) -> FloatArray:
    """Log probability of samples that differ from the model by `error`, in Gaussian noise."""
    # By symmetry both ends lie below the mean, where the logarithms are exact.
    upper = (step / 2 - np.abs(error)) / noise
    lower = upper - step / noise
    top = log_ndtr(upper)
    return np.asarray(top + np.log1p(-np.exp(np.minimum(log_ndtr(lower) - top, -_NOTHING))))


def scores(error: FloatArray, step: float, noise: float) -> tuple[FloatArray, FloatArray]:
    """Derivative of the log probability by the model, and Fisher's information, of each sample."""
    reach = int(np.ceil(_FAR * noise / step)) + 1
    # Levels that could have been read instead, with their probabilities.
    weight = np.zeros_like(error)
    for level in range(-reach, reach + 1):
        other = error - np.round(error / step) * step + level * step
        weight += np.exp(log_probability(other, step, noise)) * _slope(other, step, noise) ** 2
    return _slope(error, step, noise), np.maximum(weight, _NOTHING / noise**2)


def _slope(error: FloatArray, step: float, noise: float) -> FloatArray:
    log = log_probability(error, step, noise)
    ends = np.stack([error - step / 2, error + step / 2]) / noise
    densities = np.exp(np.minimum(-0.5 * ends**2 - log, _LARGEST)) / np.sqrt(2 * np.pi)
    return np.asarray((densities[0] - densities[1]) / noise)
