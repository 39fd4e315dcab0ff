"""Output-error estimate of a dead time from a step record, with an honest interval.

The rule:

1. All structures are fitted to the whole record; the one with the lowest information criterion
   is the model, and what its residual leaves is compared with the noise before the step.
2. Where the residual is noise, the delay is that of the model, and its interval spans the
   95 % profile-likelihood intervals of all structures that the data cannot rule out.
3. Where it is not, no likelihood knows the error. Five views are taken: the first motion, a
   first- and a second-order lag fitted to the first 15 % of the excursion, and the best model
   of up to three poles for the first 63 % and for all of it. The delay is their median.
4. The interval then spans the views and a third-order lag on the first 15 % (more lags, less
   delay), without the lowest: a fit that goes wrong takes delay for lag.
5. No delay is later than the first lasting motion of the output.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .arrays import ComplexArray, FloatArray
from .delayed_modes import HeldInput
from .noise_level import correlation_time, mad_sigma
from .profile_interval import delay_profile, profile_limits
from .separable_fit import KnownFactor, Problem, Structure, evaluate, fit_batch, respond
from .step_problem import (
    StepData,
    bins_until,
    fixed_regressors,
    problem_until,
    sample_drive,
    stop_at,
)
from .structure_search import (
    ALL_STRUCTURES,
    SIMPLE_STRUCTURES,
    Candidate,
    Scales,
    choose,
    criteria,
    parameter_bounds,
    plausible,
    refine,
    search,
)

ADEQUATE = 1.3
"""Residual over noise, in means over bins, up to which a model is taken for right."""

_HUBER = 1.345
_PASSES = 2


@dataclass(frozen=True, eq=False)
class StructureFit:
    """One line of the table of structures; delays in s, `excess` of the criterion to the best.

    `low` and `high` are the profile-likelihood interval, NaN where it was not needed.
    """

    structure: Structure
    delay: float
    total_delay: float
    excess: float
    low: float
    high: float
    poles: ComplexArray


@dataclass(frozen=True, eq=False)
class OutputErrorFit:
    """Delay and model of one record; see the rule in the module's docstring.

    ``low <= delay <= high``. `views` are (name, delay) pairs, empty where the model is adequate.
    The model is exp(-delay s) b(s) / a(s): `numerator` lists b from the lowest power on, `poles`
    are the roots of the monic a. `misfit` is residual over noise in means over bins.
    """

    delay: float
    low: float
    high: float
    std: float
    structure: Structure
    poles: ComplexArray
    numerator: FloatArray
    total_delay: float
    adequate: bool
    misfit: float
    residual: float
    correlation: float
    structures: tuple[StructureFit, ...]
    views: tuple[tuple[str, float], ...]
    fitted: FloatArray
    profile: tuple[FloatArray, FloatArray]
    latest: float


@dataclass(frozen=True, eq=False)
class _WindowFit:
    """Candidates on one window, and the noise that the best of them leaves."""

    problem: Problem
    candidates: dict[Structure, Candidate]
    criterion: dict[Structure, float]
    scales: Scales
    sigma: float
    correlation: float
    misfit: float

    @property
    def variance(self) -> float:
        return self.sigma**2 * self.correlation

    @property
    def best(self) -> Candidate:
        return self.candidates[choose(self.criterion)]


def fit_output_error(
    data: StepData,
    *,
    structures: Sequence[Structure] | None = None,
    latest: float | None = None,
    known: KnownFactor | None = None,
    huber: bool = True,
) -> OutputErrorFit:
    """Estimate the dead time of a step record.

    Parameters
    ----------
    data : StepData
        With a motion.
    structures : sequence of Structure, optional
        Default: orders 1 to 5, relative degrees 1 to the order. With structures given, the
        delay is that of the best of them, adequate or not.
    latest : float, optional
        Largest delay, in s.
    known : KnownFactor, optional
        Dynamics in cascade that do not belong to the plant.
    huber : bool, optional
        Huber's loss (k = 1.345) instead of least squares.
    """
    factor = known or KnownFactor()
    tried = ALL_STRUCTURES if structures is None else tuple(structures)
    whole = _fit_window(data, data.output.size, tried, latest, factor, huber)
    adequate = whole.misfit <= ADEQUATE * data.colour
    views: tuple[tuple[str, float], ...] = ()
    chosen = whole.best
    if not adequate and structures is None:
        simple = {s: c for s, c in whole.criterion.items() if s in SIMPLE_STRUCTURES}
        chosen = whole.candidates[choose(simple)]
        views = _views(data, chosen, latest, factor, huber)
    kept = [chosen.structure] if views else plausible(whole.criterion, chosen.structure)
    profiles = _profiles(whole, kept)
    table = _table(whole, profiles)
    if views:
        delay = float(np.median([at for _, at in views[:-1]]))
        delays = np.sort([at for _, at in views])
        low, high = float(delays[1]), float(delays[-1])
        std = (high - low) / 3.92
        chosen = _with_delay(whole, chosen, delay)
    else:
        delay = chosen.delay
        low = min([delay, *(line.low for line in table if line.low == line.low)])
        high = max([delay, *(line.high for line in table if line.high == line.high)])
        own = profile_limits(*profiles[chosen.structure])
        std = (own[1] - own[0]) / 3.92
    return _result(data, whole, chosen, adequate, views, table, profiles, (delay, low, high, std))


def _fit_window(
    data: StepData,
    stop: int,
    structures: Sequence[Structure],
    latest: float | None,
    known: KnownFactor,
    huber: bool,
) -> _WindowFit:
    """Search all structures on the samples up to `stop`."""
    bins = bins_until(data, stop)
    problem = problem_until(data, data.output, bins, stop, known)
    scales = _scales(data, stop, latest)
    first = search(problem, [Structure(1, 1)], scales)
    rough = first[Structure(1, 1)]
    scales = _with_ringing(data, stop, problem, rough, scales)
    candidates = search(problem, structures, scales)
    drive, columns = sample_drive(data, stop), fixed_regressors(data)[:stop]
    passes = _PASSES if huber else 0
    for turn in range(passes + 1):
        best = min(candidates.values(), key=lambda c: c.cost)
        error = data.output[:stop] - _predict(problem, best, drive, columns)
        if turn < passes:
            values = _pseudo_values(error, data, huber)
            problem = problem_until(data, data.output[:stop] - error + values, bins, stop, known)
            candidates = refine(problem, candidates, scales)
    left = _pseudo_values(error, data, huber)
    after = left[data.edge :]
    lost = 1 + best.structure.order + best.structure.zeros + columns.shape[1]
    freedom = max(after.size - lost, 1)
    level = float(np.sqrt(np.sum(after**2) / freedom))
    # Below that the residual is rounding, and its correlation says nothing.
    floor = 0.3 * data.sigma
    correlation = correlation_time(after) if level > floor else 1.0
    level = max(level, floor)
    criterion = criteria(candidates, level**2 * correlation, after.size / correlation)
    chosen = candidates[choose(criterion)]
    misfit = np.sqrt(chosen.cost / max(problem.data.size - lost, 1)) / data.sigma
    return _WindowFit(problem, candidates, criterion, scales, level, correlation, float(misfit))


def _scales(data: StepData, stop: int, latest: float | None) -> Scales:
    motion = data.motion
    assert motion is not None
    dt, length = data.dt, (stop - data.edge) * data.dt
    rise = (min(stop, stop_at(data, 0.63)) - data.edge - motion.onset) * dt
    last = (motion.crossing + max(1.0, 0.05 * motion.crossing)) * dt
    return Scales(
        onset=max(motion.onset, 0.5) * dt,
        rise=max(rise, 2 * dt),
        length=length,
        dt=dt,
        latest=last if latest is None else min(last, latest),
    )


def _with_ringing(
    data: StepData, stop: int, problem: Problem, rough: Candidate, scales: Scales
) -> Scales:
    """Add the frequency that a first-order fit leaves over."""
    assert data.motion is not None
    start = data.edge + data.motion.crossing
    if stop - start < 16:
        return scales
    error = data.output[:stop] - _predict(
        problem, rough, sample_drive(data, stop), fixed_regressors(data)[:stop]
    )
    left = error[start:] - error[start:].mean()
    power = np.abs(np.fft.rfft(left)) ** 2
    peak = int(np.argmax(power[2:])) + 2
    ringing = 2 * np.pi * peak / (left.size * data.dt)
    return Scales(**{**scales.__dict__, "ringing": float(ringing)})


def _pseudo_values(error: FloatArray, data: StepData, huber: bool) -> FloatArray:
    """Residuals whose least squares are Huber's loss: clipped, and scaled by 1 / E psi'."""
    if not huber:
        return error
    limit = _HUBER * max(mad_sigma(error), 0.5 * data.quantum, 0.1 * data.sigma)
    inside = float(np.mean(np.abs(error) <= limit))
    return np.asarray(np.clip(error, -limit, limit) / max(inside, 0.5))


def _predict(
    problem: Problem, candidate: Candidate, drive: HeldInput, columns: FloatArray
) -> FloatArray:
    """Model at every sample, with the linear terms of the problem."""
    state = evaluate(problem, candidate.structure, candidate.parameters[None])
    model = respond(drive, problem.known, state.numerator[0], candidate.parameters)
    return np.asarray(model + columns @ state.regression[0])


def _views(
    data: StepData, whole: Candidate, latest: float | None, known: KnownFactor, huber: bool
) -> tuple[tuple[str, float], ...]:
    """Looks at the delay that err in different ways, in s; the last serves the interval only."""
    assert data.motion is not None
    lags = (Structure(1, 1), Structure(2, 2), Structure(3, 3))
    early = _fit_window(data, stop_at(data, 0.15), lags, latest, known, huber)
    rise = _fit_window(data, stop_at(data, 0.63), SIMPLE_STRUCTURES, latest, known, huber)
    onset = data.motion.onset * data.dt
    return (
        ("first motion", onset if latest is None else min(onset, latest)),
        ("first-order lag, first 15 %", early.candidates[lags[0]].delay),
        ("second-order lag, first 15 %", early.candidates[lags[1]].delay),
        ("best model of the first 63 %", rise.best.delay),
        ("best model of the whole record", whole.delay),
        ("third-order lag, first 15 %", early.candidates[lags[2]].delay),
    )


def _profiles(
    whole: _WindowFit, kept: list[Structure]
) -> dict[Structure, tuple[FloatArray, FloatArray]]:
    return {
        s: delay_profile(whole.problem, whole.candidates[s], whole.variance, whole.scales)
        for s in kept
    }


def _table(
    whole: _WindowFit, profiles: dict[Structure, tuple[FloatArray, FloatArray]]
) -> tuple[StructureFit, ...]:
    best = min(whole.criterion.values())
    lines = []
    for s, candidate in whole.candidates.items():
        low, high = profile_limits(*profiles[s]) if s in profiles else (np.nan, np.nan)
        state = evaluate(whole.problem, s, candidate.parameters[None])
        total = candidate.delay + lag_sum(candidate.poles, state.numerator[0])
        excess = whole.criterion[s] - best
        lines.append(StructureFit(s, candidate.delay, total, excess, low, high, candidate.poles))
    return tuple(sorted(lines, key=lambda line: line.excess))


def lag_sum(poles: ComplexArray, numerator: FloatArray) -> float:
    """Delay at zero frequency of b(s)/a(s): sum of its lags less that of its leads, in s."""
    lag = float(np.sum(-1.0 / poles).real)
    if numerator.size > 1 and numerator[0] != 0:
        lag -= float(numerator[1] / numerator[0])
    return lag


def _with_delay(whole: _WindowFit, candidate: Candidate, delay: float) -> Candidate:
    """Best model of the same structure with a given delay."""
    start = candidate.parameters.copy()
    start[0] = delay
    bounds = parameter_bounds(candidate.structure.order, whole.scales)
    parameters, cost = fit_batch(
        whole.problem, candidate.structure, start[None], bounds, delay_fixed=True
    )
    return Candidate(candidate.structure, parameters[0], float(cost[0]))


def _result(
    data: StepData,
    whole: _WindowFit,
    chosen: Candidate,
    adequate: bool,
    views: tuple[tuple[str, float], ...],
    table: tuple[StructureFit, ...],
    profiles: dict[Structure, tuple[FloatArray, FloatArray]],
    interval: tuple[float, float, float, float],
) -> OutputErrorFit:
    n = data.output.size
    state = evaluate(whole.problem, chosen.structure, chosen.parameters[None])
    numerator = state.numerator[0]
    fitted = _predict(whole.problem, chosen, sample_drive(data, n), fixed_regressors(data))
    delay, low, high, std = interval
    return OutputErrorFit(
        delay=delay,
        low=low,
        high=high,
        std=std,
        structure=chosen.structure,
        poles=chosen.poles,
        numerator=numerator,
        total_delay=delay + lag_sum(chosen.poles, numerator),
        adequate=adequate,
        misfit=whole.misfit,
        residual=whole.sigma,
        correlation=whole.correlation,
        structures=table,
        views=views,
        fitted=fitted,
        profile=profiles[chosen.structure],
        latest=whole.scales.latest,
    )
