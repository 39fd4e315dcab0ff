"""Samples of input and output with their time stamps, from the columns of a table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ...data.record_checks import labelled
from ...data.resampling import MIN_SAMPLES
from ...data.samples import Samples
from ...errors import DataError, OptionError
from ...numerics.arrays import BoolArray, FloatArray
from ...numerics.signals.sample_grid import filled, held
from ..columns import check_lengths
from ..tables import Table
from ..text.dates import date_of
from ..time_column import Clock, TimeAxis, time_axis
from ..units import plain_unit
from .long_format import LongTable
from .names import MODES, Parts, mode_word, strange_modes
from .quality import Rows, Rules


def wide_axis(table: Table, parts: Parts, clock: Clock) -> tuple[TimeAxis, Rows]:
    """Time axis of a table with a column for each signal, and its rows in the order of time."""
    used = [*parts.inputs, *parts.outputs, *parts.references, parts.time]
    check_lengths(table, [k for k in used if k is not None])
    count = table.columns[parts.outputs[0]].cells.size
    if parts.time is None:
        return TimeAxis(parts.dt * np.arange(count, dtype=np.float64), None), np.arange(count)
    axis = time_axis(table, parts.time, clock, parts.date)
    seconds, rows = axis.seconds, np.arange(count)
    if count > 1 and np.all(np.diff(seconds) <= 0) and seconds[-1] < seconds[0]:
        # historians list the newest sample first
        rows, seconds = rows[::-1], seconds[::-1]
        if axis.start is not None:
            start = axis.start + np.timedelta64(round(1e9 * float(seconds[0])), "ns")
            return axis._replace(seconds=seconds - seconds[0], start=start), rows
    return axis._replace(seconds=seconds), rows


def wide_samples(
    table: Table, parts: Parts, seconds: FloatArray, rows: Rows, rules: Rules
) -> Samples:
    """Samples in some rows of a table with a column for each signal."""
    input, output = (
        _stacked([rules.values(table, k, rows) for k in chosen])
        for chosen in (parts.inputs, parts.outputs)
    )
    reference = None
    if parts.references:
        lenient = replace(rules, keep=True)
        wanted = [filled(lenient.values(table, k, rows)) for k in parts.references]
        reference = _stacked(wanted)
        if parts.mode is not None:
            reference[..., _in_manual(table, parts.mode)[rows]] = np.nan
    return Samples(seconds, input, output, None, table.rows(rows, []).place, reference)


def long_samples(
    table: Table,
    long: LongTable,
    parts: Parts,
    axis: TimeAxis,
    span: tuple[float, float],
    rules: Rules,
) -> Samples:
    """Samples of the chosen tags of a long table, each at its own stamps."""
    tags, seconds, (first, last) = list(long.rows), axis.seconds, span

    def series_of(k: int, *, holds: bool) -> tuple[FloatArray, FloatArray]:
        """Stamps and values of one tag in the order of time; of equal stamps the last one holds."""
        rows = long.rows[tags[k]]
        rows = rows[np.argsort(seconds[rows], kind="stable")]
        rows = rows[np.r_[np.diff(seconds[rows]) != 0, True]]
        inside = (seconds[rows] >= first) & (seconds[rows] <= last)
        if holds and rows.size:
            # what was set before the part begins still holds there
            before = np.flatnonzero(seconds[rows] < first)
            inside[before[-1:]] = True
        rows = rows[inside]
        values = rules.values(table, long.value, rows)
        known = ~np.isnan(values)  # a sample without a value is no sample
        return np.maximum(seconds[rows][known], first), values[known]

    both = []
    for chosen in (parts.inputs, parts.outputs):
        series = [series_of(k, holds=chosen is parts.inputs) for k in chosen]
        time = np.unique(np.concatenate([stamps for stamps, _ in series]))
        values = np.full((len(series), time.size), np.nan)
        for row, (stamps, numbers) in zip(values, series, strict=True):
            row[np.searchsorted(time, stamps)] = numbers
        both.append((time, values[0] if len(series) == 1 else values))
    (input_time, input), (time, output) = both
    if input_time.size and time.size and input_time[-1] < time[-1]:
        # a valve that did not move again has held its place to the end
        input_time = np.r_[input_time, time[-1]]
        input = np.concatenate([input, input[..., -1:]], axis=-1)
    reference = None
    if parts.references:
        wanted = [held(*series_of(k, holds=True), time) for k in parts.references]
        reference = _stacked(wanted)
        if parts.mode is not None:
            rows = long.rows[tags[parts.mode]]
            rows = rows[np.argsort(seconds[rows], kind="stable")]
            manual = _in_manual(table.rows(rows, [long.value]), long.value)
            reference[..., held(seconds[rows], manual, time) == 1] = np.nan
    return Samples(time, input, output, input_time, "sample {}".format, reference)


def span_of(start: Any, stop: Any, axis: TimeAxis) -> tuple[float, float]:
    """First and last time in s of the wanted part; dates are compared with those of the file."""
    low = -np.inf if start is None else _second(start, "start", axis)
    high = np.inf if stop is None else _second(stop, "stop", axis)
    if not low < high:
        raise OptionError(f"start={start!r} is not before stop={stop!r}")
    return low, high


def check_part(path: Path, span: tuple[float, float], inside: FloatArray, axis: TimeAxis) -> None:
    """Refuse a part with too few samples for a record."""
    if np.isfinite(span).any() and inside.size < MIN_SAMPLES:
        raise DataError(
            f"{path}: there are {inside.size} samples between {span[0]:g} s and {span[1]:g} s; "
            f"the file covers {np.min(axis.seconds):g} s to {np.max(axis.seconds):g} s"
            + ("" if axis.start is None else f" from {_beginning(axis)} on")
        )


def _second(given: Any, name: str, axis: TimeAxis) -> float:
    if isinstance(given, int | float | np.integer | np.floating) and not isinstance(given, bool):
        return float(given)
    import pandas as pd

    if axis.start is None:
        raise OptionError(
            f"{name}={given!r}: the time of the file has no dates; expected a time in s"
        )
    if axis.doubt:
        raise OptionError(f"{name}={given!r}: {axis.doubt}")
    try:
        stamp = date_of(given, axis.form) if isinstance(given, str) else pd.Timestamp(given)
    except (ValueError, TypeError):
        stamp = pd.NaT
    if pd.isna(stamp):
        raise OptionError(
            f"{name}={given!r}; expected a time in s, or a date, with a time of day or without, "
            f"as in the file or in ISO 8601, such as {_beginning(axis)!r}"
        )
    if stamp.tzinfo is None and axis.zone:
        # the first of an hour that comes twice, and the end of one that is left out
        stamp = stamp.tz_localize(axis.zone, ambiguous=True, nonexistent="shift_forward")
    if stamp.tzinfo is None and axis.zone is not None:
        raise OptionError(
            f"{name}={given!r}: the offsets of the file from UTC differ; give the date with its "
            "offset, or time_zone=, such as 'Europe/Berlin'"
        )
    if stamp.tzinfo is not None and axis.zone is None:
        raise OptionError(
            f"{name}={given!r}: the dates of the file have no offset from UTC; give the date "
            "without one, or time_zone=, the zone of the file, such as 'Europe/Berlin'"
        )
    first = pd.Timestamp(axis.start).tz_localize("UTC" if stamp.tzinfo else None)
    return float((stamp - first) / pd.Timedelta(1, "s"))


def _beginning(axis: TimeAxis) -> str:
    """First date on the clock of the file, and in its format."""
    import pandas as pd

    start: Any = axis.start
    first = pd.Timestamp(start)
    if axis.zone is not None:
        first = first.tz_localize("UTC").tz_convert(axis.zone or "UTC")
    return first.strftime(axis.form) if "%" in axis.form else first.isoformat(" ", "seconds")


def labels_of(table: Table, parts: Parts, time_unit: str) -> dict[str, Any]:
    """Names and units of the signals, as the file has them, and the unit of time."""
    labels: dict[str, Any] = {}
    units: dict[str, str] = {"time": time_unit}
    for argument, letter, chosen in (
        ("input_labels", "u", parts.inputs),
        ("output_labels", "y", parts.outputs),
    ):
        names = [table.columns[k].name for k in chosen]
        unique = all(names) and len(set(names)) == len(names)
        labels[argument] = labelled(names if unique else None, len(chosen), letter, argument)
        for name, k in zip(labels[argument], chosen, strict=True):
            unit = table.columns[k].told_unit
            if plain_unit(unit):
                units[name] = unit
    return labels | {"units": units}


def _in_manual(table: Table, index: int) -> BoolArray:
    """Rows in which a controller is in manual; a cell without a mode has the one before.

    There a set point is not in force: NaN. Otherwise it holds its value until it is stored again.

    Raises
    ------
    OptionError
        A cell is no mode that is known.
    """
    if strange := strange_modes(table, index):
        raise OptionError(
            f"{table.at(index)} has the modes {', '.join(sorted(strange)[:5])}; "
            f"expected {', '.join(MODES['manual'][:3])}, {', '.join(MODES['automatic'][:3])}, "
            "cas, or 0 and 1"
        )
    kinds = dict.fromkeys(MODES["manual"], 1.0) | dict.fromkeys(MODES["automatic"], 0.0)
    words = map(mode_word, table.columns[index].cells.tolist())
    return np.asarray(filled(np.array([kinds.get(word, np.nan) for word in words])) == 1)


def _stacked(rows: Sequence[FloatArray]) -> FloatArray:
    return rows[0] if len(rows) == 1 else np.stack(rows)
