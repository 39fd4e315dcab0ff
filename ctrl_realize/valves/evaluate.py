"""From records of a valve test to its report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from .._flags import Flag, flagged
from ..data import Record
from ..data.given import as_records, check_complete
from ..numerics.valve_test.play import slope_of
from .flags import flags_of
from .groups import Interval, grouped, linear_fit
from .metrics import check_limits, collected, judged
from .part import TestPart
from .parts import range_of, split_test
from .result import ValveReport
from .statics import (
    StaticCurve,
    dead_band_and_resolution,
    hysteresis_and_linearity,
    joined,
    reversal_wait,
    static_curve,
)
from .steps import Ranges, StepMetrics, measured_steps, noise_of

_KNOWN_RANGES = {"%": (0.0, 100.0), "mA": (4.0, 20.0)}
"""Range of a command by its unit."""
_ALIKE = 2.0
"""Ratio of sizes of steps that count as the smallest."""
_MOST_SAMPLES = 2000
"""Samples of a record of operation that are fitted."""


def valve_report(
    records: Record | Sequence[Record],
    *,
    command_range: Sequence[float] | None = None,
    travel_range: Sequence[float] | None = None,
    limits: Mapping[str, Any] | None = None,
    fit: bool = True,
) -> ValveReport:
    """Measure the metrics of a step-response test of a control valve.

    The command of each record is split into steps, staircases, full strokes and ramps (see
    `split_test`); the responses of the position, or of a process variable, give the metrics of
    `DEFINITIONS` with 95 % intervals: against step size and direction, and their worst case. What
    the records cannot tell is listed with the test that is missing.

    Parameters
    ----------
    records : Record or sequence of Record
        Command (input) and position of the stem (output), or a process variable instead of the
        position. Records of the same valve.
    command_range : (float, float), optional
        Command of the closed and of the open valve, in the unit of the records; default 0 to 100
        for %, 4 to 20 for mA. For other units it is the range of the command.
    travel_range : (float, float), optional
        Output at the closed and at the open valve, in the unit of the records; default 0 to 100
        for %. For other units it is a travel with which the gain of the larger steps is one.
    limits : mapping, optional
        Largest permitted value, or (smallest, largest), of metrics by their key in `DEFINITIONS`;
        in s, % and %/s. Of a metric that depends on the step also a mapping from step size in % to
        such a limit: ``{"t86": {2: 0.4, 10: 0.8}}``. There are no default limits: they are those
        of your specification.
    fit : bool, default True
        False: Do not fit the dead time of each size and direction with `identify` (about 0.3 s for
        each, and up to 3 s where the rate is limited).

    Returns
    -------
    ValveReport

    Raises
    ------
    DataError
        No record, several channels, or missing samples.
    OptionError
        Limits of unknown metrics, or that are not numbers.

    Notes
    -----
    The interval of a mean is that of Student's distribution from three repeats on, and the
    propagated noise before that; what the samples leave open is added. Interval of the dead band:
    widths of a play that the F-test does not reject, given the levels of the staircase [1]_. All
    rules are stated in `DEFINITIONS`, with the source of each as far as it was read.

    References
    ----------
    .. [1] A. Visintin, Differential Models of Hysteresis, Springer 1994, section III.2.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> valve = cr.bench.valve(noise=5e-4)
    >>> records = valve.step_campaign(1, amplitudes=(16.0, 4.0), repeats=2)
    >>> report = cr.valves.valve_report(
    ...     records, command_range=(4, 20), limits={"overshoot": 10}, fit=False
    ... )
    >>> print(report.verdict)
    All limits are met: overshoot (25 % opening; without full strokes).
    >>> print(f"{1e3 * report.metric('t86').interval.value:.0f} ms")
    205 ms
    """
    given = as_records(records)
    for record in given:
        check_complete(record, "a valve test")
    check_limits(limits)
    choices: list[str] = []
    command = _command_range(given, command_range, choices)
    parts = tuple(tuple(split_test(record, command_range=command)) for record in given)
    ranges = Ranges(command, _travel_range(given, parts, command, travel_range, choices))
    steps = tuple(
        step
        for k, (record, own) in enumerate(zip(given, parts, strict=True))
        for step in measured_steps(record, own, ranges, k)
    )
    groups = grouped(steps, given, fit=fit)
    curve, statics = _statics(given, parts, steps, ranges)
    flags = [*flags_of(steps, groups, parts, ranges)]
    if fit and any(flag.code == "no_valve_test" for flag in flags):
        model = _fit_of_operation(given)
        if model is not None:
            statics["fitted_dead_time"] = model[0], "all records, not by steps"
            flags.append(model[1])
    return ValveReport(
        metrics=judged(collected(groups, statics), groups, limits), groups=groups, steps=steps,
        parts=parts, curve=curve, ranges=ranges, records=given, choices=tuple(choices),
        flags=tuple(flags),
    )  # fmt: skip


def _command_range(
    records: tuple[Record, ...], given: Sequence[float] | None, choices: list[str]
) -> tuple[float, float]:
    if given is not None:
        return range_of(given)[:2]
    unit = records[0].input_units[0] if records[0].ninputs == 1 else ""
    if unit in _KNOWN_RANGES:
        return _KNOWN_RANGES[unit]
    low = min(float(np.min(record.input)) for record in records)
    high = max(float(np.max(record.input)) for record in records)
    if high == low:
        high = low + 1.0
    choices.append(
        f"command range {low:.4g} to {high:.4g}: what the records cover; give command_range for "
        "percentages of the span"
    )
    return low, high


def _travel_range(
    records: tuple[Record, ...], parts: tuple[tuple[TestPart, ...], ...],
    command: tuple[float, float], given: Sequence[float] | None, choices: list[str],
) -> tuple[float, float]:  # fmt: skip
    if given is not None:
        return range_of(given)[:2]
    if records[0].noutputs == 1 and records[0].output_units[0] == "%":
        return 0.0, 100.0
    # levels as they are, then scaled such that the larger steps have a gain of one
    span = command[1] - command[0]
    plain = Ranges(command, (0.0, 100.0))
    steps = [
        step for k, (record, own) in enumerate(zip(records, parts, strict=True))
        for step in measured_steps(record, own, plain, k) if step.moved
    ]  # fmt: skip
    if steps:
        largest = max(abs(one.size) for one in steps)
        large = [one for one in steps if abs(one.size) >= 0.5 * largest]
        slope = float(np.median([one.values["gain"] for one in large])) * 100 / span
        points = [(one.after, one.travel_after) for one in large]
    else:
        u = np.concatenate([np.ravel(record.input) for record in records])
        y = np.concatenate([np.ravel(record.output) for record in records])
        slope = slope_of(u, y)
        points = [(float(np.mean(u)), float(np.mean(y)))]
    largest = max(float(np.max(np.abs(record.output))) for record in records)
    if not np.isfinite(slope) or abs(slope * span) <= 1e-9 * largest:
        # the position does not follow the command: no range is a sensible one
        slope = max(100.0, largest) / span
    low = float(np.median([y - slope * (u - command[0]) for u, y in points]))
    choices.append(
        f"travel range {low:.4g} to {low + slope * span:.4g}: with it the gain of the larger steps "
        "is one; give travel_range for percentages of the stroke"
    )
    return low, low + slope * span


def _statics(
    records: tuple[Record, ...], parts: tuple[tuple[TestPart, ...], ...],
    steps: tuple[StepMetrics, ...], ranges: Ranges,
) -> tuple[StaticCurve | None, dict[str, tuple[Interval, str]]]:  # fmt: skip
    found: list[tuple[Interval, Interval, Interval]] = []
    delay, longest = _slow_delay(steps)
    curves, waits, rates = [], [], [0.0]
    for k, (record, own) in enumerate(zip(records, parts, strict=True)):
        mine = [one for one in steps if one.record == k]
        found.append(dead_band_and_resolution(mine, own, ranges))
        noise = noise_of(record, own)
        waits.append(reversal_wait(record, own, ranges, noise, delay))
        rates += [
            abs(part.after - part.before) / ((part.stop - part.start) * record.dt)
            for part in own if part.kind == "ramp"
        ]  # fmt: skip
        curves.append(static_curve(record, own, mine, ranges, noise, delay))
    # a ramp before levels, the longer before the shorter
    known = [one for one in curves if one is not None]
    curve = max(known, key=lambda one: (one.origin == "ramp", np.ptp(one.command)), default=None)
    band, resolution, backlash = (joined(own) for own in zip(*found, strict=True))
    lag_known = bool(np.isfinite(delay))
    # An unknown lag widens the loop at every command alike, as a dead band does.
    hysteresis, linearity, width = hysteresis_and_linearity(
        curve, band if lag_known else Interval()
    )
    if lag_known:
        # with a longer delay both branches come closer by its difference times the rate
        closer = 2 * (longest - delay) * max(rates) * 100 / abs(ranges.command_span)
        hysteresis, width = (
            replace(one, low=max(one.low - closer, 0.0)) if one.is_known else one
            for one in (hysteresis, width)
        )
    # A stem that sticks shows less of its dead band in the loop than at the reversal.
    sticks = [wait for wait, least in waits if least > width.high]
    if width.is_known and sticks:
        width = replace(width, high=max(sticks))
    origin = ""
    if not band.is_known and width.is_known:
        origin = "slow ramp" if lag_known else "slow ramp whose lag no step tells"
        width = width if lag_known else replace(width, low=0.0)
    over = ""
    if curve is not None:
        over = "{:.3g} to {:.3g} % of the command".format(*curve.command[[0, -1]])
    return curve, {
        "dead_band": (band if band.is_known else width, origin),
        "resolution": (resolution, ""),
        "backlash": (backlash, ""),
        "hysteresis": (hysteresis, over if hysteresis.is_known else ""),
        "linearity": (linearity, over if linearity.is_known else ""),
    }


def _slow_delay(steps: Sequence[StepMetrics]) -> tuple[float, float]:
    """Mean delay in s of small steps: those of large ones hold half of their travel at the rate.

    The line through the delays over the sizes, at zero; and that of the smallest, which it does
    not exceed.
    """
    known = [one for one in steps if np.isfinite(one.mean_delay) and not one.stroke]
    if not known:
        return float("nan"), float("nan")
    size = np.array([abs(one.size) for one in known])
    delay = np.array([one.mean_delay for one in known])
    small = float(np.median(delay[size <= _ALIKE * size.min()]))
    if np.ptp(size) <= 0.5 * size.max():
        return small, small
    return float(np.clip(np.polyfit(size, delay, 1, w=size)[1], 0.0, small)), small


def _fit_of_operation(records: tuple[Record, ...]) -> tuple[Interval, Flag] | None:
    """Dead time of a linear model of records that contain no test."""
    parts = (record.between(*record.time[:_MOST_SAMPLES][[0, -1]]) for record in records)
    fits = (linear_fit([part]) for part in parts)
    first = next((found for found in fits if found is not None), None)
    if first is None:
        return None
    fit, interval = first
    more = "".join(f"; {flag}" for flag in fit.flags[:2])
    return interval, flagged("operation_fit", dead_time=interval.value, gain=fit.gain, more=more)
