"""Output-error fit for inputs other than steps: random, pseudo-random, sweeps, operating data.

One record or several of one plant: poles, numerator and dead time are common; level, drift and
initial state are estimated for each record (see `local_terms`).

Output error [1]_ with elimination of linear terms [2]_. The selection of samples and of slow
cosines is our own rule.

References
----------
.. [1] L. Ljung, System Identification: Theory for the User, 2nd ed., Prentice Hall 1999, section
   4.2 (output-error models) and 10.2 (iterative search).
.. [2] G. Golub and V. Pereyra, Separable nonlinear least squares: the variable projection method
   and its applications, Inverse Problems 19 (2003) R1-R26, doi:10.1088/0266-5611/19/2/201.
.. [3] R. E. Kass and A. E. Raftery, Bayes factors, J. Amer. Statist. Assoc. 90 (1995) 773-795,
   doi:10.1080/01621459.1995.10476572.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ..arrays import FloatArray, without_gaps
from ..parameters.process_form import ProcessForm
from ..separable.batch_search import fit_batch
from ..separable.compared_fits import converged, settled
from ..separable.poles import parameters_from_poles, poles_from_parameters
from ..separable.structures import Candidate, Scales, neighbour_starts, parameter_bounds, search
from ..separable.varpro import KnownFactor, Problem, Structure, respond
from ..separable.window import Window, WindowFit, extended, fit_window
from ..signals.noise import correlation_time, quantisation_step, winsorised_sigma
from ..signals.onset import correlation_onset
from ..validation.own_response import OwnResponse
from .better_structure import better_structure
from .condensed import MOST_LAGS, Condensed, condensed
from .input_data import SampledData, cut
from .interval import likelihood_fit
from .margins import close_to
from .own_response import own_response
from .process_models import process_fit
from .result import OutputErrorEstimate
from .selection import chains_of

WHITE = 3.0
"""Correlation time of the residual, in samples, up to which a model is taken for right: twice what
white noise scatters to. It decides on flags alone."""

ORDERS = tuple(Structure(n, r) for n in range(1, 4) for r in range(n, 0, -1))
"""Every sample counts here, so that orders 4 and 5 would take most of the time."""
MORE_LAGS = (Structure(4, 4), Structure(5, 5))
"""Tried as well where three poles are chosen: zeros beside them imitate further lags. Ablation:
fourth and fifth lag."""
_RISES = (2.0, 10.0, 50.0)  # samples, of the starts of the first-order fit, and
_ONSETS = (1.0, 5.0, 20.0)
_SMALLEST = 1e-4  # of the range: noise is not taken to be less
_CONFIDENCE = 0.99  # of a start; ablation: start from the correlation
_UNLIKE = 1.3  # ratio of noise levels from which weights shorten errors by more than 2 %
_BEYOND = 1.5  # of a first-order model's dead time: no model's dead time is later
_SLOW = 10.0  # times dead time and lag: periods from there on tell little of the plant
_SHORTEST = 40.0  # samples in such a period, lest there be as many cosines as samples
_CALMER = 0.5  # to which they must lower the variance, colour included; ablation: slow cosines
_DIED_AWAY = 10.0  # slowest time constants in which a response ends, but for 5e-5 of it
_LEAST_LAGS = 30  # of a response that is condensed; fewer cost as much
_CLEARLY = 4.0  # standard deviations of a chi-square: 3e-5 by chance


@dataclass(frozen=True, eq=False)
class SampledFit:
    """Fit of records with any input.

    `fitted` has one entry for each record, from its start on. `explained` is the decrease of the
    sum of squares due to the input, divided by the residual variance: a chi-square. If the records
    are longer than `data`, `condensed` contains the data that were fitted.
    """

    fit: OutputErrorEstimate
    data: SampledData
    fitted: tuple[FloatArray, ...]
    explained: float
    known: KnownFactor
    condensed: Condensed | None = None

    def own_delay(self, output: FloatArray, signal: FloatArray) -> OwnResponse:
        """Shift and scale the common model to fit one record best, whether it was fitted or not."""
        one = cut([output], [signal], self.data.dt)
        start = min(max(self.data.starts), output.size // 2)
        return own_response(replace(one, starts=(start,)), self.fit, self.known)


def fit_sampled(
    outputs: Sequence[FloatArray],
    inputs: Sequence[FloatArray],
    dt: float,
    *,
    structures: Sequence[Structure] | None = None,
    forms: Sequence[ProcessForm] = (),
    latest: float | None = None,
    known: KnownFactor | None = None,
    huber: bool = True,
) -> SampledFit:
    """Estimate the dead time of one plant from records with any input that moves.

    Parameters
    ----------
    outputs, inputs : sequence of ndarray
        One of each for every record; outputs are NaN where a sample is missing.
    dt : float
        Sample time in s.
    structures, forms, latest, known, huber
        See `fit_step_record`; orders up to 3 by default, `latest` a quarter of the longest record.

    Notes
    -----
    The past before a record is represented by an initial state, which is eliminated together with
    level and drift. The input within the dead time before the record is unknown: samples for one
    and a half dead times of the best first-order model are left out, at most half of the record. If
    the residual is coloured and slow cosines explain half of it, they are added to the local terms.

    Where samples are missing, the correlation of the residual is that of its samples as if they
    were neighbours: an average over the gaps, as it counts for the errors of slow parameters.
    """
    factor = known or KnownFactor()
    data = cut(outputs, inputs, dt)
    n = max(y.size for y in data.outputs)
    limit = 0.25 * n * dt if latest is None else latest
    data = replace(data, starts=tuple(y.size // 20 for y in data.outputs))
    usual = data.spacing * dt
    rough = _first_order(data.problem(factor), n, dt, usual, limit, _seen(data, limit))
    lag = float(-1.0 / rough.poles[0].real)
    late = int(np.ceil(_BEYOND * rough.dead_time / dt))
    data = replace(data, starts=tuple(min(late, y.size // 2) for y in data.outputs))
    scales = Scales(
        max(rough.dead_time, 0.5 * usual), max(lag, 2 * usual), max(data.lengths) * dt, dt, limit
    )
    tried = ORDERS if structures is None else tuple(structures)
    whole = _fit(data, factor, tried, scales, huber)
    levels = _noise_levels(data, whole)
    if levels.max() > _UNLIKE * levels.min():
        mean = float(np.exp(np.mean(np.log(levels))))
        data = replace(data, scales=tuple(float(level) / mean for level in levels))
        whole = _fit(data, factor, tried, scales, huber)
    period = _SLOW * (rough.dead_time + lag)
    if whole.correlation > WHITE and period >= _SHORTEST * usual:
        without = replace(data, period=period)
        calm = _fit(without, factor, tried, scales, huber)
        if calm.variance < _CALMER * whole.variance:
            data, whole = without, calm
    stretch = whole
    long = any(y.size > part.size for y, part in zip(outputs, data.outputs, strict=True))
    usable = long and not any(np.isnan(y).any() for y in outputs)
    sums = _condensed(outputs, inputs, data, stretch, huber) if usable else None
    if sums is not None:
        whole = _fit_condensed(sums, stretch, factor)
    if structures is None and whole.best.structure.order == ORDERS[-1].order:
        whole = extended(whole, MORE_LAGS)
    chains = chains_of(whole) if structures is None else []
    better = None
    if structures is not None:
        # On the part also if all samples were fitted: what is ruled out there is ruled out in any
        # case.
        every = partial(_fit, data, factor, ORDERS, scales, huber)
        better = better_structure(stretch, stretch.best, every)
    white = whole.correlation <= WHITE
    if forms:
        fit = process_fit(
            whole, forms, is_noise=lambda _, correlation: correlation <= WHITE, better=better
        )
    else:
        fit = likelihood_fit(whole, adequate=white, chains=chains, better=better)
    if sums is not None:
        fit = replace(fit, fitted=_on_stretch(data, fit, factor))
    elif fit.chain:
        left = correlation_time(whole.window.output - fit.fitted)
        fit = replace(fit, correlation=left, adequate=left <= WHITE)
    fit = replace(fit, close=fit.close + close_to("adequate", fit.correlation, WHITE))
    # There is no baseline for the noise; correlation is estimated from means over bins.
    fit = replace(fit, normalized_rms=float(np.sqrt(fit.correlation)))
    parts = np.split(fit.fitted, data.edges[1:-1])
    return SampledFit(
        fit,
        data,
        tuple(part * scale for part, scale in zip(parts, data.scales, strict=True)),
        _explained(stretch),
        factor,
        sums,
    )


def _fit(
    data: SampledData,
    known: KnownFactor,
    structures: Sequence[Structure],
    scales: Scales,
    huber: bool,
) -> WindowFit:
    problem = data.problem(known)
    window = Window(0, problem.data, problem, problem.drive, problem.regressors, None)
    window = replace(window, spacing=data.spacing)
    # after a spike at the start there may be nothing left that moves
    whole = 1e-9 * max(float(np.ptp(y[~np.isnan(y)])) for y in data.outputs)
    sigma = _SMALLEST * max(float(np.ptp(problem.data)), whole)
    noise = sigma, max(quantisation_step(y[~np.isnan(y)]) for y in data.outputs)
    return fit_window(window, structures, scales, noise, huber)


def _condensed(
    outputs: Sequence[FloatArray],
    inputs: Sequence[FloatArray],
    data: SampledData,
    stretch: WindowFit,
    huber: bool,
) -> Condensed | None:
    """All samples of records of which a part was fitted, if their response is short enough."""
    best = stretch.best
    slowest = float(1.0 / np.abs(best.poles.real).min())
    lags = (_BEYOND * best.dead_time + _DIED_AWAY * slowest) / data.dt
    if not lags <= MOST_LAGS:
        return None
    return condensed(
        [y / scale for y, scale in zip(outputs, data.scales, strict=True)],
        [u / scale for u, scale in zip(inputs, data.scales, strict=True)],
        data.dt,
        max(int(np.ceil(lags)), _LEAST_LAGS),
        huber=huber,
    )


def _fit_condensed(sums: Condensed, stretch: WindowFit, known: KnownFactor) -> WindowFit:
    """Fit all structures to all samples, starting from the fit of a part."""
    m = sums.data.size
    problem = Problem(sums.data, np.ones(m), sums.drive, np.empty((m, 0)), known)
    window = Window(0, sums.data, problem, sums.drive, problem.regressors, None)
    window = replace(window, samples=sums.samples)
    found: dict[Structure, Candidate] = {}
    for structure in sorted(stretch.candidates, key=lambda s: (s.order, s.zeros)):
        starts = [stretch.candidates[structure].parameters]
        starts += neighbour_starts(structure, stretch.scales, found)
        parameters, cost = fit_batch(
            problem, structure, np.array(starts), parameter_bounds(structure, stretch.scales)
        )
        best = int(np.argmin(cost))
        found[structure] = Candidate(structure, parameters[best], float(cost[best]))
    found = converged(problem, found, stretch.scales, sums.noise**2, sums.samples)
    first = min(found.values(), key=lambda candidate: candidate.cost)
    freedom = max(m - 2 - first.structure.order - first.structure.zeros, 1)
    # Residual above the noise: what no structure explains is treated as noise of that size.
    excess = first.cost / freedom / sums.noise**2
    colour = excess if excess > 1 + _CLEARLY * np.sqrt(2 / freedom) else 1.0
    fit = WindowFit(
        window, problem, found, {}, stretch.scales, sums.noise, colour, float(np.sqrt(colour))
    )
    return replace(fit, criterion=fit.criteria(found))


def _on_stretch(data: SampledData, fit: OutputErrorEstimate, known: KnownFactor) -> FloatArray:
    """Model at the samples of the part, with local level, drift and initial state."""
    problem = data.problem(known)
    parameters = np.concatenate([[fit.dead_time], parameters_from_poles(fit.poles)])
    model = respond(problem.drive, known, fit.numerator, parameters)
    own = problem.local_terms(poles_from_parameters(parameters[None, 1:])[0])
    rest = (problem.data - model)[None, :, None]
    return np.asarray(problem.data - own.without(rest)[0, :, 0])


def _noise_levels(data: SampledData, whole: WindowFit) -> FloatArray:
    """Residual of the best model in every record, in its unit."""
    error = whole.window.output - whole.window.predict(whole.problem, whole.best)
    floor = _SMALLEST * float(np.ptp(whole.window.output))
    return np.array(
        [max(winsorised_sigma(part, 0.0), floor) for part in np.split(error, data.edges[1:-1])]
    )


def _explained(whole: WindowFit) -> float:
    """Chi-square of the forced response: local terms alone against local terms and input."""
    problem, best = whole.problem, whole.best
    assert problem.segments is not None
    own = problem.local_terms(best.poles[None])
    alone = float(np.sum(own.without(problem.data[None, :, None]) ** 2))
    return (alone - best.cost) / max(whole.variance, 1e-300)


def _seen(data: SampledData, limit: float) -> list[float]:
    """First lag, in samples, at which the output responds to the input; empty if there is none.

    For an input that changes at every sample the minima are as narrow as the plant is fast, and may
    lie between the dead times that are tried otherwise. Missing samples are interpolated here.
    """
    found = []
    for u, y in zip(data.inputs, data.outputs, strict=True):
        most = int(min(limit / data.dt, u.size // 3))
        if most > 1 and np.ptp(u) > 0:
            found.append(correlation_onset(u, without_gaps(y), most, _CONFIDENCE).onset)
    onsets = [float(lag) for lag in found if lag > 0]
    return [float(np.median(onsets))] if onsets else []


def _first_order(
    problem: Problem, n: int, dt: float, usual: float, limit: float, seen: Sequence[float]
) -> Candidate:
    """Best first-order model from a grid of dead times and time constants.

    `usual` is the mean distance of the samples in s, of which `n` would follow every `dt`.
    """
    scales = [
        Scales(min(onset, limit), min(rise * usual, n * dt / 4), n * dt, dt, limit)
        for rise in _RISES
        for onset in (*(usual * onset for onset in _ONSETS), *(dt * lag for lag in seen))
    ]
    tries = [search(problem, [Structure(1, 1)], each)[Structure(1, 1)] for each in scales]
    best = min(tries, key=lambda candidate: candidate.cost)
    # It has converged, because its dead time determines the samples that are used.
    return settled(problem, replace(best, ends=None), scales[0])
