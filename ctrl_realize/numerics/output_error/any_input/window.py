"""Fit all structures to records with any input, in white noise or in coloured noise.

A linear plant responds to a filtered input with the equally filtered output. If the residual is
coloured, inputs and outputs are filtered by its autoregressive model and fitted again (generalised
least squares [1]_, [2]_): slow disturbances then do not hide fast motion, nor imitate slow poles.

References
----------
.. [1] D. W. Clarke, Generalized least squares estimation of the parameters of a dynamic model, IFAC
   Symposium on Identification in Automatic Control Systems, Prague 1967, paper 3.17.
.. [2] T. Soderstrom, Convergence properties of the generalised least squares identification method,
   Automatica 10 (1974) 617-626, doi:10.1016/0005-1098(74)90083-8.
.. [3] L. Ljung, System Identification: Theory for the User, 2nd ed., Prentice Hall 1999.
.. [4] G. Schwarz, Estimating the dimension of a model, Ann. Statist. 6 (1978) 461-464,
   doi:10.1214/aos/1176344136.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import block_diag
from scipy.signal import fftconvolve

from ...arrays import FloatArray, unit_columns, without_gaps
from ...constants import SMALLEST, STRONG, VERY_STRONG
from ...engine.eliminate import evaluate
from ...engine.local_terms import local_columns
from ...engine.modal import poles_from_parameters, respond
from ...engine.plausible_models import PlausibleModel
from ...engine.problem import Problem, Structure
from ...engine.static_gain import StaticGain, local_errors
from ...engine.structures import (
    Candidate,
    Scales,
    criteria,
    needless_parameters,
    pattern_starts,
    search,
    settled,
)
from ...engine.window_fit import Window, WindowFit, fit_window, window_of_rows
from ...rules import Rule
from ...signals.noise import (
    correlation_time,
    is_coarse,
    quantisation_step,
    rounding_of_sums,
    winsorised_sigma,
)
from ...signals.noise_model import noise_lags, whitening_filter
from ...signals.onset import correlation_onset
from ..step_data import step_data
from .data import BEYOND, MOST_SAMPLES, Load, SampledData

ORDERS = tuple(Structure(n, r) for n in range(1, 4) for r in range(n, 0, -1))
"""Every sample counts here, so that orders 4 and 5 would take most of the time."""
WHITE = 3.0
"""Correlation time of the residual, in samples, up to which a model is taken for right: twice what
white noise scatters to."""
_FEW = (Structure(1, 1), Structure(2, 2))  # with which a motion is tried beside the best
_NOISE_TURNS = 2
"""Noise models, each from the residual of the previous fit: the first residual contains what
the model followed of slow noise. Ablation: coloured noise of any input."""
_SETTLED = 3.0  # time constants in a record, in which a response settles but for 5 %
_RISES = (2.0, 10.0, 50.0)  # samples, of the starts of the first-order fit, and
_ONSETS = (1.0, 5.0, 20.0)
_SMALLEST = 1e-4  # of the range: noise is not taken to be less
_CONFIDENCE = 0.99  # of a start; ablation: start from the correlation
_REST = 4  # samples before the first move of the input, for an onset to be visible
_UNLIKE = 1.3  # ratio of noise levels from which weights shorten errors by more than 2 %


@dataclass(frozen=True, eq=False)
class SampledWindow:
    """Fit of all structures to records that were filtered by a polynomial `noise`, 1 for none.

    `data` are the records before the filter, without the samples that depend on the unknown past;
    `unweighted` is the model before it, and `residual` as for `SampledData.whitened`; `loads` are
    those that were found.
    """

    data: SampledData
    noise: FloatArray
    scales: Scales
    fit: WindowFit
    huber: bool
    unweighted: PlausibleModel | None = None
    residual: tuple[FloatArray, ...] = ()
    loads: tuple[Load, ...] = ()

    @property
    def model(self) -> PlausibleModel:
        """What was chosen to determine the noise."""
        best = self.fit.best
        state = evaluate(self.fit.problem, best.structure, best.parameters[None])
        return PlausibleModel(best.dead_time, best.poles, state.numerator[0])

    def fit_of(self, structures: Sequence[Structure]) -> WindowFit:
        """Fit other structures to the same data."""
        return _fit(self.data.whitened(self.noise), structures, self.scales, self.huber)

    @cached_property
    def fitted(self) -> list[FloatArray]:
        """Output of the model for every record before the filter, in its unit of noise."""
        model = modelled(self.data, self.fit.best.theta, self.model.numerator)
        return np.split(model, self.data.edges[1:-1])

    @cached_property
    def quantum(self) -> float:
        """Quantisation step of the outputs if averaging does not remove their rounding, else 0."""
        data = self.data
        step = quantisation_step(np.concatenate(data.measured))
        every = zip(data.measured, data.scales, self.fitted, strict=True)
        left = np.concatenate([y - scale * model for y, scale, model in every])
        coarse = is_coarse(winsorised_sigma(left, 0.5 * step), step) and Rule.COARSE.on
        return step if coarse else 0.0

    def rounding(self, weights: FloatArray) -> FloatArray:
        """Variances (k,) of sums of the rows with weights (k, m), by coarse rounding."""
        found, order = np.zeros(len(weights)), self.noise.size - 1
        ends = np.cumsum([model.size - order for model in self.fitted])[:-1]
        of_records = np.split(weights, ends, axis=1)
        for own, model, scale in zip(of_records, self.fitted, self.data.scales, strict=True):
            of_samples = fftconvolve(own, self.noise[None, ::-1], axes=1)
            found += rounding_of_sums(model, of_samples, self.quantum / scale)
        return found


def fit_windows(
    data: SampledData,
    structures: Sequence[Structure],
    within: tuple[float, float],
    huber: bool,
    noise: FloatArray,
    residual: tuple[FloatArray, ...] = (),
    longest: float = 0.0,
    like: WindowFit | None = None,
) -> SampledWindow:
    """Fit structures to filtered records, every record weighted by its noise.

    Dead times are sought `within` these, in s; `residual` as for `SampledData.whitened`. What
    depends on the input before the records for a dead time of `longest` is left out in any case.
    The search starts from a fit of the structures to records with almost the same filter, `like`.
    """
    dt, n, usual = data.step, max(y.size for y in data.outputs), data.spacing * data.dt
    order = noise.size - 1
    alike = (1.0,) * len(data.outputs)
    # A start of its own motion is left out, but not what an early pulse does.
    moves = [int(np.argmax(u != u[0])) for u in data.held]
    starts = tuple(min(y.size // 20, at) for y, at in zip(data.outputs, moves, strict=True))
    data = replace(data, starts=starts, scales=alike)
    filtered = data.whitened(noise, residual)
    seen = [*_seen(filtered, within[1]), *_onsets(data)]
    rough = _first_order(filtered.problem, n, dt, usual, within, seen)
    lag = float(-1.0 / rough.poles[0].real)
    data = data.after(max(rough.dead_time, longest / BEYOND))
    length = (max(data.lengths) - order) * dt
    # A lag beyond the record is a ramp, which tells nothing about lags to start from.
    onset, rise = max(rough.dead_time, 0.5 * usual), min(max(lag, 2 * usual), length)
    scales = Scales(onset, rise, length, dt, within[1], within[0])
    fits = _fit(data.whitened(noise, residual), structures, scales, huber, like)
    levels = _noise_levels(data.whitened(noise, residual), fits)
    if levels.max() > _UNLIKE * levels.min() and Rule.RECORD_NOISE.on:
        mean = float(np.exp(np.mean(np.log(levels))))
        data = replace(data, scales=tuple(float(level) / mean for level in levels))
        fits = _fit(data.whitened(noise, residual), structures, scales, huber, fits)
    return SampledWindow(data, noise, scales, fits, huber, residual=residual)


def in_coloured_noise(
    plain: SampledWindow, structures: Sequence[Structure] | None = None
) -> SampledWindow:
    """Fit filtered records; the noise model is the autoregression of the residual.

    Where the residual does not become whiter, the previous fit remains. The filter removes the low
    frequencies, which distinguish a slow pole from a disturbance: structures whose response does
    not settle within the record, or whose gain is not significant, are left out unless they are
    stated; if no other is left, as for an integrator, the previous fit remains too.
    """
    found, before = plain, None
    for _ in range(_NOISE_TURNS):
        error = simulation_error(found.data, found.fit.best, found.fit)
        lags = noise_lags(min(found.data.counts))
        noise = noise_model(found, found.fit.best, error, lags)
        within = plain.scales.earliest, plain.scales.latest
        every = structures or ORDERS
        again = fit_windows(plain.data, every, within, plain.huber, noise, like=before)
        before, candidates = again.fit, again.fit.candidates
        settling = structures or [s for s, c in candidates.items() if _settles(before.static(c))]
        if not settling:
            break
        if len(settling) < len(every):
            again = fit_windows(plain.data, settling, within, plain.huber, noise, like=before)
        if not again.fit.correlation < plain.fit.correlation:
            break
        found = again
    return found


def rests(part: SampledWindow) -> bool:
    """Whether records that were fitted from rest show neither a free response nor a drift.

    These are tried with the best structure, and with one and two lags: slow poles beside zeros take
    their place in richer ones, and a filter in coloured noise, which is why it comes afterwards.
    Rest needs strong evidence by the criterion [4]_, as what was fitted with a motion that is none
    loses accuracy alone.
    """
    still, data = part.fit, replace(part.data, rested=False)
    tried = dict.fromkeys([still.best.structure, *(s for s in _FEW if s in still.candidates)])
    moving = _fit(data, list(tried), part.scales, part.huber, still)
    variance = min(still.variance, moving.variance)
    assert still.problem.segments is not None
    levels = still.problem.segments.shapes

    def least(fits: WindowFit) -> float:
        values = criteria(fits.candidates, variance, still.independent)
        # Local terms are what is chosen here, and are charged as parameters.
        terms = {s: fits.problem.local_count(s.order) if fits is moving else levels for s in values}
        return min(
            value + still.penalty * terms[s] + needless_parameters(s) for s, value in values.items()
        )

    return bool(least(still) + STRONG < least(moving))


def noise_model(part: SampledWindow, model: Candidate, error: FloatArray, lags: int) -> FloatArray:
    """Polynomial that makes white what a model leaves of the records, and what it has followed."""
    if not lags:
        return np.ones(1)
    problem, edges = part.data.problem, part.data.edges
    assert problem.segments is not None
    # As many records as one may have samples: every one has terms of its own.
    stop = max(int(np.searchsorted(edges, MOST_SAMPLES, "right")), 2) - 1
    state = evaluate(part.fit.problem, model.structure, model.parameters[None])
    slopes = local_errors(problem, model, state.numerator[0], part.scales.length).slopes
    own = np.split(local_columns(problem.segments, model.poles[None])[0], edges[1:-1])[:stop]
    columns = unit_columns(np.hstack([slopes[: edges[stop]], block_diag(*own)]))[0]
    followed = columns if Rule.FOLLOWED.on else None
    return whitening_filter(error[: edges[stop]], lags, columns=followed)


def simulates_worse(weighted: SampledWindow, plain: SampledWindow) -> bool:
    """Whether a fit of filtered records simulates them worse than a fit to the records themselves.

    That is, by more than the noise explains: where the structure is right both estimates have the
    same limit, and the weighted one is the more accurate; where it is not, the weighted one is that
    for the frequencies at which the noise is small [3]_, section 8.5, not for those of the input.
    Likelihood ratio with as many samples as independent ones tell as much, and the charge of BIC. A
    fit that does not settle within the record follows a plant that changes, or a disturbance.
    """
    if not _settles(plain.fit.static(plain.fit.best)):
        return False
    both = plain.fit, weighted.fit
    before, after = (simulation_error(plain.data, fit.best, fit) for fit in both)
    independent = after.size / correlation_time(after)
    ratio = winsorised_sigma(after, 0.0) / max(winsorised_sigma(before, 0.0), SMALLEST)
    fewer = weighted.fit.best.structure.free - plain.fit.best.structure.free
    evidence = 2 * independent * np.log(max(ratio, SMALLEST)) + fewer * np.log(independent)
    return bool(evidence > VERY_STRONG)


def simulation_error(data: SampledData, model: Candidate, fit: WindowFit) -> FloatArray:
    """Error of a simulation with the best local terms, and the numerator that a fit gives."""
    state = evaluate(fit.problem, model.structure, model.parameters[None])
    return np.asarray(data.problem.data - modelled(data, model.parameters, state.numerator[0]))


def left_of(part: SampledWindow, model: Candidate) -> list[FloatArray]:
    """What a model leaves of every record."""
    return np.split(simulation_error(part.data, model, part.fit), part.data.edges[1:-1])


def _settles(static: StaticGain) -> bool:
    return static.significant and not static.integrates and static.slowest >= _SETTLED


def window_of(data: SampledData) -> Window:
    """Set up the fit of all samples."""
    return replace(window_of_rows(data.problem), spacing=data.spacing / data.every)


def _fit(
    data: SampledData,
    structures: Sequence[Structure],
    scales: Scales,
    huber: bool,
    like: WindowFit | None = None,
) -> WindowFit:
    window = window_of(data)
    problem = window.problem
    # after a spike at the start there may be nothing left that moves
    fits = 1e-9 * max(float(np.ptp(y[~np.isnan(y)])) for y in data.outputs)
    sigma = _SMALLEST * max(float(np.ptp(problem.data)), fits)
    noise = sigma, max(quantisation_step(y[~np.isnan(y)]) for y in data.outputs)
    return fit_window(window, structures, scales, noise, huber, like)


def modelled(data: SampledData, parameters: FloatArray, numerator: FloatArray) -> FloatArray:
    """Output of a model, with local level, drift and initial state."""
    problem = data.problem
    model = respond(problem.drive, data.known, numerator, parameters)
    own = problem.local_terms(poles_from_parameters(parameters[None, 1:])[0])
    rest = (problem.data - model)[None, :, None]
    return np.asarray(problem.data - own.without(rest)[0, :, 0])


def _noise_levels(data: SampledData, fits: WindowFit) -> FloatArray:
    """Residual of the best model in every record, in its unit."""
    error = fits.residual(fits.best)
    floor = _SMALLEST * float(np.ptp(fits.window.output))
    return np.array(
        [max(winsorised_sigma(part, 0.0), floor) for part in np.split(error, data.edges[1:-1])]
    )


def _seen(data: SampledData, limit: float) -> list[float]:
    """First lag, in samples, at which the output responds to the input; empty if there is none.

    For an input that changes at every sample the minima are as narrow as the plant is fast, and may
    lie between the dead times that are tried otherwise. Missing samples are interpolated here.
    """
    found = []
    for u, y in zip(data.held, data.outputs, strict=True):
        most = int(min(limit / data.step, u.size // 3))
        if most > 1 and np.ptp(u) > 0:
            found.append(correlation_onset(u, without_gaps(y), most, _CONFIDENCE).onset)
    onsets = [float(lag) for lag in found if lag > 0]
    return [float(np.median(onsets))] if onsets and Rule.CORRELATION.on else []


def _onsets(data: SampledData) -> list[float]:
    """Visible onset after the first move of the input, in samples; empty if there is none.

    A response to several moves looks like a slow one to the first of them, with less dead time.
    """
    found = []
    for u, y in zip(data.held, data.outputs, strict=True):
        first = int(np.argmax(u != u[0]))
        if np.count_nonzero(~np.isnan(y[:first])) >= _REST:
            motion = step_data(y, u, data.step, [(first, 1)]).motion
            found += [] if motion is None else [float(motion.onset)]
    return [float(np.median(found))] if found else []


def _first_order(
    problem: Problem,
    n: int,
    dt: float,
    usual: float,
    within: tuple[float, float],
    seen: Sequence[float],
) -> Candidate:
    """Best first-order model from a grid of dead times and time constants.

    `usual` is the mean distance of the samples in s, of which `n` would follow every `dt`.
    """
    earliest, latest = within
    scales = [
        Scales(min(onset, latest), min(rise * usual, n * dt / 4), n * dt, dt, latest, earliest)
        for rise in _RISES
        for onset in (*(usual * onset for onset in _ONSETS), *(dt * lag for lag in seen))
    ]
    first = Structure(1, 1)
    starts = [start for each in scales for start in pattern_starts(first, each)]
    best = search(problem, [first], scales[0], starts={first: starts})[first]
    # It has converged, because its dead time determines the samples that are used.
    return settled(problem, replace(best, ends=None), scales[0])
