"""Tests of records for feedback and instability, and by a step of generalised least squares."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.special import ndtr

from ..._flags import Flag, flagged
from ..._wording import chosen, in_time, interval_in_time
from ...data import Record
from ...numerics.arrays import BoolArray, FloatArray, runs
from ...numerics.constants import Z_95
from ...numerics.engine.plausible_models import PlausibleModel
from ...numerics.loops.relay import switched_by_relay
from ...numerics.rules import Rule
from ...numerics.signals.excitation import beyond_order_two, lively_start
from ...numerics.validation.innovations import (
    RARE,
    REGRESSED,
    feedback_chance,
    late_samples,
    past_inputs,
    shows_feedback,
)
from ...numerics.validation.instability import unstable_chance
from ...numerics.validation.white_step import WhiteStep, white_step
from .flags import GAINS_APART
from .result import OutputErrorFit
from .words import FAR_APART

_LARGER = np.geomspace(1.5, 16, 8).tolist()  # moves of a set point that are tried, over its own
_LEVELS = 10  # of an input: a relay has two, or three
_CERTAIN = 0.9
"""Part of what earlier inputs leave of an output that later ones explain, where no answer holds: it
was 97 to 100 % where an input was late to a lag of two samples at most, and 60 to 66 % in loops,
whose answers held."""
_STRETCH = 20  # samples of a stretch in manual that is worth a word
_EXCITING = 1e-5
"""Part of the moves of an input beyond order 2 from which on it is exciting: as much as a sinusoid
with noise of 0.03 % has, and twice that of a ramp behind a rest of a hundredth of its record."""


def in_automatic(record: Record) -> bool:
    """Whether a set point is known, and moves while it is in force.

    One that follows the measured value, as in manual, is none.
    """
    wanted = record.reference
    if wanted is None or not record.issiso() or np.isnan(wanted).all():
        return False
    if not np.any(np.ravel(wanted - record.output)[record.seen]):
        return False
    return float(np.nanmax(wanted) - np.nanmin(wanted)) > 0.0


def loop_choices(record: Record) -> Iterator[str]:
    """Say how a record of a loop is used."""
    if not in_automatic(record):
        yield chosen("loop.seen")
        return
    assert record.reference is not None
    wanted = np.ravel(record.reference)
    moves = np.diff(wanted)
    moves = moves[~np.isnan(moves) & (moves != 0)]
    size = float(np.nanmax(wanted) - np.nanmin(wanted))
    yield chosen("loop.set_point", moves=moves.size, size=size)
    if spans := _spans(record, np.isnan(wanted)):
        yield chosen("loop.manual", spans=spans)
    signal = np.ravel(record.input)
    still = np.r_[np.diff(signal) == 0, False] & ~np.isnan(wanted)
    # At its limits the output of a controller does not move either.
    still &= (signal > np.nanmin(signal)) & (signal < np.nanmax(signal))
    if spans := _spans(record, still):
        yield chosen("loop.held", spans=spans)


def _spans(record: Record, where: BoolArray) -> str:
    """Longest stretches of some samples in words, the first three; short ones are left out."""
    longest = [(a, b - 1) for a, b in zip(*runs(where), strict=True) if b - a >= _STRETCH][:3]
    time = record.time
    return ", ".join(interval_in_time(float(time[a]), float(time[b])) for a, b in longest)


def set_point_flags(fit: OutputErrorFit) -> Iterator[Flag]:
    """Report a set point that moves too little, and how far it should."""
    low, high = fit.interval
    known = fit.estimate.with_moves
    if known is None or not _is_wide(fit.dead_time, low, high, fit.dt):
        return
    every = [record.reference for record in fit.records if record.reference is not None]
    if not all(map(in_automatic, fit.records)):
        return
    moved = max(float(np.nanmax(wanted) - np.nanmin(wanted)) for wanted in every)
    enough = next((s for s in _LARGER if not _is_wide(*known(s), fit.dt)), None)
    way, times = ("about", enough) if enough else ("more than", _LARGER[-1])
    yield flagged(
        "small_set_point",
        total=in_time(fit.total_delay),
        interval=interval_in_time(low, high),
        moved=moved,
        enough=f"{way} {times * moved:.2g}",
    )


def _is_wide(dead_time: float, low: float, high: float, dt: float) -> bool:
    return high - low > max(FAR_APART * dead_time, dt)


def feedback_flags(records: tuple[Record, ...], delay: float) -> Iterator[Flag]:
    """Test whether the input depends on the output; `delay` in samples is an upper bound."""
    if all(_regulates(record) for record in records):
        yield flagged("feedback.regulation")
        return
    chances = [
        feedback_chance(y[0], u[0], past_inputs(y[0].size, delay)) for y, u in _stretches(records)
    ]
    if not _rare(chances):
        return
    if any(in_automatic(record) for record in records):
        yield flagged("closed_loop", chance=min(chances))
    elif late := late_input(records):
        yield late
    else:
        yield flagged("feedback", chance=min(chances))


def answers_the_output(records: Sequence[Record]) -> bool:
    """Whether inputs are those of controllers: no response within a sample explains that."""
    if any(record.n_missing for record in records):
        return False
    signals = [(np.ravel(one.output), np.ravel(one.input)) for one in records]
    return all(switched_by_relay(*each) for each in signals) or shows_feedback(signals)


def late_input(records: Sequence[Record]) -> Flag | None:
    """Flag inputs of which all are recorded late, as `late_samples` counts."""
    stretches = [(y[0], u[0], past_inputs(y[0].size, 0.0)) for y, u in _stretches(records)]
    found = [late_samples(*stretch) for stretch in stretches]
    samples, part = (min(values) for values in zip(*found, strict=True))
    if part > _CERTAIN:
        return flagged("late_input", samples=samples, part=100 * part)
    return flagged("feedback.late", samples=samples, part=100 * part) if samples else None


def excitation_flags(fit: OutputErrorFit) -> Iterator[Flag]:
    """Report inputs that tell less of a plant than its model has parameters."""
    form, inputs = fit.estimate.process.form, [np.ravel(one.input) for one in fit.records]
    known = form is not None and len(form.names) - len(form.fixed) - (not form.dead_time) <= 2
    if not known and beyond_order_two(inputs) < _EXCITING:
        yield flagged("not_exciting")


def _regulates(record: Record) -> bool:
    """Whether a known set point does not move, and the input is not that of a relay."""
    wanted = record.reference
    return wanted is not None and np.ptp(wanted) == 0 and np.unique(record.input).size > _LEVELS


def unstable_flags(
    records: tuple[Record, ...], delay: float, *, imitated: bool = False
) -> Iterator[Flag]:
    """Test whether a plant of any channels is unstable; `delay` in samples is an upper bound.

    Where a model with slow poles leaves noise, and they may have `imitated` it, inputs must have
    moved both ways: behind steps and ramps from rest lags look alike (6 of 480 integrators).
    """
    moves = [np.diff(record.input, axis=-1) for record in records]
    if imitated and not any(move.max() > 0 > move.min() for move in moves):
        return
    chances = [
        unstable_chance(own, u, past_inputs(own.size // len(u), delay))
        for y, u in _stretches(records)
        for own in y
    ]
    if _rare(chances):
        yield flagged("unstable", chance=min(chances))


def _rare(chances: list[float]) -> bool:
    return min(chances) < RARE / len(chances)


def _stretches(records: Sequence[Record]) -> list[tuple[FloatArray, FloatArray]]:
    """Outputs (p, n) and inputs (m, n) of the part of each record with the largest variation."""
    found = []
    for record in records:
        inputs, outputs = np.atleast_2d(record.input), np.atleast_2d(record.output)
        start = lively_start(inputs, REGRESSED)
        part = slice(start, start + REGRESSED)
        found.append((outputs[:, part], inputs[:, part]))
    return found


def generalised_step(
    fit: OutputErrorFit, output: FloatArray, drive: FloatArray
) -> WhiteStep | None:
    """One step of generalised least squares, from a fit with coloured residual."""
    if not np.all(fit.poles) or not fit.gain or not Rule.GENERALISED.on:
        return None
    model = PlausibleModel(fit.dead_time, fit.poles, fit.estimate.numerator)
    return _step(fit, model, output, drive)


def _step(
    fit: OutputErrorFit, start: PlausibleModel, output: FloatArray, drive: FloatArray
) -> WhiteStep | None:
    step = white_step(output, drive, fit.data.dt, *start)
    reach = max(fit.total_delay, fit.dead_time)
    # Farther away, one step of a linearisation is not a valid estimate.
    return step if step is None or abs(step.dead_time - start.dead_time) <= reach else None


def coloured_flags(
    fit: OutputErrorFit, step: WhiteStep, output: FloatArray, drive: FloatArray
) -> Iterator[Flag]:
    """Flags for what generalised least squares say otherwise than output error.

    Where the fit itself is one of generalised least squares, its dead time may lie at a local
    minimum that is not negative: least squares show whether it leads to a negative one.
    """
    gain_error, total_error = Z_95 * step.gain_error, Z_95 * step.total_error
    gains = abs(step.gain - fit.gain) + gain_error
    totals = abs(step.total - fit.total_delay) + total_error
    if not (gains <= GAINS_APART * abs(fit.gain) and totals <= GAINS_APART * abs(fit.total_delay)):
        yield flagged(
            "gain_not_resolved.coloured",
            gain=step.gain,
            gain_error=gain_error,
            total=in_time(step.total),
            total_error=in_time(total_error),
        )
    before = fit.estimate.unweighted
    first: WhiteStep | None = step
    if before is not None:
        first = _step(fit, before, output, drive) if np.all(before.poles) else None
    if first is None or not first.dead_time_error:
        return
    if ndtr(first.dead_time / first.dead_time_error) < RARE:
        error = in_time(Z_95 * first.dead_time_error)
        yield flagged("noncausal.coloured", lead=in_time(-first.dead_time), error=error)
