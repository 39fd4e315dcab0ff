"""Fit all structures to one part of a record, and determine the noise from the best of them.

Huber's loss by modified residuals [1]_ with the constant of [2]_ (95 % efficiency in Gaussian
noise); the effective number of samples follows [3]_, the criterion [4]_.

A response is needed sample by sample for the noise, and at means over bins for the search: our own
arrangement.

References
----------
.. [1] P. J. Huber and E. M. Ronchetti, Robust Statistics, 2nd ed., Wiley 2009, section 7.8
   (computation of regression estimates by modified residuals), doi:10.1002/9780470434697.
.. [2] P. W. Holland and R. E. Welsch, Robust regression using iteratively reweighted least-squares,
   Comm. Statist. A 6 (1977) 813-827, doi:10.1080/03610927708827533.
.. [3] C. J. Geyer, Practical Markov chain Monte Carlo, Statist. Sci. 7 (1992) 473-483,
   doi:10.1214/ss/1177011137.
.. [4] G. Schwarz, Estimating the dimension of a model, Ann. Statist. 6 (1978) 461-464,
   doi:10.1214/aos/1176344136.
.. [5] Student, The probable error of a mean, Biometrika 6 (1908) 1-25, doi:10.2307/2331554.
.. [6] P. M. Djuric, A model selection rule for sinusoids in white Gaussian noise, IEEE Trans.
   Signal Process. 44 (1996) 1744-1751.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.special import ndtr, stdtrit

from ..arrays import FloatArray
from ..constants import HUBER, SMALLEST, VERY_STRONG, Z_95
from ..rules import Rule
from ..signals.bins import Bins
from ..signals.noise import correlation_of_noise, correlation_time, is_coarse, mad_sigma
from .eliminate import evaluate
from .local_terms import Segments
from .modal import respond
from .problem import Problem, Structure
from .responses import HeldInput
from .static_gain import StaticGain, static_gain
from .structures import (
    Candidate,
    Scales,
    choose,
    converged,
    criteria,
    needless_parameters,
    on_new_data,
    parameter_charge,
    search,
    settled,
)

_PASSES = 2  # of modified residuals; see `fit_window`
RAMP = 0.1
"""Slowest pole times the length of the record, below which there may be an integrator
beside a lag that is faster by any ratio. Ablation: integrator beside a lag of any ratio."""
_LEAST_FREEDOM = 3.0  # of a variance that is estimated: fewer tell none
_LONG = 2**18  # samples that tell a frequency, for time and memory


@dataclass(frozen=True, eq=False)
class Window:
    """A part of a record, sample by sample and as a problem of means over bins.

    Attributes
    ----------
    start : int
        Residuals count from this sample on.
    output : ndarray, shape (N,)
    problem : Problem
        On the bins, or on the samples if there are none; rows of other data may follow.
    drive : HeldInput
        For the response at every sample.
    columns : ndarray, shape (N, q)
        Regressors at every sample.
    bins : Bins or None
    own : Segments or None
        Local terms at every sample, if the problem has them on bins.
    samples : float or None
        Number that the problem represents, if it is not that of the output.
    spacing : float
        Mean distance of the samples, in sample times; 1 if none is missing.
    """

    start: int
    output: FloatArray
    problem: Problem
    drive: HeldInput
    columns: FloatArray
    bins: Bins | None = None
    own: Segments | None = None
    samples: float | None = None
    spacing: float = 1.0

    @cached_property
    def counted(self) -> float:
        """Sum of the weights of the means after the step, over that of their samples.

        Below 1 where means of coarsely rounded samples weigh less than their number.
        """
        if self.bins is None or self.samples is not None:
            return 1.0
        after = self.bins.first >= self.start
        weights = float(np.sum(self.problem.root_weight[after] ** 2))
        return weights / max(float(np.sum(self.bins.width[after])), 1.0)

    def with_output(self, values: FloatArray) -> Problem:
        """Return the problem for other values (N,)."""
        means = values if self.bins is None else self.bins.average(values)
        return replace(self.problem, data=means)

    def predict(self, problem: Problem, candidate: Candidate) -> FloatArray:
        """Model at every sample, with the linear terms of the problem."""
        state = evaluate(problem, candidate.structure, candidate.parameters[None])
        if self.bins is None:
            # The samples are the first data of the problem.
            fitted = problem.data - state.residual[0] / problem.root_weight
            return np.asarray(fitted[: self.output.size])
        setting = problem.known, state.numerator[0], candidate.theta
        model = respond(self.drive, *setting)
        model += self.columns @ state.regression[0]
        if self.own is not None:
            weight = problem.root_weight
            terms = problem.local_terms(candidate.poles[None])
            forced = respond(problem.drive, *setting) + problem.regressors @ state.regression[0]
            remainder = weight * (problem.data - forced)
            model = model + terms.fitted(remainder[None], self.own)[0]
        return np.asarray(model)


def window_of_rows(problem: Problem) -> Window:
    """Window of a problem of which every row is a sample."""
    return Window(0, problem.data, problem, problem.drive, problem.regressors)


@dataclass(frozen=True, eq=False)
class WindowFit:
    """Candidates for one window, and the noise estimated from the best of them.

    ``variance`` is that of independent noise with the same effect on the estimates as the residual:
    the variance of the residual, plus that of a coarse `rounding` (neighbours are rounded alike),
    times its `correlation`; after prewhitening, times `colour`, the mean square of the whitened
    residual, and `correlation` is that of the noise. `taken` is what a model takes from slow noise:
    errors of gain and process parameters have the variance times that, and those of the gain what
    `rounded` of `static_gain` adds. `normalized_rms` is the root
    mean square of the residual of the chosen structure, in means over bins, over the given noise
    level. `rivals` are the margins by which structures were chosen, or not, for estimating the
    noise.
    """

    window: Window
    problem: Problem
    candidates: dict[Structure, Candidate]
    criterion: dict[Structure, float]
    scales: Scales
    sigma: float
    correlation: float
    normalized_rms: float
    rounding: float = 0.0
    colour: float | None = None
    taken: float = 1.0
    rounded: Callable[[FloatArray], FloatArray] | None = None
    rivals: Mapping[Structure, float] = field(default_factory=dict)

    @property
    def variance(self) -> float:
        """Variance per sample, including correlation."""
        colour = self.colour
        if colour is None:
            colour = weighted_correlation(self.correlation, self.window.counted)
        return (self.sigma**2 + self.rounding**2) * colour

    @property
    def error_variance(self) -> float:
        """Variance that counts for errors of gain and process parameters."""
        return self.variance * self.taken

    @property
    def independent(self) -> float:
        """Number of samples after the step that count."""
        count = self.window.samples or self.window.output.size - self.window.start
        return count / self.correlation

    @property
    def penalty(self) -> float:
        """Penalty on a parameter in the criterion: log of the number of independent samples."""
        return parameter_charge(self.independent)

    @cached_property
    def best(self) -> Candidate:
        """Fit of the chosen structure."""
        return self.best_of(self.criterion)

    def best_of(self, criterion: dict[Structure, float]) -> Candidate:
        """Fit of the structure that is chosen among some.

        A structure with a pole slower than the record, or an integrator, whose gain is not
        significant is replaced by the best one without that is not ruled out: a slow drift is not a
        response.
        """
        criterion = {s: value + self.frequency_charge(s) for s, value in criterion.items()}
        first = choose(criterion)
        limit = criterion[first] + VERY_STRONG
        left = {s: value for s, value in criterion.items() if value <= limit}
        while left:
            structure = choose(left)
            if replace(self, taken=1.0).static(self.candidates[structure]).resolved:
                kept = structure if structure == first or Rule.RESOLVED.on else first
                return self.candidates[kept]
            del left[structure]
        return self.candidates[first]

    def frequency_charge(self, structure: Structure) -> float:
        """Charge for the frequencies of pairs beyond that for a parameter.

        One of little damping follows a sine in the noise, of whichever frequency has the largest.
        The error of a frequency, over it, falls with the oscillations that are seen and the root of
        their samples, and not with the root of all: three penalties for a sine [6]_.
        """
        poles = self.candidates[structure].poles
        pairs = poles[poles.imag > 0]
        rates = np.maximum(-pairs.real, SMALLEST)
        charges = 2 * np.log(np.abs(pairs)) - 3 * np.log(rates) - np.log(self.scales.dt)
        return float(np.sum(np.clip(charges - self.penalty, 0.0, 2 * self.penalty)))

    def of(self, candidates: dict[Structure, Candidate], **changes: Any) -> WindowFit:
        """Replace the candidates, and what else has changed; the criterion is theirs."""
        fit = replace(self, candidates=candidates, **changes)
        return replace(fit, criterion=fit.criteria(candidates))

    def residual(self, candidate: Candidate) -> FloatArray:
        """Output less the response of a candidate, at all samples of the window (N,)."""
        return self.window.output - self.window.predict(self.problem, candidate)

    def misfit(self, candidate: Candidate) -> float:
        """Root mean square of the residual of a candidate, in units of `normalized_rms`."""
        least = self.candidates[choose(self.criterion)].cost
        return self.normalized_rms * float(np.sqrt(candidate.cost / max(least, SMALLEST)))

    def static(self, candidate: Candidate) -> StaticGain:
        """Gain and total delay of a candidate, with their errors."""
        setting = self.problem, candidate, self.error_variance, self.scales.length
        return static_gain(*setting, self.rounded)

    def criteria(self, candidates: dict[Structure, Candidate]) -> dict[Structure, float]:
        """Information criterion of other candidates on the same data."""
        values = criteria(candidates, self.variance, self.independent)
        return {s: value + self.problem.local_count(s.order) for s, value in values.items()}


def with_known_noise(
    window: Window,
    candidates: dict[Structure, Candidate],
    scales: Scales,
    sigma: float,
    correlation: float = 1.0,
) -> WindowFit:
    """Compare candidates on a window with noise of a known level, whatever their residual is."""
    level = float(np.sqrt(correlation))
    fit = WindowFit(window, window.problem, candidates, {}, scales, sigma, correlation, level)
    return fit.of(candidates)


def with_noise_of_residual(fit: WindowFit) -> WindowFit:
    """Count for errors what a model has taken from slow noise.

    For a residual that is noise: that of a misfit tells no noise. Choices are made without it, and
    the dead time, which shows in the fast part of a response, has its interval without it. Few
    samples are independent then, and their variance is known so badly that Student's distribution
    [5]_ takes the place of the normal one. Ablation: noise that the model has taken.
    """
    count = fit.window.output.size - fit.window.start
    parameters = _estimated(fit.window, fit.best.structure)
    correlation, missing = fit.correlation, 0.0
    if fit.colour is None:  # otherwise it is that of the noise already
        correlation, missing = correlation_of_noise(correlation, parameters / count)
    if correlation <= 1.0 or not Rule.TAKEN.on:
        return fit
    freedom = max(count / correlation - parameters, _LEAST_FREEDOM)
    wider = (float(stdtrit(freedom, ndtr(Z_95))) / Z_95) ** 2
    return replace(fit, taken=wider * correlation / fit.correlation / (1.0 - missing))


def _estimated(window: Window, structure: Structure) -> int:
    """Parameters of a model of a window, with its regressors and local terms."""
    columns: int = window.columns.shape[1]
    local = window.problem.local_count(structure.order)
    return 1 + structure.order + structure.zeros + columns + local


def weighted_correlation(correlation: float, counted: float) -> float:
    """Correlation time in units of weight, of which few samples of it may have been given already.

    Ablation: correlation in units of weight.
    """
    weighted = max(correlation * counted, 1.0)
    return weighted if weighted > 0.999 * correlation or Rule.WEIGHT.on else correlation


def fit_window(
    window: Window,
    structures: Sequence[Structure],
    scales: Scales,
    noise: tuple[float, float],
    huber: bool,
    like: WindowFit | None = None,
) -> WindowFit:
    """Search all structures.

    Parameters
    ----------
    window : Window
    structures : sequence of Structure
    scales : Scales
    noise : tuple of float
        Noise level and quantisation step.
    huber : bool
        Huber's loss by pseudo-values: the data are moved towards the model, so that their
        least-squares fit is that of Huber's loss. Starting from least squares one pass suffices,
        two with outliers.
    like : WindowFit, optional
        Fit of these structures to data of the same plant that are weighted otherwise: the search
        starts from there.
    """
    sigma, quantum = noise
    known = None if like is None else {s: [c.parameters] for s, c in like.candidates.items()}
    problem = window.problem
    # Neither what rings nor what integrates matters to its search: it is made once.
    first = search(problem, [Structure(1, 1)], scales)
    rough = first[Structure(1, 1)]
    error = window.output - window.predict(problem, rough)
    spacing = window.spacing * scales.dt
    scales = replace(
        scales,
        ringing=_ringing(error[window.start :], spacing) if Rule.RINGING.on else 0.0,
        integrating=bool(np.abs(rough.poles[0]) * scales.length < RAMP),
    )
    others = [s for s in structures if s not in first]
    beside = first if len(others) < len(structures) else None
    candidates = search(problem, others, scales, beside, starts=known)
    passes = _PASSES if huber else 0
    rivals: dict[Structure, float] = {}
    for iteration in range(passes + 1):
        rest = _residual(window, problem, candidates, (sigma, quantum), huber)
        of_residual = {"variance": rest.variance, "samples": rest.independent, "floor": rest.floor}
        del rest  # to save the memory of a long record
        candidates = converged(
            problem, candidates, scales, **of_residual, last=iteration > 0 or not huber
        )
        rest = _residual(window, problem, candidates, (sigma, quantum), huber)
        if iteration == 0 and rest.best.ends is not None:
            # The structure that determines the pseudo-values has converged.
            candidates[rest.best.structure] = settled(problem, rest.best, scales)
            del rest
            rest = _residual(window, problem, candidates, (sigma, quantum), huber)
        # Huber's pseudo-values are those of the structure chosen in each pass.
        rivals = {s: min(v, rivals.get(s, v)) for s, v in rest.rivals.items()}
        if iteration == passes or (iteration == 1 and not rest.has_outliers):
            break
        problem = window.with_output(rest.values)
        candidates = on_new_data(problem, candidates)
    criterion = criteria(candidates, rest.variance, rest.independent)
    # One initial value more for a pole reduces the cost by one variance for noise alone.
    criterion = {s: value + problem.local_count(s.order) for s, value in criterion.items()}
    chosen = candidates[choose(criterion)]
    freedom = max(problem.data.size - _estimated(window, rest.best.structure), 1)
    misfit = float(np.sqrt(chosen.cost / freedom)) / max(sigma, SMALLEST)
    rounding = quantum / np.sqrt(12) if is_coarse(sigma, quantum) else 0.0
    return WindowFit(
        window, problem, candidates, criterion, scales, rest.level, rest.correlation, misfit,
        rounding, rivals=rivals,
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Residual:
    """Residual of the best of some candidates on a window: the noise, if the fit is good.

    `values` (N,) are the data that Huber's loss asks for; `level` is the standard deviation of the
    residual, at least `floor`, `correlation` its correlation time, `independent` the number of
    samples that count; `rivals` tells how much worse other structures are, and for the best by how
    much it is better.
    """

    best: Candidate
    values: FloatArray
    has_outliers: bool
    level: float
    floor: float
    correlation: float
    independent: float
    rivals: dict[Structure, float]
    variance: float


def _residual(
    window: Window,
    problem: Problem,
    candidates: dict[Structure, Candidate],
    noise: tuple[float, float],
    huber: bool,
) -> _Residual:
    """Determine the residual of the structure with the lowest criterion.

    Not that of the lowest cost, because with superfluous parameters many values are equally good.
    The criterion here is that of white noise of unknown variance, m log(cost) for m means: the
    residual of too poor a model would be large and correlated, and would thus be accepted.
    """
    sigma, quantum = noise
    samples = window.output.size - window.start
    value = {
        s: problem.data.size * float(np.log(max(c.cost, 1e-300)))
        + (s.order + s.zeros + 2) * parameter_charge(samples)
        + problem.local_count(s.order)
        for s, c in candidates.items()
    }
    chosen = choose(value)
    lowest = value[chosen] + needless_parameters(chosen)
    rivals = {s: v + needless_parameters(s) - lowest for s, v in value.items() if s != chosen}
    rivals[chosen] = min(rivals.values(), default=np.inf)
    best = candidates[chosen]
    error = window.output - window.predict(problem, best)
    kept = clipped(error, max(0.5 * quantum, 0.1 * sigma)) if huber else error.copy()
    after = kept[window.start :]
    freedom = max(after.size - _estimated(window, best.structure), 1)
    level = float(np.sqrt(float(after @ after) / freedom))
    # Far below the noise the residual is rounding, and its correlation has no meaning.
    floor = 0.3 * sigma
    correlation = correlation_time(after) if level > floor else 1.0
    level = max(level, floor)
    variance = level**2 * weighted_correlation(correlation, window.counted)
    outliers = has_outliers(error)
    kept -= error
    kept += window.output
    return _Residual(
        best, kept, outliers, level, floor, correlation, after.size / correlation, rivals, variance
    )


def extended(fit: WindowFit, structures: Sequence[Structure]) -> WindowFit:
    """Add structures to a fit; noise and data remain those of the previous structures."""
    candidates = search(fit.problem, structures, fit.scales, fit.candidates)
    return fit.of(converged(fit.problem, candidates, fit.scales, fit.variance, fit.independent))


def among(fit: WindowFit, structures: Sequence[Structure]) -> WindowFit:
    """Compare some of the structures with each other only, at their minima."""
    few = {s: fit.candidates[s] for s in structures}
    candidates = fit.candidates | converged(
        fit.problem, few, fit.scales, fit.variance, fit.independent
    )
    return fit.of(candidates)


def clipped(error: FloatArray, least: float) -> FloatArray:
    """Residuals clipped at 1.345 sigma and rescaled by the fraction that was not."""
    limit = HUBER * max(mad_sigma(error), least)
    left = np.clip(error, -limit, limit)
    inside = float(np.mean(left == error))
    return np.divide(left, max(inside, 0.5), out=left)


def has_outliers(error: FloatArray) -> bool:
    """Whether there are more residuals beyond four sigma than in Gaussian noise."""
    return bool(np.mean(np.abs(error) > 4 * mad_sigma(error)) > 0.002)


def _ringing(error: FloatArray, dt: float) -> float:
    """Angular frequency that stands out of what a first-order fit leaves over."""
    if error.size < 16:
        return 0.0
    # A length with a large prime factor takes many times the time and memory; a long residual
    # need not be looked at to its last samples.
    count = error.size if error.size < _LONG else 2 ** int(np.log2(error.size))
    lines = np.abs(np.fft.rfft(error[:count] - error.mean()))
    return float(2 * np.pi * (int(np.argmax(lines[2:])) + 2) / (count * dt))
