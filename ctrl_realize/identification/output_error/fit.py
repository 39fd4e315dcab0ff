"""Output-error fit of raw records: dead time and model."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import Literal

import control as ct
import numpy as np

from ..._checks import one_of, positive
from ..._wording import named
from ...data import Record
from ...data.shown_units import in_shown_units
from ...delayed import DelayedStateSpace
from ...errors import DataError, OptionError
from ...numerics.arrays import FloatArray
from ...numerics.blas_threads import single_threaded
from ...numerics.engine.problem import Structure
from ...numerics.output_error.any_input.data import BEYOND, MOST_SAMPLES
from ...numerics.output_error.other_structures import Requested
from ...numerics.output_error.result import OutputErrorEstimate
from ...numerics.output_error.step_data import StepData, briefly_at_rest
from ...numerics.output_error.step_fit import fit_step_record
from ...numerics.rules import Rule
from ...numerics.validation.own_response import OwnResponse
from ...results import Flag
from ..process_structures import Structures, requested
from .actuated.alternatives import ASKED, Asked
from .actuated.fit import with_actuator
from .actuated.limits import (
    at_updates,
    fit_means_of_holds,
    fit_within_limits,
    fit_without_spikes,
    has_pulses,
    with_gaps_filled,
    with_held_input,
    without_codes,
    without_cut_noise,
)
from .any_input import fit_any_input
from .arguments import checked_records, edges_of, known_factor, on_common_axis, step_data_of
from .averaging import (
    aligned_steps,
    latest_onset,
    mean_step,
    near_the_rest,
    own_responses,
    relative_gains,
    scaled,
)
from .checks import checked
from .flags import fit_flags
from .loop_flags import answers_the_output, feedback_flags, in_automatic
from .own_gains import fit_own_gains
from .repeat_flags import repeat_flags, same_record_flags
from .repeatability import delay_outliers, fit_alike, unlike_records
from .result import OutputErrorFit
from .summary import choices_of, fitted_model

Loss = Literal["huber", "least_squares"]
Noise = Literal["auto", "white"]
Gains = Literal["common", "own"]
Focus = Literal["simulation", "prediction"]
_RESPONDS = 0.9
"""Residual with a pulse of the input, over that without, up to which the output responds to it:
0.97 and more for 24 simulated error codes, 0.85 and less for 11 of 24 pulses. Of the others two,
ten samples before a step, made the interval miss."""


@single_threaded
@in_shown_units
def fit_output_error(
    records: Record | Sequence[Record],
    *,
    structures: Structures | None = None,
    max_delay: float | None = None,
    known: ct.LTI | None = None,
    loss: Loss = "huber",
    noise: Noise = "auto",
    focus: Focus = "simulation",
    include_known: bool = False,
    gains: Gains = "common",
    actuator: Asked | None = None,
    fastest_lag: float | None = None,
    dead_time: tuple[float, float] | None = None,
) -> DelayedStateSpace:
    """Fit a transfer function with dead time to raw records.

    Parameters
    ----------
    records : Record or sequence of Record
        One input, one output, any input that moves. Several records of one plant are fitted
        together: step records are aligned and averaged; for other inputs, and if samples are
        missing, poles, gain and dead time are common, and level, drift and initial state are
        estimated for each record (the level alone where all begin at rest, and no more is seen).
    structures : optional
        Models to try: (order, relative degree), a process model by name (``"P1D"``, ``"P2DZ"``,
        ``"P2DU"``, ``"P1DI"``, ``"FOPDT"``, ``"SOPDT"``, ...), a `ProcessStructure` with fixed or
        bounded parameters, or a sequence of them. Default: orders 1 to 5 with relative degrees 1 to
        the order. If structures are given, the delay is that of the best of them, adequate or not,
        and its interval holds if the right one is among them (`interval_kind` is
        ``"conditional"``). What structures of one more pole say stands beside it, with a flag where
        they fit as well and differ; where another one fits clearly better, the dead time is
        reported as an apparent one.
    max_delay : float, optional
        Largest dead time in samples. Default: the visible onset of the output, which the dead time
        cannot exceed, but for the apparent one of `structures` that approximate the plant (of one
        step, then 63 % of the response; so in slow noise, where the best one is at the onset), and
        for that of an output that moved when the record began; for inputs other than steps a
        quarter of the longest record, and half of it where they begin at rest, or where that
        explains nothing or is reached.
    known : control.TransferFunction or control.StateSpace, optional
        Known continuous dynamics between plant and record (sensor, anti-aliasing filter,
        converter). They are part of the fit, but not of the returned model.
    loss : {"huber", "least_squares"}, optional
        Huber's loss (k = 1.345) costs 2 % of accuracy on clean data and is insensitive to outliers.
    noise : {"auto", "white"}, optional
        ``"auto"``: coloured noise is prewhitened by its autoregressive model (generalised least
        squares): for step records if the baseline noise is coloured and the residual does not
        exceed it, for other inputs if the residual is coloured, no sample is missing, and no other
        structure rules out those that are given. ``"white"``: all samples have equal weight, and
        correlation only widens the interval.
    focus : {"simulation", "prediction"}, optional
        For other inputs than steps in coloured noise. ``"prediction"``: errors weigh by the noise
        model. ``"simulation"``: so do they unless the model then simulates the records worse than
        that with equal weights, by more than the noise explains (see Notes).
    include_known : bool, optional
        Include the known dynamics in the returned model.
    gains : {"common", "own"}, optional
        For several records. ``"own"``: each has its own gain, with common dynamics and dead time;
        records that do not agree with the others are named and left out. The model has the median
        gain, and ``fit.gains`` has all of them as a schedule over the operating point.
    actuator : {"auto", "slew_rate", "dead_band", "stiction", "resolution", "saturation", \
            "characteristic"}, optional
        Fit also models with this nonlinearity (``"auto"``: all that the command can tell) before or
        behind the lags. Where the evidence for one is very strong by the same criterion, the model
        that is returned is its linear part, and ``fit.actuator`` the actuator with the intervals of
        its parameters; the interval of the dead time is that of both together. Otherwise the fit
        is linear, and its interval also covers the actuators that are not ruled out. Several
        records share actuator and linear part. A slew rate has one value, or one for each
        direction; stiction with S = J is a resolution; a characteristic is told by the flows at
        the levels of the command.
    fastest_lag : float, optional
        No lag of the plant is faster, in s: stated by the user, not found in the data. Short lags
        can take the place of dead time; without them its interval is narrower, and it holds if the
        statement does. Real poles of all structures are no faster, nor is 1 / omega of a pair
        shorter. A flag says whether the data contradict the statement. A process model by name has
        bounds of its own instead.
    dead_time : (low, high), optional
        Range in s of the dead time, stated by the user. Where the best dead time is at an end of
        it, a flag says whether the data contradict the statement.

    Returns
    -------
    DelayedStateSpace
        Continuous model, sampled exactly with a zero-order hold and the fractional dead time; its
        `.fit` is an `OutputErrorFit`.

    Raises
    ------
    NoStepError, DataError
        No step, several channels, an output that does not move, or a command that cannot tell the
        actuator that was asked for.
    OrderError, OptionError, UnsuitableSystemError
        Invalid structures, options, or known dynamics.

    Notes
    -----
    If the residual of the best structure is at noise level, the interval spans the 95 %
    profile-likelihood intervals of all structures within 10 of the best information criterion.
    Otherwise a likelihood does not describe the error: the dead time is the median of five delay
    estimates (visible onset, first- and second-order models of the first 15 % of the response, best
    models of up to three poles of the first 63 % and of all of it). The interval then spans these
    and that of a third-order model of the first 15 %, except the lowest.

    If three poles or more are needed, chains of four to eight nearly equal lags are compared with
    the structures by the same criterion, so that many lags are not taken for dead time. A diffusion
    model widens the interval if it fits as well. If the best structure has a zero, which can
    imitate a smooth onset, the interval extends to one sample after the visible onset, and to three
    times the distance between dead time and onset before the dead time. A stem behind the lags
    that sticks, and begins with a jump, is such a beginning as well: if the best structure has no
    zero, the interval reaches to the latest time at which a jump is not ruled out; a dead time that
    ends with friction lasts until the stem comes loose. One lag more than chosen is never ruled
    out. For step records an axial-dispersion model (inverse Gaussian residence times,
    with or without a lag in series) is fitted as well: it widens the interval if it is not ruled
    out, and if it is clearly better than all lags, its dead time is used.

    One step of a load that moves the output during a step test is looked for. Where the evidence
    for it is very strong, its response, through a lag of its own or through the plant, is part of
    the model, and a flag tells its time and size. Before 1.5 times the time to 63 % of the response
    it cannot be told from the response: the model is left as it is, and the gain is open. Beside
    other inputs one step of a load is looked for, or two, at the input of the plant, where nothing
    but white noise is left with them; in loops beside slow noise as well.

    A slope before the step is modelled as a drift, the free response of the plant, or not at all,
    as chosen by the information criterion. A free response begins a dead time after the last move
    of the input, which may have come just before the record: if the samples from one and a half
    dead times on contradict the dead time of all, they alone are fitted.

    An output may clip. Behind its noise, samples at the highest or lowest value show it; before the
    noise, a plateau that is reached with a kink and never passed, if the model of the other samples
    passes it and explains the record clearly better together with the limit (of a single record,
    and unless an actuator is asked for). Such samples are left out, and the flag
    ``output_at_limit`` says so: gain and slow lags are extrapolated.

    Samples may be missing (NaN outputs, see `Record.from_samples`): the model is evaluated at the
    samples that there are, with the input at every sample. Their noise is white, or its correlation
    is taken as if they were neighbours; it is not prewhitened.

    Of other inputs than steps up to 4000 samples are fitted one by one, and all further ones if the
    response ends within 1000 samples. Of a slower plant means over blocks of samples are fitted,
    evaluated exactly, so that the part that is fitted is as long as the record, or 40 of its
    slowest time constants at least. Blocks are shorter than time constants; a dead time that is
    shorter than a block is resolved as far as noise and input allow. If the part is shorter than
    the record, that is reported (``cut``).

    Simulation of data that were not used is best with errors that weigh by the noise model where
    the structure is right (then both weights have the same limit, and this one is the more
    accurate), and with equal weights where it is not: weighted errors lead to the best model for
    the frequencies at which the noise is small, plain ones to that for the frequencies of the input
    (section 8.5 of [1]_). So `focus` ``"simulation"`` keeps the weights unless a likelihood ratio
    of the simulation errors, counted in independent samples, exceeds 10 as in a Bayesian
    information criterion.

    In a model with more zeros than the plant the dead time has no Fisher information: a superfluous
    zero can take its place. Therefore the relative degree is chosen, not left free.

    The model is a continuous output-error model [1]_; gain, level and drift, which enter linearly,
    are eliminated by variable projection [2]_. Huber's loss is that of [3]_; coloured noise is
    prewhitened as in [4]_; intervals are profile likelihoods [5]_; the dispersion model is that of
    [6]_.

    References
    ----------
    .. [1] L. Ljung, System Identification: Theory for the User, 2nd ed., Prentice Hall 1999,
       section 4.2.
    .. [2] G. Golub and V. Pereyra, Separable nonlinear least squares: the variable projection
       method and its applications, Inverse Problems 19 (2003) R1-R26,
       doi:10.1088/0266-5611/19/2/201.
    .. [3] P. J. Huber and E. M. Ronchetti, Robust Statistics, 2nd ed., Wiley 2009, chapter 7
       (Regression), doi:10.1002/9780470434697.
    .. [4] A. C. Aitken, On least squares and linear combination of observations, Proc. Roy. Soc.
       Edinburgh 55 (1935) 42-48.
    .. [5] D. J. Venzon and S. H. Moolgavkar, A method for computing profile-likelihood-based
       confidence intervals, Appl. Statist. 37 (1988) 87-94, doi:10.2307/2347496.
    .. [6] O. Levenspiel, Chemical Reaction Engineering, 3rd ed., Wiley 1999, chapter 13 (The
       dispersion model).

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> t = 0.01 * np.arange(900)
    >>> u = np.where(t < 1.0, 0.0, 2.0)
    >>> y = np.where(t < 1.125, 0.0, 6 * -np.expm1(-(t - 1.125) / 0.4))
    >>> rng = np.random.default_rng(1)
    >>> sys = cr.fit_output_error(cr.Record(t, u, y + 0.01 * rng.standard_normal(t.size)))
    >>> sys.fit.structure, round(sys.fit.dead_time, 3), round(sys.fit.gain, 2)
    ((1, 1), 0.125, 3.0)
    """
    loss = one_of(loss, "loss", ("huber", "least_squares"))
    focus = one_of(focus, "focus", ("simulation", "prediction"))
    gains = one_of(gains, "gains", ("common", "own"))
    if actuator is not None:
        one_of(actuator, "actuator", ASKED)
        if known is not None or gains == "own":
            raise OptionError(
                f"actuator={actuator!r} with known dynamics or gains='own': expected one of them"
            )
    if include_known and known is None:
        raise OptionError("include_known=True without known dynamics; expected them as known=")
    factor = known_factor(known)
    several = on_common_axis(checked_records(records))
    # Of long records every sample tells, where the response is not fitted by means of blocks.
    short = max(one.n_samples for one in several) <= MOST_SAMPLES
    tried = replace(
        _requested(several, structures, max_delay, noise),
        known=factor,
        huber=loss == "huber",
        simulates=focus == "simulation",
        loop=any(map(in_automatic, several))
        or (short and answers_the_output(several) and Rule.LOOP.on),
    )
    fit = partial(_fit_linear, own_gains=gains == "own", may_clip=actuator is None)
    free = partial(_linear, several, partial(fit, requested=tried))
    linear, stated = free, None
    if fastest_lag is not None or dead_time is not None:
        from .stated import bounded, checked_statements, told

        beside = {"actuator": actuator, "max_delay": None if dead_time is None else max_delay}
        stated = checked_statements(fastest_lag, dead_time, **beside)
        linear = partial(_linear, several, partial(fit, requested=bounded(tried, stated)))

    def without_actuator() -> OutputErrorFit:
        return checked(linear(), alone=known is None)

    if actuator is None:
        result = without_actuator()
    else:
        # What a valve does is no coloured noise, and need not follow a linear model.
        start = replace(tried, compared=False, whiten=False)
        plain = checked(_linear(several, partial(fit, requested=start, refuses=False)))
        result = with_actuator(plain, without_actuator, actuator, tried.structures)
    if stated is not None:
        result = told(result, stated, free)
    return fitted_model(result, known if include_known else None)


def model_alone(
    record: Record, *, structures: Structures | None, max_delay: float | None, noise: str
) -> DelayedStateSpace:
    """Fit a record without checks, and without structures that were not requested."""
    tried = replace(_requested((record,), structures, max_delay, noise), compared=False)
    return fitted_model(_linear((record,), partial(_fit_linear, requested=tried, refuses=False)))


def _requested(
    records: tuple[Record, ...], structures: Structures | None, max_delay: float | None, noise: str
) -> Requested:
    noise = one_of(noise, "noise", ("auto", "white"))
    limit = None if max_delay is None else positive(max_delay, "max_delay", "number of samples")
    asked = requested(structures)
    bounds = [form.bounds.get("dead_time", (0.0, np.inf))[1] for form in asked.forms]
    latest = max(filter(np.isfinite, bounds), default=None)
    if limit is not None:
        latest = limit * records[0].sample_time
        fixed = [form.fixed.get("dead_time", 0.0) for form in asked.forms]
        if max(fixed, default=0.0) > latest:
            raise OptionError(
                f"max_delay={max_delay} samples of {records[0].sample_time:g} s beside a dead time "
                f"fixed at {max(fixed):g} s; expected a larger one, or none"
            )
    return replace(asked, latest=latest, whiten=noise == "auto")


def _linear(
    several: tuple[Record, ...], fit: Callable[[tuple[Record, ...]], OutputErrorFit]
) -> OutputErrorFit:
    """Fit linear models, with the input held where it has error codes.

    What looks like an error code of the input is a pulse if the output responds to it.
    """
    held, codes = _left_out(several, with_held_input)
    if not codes:
        return fit(several)
    try:
        found = fit(held)
    except DataError:
        return fit(several)
    found = replace(found, flags=found.flags + codes)
    try:
        given = fit(several)
    except DataError:
        return found
    left, without = (float(np.std(one.measured - one.fitted)) for one in (given, found))
    return given if left < _RESPONDS * without else found


def _fit_linear(
    several: tuple[Record, ...],
    requested: Requested,
    *,
    own_gains: bool = False,
    may_clip: bool = True,
    refuses: bool = True,
) -> OutputErrorFit:
    """Fit linear models. One that hardly follows the output is refused, or not."""
    any_input = partial(fit_any_input, refuses=refuses)
    kept, flags = _left_out(several, without_codes) if requested.huber else (several, ())
    # Behind an actuator an output may rest because that sticks: these samples are measurements.
    if may_clip:
        kept, repeated = _left_out(kept, at_updates)
        flags += repeated
    gaps = [sum(one.n_missing for one in records) for records in (several, kept)]
    if requested.loop and not gaps[0] and gaps[1]:
        # Records with gaps are not tested for feedback afterwards.
        flags += tuple(feedback_flags(several, 0.0))
    if requested.loop:
        kept, filled = _left_out(kept, with_gaps_filled)
        flags += filled
    several = kept
    if len(several) == 1:

        def fit_one(record: Record, *quick: Structure) -> OutputErrorFit:
            few = requested.structures or quick
            alone = replace(requested, structures=few, compared=False, whiten=False)
            fit = partial(_fit_one, requested=alone if quick else requested, any_input=any_input)
            return fit_without_spikes(record, fit) if requested.huber else fit(record)

        fit_whole = partial(fit_within_limits, fit=fit_one, may_clip=may_clip)
        if may_clip and not requested.loop:
            fit_whole = partial(fit_means_of_holds, fit=fit_whole)
        result = fit_whole(several[0])
        return replace(result, flags=result.flags + flags)
    several, at_limits = _left_out(several, without_cut_noise)
    # Complete records of one step each can be averaged. Of more steps the mean would end at the
    # second one: a relay test of 40 samples a half period left 40 samples of a record of 600.
    stepped = not requested.loop and all(
        not record.n_missing and len(edges_of(record)) == 1 for record in several
    )
    way = _fit_mean if stepped else any_input
    if own_gains:
        start = relative_gains(aligned_steps(several)) if stepped else None
        quick = replace(requested, compared=False, whiten=False)

        def fit(ratios: FloatArray, whole: bool) -> OutputErrorFit:
            return way(several, requested if whole else quick, ratios)

        result = fit_own_gains(several, fit, start)
    else:
        result = way(several, requested)
    flags += at_limits + same_record_flags(several, averaged=stepped)
    return replace(result, flags=result.flags + flags)


def _left_out(
    several: tuple[Record, ...], rule: Callable[[Record], tuple[Record, tuple[Flag, ...]]]
) -> tuple[tuple[Record, ...], tuple[Flag, ...]]:
    """Leave out samples of every record by a rule, and name the first record that has some."""
    kept, flags = zip(*map(rule, several), strict=True)
    if len(several) == 1:
        return kept, flags[0]
    named_flags = [
        replace(flag, message=f"{named('record', record.name)}: {flag.message}")
        for record, own in zip(several, flags, strict=True)
        for flag in own
    ]
    return kept, tuple(named_flags[:1])


def _fit_one(
    record: Record, requested: Requested, any_input: Callable[..., OutputErrorFit], first: int = 0
) -> OutputErrorFit:
    if requested.loop:  # spikes may have been left out
        record = with_gaps_filled(record)[0]
    data = None if requested.loop or has_pulses(record) else step_data_of(record, first)
    if data is None:
        return any_input((record,), requested)
    data, fit = fit_step_record(data, requested)
    form = fit.process.form
    if form and form.integrator and not fit.adequate and briefly_at_rest(data):
        # In operation an integrator is on its way, which no steps from rest explain. Of other
        # plants drift and free response would hide backlash.
        with suppress(DataError):
            moving = any_input((record,), requested)
            if moving.estimate.adequate:
                return moving
    unknown = int(np.ceil(BEYOND * fit.high / data.dt))
    if data.relaxing and first < unknown < data.edges[0][0] // 2:
        # The input may have moved just before the record: the response to that is not yet free.
        later = _fit_one(record, requested, any_input, unknown)
        if later.data.relaxing and not fit.low <= later.dead_time <= fit.high:
            return later
    flags = tuple(fit_flags(data, fit, requested.latest, float(record.time[0])))
    time = record.time[data.rows]
    return OutputErrorFit(fit, data, time, (record,), choices=tuple(choices_of(fit)), flags=flags)


def _fit_mean(
    records: tuple[Record, ...], requested: Requested, ratios: FloatArray | None = None
) -> OutputErrorFit:
    aligned = aligned_steps(records)
    steps = aligned if ratios is None else scaled(aligned, ratios)

    def fitted(used: tuple[int, ...]) -> tuple[StepData, OutputErrorEstimate, list[OwnResponse]]:
        data, fit = fit_step_record(mean_step(steps, used), requested)
        return data, fit, own_responses(steps, data, fit)

    data, fit, repeats = fit_alike(
        fitted,
        delay_outliers if ratios is None else partial(unlike_records, dt=steps[0].dt),
        [step.name for step in steps],
        [step.edge.amplitude for step in steps],
        near_the_rest(steps),
    )
    time = data.dt * data.since.astype(np.float64)
    if fit.high > fit.latest:
        # What widens the interval for jitter does not go beyond the last visible onset.
        last = latest_onset(steps, np.flatnonzero(repeats.kept).tolist())
        fit = replace(fit, high=min(fit.high, max(last, fit.latest)))
    flags = fit_flags(data, fit, requested.latest, float(time[0]))
    every = (*flags, *repeat_flags(repeats, fit.dead_time, data.dt))
    choices = tuple(choices_of(fit))
    return OutputErrorFit(fit, data, time, records, repeats, choices=choices, flags=every)
