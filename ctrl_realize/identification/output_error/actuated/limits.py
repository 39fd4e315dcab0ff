"""Samples that are no measurements of the plant are left out of the fit, and it is told.

Those at a limit are bounds of what it does, spikes are the sensor's, values far beyond all others
the logger's, and between two of its updates a held output repeats what was measured before.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ...._flags import Flag, flagged
from ...._wording import in_time
from ....data import Record
from ....delayed.simulation import simulate_record
from ....errors import DataError, UnsuitableSystemError
from ....numerics.arrays import BoolArray, FloatArray, IntArray, without_gaps
from ....numerics.constants import STRONG
from ....numerics.rules import Rule
from ....numerics.signals.noise import BEYOND, FAR, far_value, spikes
from ....numerics.validation.held_output import hold_in_noise, holds_in_motion, updates
from ....numerics.validation.limits import at_limit, clips, ends, passed, plateaus
from ..arguments import FEWEST_SAMPLES, step_data_of
from ..loop_flags import feedback_flags
from ..result import OutputErrorFit
from ..summary import fitted_model

_TURNS = 3  # at most: time
_MORE = 0.05  # of the samples on plateaus that a model finds besides: it is fitted anew
_SELDOM = 0.05  # of the samples, up to which a value far beyond the others is no state of a plant
_FEW_GAPS, _SHORT_GAP = 0.2, 5  # part of the samples, and samples in a row, that are interpolated
_PULSE = 0.5  # ranges of the others by which an input is beyond them: the output tells what it is

_EXPLAINED = 2.0
"""Residual of means over their noise, up to which a model explains them: 0.7 to 1.4 for 26 held
outputs, simulated and measured."""

Fit = Callable[..., OutputErrorFit]


def without_cut_noise(record: Record) -> tuple[Record, tuple[Flag, ...]]:
    """Leave out samples at the highest or lowest value of a noisy output, and tell it.

    They stay where there is no other baseline, or too little else.
    """
    output = np.ravel(record.output)
    limits = at_limit(output)
    if not limits:
        return record, ()
    data = step_data_of(record)
    rest = 0 if data is None else data.edges[0][0]
    left, flags = np.zeros(output.size, dtype=bool), []
    for limit, samples in limits:
        others = np.count_nonzero(record.seen[rest:] & ~(left | samples)[rest:])
        left_out = not np.any(samples[:rest]) and bool(others >= FEWEST_SAMPLES)
        if left_out:
            left |= samples
        flags.append(_at_limit(limit, samples, left_out=left_out))
    return _without(record, left) if left.any() else record, tuple(flags)


def without_codes(record: Record) -> tuple[Record, tuple[Flag, ...]]:
    """Leave out samples of the output with a value that marks missing data, and tell it."""
    codes, said = _codes(record, record.output, BEYOND)
    if not codes.size:
        return record, ()
    left = np.isin(np.arange(record.n_samples), codes)
    return _without(record, left), (flagged("outliers.code_left_out", said=said, limit=BEYOND),)


def with_held_input(record: Record) -> tuple[Record, tuple[Flag, ...]]:
    """Hold the input where it has such a value, and tell it.

    A few ranges are enough for single samples; what lasts is a pulse of a test, and where the set
    point moves it is the controller's answer.
    """
    limit = _PULSE
    codes, said = _codes(record, record.input, limit)
    if np.any(np.diff(codes) == 1):
        limit = BEYOND
        codes, said = _codes(record, record.input, limit)
    wanted = np.full(2, np.nan) if record.reference is None else np.ravel(record.reference)
    moved = 1 + np.flatnonzero(np.abs(np.diff(wanted)) > 0)
    if not codes.size or np.isin(codes, moved).any():
        return record, ()
    index = np.arange(record.n_samples)
    kept = np.delete(index, codes)
    before = kept[np.maximum(np.searchsorted(kept, index, "right") - 1, 0)]
    flag = flagged("outliers.code_of_input", said=said, limit=limit)
    return record.__replace__(input=np.ravel(record.input)[before]), (flag,)


def has_pulses(record: Record) -> bool:
    """Whether all samples of an input with such a value are single: no edges of a step test."""
    codes, _ = _codes(record, record.input, _PULSE)
    return codes.size > 0 and bool(np.all(np.diff(codes) > 1))


def with_gaps_filled(record: Record) -> tuple[Record, tuple[Flag, ...]]:
    """Interpolate few and short gaps of an output, and tell it.

    The noise of a loop is modelled from sample to sample, without which its plant is biased.
    """
    output = np.ravel(record.output)
    gap = np.isnan(output)
    apart = np.diff(np.flatnonzero(np.r_[True, ~gap, True]))
    if np.isnan(record.input).any() or not gap.any():
        return record, ()
    if gap.mean() > _FEW_GAPS or apart.max() - 1 > _SHORT_GAP:
        return record, ()
    flags = (flagged("closed_loop.filled", count=np.count_nonzero(gap)),)
    return record.__replace__(output=without_gaps(output), missing="refuse"), flags


def _codes(record: Record, signal: FloatArray, limit: float) -> tuple[IntArray, str]:
    """Samples of a signal that are a code, and these in words."""
    values = np.ravel(signal)
    far = far_value(values, limit)
    if not 0 < far.size <= _SELDOM * values.size:
        return far[:0], ""
    first = in_time(record.time[far[0]])
    return far, f"{far.size} sample(s), the first at {first}, are {values[far[0]]:g}"


def at_updates(record: Record) -> tuple[Record, tuple[Flag, ...]]:
    """Leave out samples between two updates of an output, and tell it."""
    output = np.ravel(record.output)
    new = updates(output, np.atleast_2d(record.input))
    if not np.any(record.seen & ~new) or not Rule.REPEATS.on:
        return record, ()
    stored = np.flatnonzero(new & record.seen)
    apart, count = np.diff(np.flatnonzero(new)), stored.size
    if count < FEWEST_SAMPLES:
        hold = in_time(holds_in_motion(output, stored).max() * record.dt)
        return record, (flagged("held_output.few", count=count, hold=hold),)
    longest = in_time(int(apart.max()) * record.dt)
    if np.ptp(apart) == 0:
        lines = np.nanmedian(np.abs(np.diff(output))) > 0  # most samples differ from the last
        flag = flagged(
            "repeats_left_out.lines" if lines else "repeats_left_out",
            period=int(apart[0]),
            time=longest,
        )
    else:
        band = np.nanmin(np.abs(np.diff(output[new]))[:-1])
        flag = flagged("repeats_left_out.seldom", count=count, band=band, hold=longest)
    return _without(record, ~new), (flag,)


def fit_means_of_holds(record: Record, fit: Fit) -> OutputErrorFit:
    """Fit a record, and anew the means between two updates of an output that is held beneath noise.

    They are measurements at the updates; that the output is held is told.
    """
    found = fit(record)
    # What a model does not follow tells nothing of samples.
    if found.data.every > 1 or not found.at_noise_level:
        return found
    kept, rows = found.records[0], _rows(record, found)  # without spikes and codes
    index = np.arange(record.n_samples)
    fitted, output = np.interp(index, rows, found.fitted), np.full(index.size, np.nan)
    output[rows] = found.measured
    held = hold_in_noise(output, fitted)
    if held is None or not Rule.HOLDS.on:
        return found
    # The noise of a loop moves from sample to sample what its model takes for a response.
    if not record.n_missing and any(feedback_flags((record,), found.delay)):
        return found
    period, first, variance = held
    output[:first] = np.nan  # of a hold that began before the record
    which = (index - first) // period + 1
    count = np.bincount(which, np.isfinite(output))
    mean = np.bincount(which, np.nan_to_num(output)) / np.where(count > 0, count, np.nan)
    means = np.where((index - first) % period == 0, mean[which], np.nan)
    time, updates_seen = period * record.dt, np.count_nonzero(np.isfinite(means))
    if updates_seen < FEWEST_SAMPLES:
        low = max(found.interval[0] - time, 0.0)
        hold, least = in_time(time), in_time(low)
        flag = flagged("held_output.noise", count=updates_seen, hold=hold, least=least)
        return replace(found, estimate=replace(found.estimate, low=low), flags=(*found.flags, flag))
    again = fit(kept.__replace__(output=means, missing="keep"))
    if again.residual**2 > _EXPLAINED**2 * variance / period:
        return found
    flag = flagged("repeats_left_out.noise", period=period, time=in_time(time))
    return replace(again, flags=(*again.flags, flag))


def _at_limit(limit: float, samples: BoolArray, *, left_out: bool) -> Flag:
    return flagged(
        "output_at_limit" if left_out else "output_at_limit.kept",
        count=np.count_nonzero(samples),
        limit=limit,
    )


def fit_within_limits(record: Record, fit: Fit, *, may_clip: bool = True) -> OutputErrorFit:
    """Fit a record without the samples at its limits, if there are any.

    With `may_clip`, also those of a limit before the noise are looked for. A `fit` of a record and
    a structure is a quick one, of that alone.
    """
    kept, flags = without_cut_noise(record)
    try:
        found = fit(kept)
    except DataError:
        if kept is record:
            raise
        # What is left shows no response.
        found = fit(record)
        flags = tuple(_at_limit(*end, left_out=False) for end in at_limit(np.ravel(record.output)))
    if flags or not may_clip:
        return replace(found, flags=found.flags + flags)
    return _without_plateaus(record, found, fit)


def fit_without_spikes(record: Record, fit: Fit) -> OutputErrorFit:
    """Fit a record, and anew without samples that neither the plant nor its noise explains."""
    found, left = fit(record), np.zeros(record.n_samples, dtype=bool)
    for _ in range(_TURNS):  # large ones hide smaller ones
        far = spikes(found.measured, found.fitted)
        enough = np.sum(~far) >= FEWEST_SAMPLES and found.data.every == 1
        if not (far.any() and enough and Rule.SPIKES.on):
            break
        left[_rows(record, found)[far]] = True
        found = fit(_without(record, left))
    if not left.any():
        return found
    wild, first = np.ravel(record.output)[left], in_time(record.time[np.argmax(left)])
    alike = f", {wild[0]:g} each," if wild.size > 1 and np.ptp(wild) == 0 else ""
    flag = flagged("outliers.left_out", count=wild.size, first=first + alike, limit=FAR)
    return replace(found, flags=(*found.flags, flag))


def _without_plateaus(record: Record, linear: OutputErrorFit, fit: Fit) -> OutputErrorFit:
    """Fit a record without plateaus, if that and a limit explain it better than a linear plant.

    If they do not, a plateau is told all the same: in noise a response that a limit ends looks like
    one that settles. The intervals of gain and total delay of a step are those of both then. Not so
    where a linear plant explains several steps: of 56 records without a limit 17 had the doubt.
    """
    stepped = bool(np.isfinite(linear.onset))
    if linear.at_noise_level and not stepped:
        return linear  # nothing is left for a limit to explain
    output = np.ravel(record.output)
    held, evidence = plateaus(output, [edge for edge, _ in linear.data.edges])
    if not held.any():
        return linear
    # A controller holds the output as well, and a model of it alone leaves much to explain.
    if not record.n_missing and any(feedback_flags((record,), linear.delay)):
        return linear
    # Inputs other than steps may leave the output where it is.
    doubted = stepped and not (linear.at_noise_level and len(linear.data.edges) > 1)
    if doubted:
        when = in_time(record.time[np.argmax(held)])
        doubt = flagged("may_be_at_limit", limits=_levels(output, held), when=when)
        linear = replace(linear, flags=(*linear.flags, doubt))
    told = evidence >= STRONG
    if not (told or doubted) or np.count_nonzero(record.seen & ~held) < FEWEST_SAMPLES:
        return linear
    rows, load = _rows(record, linear), linear.estimate.load
    loaded = load is not None and not load.early
    # Whether a limit explains more is asked first where nothing else is told: time.
    for given in [()] if doubted else [(linear.estimate.structure,), ()]:
        try:
            found = fit(_without(record, held), *given)
            beyond = _simulated(found)
            further = passed(output, beyond, held) & ~held
            if np.count_nonzero(further) > _MORE * np.count_nonzero(held):
                held |= further
                found = fit(_without(record, held), *given)
                beyond = _simulated(found)
        except (DataError, UnsuitableSystemError):
            return linear
        at_rows = output[rows], linear.fitted, beyond[rows], held[rows]
        if not (told and clips(*at_rows, loaded=loaded)):
            beside = found.estimate if doubted else None
            return replace(linear, estimate=replace(linear.estimate, beyond=beside))
    count, levels = np.count_nonzero(held), _levels(output, held)
    flag = flagged("output_at_limit.plateau", count=count, limits=levels)
    return replace(found, flags=(*found.flags, flag))


def _rows(record: Record, fit: OutputErrorFit) -> IntArray:
    """Samples of a record that were fitted."""
    return np.asarray(np.rint((fit.time - record.time[0]) / record.dt), dtype=np.int64)


def _simulated(found: OutputErrorFit) -> FloatArray:
    """Response of a model to its record (N,), also where samples are missing."""
    rest = np.isfinite(found.onset) and not found.data.relaxing
    start = "rest" if rest else "estimate"
    return np.ravel(simulate_record(fitted_model(found), found.records[0], start, gaps=True))


def _levels(output: FloatArray, held: BoolArray) -> str:
    return " and ".join(f"{sign * level:.4g}" for _, sign, level in ends(output, held))


def _without(record: Record, samples: BoolArray) -> Record:
    """Mark samples as missing."""
    return record.__replace__(output=np.where(samples, np.nan, record.output), missing="keep")
