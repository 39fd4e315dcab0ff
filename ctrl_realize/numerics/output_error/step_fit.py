"""Output-error estimate of a dead time from a step record, with a realistic interval.

The rule:

0. The output before the step is modelled as noise, hum, a drift, or the free response of the
   plant, as chosen by the information criterion; a free response needs strong evidence, a drift
   very strong evidence. Neither is taken if the gain is then not determined.
1. All structures are fitted to the whole record; the one with the lowest information criterion
   is the model, and its residual is compared with the noise before the step. A larger residual
   counts as noise, too, if it is white, or not much larger and no larger than that long after the
   step. If the residual is at noise level and the noise was coloured before the step already, all
   structures are fitted again with prewhitening.
2. If the residual is at noise level, the dead time is that of the model, and its interval spans the
   95 % profile-likelihood intervals of all structures that the data cannot rule out, including
   chains of four to eight nearly equal lags, diffusion and axial dispersion. If dispersion fits
   clearly better than any lags, and rounding is not coarse, its dead time is used. A zero can
   imitate a smooth onset: if the best structure has one, the interval extends to a sample after the
   visible onset, and to three times the distance between dead time and onset before the dead time.
   If it has none, the interval extends to the end of the likelihood of a stem behind the lags that
   sticks and then jumps, unless that is ruled out or rounding is coarse.
   Where the noise is much less than a step of the converter, dead time and model are those of the
   likelihood of rounded data.
   Where the residual is correlated or coarsely rounded, the likelihood may be flat down to the
   earliest dead time and have its maximum there, although the first 15 % of the response alone tell
   the dead time more closely: the dead time is then the median of the estimates of point 3, if most
   of them agree; the interval is not changed.
3. Otherwise a likelihood does not describe the error. Five estimates are made: the visible onset, a
   first- and a second-order model of the first 15 % of the response, and the best models of up
   to three poles (or five, if these miss twice as much) of the first 63 % and of all of it. The
   dead time is their median.
4. The interval then spans these and a third-order model of the first 15 % (more lags, less dead
   time), without the lowest: a fit that fails takes dead time for lag. It contains the visible
   onset, and reaches as far on both sides as the time that the model takes to move by what it
   misses of the output.
5. No dead time is later than the visible onset of the output, or than 63 % of the response where
   the output may have been moving before, and was seen at rest for less time than that. In slow
   noise, a swing of which may pass for the onset, the search is extended to 63 % of the response
   where its best dead time is at that bound.
6. Of a slow pole that leaves the gain undetermined, the fastest value that is not ruled out is
   taken, so that the model extrapolates little.

Points 0 to 2 are based on the information criterion [3]_, profile likelihoods [1]_ and multimodel
inference [2]_. Points 3 to 5 are our own: estimates whose errors have different causes (threshold,
few lags, late misfit), so that their median is wrong only if most of them are; such methods are
compared in [4]_. They were tested on simulated and real plants, see docs/accuracy.md;
`benchmarks.ablation` switches each of them off.

A residual that is correlated in an unknown way, or coarsely rounded, is one of fewer independent
samples [5]_, whose likelihood may hardly depend on a short dead time.

References
----------
.. [1] D. J. Venzon and S. H. Moolgavkar, A method for computing profile-likelihood-based confidence
   intervals, Appl. Statist. 37 (1988) 87-94, doi:10.2307/2347496.
.. [2] K. P. Burnham and D. R. Anderson, Model Selection and Multimodel Inference, 2nd ed., Springer
   2002, chapter 4 (Multimodel inference), doi:10.1007/b97636.
.. [3] G. Schwarz, Estimating the dimension of a model, Ann. Statist. 6 (1978) 461-464,
   doi:10.1214/aos/1176344136.
.. [4] S. Bjorklund and L. Ljung, A review of time-delay estimation techniques, Proc. 42nd IEEE
   Conf. Decision and Control (2003) 2502-2507, doi:10.1109/CDC.2003.1272997.
.. [5] C. J. Geyer, Practical Markov chain Monte Carlo, Statist. Sci. 7 (1992) 473-483,
   doi:10.1214/ss/1177011137.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache, partial

import numpy as np

from ..constants import SMALLEST, Z_95
from ..engine.eliminate import evaluate
from ..engine.modal import respond
from ..engine.problem import Structure
from ..engine.profile import dead_time_error
from ..engine.structures import (
    ALL_STRUCTURES,
    SIMPLE_STRUCTURES,
    Candidate,
    Scales,
    at_dead_time,
    choose,
)
from ..engine.window_fit import WindowFit, among, fit_window, with_noise_of_residual
from ..families.physical import process_parameters
from ..rules import Rule
from ..signals.edges import difference_noise, level_error
from ..signals.load_step import LoadStep
from ..signals.noise import rounding_of_level
from ..signals.noise_model import continues
from .coloured import in_coloured_noise
from .interval import likelihood_fit, profile_of
from .load import load_of
from .other_structures import Compared, Requested, other_structures
from .process_models import fit_requested
from .result import AT_BOUND, DelayInterval, OutputErrorEstimate, RobustKey, assembled, followed_by
from .rounded import in_rounded_data
from .selection import CloseDecision, chains_of, close_to, flows_of, least_extrapolating
from .step_data import StepData, fitted_from_rest, settled_at, step_scales, stop_at, window

ADEQUATE = 1.3
"""Residual over noise, in means over bins, up to which a model is taken for right: noise that is
known from 30 samples at rest is off by 13 % (one standard deviation). Ablation: views (the
likelihood always)."""

_LAGS = (Structure(1, 1), Structure(2, 2), Structure(3, 3))
"""Structures of the early models. Ablation: views (the likelihood always)."""

_LOUDER = 4.0
"""How much louder slow noise may be after the step than before it: a short rest shows little of it
(AR(1) noise with a pole at 0.98 and 60 samples: four times less). White noise may be louder by any
factor: that of a gauge grows with the signal, and no misfit is white. Ablation: louder noise after
the step."""
_FAR_POORER = 2.0
"""Residual of models of up to three poles over that of up to five, from which on these are needed
though none is at noise level. 1.0 to 1.7 on measured plants, 2.5 on one canal, 8.4 for an arm that
swings in two modes (fit 73.6 with three poles, 96.9 % with five). Ablation: simple models alone."""
_FEWEST_LATE = 8  # bins in the later half of what comes when the response has settled
_PINNED = 0.25
"""Distance of the dead time from the earliest one, where a likelihood interval ends, in its widths,
up to which it counts as pinned there. Ablation: estimates against a pinned likelihood."""


def fit_step_record(
    data: StepData, requested: Requested | None = None
) -> tuple[StepData, OutputErrorEstimate]:
    """Estimate the dead time of a step record.

    Returned with the estimate are the data with the model of the samples before the step that was
    chosen.

    Parameters
    ----------
    data : StepData
        With a visible onset.
    requested : Requested, optional
        By default orders 1 to 5 with relative degrees 1 to the order are tried; the noise is that
        of the baseline.
    """
    requested = requested or Requested()
    fit = partial(_fit_until, requested=requested)
    given, structures = data, requested.structures
    data, fits = fitted_from_rest(data, fit, structures or ALL_STRUCTURES, _is_noise)
    free = cache(partial(fit, data, data.output.size, ALL_STRUCTURES))
    loaded = None if data.load is not None else load_of(data, fits, fit, free, _is_noise)
    if loaded is not None and not loaded[0].early:
        load, part = loaded
        late = _late_path(data, load)
        load = replace(load, own_gain=late[0])
        data, found = fit_step_record(given.with_load(load, part), requested)
        if load.own_gain and found.drawn is not None:
            found = replace(found, drawn=replace(found.drawn, late=late))
        return data, replace(found, load=load)
    chosen = structures is None and requested.fastest is None
    if chosen:
        found = _free_choice(data, fits, fit, requested.whiten)
        # In slow noise a swing of it may be taken for the visible onset.
        beyond = found.residual.whitened or found.residual.correlation > 1
    else:
        found = _given_structures(data, fits, free, requested)
        # That of an approximation includes lags, and may be after the visible onset.
        beyond = found.better is not None
    later = min(fits.scales.onset + fits.scales.rise, requested.latest or np.inf)
    at_bound = AT_BOUND * found.latest < found.dead_time and found.latest < later
    alone = len(data.edges) == 1  # what several responses differ in would be followed as well
    if alone and at_bound and beyond and (not chosen or Rule.NOISE_ONSET.on):
        return fit_step_record(given, replace(requested, latest=later, beyond=True))
    if found.static is not None:
        found = replace(found, rounding=_input_error(data) * abs(found.static.gain))
    if data.coarse:  # both levels of a step are rounded, however many samples they have
        noise = found.residual.rounded or np.sqrt(max(data.sigma**2 - data.quantum**2 / 12, 0.0))
        level = rounding_of_level(float(noise), data.quantum)
        level *= np.sqrt(2) / float(np.ptp(data.input))
        found = replace(found, rounding=float(np.hypot(found.rounding, level)))
    return data, found if loaded is None else replace(found, load=loaded[0])


def _late_path(data: StepData, load: LoadStep) -> tuple[float, float, float]:
    """Gain, delay and lag of a load if it is a late part of the response to the step before it.

    A gain of 0 where such a part would have followed another step as well.
    """
    times = data.dt * np.array([index for index, _ in data.edges])
    own = int(np.flatnonzero(times <= load.time)[-1])
    since = load.time - times[own]
    if np.any(np.delete(times, own) + since + load.lag <= data.clock[-1]):
        return 0.0, since, load.mean_lag
    index, samples = data.edges[own]
    height = float(data.input[index + samples] - data.input[index - 1])
    return load.size / height, since, load.mean_lag


def _input_error(data: StepData) -> float:
    """Standard error of the height of steps, over that height, from noise of the recorded input."""
    first, (last, samples) = data.edges[0][0], data.edges[-1]
    after = data.input.size - last - samples
    return level_error(difference_noise(data.input), first, after) / float(np.ptp(data.input))


def _given_structures(
    data: StepData, fits: WindowFit, free: Callable[[], WindowFit], requested: Requested
) -> OutputErrorEstimate:
    """Estimate the dead time by the likelihood of the best of given structures, adequate or not."""
    near, noisy = _close_to_noise(data, fits), _at_noise_level(data, fits)
    adequate, fits = noisy is not None, noisy or fits
    compared = requested.fastest is None and requested.compared
    others = other_structures(fits, free) if compared else Compared()
    if adequate and requested.whiten:
        fits = in_coloured_noise(fits, data)
    if adequate and others.better is None:
        fits = with_noise_of_residual(fits)
    level = max(ADEQUATE * data.colour, fits.normalized_rms if adequate else 0.0)
    given = fit_requested(
        fits, requested, adequate=adequate, is_noise=lambda rms, _: rms <= level, others=others,
        near=near,
    )  # fmt: skip
    plain = adequate and requested.fastest is None and not requested.forms
    return in_rounded_data(given, fits, data.quantum) if plain and data.coarse else given


def _free_choice(
    data: StepData, plain: WindowFit, fit: Callable[..., WindowFit], whiten: bool
) -> OutputErrorEstimate:
    """Estimate the dead time if no structures are given (points 1 to 5 of the rule)."""
    assert data.motion is not None
    near = _close_to_noise(data, plain)
    likely: OutputErrorEstimate | None = None
    noisy = _at_noise_level(data, plain)
    if noisy is not None:
        fits = in_coloured_noise(noisy, data) if whiten else noisy
        fits = with_noise_of_residual(fits)
        chains = chains_of(fits)
        # Rounding decides on how smoothly a response begins.
        likely = likelihood_fit(
            fits,
            adequate=True,
            chains=chains,
            flows=[] if data.coarse and Rule.NO_DISPERSION.on else flows_of(fits, chains),
            onset=data.motion.onset * data.dt,
            may_stick=not data.coarse,  # what is rounded begins with a jump
            near=near,
        )
        if data.coarse:
            likely = in_rounded_data(likely, fits, data.quantum)
        at_the_end = _pinned(likely, data, plain)
        likely = _with_close_decision(likely, at_the_end)
        if at_the_end > 1 or not Rule.PINNED.on:
            return likely
    early = fit(data, stop_at(data, 0.15), _LAGS)
    if likely is not None:
        nearer = _closer(early, _LAGS[-1], likely)
        likely = _with_close_decision(likely, nearer)
        if nearer > 1:
            return likely
    kept = SIMPLE_STRUCTURES if _simple_ones_suffice(plain) else tuple(plain.candidates)
    simple = among(plain, kept)
    chosen = simple.best_of({s: simple.criterion[s] for s in kept})
    rise = fit(data, stop_at(data, 0.63), SIMPLE_STRUCTURES)
    estimates = _views(data, early, rise, chosen, plain.scales)
    if likely is not None:
        agreed = _later(likely, estimates)
        likely = _with_close_decision(likely, agreed)
        return likely if agreed > 1 else _moved(likely, plain, estimates)
    return replace(_robust_fit(simple, chosen, estimates), close=near)


def _simple_ones_suffice(fits: WindowFit) -> bool:
    """Whether structures of up to three poles follow the output about as well as any."""
    least = min(c.cost for c in fits.candidates.values())
    simple = min(fits.candidates[s].cost for s in SIMPLE_STRUCTURES)
    return simple <= _FAR_POORER**2 * least or not Rule.SIMPLE.on


def _close_to_noise(data: StepData, fits: WindowFit) -> tuple[CloseDecision, ...]:
    return close_to("adequate", fits.normalized_rms, ADEQUATE * data.colour)


def _at_noise_level(data: StepData, fits: WindowFit) -> WindowFit | None:
    """Fits of which the best is at noise level: all, or those that are if it is not.

    Where the residual of the richest structure is correlated over much of the record, few samples
    count as independent, and the criterion prefers a simpler one that misses the output.
    """
    if _is_noise(data, fits, fits.best):
        return fits
    left = {s: c for s, c in fits.candidates.items() if _is_noise(data, fits, c)}
    if not left:
        return None
    found = replace(fits, candidates=left, criterion={s: fits.criterion[s] for s in left})
    return replace(found, normalized_rms=fits.misfit(found.best))


def _is_noise(data: StepData, fits: WindowFit, candidate: Candidate) -> bool:
    """Whether the residual is white, at the noise level before the step, or at that long after."""
    rms, level = fits.misfit(candidate), ADEQUATE * data.colour
    white = fits.correlation == 1.0 and candidate is fits.best
    noise = rms <= level or (
        (white or (rms <= level * _LOUDER and _is_louder_noise(data, fits, candidate)))
        and Rule.LOUDER.on
    )
    return Rule.LIKELIHOOD.on if noise else not Rule.VIEWS.on


def _is_louder_noise(data: StepData, fits: WindowFit, candidate: Candidate) -> bool:
    """Whether a residual is slow noise that the rest does not show, or as large later."""
    error = fits.residual(candidate)
    if continues(error[: data.edge], error[data.edge :], ADEQUATE) and Rule.GOES_ON.on:
        return True
    state = evaluate(fits.problem, candidate.structure, candidate.parameters[None])
    assert fits.window.bins is not None
    first = fits.window.bins.first
    settled = settled_at(data)
    late = np.asarray(state.residual[0][first >= settled])
    moving = state.residual[0][(first >= data.edge) & (first < settled)]
    if late.size < 2 * _FEWEST_LATE:
        return False
    # The error of a wrong model decays: it is in the first half.
    late = late[late.size // 2 :]
    return bool(np.mean(moving**2) <= ADEQUATE**2 * np.mean(late**2))


def _robust_fit(
    fits: WindowFit, chosen: Candidate, estimates: tuple[tuple[RobustKey, float], ...]
) -> OutputErrorEstimate:
    """Determine dead time and interval from the delay estimates (points 3 and 4 of the rule)."""
    dead_time = float(np.median([at for _, at in estimates[:-1]]))
    dead_times = np.sort([at for _, at in estimates])
    onset = dict(estimates)["onset"]
    profiles = {chosen.structure: profile_of(fits, chosen)}
    fixed = at_dead_time(fits.problem, chosen, fits.scales, dead_time)
    fixed, static = least_extrapolating(fits, fixed, dead_time_fixed=True)
    unseen = _unseen(fits, fixed) if Rule.MISFIT.on else 0.0
    low = max(min(float(dead_times[1]), onset, dead_time - unseen), fits.scales.earliest)
    high = min(max(float(dead_times[-1]), dead_time + unseen), fits.scales.latest)
    interval = DelayInterval(low, high, (high - low) / (2 * Z_95))
    own = profiles[chosen.structure]
    found = assembled(fits, fixed, False, estimates, profiles, interval, own, static=static)
    return replace(found, process=found.process.without_errors())


def _unseen(fits: WindowFit, model: Candidate) -> float:
    """Time in s that a model takes to move by what it misses of the output (root mean square).

    Estimates that share this misfit may agree by far more closely than they are right: on a canal
    171 to 178 samples, where the dead time is 166. Ablation: time to move by the misfit.
    """
    window = fits.window
    state = evaluate(fits.problem, model.structure, model.parameters[None])
    forced = respond(window.drive, fits.problem.known, state.numerator[0], model.parameters)
    moved = np.abs(forced[window.start :]) > np.std(fits.residual(model)[window.start :])
    since = float(np.argmax(moved)) * window.spacing * fits.scales.dt
    return max(since - model.dead_time, 0.0) if moved.any() else fits.scales.latest


def _fit_until(
    data: StepData, stop: int, structures: Sequence[Structure], requested: Requested
) -> WindowFit:
    # A structure that is given may be an approximation.
    given = requested.structures is not None and structures is not ALL_STRUCTURES
    apparent = given or requested.beyond
    return fit_window(
        window(data, stop, requested.known),
        structures,
        step_scales(data, stop, requested.latest, requested.earliest, apparent),
        (data.sigma, data.quantum),
        requested.huber and Rule.HUBER.on,
    )


def _views(
    data: StepData, early: WindowFit, rise: WindowFit, fits: Candidate, scales: Scales
) -> tuple[tuple[RobustKey, float], ...]:
    """Six estimates in s with independent errors; the sixth only widens the interval."""
    assert data.motion is not None
    onset = data.motion.onset * data.dt
    one, two, three = (early.candidates[lags].dead_time for lags in _LAGS)
    # by the criterion alone: the first part of a response does not show the gain
    of_rise = rise.candidates[choose(rise.criterion)].dead_time
    views: tuple[tuple[RobustKey, float, bool], ...] = (
        ("onset", max(min(onset, scales.latest), scales.earliest), Rule.VIEW_ONSET.on),
        ("one_lag_early", one, Rule.VIEW_ONE_LAG.on),
        ("two_lags_early", two, Rule.VIEW_TWO_LAGS.on),
        ("model_of_rise", of_rise, Rule.VIEW_RISE.on),
        ("model_of_record", fits.dead_time, Rule.VIEW_RECORD.on),
        ("three_lags_early", three, Rule.VIEW_THREE_LAGS.on),
    )
    amid = float(np.median([at for _, at, on in views[:-1] if on]))
    return tuple((key, at if on else amid) for key, at, on in views)


def _with_close_decision(found: OutputErrorEstimate, ratio: float) -> OutputErrorEstimate:
    """Add a decision on the source of the dead time to the close ones, if its ratio is near 1."""
    return replace(found, close=found.close + close_to("likelihood", ratio, 1.0))


def _pinned(found: OutputErrorEstimate, data: StepData, fits: WindowFit) -> float:
    """Below 1 if a likelihood is flat down to the earliest dead time, and its maximum there.

    So it may be where the residual is quantised, or correlated in a way that is not known.
    """
    white = not data.coarse and fits.correlation == 1.0
    lags = found.distributed.chain is None and not found.distributed.follows_flow
    if white or found.residual.whitened or not lags or found.low > fits.scales.earliest:
        return np.inf
    return float((found.dead_time - found.low) / max(_PINNED * (found.high - found.low), SMALLEST))


def _closer(early: WindowFit, lags: Structure, found: OutputErrorEstimate) -> float:
    """Below 1 if the first part of the response alone, with `lags`, tells the dead time better.

    Width of the interval that it gives, in that of the likelihood.
    """
    error = dead_time_error(early.problem, early.candidates[lags], early.variance)
    return float(2 * Z_95 * error / max(found.high - found.low, SMALLEST))


def _later(found: OutputErrorEstimate, estimates: tuple[tuple[RobustKey, float], ...]) -> float:
    """Below 1 if most delay estimates agree with each other that the output moves later."""
    dead_times = np.array([at for _, at in estimates[:-1]])
    middle = float(np.median(dead_times))
    apart = float(np.median(np.abs(dead_times - middle)))
    later = middle - found.dead_time
    return 2 * apart / later if later > 0 else np.inf


def _moved(
    found: OutputErrorEstimate, fits: WindowFit, estimates: tuple[tuple[RobustKey, float], ...]
) -> OutputErrorEstimate:
    """Put the dead time at the median of the delay estimates; the interval is not changed."""
    dead_time = float(np.clip(np.median([at for _, at in estimates[:-1]]), found.low, found.high))
    own = fits.candidates[found.structure]
    fixed = at_dead_time(fits.problem, own, fits.scales, dead_time)
    fixed, static = least_extrapolating(fits, fixed, dead_time_fixed=True)
    state = evaluate(fits.problem, fixed.structure, fixed.parameters[None])
    return replace(
        found,
        dead_time=dead_time,
        poles=fixed.poles,
        numerator=state.numerator[0],
        fitted=fits.window.predict(fits.problem, fixed),
        followed=followed_by(fits, fixed, state.numerator[0]),
        static=static,
        delay_estimates=estimates,
        process=replace(
            found.process,
            find=partial(
                process_parameters, fixed.poles, state.numerator[0], dead_time, fits.scales.length
            ),
        ),
    )
