"""Fit all structures to one stretch of a record, and see what noise the best of them leaves.

Huber's loss by modified residuals [1]_ with the constant of [2]_ (95 % efficiency in Gaussian
noise); the number of independent samples is that of [3]_, the criterion [4]_.

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
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from ..arrays import FloatArray
from ..constants import HUBER, SMALLEST
from ..signals.bins import Bins
from ..signals.noise import correlation_time, is_coarse, mad_sigma
from .compared_fits import converged, on_new_data, settled
from .local_terms import Segments
from .responses import HeldInput
from .static_gain import StaticGain, static_gain
from .structures import (
    PLAUSIBLE,
    Candidate,
    Scales,
    choose,
    criteria,
    needless_parameters,
    parameter_charge,
    search,
)
from .varpro import Problem, Structure, evaluate, respond

_PASSES = 2  # of modified residuals; see `fit_window`


@dataclass(frozen=True, eq=False)
class Window:
    """A stretch of a record, sample by sample and as a problem of means over bins.

    Attributes
    ----------
    start : int
        Residuals count from this sample on.
    output : ndarray, shape (N,)
    problem : Problem
        On the bins, or on the samples where there are none.
    drive : HeldInput
        For the response at every sample.
    columns : ndarray, shape (N, q)
        Regressors at every sample.
    bins : Bins or None
    own : Segments or None
        Local terms at every sample, where the problem has them on bins.
    samples : int or None
        That the output stands for, where it is none of them itself.
    """

    start: int
    output: FloatArray
    problem: Problem
    drive: HeldInput
    columns: FloatArray
    bins: Bins | None
    own: Segments | None = None
    samples: int | None = None

    def with_output(self, values: FloatArray) -> Problem:
        """Return the problem for other values (N,)."""
        means = values if self.bins is None else self.bins.average(values)
        return replace(self.problem, data=means)

    def predict(self, problem: Problem, candidate: Candidate) -> FloatArray:
        """Model at every sample, with the linear terms of the problem."""
        state = evaluate(problem, candidate.structure, candidate.parameters[None])
        if self.bins is None:
            # The samples are the data of the problem, all of weight 1.
            return np.asarray(problem.data - state.residual[0])
        setting = problem.known, state.numerator[0], candidate.parameters
        model = respond(self.drive, *setting)
        model += self.columns @ state.regression[0]
        if self.own is not None:
            weight = problem.root_weight
            terms = problem.local_terms(candidate.poles[None])
            rest = weight * (problem.data - respond(problem.drive, *setting))
            model = model + terms.fitted(rest[None], self.own)[0]
        return np.asarray(model)


@dataclass(frozen=True, eq=False)
class WindowFit:
    """Candidates on one window, and the noise that the best of them leaves.

    ``variance`` is that of independent noise which would scatter the estimates as much as the
    residual does: its own, with that of a coarse `rounding` once more, for neighbours are rounded
    alike, times its `correlation`; where the noise has been made white instead, times `colour`,
    the mean square that is left there in units of it. `misfit` is the root mean square of the
    residual of the chosen structure, in means over bins, over the noise level given. `rivals` are
    the margins by which structures were chosen, or not, to tell what noise there is.
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
    rivals: Mapping[Structure, float] = field(default_factory=dict)

    @property
    def variance(self) -> float:
        """Variance per sample, colour included."""
        colour = self.correlation if self.colour is None else self.colour
        return (self.sigma**2 + self.rounding**2) * colour

    @property
    def independent(self) -> float:
        """Samples after the step that count."""
        count = self.window.samples or self.window.output.size - self.window.start
        return count / self.correlation

    @property
    def penalty(self) -> float:
        """What the criterion charges for a parameter: log of the independent samples."""
        return parameter_charge(self.independent)

    @cached_property
    def best(self) -> Candidate:
        """Fit of the chosen structure."""
        return self.best_of(self.criterion)

    def best_of(self, criterion: dict[Structure, float]) -> Candidate:
        """Fit of the structure that is chosen among some.

        One with a pole slower than the record, or an integrator, whose gain is not significant is
        left for the best one without that is not ruled out: what wanders slowly is no response.
        """
        first = choose(criterion)
        limit = criterion[first] + PLAUSIBLE
        left = {s: value for s, value in criterion.items() if value <= limit}
        while left:
            structure = choose(left)
            if self.static(self.candidates[structure]).resolved:
                return self.candidates[structure]
            del left[structure]
        return self.candidates[first]

    def static(self, candidate: Candidate) -> StaticGain:
        """Gain and total delay of a candidate, with their errors."""
        return static_gain(self.problem, candidate, self.variance, self.scales.length)

    def criteria(self, candidates: dict[Structure, Candidate]) -> dict[Structure, float]:
        """Information criterion of other candidates on the same data."""
        values = criteria(candidates, self.variance, self.independent)
        return {s: value + self.problem.local_count(s.order) for s, value in values.items()}


def fit_window(
    window: Window,
    structures: Sequence[Structure],
    scales: Scales,
    noise: tuple[float, float],
    huber: bool,
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
        Huber's loss by pseudo-values: the data are moved towards the model, so that their least
        squares are Huber's. From a least-squares start one pass suffices, two with outliers.
    """
    sigma, quantum = noise
    problem = window.problem
    candidates = search(problem, structures, scales)
    passes = _PASSES if huber else 0
    rivals: dict[Structure, float] = {}
    for turn in range(passes + 1):
        rest = _left(window, problem, candidates, (sigma, quantum), huber)
        setting = rest.variance, rest.independent
        del rest  # of a long record every array counts
        candidates = converged(problem, candidates, scales, *setting, last=turn > 0 or not huber)
        rest = _left(window, problem, candidates, (sigma, quantum), huber)
        if turn == 0 and rest.best.ends is not None:
            # What moves the data has converged.
            candidates[rest.best.structure] = settled(problem, rest.best, scales)
            del rest
            rest = _left(window, problem, candidates, (sigma, quantum), huber)
        # Huber's data are those of the structure that was chosen at every turn.
        rivals = {s: min(v, rivals.get(s, v)) for s, v in rest.rivals.items()}
        if turn == passes or (turn == 1 and not rest.wild):
            break
        problem = window.with_output(rest.values)
        candidates = on_new_data(problem, candidates)
    criterion = criteria(candidates, rest.variance, rest.independent)
    # One initial value more for a pole fits noise alone by one variance.
    criterion = {s: value + problem.local_count(s.order) for s, value in criterion.items()}
    chosen = candidates[choose(criterion)]
    freedom = max(problem.data.size - rest.lost, 1)
    misfit = float(np.sqrt(chosen.cost / freedom)) / max(sigma, SMALLEST)
    rounding = quantum / np.sqrt(12) if is_coarse(sigma, quantum) else 0.0
    return WindowFit(
        window, problem, candidates, criterion, scales, rest.level, rest.correlation, misfit,
        rounding, rivals=rivals,
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Left:
    """What the best of some candidates leaves of a window: the noise, if it is a good one.

    `values` (N,) are the data that Huber's loss asks for, `wild` tells of outliers; `level` is the
    standard deviation of what is left, `correlation` its correlation time, `lost` the parameters,
    `independent` the samples that count; `rivals` tells how much worse other structures are,
    and for the best by how much it is better.
    """

    best: Candidate
    values: FloatArray
    wild: bool
    level: float
    correlation: float
    lost: int
    independent: float
    rivals: dict[Structure, float]

    @property
    def variance(self) -> float:
        return self.level**2 * self.correlation


def _left(
    window: Window,
    problem: Problem,
    candidates: dict[Structure, Candidate],
    noise: tuple[float, float],
    huber: bool,
) -> _Left:
    """Look at what the structure of the lowest criterion leaves.

    Not at that of the lowest cost: of parameters that fit noise alone many values are as good.
    The criterion here is that of white noise of unknown variance, m log(cost) of m means: a model
    too poor would leave much that is correlated, and pass for enough by that.
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
    kept = _clipped(error, max(0.5 * quantum, 0.1 * sigma)) if huber else error.copy()
    after = kept[window.start :]
    lost = 1 + best.structure.order + best.structure.zeros + window.columns.shape[1]
    lost += problem.local_count(best.structure.order)
    level = float(np.sqrt(float(after @ after) / max(after.size - lost, 1)))
    # Far below the noise the residual is rounding, and its correlation says nothing.
    floor = 0.3 * sigma
    correlation = correlation_time(after) if level > floor else 1.0
    independent = after.size / correlation
    wild = _wild(error)
    kept -= error
    kept += window.output
    return _Left(best, kept, wild, max(level, floor), correlation, lost, independent, rivals)


def extended(fit: WindowFit, structures: Sequence[Structure]) -> WindowFit:
    """Add structures to a fit; noise and data stay those of the structures before."""
    candidates = search(fit.problem, structures, fit.scales, fit.candidates)
    candidates = converged(fit.problem, candidates, fit.scales, fit.variance, fit.independent)
    return replace(fit, candidates=candidates, criterion=fit.criteria(candidates))


def among(fit: WindowFit, structures: Sequence[Structure]) -> WindowFit:
    """Compare some of the structures with each other alone, at their minima."""
    few = {s: fit.candidates[s] for s in structures}
    candidates = fit.candidates | converged(
        fit.problem, few, fit.scales, fit.variance, fit.independent
    )
    return replace(fit, candidates=candidates, criterion=fit.criteria(candidates))


def _clipped(error: FloatArray, least: float) -> FloatArray:
    """Residuals clipped at 1.345 sigma and scaled up again by the part that was not."""
    limit = HUBER * max(mad_sigma(error), least)
    left = np.clip(error, -limit, limit)
    inside = float(np.mean(left == error))
    return np.divide(left, max(inside, 0.5), out=left)


def _wild(error: FloatArray) -> bool:
    """Tell whether there are more residuals beyond four sigma than Gaussian noise has."""
    return bool(np.mean(np.abs(error) > 4 * mad_sigma(error)) > 0.002)
