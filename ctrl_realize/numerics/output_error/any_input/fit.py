"""Output-error fit for inputs other than steps: random, pseudo-random, sweeps, operating data.

One record or several of one plant: poles, numerator and dead time are common; level, drift and
initial state are estimated for each record (see `local_terms`).

Output error [1]_ with elimination of linear terms [2]_. The selection of samples is our own
rule.

References
----------
.. [1] L. Ljung, System Identification: Theory for the User, 2nd ed., Prentice Hall 1999, section
   4.2 (output-error models) and 10.2 (iterative search).
.. [2] G. Golub and V. Pereyra, Separable nonlinear least squares: the variable projection method
   and its applications, Inverse Problems 19 (2003) R1-R26, doi:10.1088/0266-5611/19/2/201.
.. [3] D. W. Clarke, Generalized least squares estimation of the parameters of a dynamic model, IFAC
   Symposium on Identification in Automatic Control Systems, Prague 1967, paper 3.17.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ...arrays import FloatArray
from ...constants import Z_95
from ...engine.local_terms import local_columns
from ...engine.modal import lag_sum, parameters_from_poles, poles_from_parameters, respond
from ...engine.problem import KnownFactor, Problem, Structure
from ...engine.profile import dead_time_error
from ...engine.structures import Candidate, converged, search
from ...engine.window_fit import WindowFit, extended, window_of_rows, with_known_noise
from ...rules import Rule
from ...signals.noise import correlation_time, winsorised_sigma
from ...validation.own_response import OwnResponse, matched, response_slopes
from ..interval import likelihood_fit
from ..other_structures import Compared, Requested, other_structures
from ..process_models import fit_requested
from ..result import OutputErrorEstimate, followed_by, followed_percent, levels
from ..selection import chains_of, close_to, flows_of
from .condensed import MOST_LAGS, Condensed, condensed
from .data import BEYOND, MOST_SAMPLES, Load, SampledData, cut
from .lags import fit_lags, plain_lags, posterior_of
from .stretch import (
    DIED_AWAY,
    FOLLOWS,
    FOLLOWS_IN_LOOPS,
    explained,
    fit_stretch,
    made_white,
    response_samples,
    samples_in_a_block,
)
from .window import ORDERS, WHITE, SampledWindow, modelled, window_of

MORE_LAGS = (Structure(4, 4), Structure(5, 5))
"""Tried as well where three poles are chosen: zeros beside them imitate further lags. Ablation:
fourth and fifth lag."""
_LEAST_LAGS = 30  # of a response that is condensed; fewer cost as much
_SHIFT = 0.25  # samples, for a slope by differences
_REACH = 20.0  # samples by which the dead time of a record moves in one turn at most
_MORE = 1.1  # lags over those that are needed
_LESS = 0.5  # of what is unexplained, for twice as many lags to be worthwhile
_CLEARLY = 4.0  # standard deviations of a chi-square: 3e-5 by chance


@dataclass(frozen=True, eq=False)
class SampledFit:
    """Fit of records with any input.

    `explained` is the decrease of the sum of squares due to the input, divided by the residual
    variance: a chi-square. If the records are longer than `data`, `condensed` contains the data
    that were fitted. `noise` is the polynomial that makes the noise white, 1 for white noise;
    `loads` are those that were found, `quantum` is the quantisation step of the output if it is
    coarse, otherwise 0.
    """

    fit: OutputErrorEstimate
    data: SampledData
    explained: float
    noise: FloatArray
    condensed: Condensed | None
    loads: tuple[Load, ...] = ()
    quantum: float = 0.0

    @property
    def needed(self) -> float:
        """Least chi-square of the response to the input for which the output follows it."""
        return FOLLOWS_IN_LOOPS if self.fit.averaged else FOLLOWS

    @property
    def follows(self) -> bool:
        """Whether the output follows the input."""
        return self.explained >= self.needed

    def own_delay(self, output: FloatArray, signal: FloatArray) -> OwnResponse:
        """Shift and scale the common model to fit one record best, whether it was fitted or not."""
        data = self.data
        one = cut([output], [signal], data.dt, data.every, data.known, data.rested)
        start = min(max(data.starts), one.outputs[0].size // 2)
        problem = replace(one, starts=(start,)).whitened(self.noise).problem
        assert problem.segments is not None
        poles = poles_from_parameters(parameters_from_poles(self.fit.poles)[None])[0]
        own, step = local_columns(problem.segments, poles)[0], data.step

        def moved(shift: float, stretch: float) -> tuple[FloatArray, FloatArray, FloatArray]:
            at, model = self.fit.dead_time + shift * step, (self.fit.poles, self.fit.numerator)
            here, later, longer = response_slopes(
                problem.drive, data.known, at, *model, _SHIFT * step, stretch
            )
            return here, step * later, longer

        return matched(problem.data, moved, own, own, _REACH, step)


def fit_sampled(
    outputs: Sequence[FloatArray], inputs: Sequence[FloatArray], dt: float, requested: Requested
) -> SampledFit:
    """Estimate the dead time of one plant from records with any input that moves.

    Parameters
    ----------
    outputs, inputs : sequence of ndarray
        One of each for every record; outputs are NaN where a sample is missing.
    dt : float
        Sample time in s.
    requested : Requested
        By default orders up to 3 are tried, and dead times up to `SampledData.sought`.

    Notes
    -----
    The past before a record is represented by an initial state, which is eliminated together with
    level and drift; records that are `requested` as rested have neither, unless they ask for one.
    The input within the dead time before the record is unknown: samples for one and a half dead
    times of the best first-order model are left out, at most half of the record. If the residual is
    coloured, all structures are fitted again by generalised least squares [3]_: inputs and outputs
    are filtered by the residual's autoregressive model, which does not change a linear plant. A
    likelihood in such noise has many narrow maxima, and its ratio is no chi-square: the interval
    contains 95 % of the weight of the dead times as well (`posterior_of`; of 42 ramps in AR(0.9)
    noise 37 intervals hold, 31 without). Structures that are given remain those of equal weights
    where others rule them out in such noise: the residual is what they cannot describe.

    Where the residual is coloured a load is looked for, or two, that make it white (`loads`); all
    that is fitted then is the part in which they are.

    Of a record of more than `data.MOST_SAMPLES` a part is fitted. If the response ends within
    `condensed.MOST_LAGS` samples, all samples are fitted afterwards; if the plant is slower, means
    over blocks of samples, with which the part is longer (`stretch`).

    Records of a loop are fitted by lags, unless these are ruled out (`lags`).

    Where samples are missing, there is no filter, and the correlation of the residual is that of
    its samples as if they were neighbours: an average over the gaps, as it counts for the errors of
    slow parameters.
    """
    complete = not any(np.isnan(y).any() for y in outputs)
    if requested.loop and complete and plain_lags(requested):
        every = -(-max(y.size for y in outputs) // MOST_SAMPLES)
        found, fit, loads = fit_lags(cut(outputs, inputs, dt, every, requested.known), requested)
        if requested.forms or fit.better is None:
            fit = _at_rest(found.data, _of_measured(found, fit, found.noise))
            of_fit = explained(found.fit), found.noise, None, loads, found.quantum
            return SampledFit(fit, found.data, *of_fit)
    structures = requested.structures
    # How long a plant must be seen is a question to all structures.
    every, part = samples_in_a_block(outputs, inputs, dt, replace(requested, structures=None))
    if part is None or structures is not None:
        data = cut(outputs, inputs, dt, every, requested.known, requested.rested)
        part = fit_stretch(data, structures or ORDERS, requested)
    data, stretch = part.data, part.fit
    fits, sums = stretch, None
    long = any(y.size > every * kept.size for y, kept in zip(outputs, data.outputs, strict=True))
    # More samples do not take the rounding away.
    if long and complete and not (part.loads or part.quantum):
        y, u = (
            [x / scale for x, scale in zip(signals, data.scales, strict=True)]
            for signals in (outputs, inputs)
        )
        of_all = _of_all_samples(y, u, dt, stretch, requested)
        if of_all is not None:
            fits, sums = of_all
    if structures is None and fits.best.structure.order == ORDERS[-1].order and Rule.MORE_LAGS.on:
        fits = extended(fits, MORE_LAGS)
    others = Compared()
    if structures is not None and requested.fastest is None and requested.compared:
        # On the part also if all samples were fitted: what is ruled out there is ruled out in any
        # case. The residual may be what a structure cannot describe, and is then no noise.
        filtered = part if sums is not None else made_white(part, requested)
        others = other_structures(filtered.fit, partial(filtered.fit_of, ORDERS))
        if others.better is None and filtered is not part:
            part, data, fits = filtered, filtered.data, filtered.fit
    if part.quantum:
        fits = replace(fits, rounded=part.rounding)
    white = fits.correlation <= WHITE
    if structures is None and requested.fastest is None:
        chains = chains_of(fits)
        flows = flows_of(fits, chains)
        # Ten lags in a sweep look like a flow, which then takes their dead time (benchmarks.worlds,
        # swept_wall).
        fit = likelihood_fit(fits, adequate=white, chains=chains, flows=flows, follow=False)
    else:
        fit = fit_requested(
            fits, requested, adequate=white, is_noise=lambda _, correlation: correlation <= WHITE,
            others=others,
        )  # fmt: skip
    if sums is not None:
        later = data.after(fit.dead_time)
        if later.starts > data.starts:
            part, data = replace(part, data=later), later
        fit = _of_measured(part, fit)
    elif part.noise.size > 1:
        fit = replace(_of_measured(part, fit, part.noise), unweighted=part.unweighted)
        if fit.structure in fit.points:
            _, low, high = posterior_of(fit.points[fit.structure], fits.variance)
            fit = replace(fit, low=min(fit.low, low), high=max(fit.high, high))
    elif part.loads:
        fit = _of_measured(part, fit)
    elif fit.distributed.chain:
        left = correlation_time(fits.window.output - fit.fitted)
        fit = replace(fit, residual=fit.residual._replace(correlation=left), adequate=left <= WHITE)
    correlation = fit.residual.correlation
    # There is no baseline for the noise; correlation is estimated from means over bins.
    residual = fit.residual._replace(normalized_rms=float(np.sqrt(correlation)))
    close = fit.close + close_to("adequate", correlation, WHITE)
    fitted = fit.fitted * np.repeat(data.scales, data.counts)
    fit = _at_rest(data, replace(fit, residual=residual, close=close, fitted=fitted))
    return SampledFit(fit, data, explained(stretch), part.noise, sums, part.loads, part.quantum)


def _of_measured(
    part: SampledWindow, fit: OutputErrorEstimate, noise: FloatArray | None = None
) -> OutputErrorEstimate:
    """Describe a fit of filtered or condensed records in terms of those that were measured."""
    window = window_of(part.data.without_loads)
    parameters = np.append(fit.dead_time, parameters_from_poles(fit.poles))
    fitted = modelled(part.data, parameters, fit.numerator)
    measured = replace(part.fit, window=window, problem=window.problem)
    followed = followed_by(measured, Candidate(fit.structure, parameters, 0.0), fit.numerator)
    complete = followed_percent(part.data.edges[1:-1], window.output, fitted)
    left = winsorised_sigma(window.output - fitted, 0.0)
    return replace(
        fit,
        fitted=fitted,
        followed=followed._replace(complete=complete),
        residual=fit.residual._replace(std=left, noise=noise),
    )


def _at_rest(data: SampledData, fit: OutputErrorEstimate) -> OutputErrorEstimate:
    """Tell how much of the output a simulation follows: at rest at the first input, or its mean.

    It is that which follows more: what came before is not known.
    """
    rest = tuple(u - u[0] for u in data.inputs)
    problem = replace(data.without_loads, inputs=rest).problem
    parameters = np.append(fit.dead_time, parameters_from_poles(fit.poles))
    left = problem.data - respond(problem.drive, data.known, fit.numerator, parameters)
    edges = data.edges[1:-1]
    alone = problem.data - left + levels(edges, left)
    simulated = max(fit.followed.simulated, followed_percent(edges, problem.data, alone))
    return replace(fit, followed=fit.followed._replace(simulated=simulated))


def _of_all_samples(
    outputs: Sequence[FloatArray],
    inputs: Sequence[FloatArray],
    dt: float,
    stretch: WindowFit,
    requested: Requested,
) -> tuple[WindowFit, Condensed] | None:
    """Fit all samples of long records, condensed; None if the response is too long for that.

    A part may not tell how long it is: there are more lags until the responses of models end within
    them, and until more of them leave no less unexplained.
    """
    found = None
    needed = _lags_needed(stretch, dt)
    if needed > MOST_LAGS:
        return None
    lags = min(max(int(np.ceil(_MORE * needed)), _LEAST_LAGS), MOST_LAGS)
    stretch = replace(stretch, scales=replace(stretch.scales, dt=dt))
    while (sums := condensed(outputs, inputs, dt, lags, huber=requested.huber)) is not None:
        fits = _fit_condensed(sums, stretch, requested.known)
        needed = _lags_needed(fits, dt)
        if needed <= lags:
            if found is not None and fits.correlation > _LESS * found[0].correlation:
                break
            found = fits, sums
        if lags == MOST_LAGS or (needed <= lags and fits.correlation <= 1):
            break
        lags = min(int(np.ceil(_MORE * needed)) if needed > lags else 2 * lags, MOST_LAGS)
    return found


def _lags_needed(fits: WindowFit, dt: float) -> float:
    """Samples until the response of the best model has ended, and of others with its total delay.

    These have the shortest dead time that the data allow, and a longer lag.
    """
    best = fits.best
    reach = Z_95 * dead_time_error(fits.problem, best, fits.variance)
    low, total = max(best.dead_time - reach, 0.0), best.dead_time + lag_sum(best.poles, np.ones(1))
    other = (BEYOND * low + DIED_AWAY * (total - low)) / dt
    return float(max(response_samples(best, dt), min(other, MOST_LAGS / _MORE)))


def _fit_condensed(sums: Condensed, stretch: WindowFit, known: KnownFactor) -> WindowFit:
    """Fit all structures to all samples, starting from the fit of a part."""
    m, lags = sums.drive.factor.shape
    # What has not died away at the last lag is missing.
    scales = replace(stretch.scales, slowest=DIED_AWAY / (lags * stretch.scales.dt))
    problem = Problem(sums.data, np.ones(m), sums.drive, np.empty((m, 0)), known)
    starts = {s: [fit.parameters] for s, fit in stretch.candidates.items()}
    fits = search(problem, starts, scales, starts=starts)
    fits = converged(problem, fits, scales, sums.noise**2, sums.samples)
    closest = min(fits.values(), key=lambda candidate: candidate.cost)
    freedom = max(m - 2 - closest.structure.free, 1)
    # Residual above the noise: what no structure explains is treated as noise of that size.
    excess = closest.cost / freedom / sums.noise**2
    colour = excess if excess > 1 + _CLEARLY * np.sqrt(2 / freedom) else 1.0
    window = replace(window_of_rows(problem), samples=sums.samples)
    return with_known_noise(window, fits, scales, sums.noise, colour)
