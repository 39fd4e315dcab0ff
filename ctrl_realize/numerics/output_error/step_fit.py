"""Output-error estimate of a dead time from a step record, with a realistic interval.

The rule:

0. The output before the step is modelled as noise, hum, a drift, or the free response of the
   plant, as chosen by the information criterion; a free response needs strong evidence, a drift
   very strong evidence. Neither is taken if the gain is then not determined.
1. All structures are fitted to the whole record; the one with the lowest information criterion
   is the model, and its residual is compared with the noise before the step. A residual that is not
   much larger counts as noise, too, if it is white or no larger than that long after the step. If
   the residual is at noise level and the noise was coloured before the step already, all structures
   are fitted again with prewhitening.
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
   to three poles of the first 63 % and of all of it. The dead time is their median.
4. The interval then spans these and a third-order model of the first 15 % (more lags, less dead
   time), without the lowest: a fit that fails takes dead time for lag.
5. No dead time is later than the visible onset of the output.
6. Of a slow pole that leaves the gain undetermined, the fastest value that is not ruled out is
   taken, so that the model extrapolates little.

Points 0 to 2 are based on the information criterion [3]_, profile likelihoods [1]_ and multimodel
inference [2]_. Points 3 to 5 are our own: estimates whose errors have different causes (threshold,
few lags, late misfit), so that their median is wrong only if most of them are; such methods are
compared in [4]_. They were tested on simulated and real plants, see docs/accuracy.md;
`benchmarks.ablation` switches each of them off.

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
.. [5] R. E. Kass and A. E. Raftery, Bayes factors, J. Amer. Statist. Assoc. 90 (1995) 773-795,
   doi:10.1080/01621459.1995.10476572.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..constants import Z_95
from ..parameters.physical import without_errors
from ..parameters.process_form import ProcessForm
from ..separable.compared_fits import at_dead_time
from ..separable.dispersion.fit import DispersedFlow
from ..separable.lag_chains import LagChain
from ..separable.structures import (
    ALL_STRUCTURES,
    PLAUSIBLE,
    SIMPLE_STRUCTURES,
    Candidate,
    choose,
    needless_parameters,
)
from ..separable.varpro import KnownFactor, Structure, evaluate, respond
from ..separable.window import WindowFit, among, fit_window
from .better_structure import better_structure
from .coloured import in_coloured_noise
from .extrapolation import least_extrapolating
from .flat_likelihood import closer, later, moved, pinned, with_close_decision
from .interval import likelihood_fit
from .margins import close_to
from .process_models import process_fit
from .profiles import profile_of
from .result import DelayInterval, OutputErrorEstimate, RobustKey, assembled
from .rounded import in_rounded_data
from .selection import chains_of, flows_of
from .step_data import StepData, settled_at, step_scales, stop_at, window

ADEQUATE = 1.3
"""Residual over noise, in means over bins, up to which a model is taken for right: noise that is
known from 30 samples at rest is off by 13 % (one standard deviation). Ablation: views (the
likelihood always)."""

_OUTLIER = 3.0  # standard deviations at which residuals are cut where explanations are compared

_STRONG = 6.0
"""Difference of criteria that is strong evidence ([5]_, section 3.2). Ablation: strong evidence of
a motion."""

_LAGS = (Structure(1, 1), Structure(2, 2), Structure(3, 3))
"""Structures of the early models. Ablation: views (the likelihood always)."""

_LOUDER = 4.0
"""How much louder noise may be after the step than before it: slow noise shows little of itself in
a short rest (AR(1) noise with a pole at 0.98 and 60 samples: four times less). Ablation: louder
noise after the step."""
_MOST_TO_COME = 10.0
"""How much more a free response may move after the step than before it. One that hardly moves
before it takes the place of the response to the step, whose gain is then lost: 50 and more in joint
fits of 13 step records of a two-cart drive, with gains up to three times too large; 0.7 to 1 for
simulated records that were moving."""
_MOST_OF_A_BEND = 2.0
"""The same where the baseline has risen and fallen: the extremes of the motion are in it then. 0.4
to 0.7 for simulated pulses just before the record, 1.7 for a heater in a box."""
_FEWEST_LATE = 8  # bins in the later half of what comes when the response has settled


def fit_step_record(
    data: StepData,
    *,
    structures: Sequence[Structure] | None = None,
    forms: Sequence[ProcessForm] = (),
    latest: float | None = None,
    known: KnownFactor | None = None,
    huber: bool = True,
    whiten: bool = True,
) -> OutputErrorEstimate:
    """Estimate the dead time of a step record.

    Parameters
    ----------
    data : StepData
        With a visible onset.
    structures : sequence of Structure, optional
        Default: orders 1 to 5, relative degrees 1 to the order. If structures are given, the dead
        time is that of the best of them, adequate or not.
    forms : sequence of ProcessForm, optional
        Process models to which the choice is limited; `structures` are theirs.
    latest : float, optional
        Largest dead time, in s.
    known : KnownFactor, optional
        Dynamics in cascade that are not part of the plant.
    huber : bool, optional
        Huber's loss (k = 1.345) instead of least squares.
    whiten : bool, optional
        Prewhiten the data if the baseline noise is coloured.
    """
    factor = known or KnownFactor()
    tried = ALL_STRUCTURES if structures is None else tuple(structures)
    ways = data.explanations()
    if len(ways) > 1:
        few = SIMPLE_STRUCTURES if structures is None else tried
        data = _explained(
            [(way, _fit_until(way, way.output.size, few, latest, factor, huber)) for way in ways]
        )
    fits = _fit_until(data, data.output.size, tried, latest, factor, huber)
    if _takes_the_gain(data, fits, factor):
        data = replace(ways[-1], drift=0.0, relaxing=False)
        fits = _fit_until(data, data.output.size, tried, latest, factor, huber)
    adequate = _is_noise(data, fits)
    near = close_to("adequate", fits.normalized_rms, ADEQUATE * data.colour)
    plain = fits
    if adequate and whiten:
        fits = in_coloured_noise(fits, data)
    if structures is not None:
        better = better_structure(
            plain,
            plain.best,
            lambda: _fit_until(data, data.output.size, SIMPLE_STRUCTURES, latest, factor, huber),
        )
        if forms:
            level = max(ADEQUATE * data.colour, fits.normalized_rms if adequate else 0.0)
            return process_fit(
                fits,
                forms,
                is_noise=lambda rms, _: rms <= level,
                better=better,
                relaxing=data.relaxing,
                near=near,
            )
        given = likelihood_fit(
            fits, adequate=adequate, relaxing=data.relaxing, better=better, near=near
        )
        rounded = adequate and data.coarse
        return in_rounded_data(given, fits, data.quantum) if rounded else given
    likely: OutputErrorEstimate | None = None
    if adequate:
        assert data.motion is not None
        chains = chains_of(fits)
        likely = likelihood_fit(
            fits,
            adequate=True,
            chains=chains,
            flows=_flows(data, fits, chains),
            onset=data.motion.onset * data.dt,
            may_stick=not data.coarse,  # what is rounded begins with a jump
            relaxing=data.relaxing,
            near=near,
        )
        if data.coarse:
            likely = in_rounded_data(likely, fits, data.quantum)
        at_the_end = pinned(likely, data, plain)
        likely = with_close_decision(likely, at_the_end)
        if at_the_end > 1:
            return likely
    early = _fit_until(data, stop_at(data, 0.15), _LAGS, latest, factor, huber)
    if likely is not None:
        nearer = closer(early, _LAGS[-1], likely)
        likely = with_close_decision(likely, nearer)
        if nearer > 1:
            return likely
    simple = among(plain, SIMPLE_STRUCTURES)
    chosen = simple.best_of({s: simple.criterion[s] for s in SIMPLE_STRUCTURES})
    rise = _fit_until(data, stop_at(data, 0.63), SIMPLE_STRUCTURES, latest, factor, huber)
    estimates = _views(data, early, rise, chosen, latest)
    if likely is not None:
        agreed = later(likely, estimates)
        likely = with_close_decision(likely, agreed)
        return likely if agreed > 1 else moved(likely, plain, estimates)
    found = _robust_fit(simple, chosen, estimates, relaxing=data.relaxing)
    return replace(found, close=near)


def _explained(ways: list[tuple[StepData, WindowFit]]) -> StepData:
    """Choose between models of the samples before the step, by an information criterion.

    A motion that goes on after the step needs strong evidence: it changes the gain of the model. A
    drift, which goes on to the end of the record, needs very strong evidence ([5]_).
    """
    closest = min((fits for _, fits in ways), key=lambda fits: fits.sigma)
    worst = _OUTLIER * closest.sigma

    def criterion(way: tuple[StepData, WindowFit]) -> float:
        data, fits = way
        best = fits.best.structure
        error = fits.window.output - fits.window.predict(fits.problem, fits.best)
        squares = float(np.sum(np.clip(error, -worst, worst) ** 2))
        terms = best.order + best.zeros + (best.order if data.relaxing else bool(data.drift))
        value = squares / closest.variance + closest.penalty * terms + needless_parameters(best)
        return value + (PLAUSIBLE if data.drift else _STRONG if data.relaxing else 0.0)

    return min(ways, key=criterion)[0]


def _takes_the_gain(data: StepData, fits: WindowFit, known: KnownFactor) -> bool:
    """Whether a motion before the step takes the place of the response to it.

    Together with a slow pole, which is its opposite, it leaves the gain without a value or with the
    wrong sign. Ablation: motion that takes the gain.
    """
    if not (data.drift or data.relaxing):
        return False
    if data.relaxing and not _dies_away(data, fits, known):
        return True
    static = fits.static(fits.best)
    return not static.resolved or static.reached * static.gain < 0


def _dies_away(data: StepData, fits: WindowFit, known: KnownFactor) -> bool:
    """Whether the free response in the best model is mostly over when the step comes."""
    best = fits.best
    state = evaluate(fits.problem, best.structure, best.parameters[None])
    forced = respond(fits.window.drive, known, state.numerator[0], best.parameters)
    free = fits.window.predict(fits.problem, best) - forced
    most = _MOST_OF_A_BEND if data.bend else _MOST_TO_COME
    return bool(np.ptp(free[data.edge :]) <= most * np.ptp(free[: data.edge]))


def _is_noise(data: StepData, fits: WindowFit) -> bool:
    """Whether the residual is at the noise level before the step, or at that long after it."""
    if fits.normalized_rms <= ADEQUATE * data.colour:
        return True
    if fits.normalized_rms > ADEQUATE * data.colour * _LOUDER:
        return False
    if fits.correlation == 1.0:
        return True
    state = evaluate(fits.problem, fits.best.structure, fits.best.parameters[None])
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


def _flows(data: StepData, fits: WindowFit, chains: Sequence[LagChain]) -> Sequence[DispersedFlow]:
    """Dispersion, unless rounding decides on how smoothly a response begins."""
    return [] if data.coarse else flows_of(fits, chains)


def _robust_fit(
    fits: WindowFit,
    chosen: Candidate,
    estimates: tuple[tuple[RobustKey, float], ...],
    *,
    relaxing: bool,
) -> OutputErrorEstimate:
    """Determine dead time and interval from the delay estimates (points 3 and 4 of the rule)."""
    dead_time = float(np.median([at for _, at in estimates[:-1]]))
    dead_times = np.sort([at for _, at in estimates])
    low, high = float(dead_times[1]), float(dead_times[-1])
    profiles = {chosen.structure: profile_of(fits, chosen)}
    fixed = at_dead_time(fits.problem, chosen, fits.scales, dead_time)
    fixed, static = least_extrapolating(fits, fixed, dead_time_fixed=True)
    interval = DelayInterval(low, high, (high - low) / (2 * Z_95))
    own = profiles[chosen.structure]
    found = assembled(
        fits, fixed, False, estimates, profiles, interval, own, static=static, relaxing=relaxing
    )
    return replace(
        found, process=found.process._replace(parameters=without_errors(found.process.parameters))
    )


def _fit_until(
    data: StepData,
    stop: int,
    structures: Sequence[Structure],
    latest: float | None,
    known: KnownFactor,
    huber: bool,
) -> WindowFit:
    return fit_window(
        window(data, stop, known),
        structures,
        step_scales(data, stop, latest),
        (data.sigma, data.quantum),
        huber,
    )


def _views(
    data: StepData, early: WindowFit, rise: WindowFit, fits: Candidate, latest: float | None
) -> tuple[tuple[RobustKey, float], ...]:
    """Six estimates in s with independent errors; the sixth only widens the interval."""
    assert data.motion is not None
    onset = data.motion.onset * data.dt
    one, two, three = (early.candidates[lags].dead_time for lags in _LAGS)
    return (
        ("onset", onset if latest is None else min(onset, latest)),
        ("one_lag_early", one),
        ("two_lags_early", two),
        # by the criterion alone: the first part of a response does not show the gain
        ("model_of_rise", rise.candidates[choose(rise.criterion)].dead_time),
        ("model_of_record", fits.dead_time),
        ("three_lags_early", three),
    )
