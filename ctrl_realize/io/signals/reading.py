"""From the table in a file to its record, or to those of several tests."""

from __future__ import annotations

import re
import warnings
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from ..._checks import one_of, positive
from ..._wording import ASSUMED
from ...data import Record
from ...data.samples import COARSE, Samples
from ...errors import CtrlRealizeError, DataError, OptionError, TimeAxisError, warn_caller
from ...numerics.signals.noise import far_value
from ..frf import parts_of_frf
from ..read import read_table
from ..tables import Table
from ..text_options import TextOptions
from ..time_column import AS_STATED, Clock, TimeAxis, time_axis
from .long_format import LongTable, long_table, tags_as_columns
from .names import Parts, choose_columns, clocks_of
from .quality import Rows, Rules, rules_of
from .samples import check_part, labels_of, long_samples, span_of, wide_axis, wide_samples

_JUMP = 10.0
"""Length of a jump of time that separates two tests, in usual steps; missing samples of one test
leave shorter gaps, and tests are mostly hours apart."""


class Reading(SimpleNamespace):
    """Arguments of `read_record` by their names, checked."""

    def __init__(self, **given: Any) -> None:
        super().__init__(**given)
        self.treatment = one_of(self.missing, "missing", ("auto", "refuse", "keep", "hold"))
        if self.dt is not None:
            positive(self.dt, "dt", "sample time in s")
        if self.wrap:
            positive(self.wrap, "wrap", "number of values of a counter")
        if self.treatment not in ("refuse", "auto") and self.resample:
            raise OptionError(
                f"missing={self.missing!r} and resample=True exclude each other: expected one of "
                "them"
            )
        pair = not isinstance(self.rest, str) and np.shape(self.rest)[:1] == (2,)
        if self.rest is not None and not pair:
            raise OptionError(f"rest={self.rest!r}; expected input and output in the steady state")
        self.text = TextOptions.among(given)
        self.clock = Clock(self.time_unit, self.time_format, self.time_zone)
        kept = self.treatment != "refuse" and not self.resample
        self.rules: Rules = rules_of(kept, self.na_values, self.quality, self.good)

    @property
    def label(self) -> str:
        """Name of the record."""
        return Path(self.path).stem if self.name is None else str(self.name)

    def table(self) -> Table:
        """Read the file."""
        return read_table(self.path, self.text, variable=self.variable, max_bytes=self.max_bytes)

    def signals(self, table: Table) -> tuple[Table, LongTable | None]:
        """Table with a column for each signal, and the rows of each in a long table."""
        long = long_table(table, self.time, (self.input, self.output, self.reference))
        return (table if long is None else tags_as_columns(table, long)), long

    def parts(self, signals: Table, taken: Sequence[int] | None) -> Parts:
        """Which column is what; `taken` are no signals, and None for those of a long table."""
        time, dt = (None, 1.0) if taken is None else (self.time, self.dt)
        try:
            return choose_columns(
                signals, time, self.input, self.output, dt, taken or (), self.reference, self.mode
            )
        except OptionError:
            if not parts_of_frf(signals):
                raise
            raise OptionError(
                f"{signals.path} holds a frequency response ({signals.listing()}); expected a "
                f"record in time. In Python cr.read_frf({str(signals.path)!r}) reads it, and "
                "cr.fit_frf of that makes a model"
            ) from None


def record_of(table: Table, how: Reading, name: str, taken: Sequence[int] = ()) -> Record:
    """Make a record of a table; columns that are `taken` are no signals."""
    samples, labels = _samples(table, how, taken)
    labels["name"] = name
    samples, treatment = samples.without_turns(table.path, how.wrap), how.treatment
    try:
        if treatment == "auto" and not how.resample:
            samples, treatment = samples.as_found(table.path)
        record = samples.record(labels, treatment=treatment, resample=how.resample)
    except TimeAxisError as error:
        raise TimeAxisError(_explained(error, table, samples)) from error
    except DataError as error:
        raise DataError(f"{table.path}: {error}") from error
    _warn_of_codes(table, record)
    return record if how.rest is None else record.with_baseline(*how.rest)


def _warn_of_codes(table: Table, record: Record) -> None:
    """Tell inputs with nines far from all else: what a code did to an output is told by its fit."""
    for label, values in zip(record.input_labels, np.atleast_2d(record.input), strict=True):
        far = far_value(values)
        if far.size and set(f"{abs(values[far[0]]):.0f}") == {"9"}:
            code = f"{values[far[0]]:g}"
            warn_caller(
                f"{table.path}: {label} is {code} in {far.size} of {values.size} samples, far from "
                f"all others; na_values={code} if that stands for a missing value"
            )


@np.errstate(over="ignore", invalid="ignore")  # the largest doubles
def _explained(error: TimeAxisError, table: Table, samples: Samples) -> str:
    """Message of a fault of the time axis, with its place in the file and what helps."""
    row = re.search(r"row (\d+)", str(error))
    place = f" ({samples.place(int(row[1]))})" if row else ""
    steps = np.diff(samples.time)
    steps *= np.sign(np.median(steps)) or 1.0  # the newest sample may come first
    # many repeated time stamps: the samples are faster than the resolution of the clock
    if np.mean(steps == 0) > COARSE:
        advice = "; the clock is coarser than the sample time, give dt= instead"
    elif np.any(steps < 0):
        advice = (
            "; if the file has several tests, read them with read_records(path, by=); if the clock "
            "was set for summer time, time_zone= is its zone, such as 'Europe/Berlin'"
        )
    else:
        advice = (
            "" if "missing=" in str(error) else "; missing='keep' takes the samples as they are"
        )
    return f"{table.path}{place}: {error}{advice}"


def _samples(table: Table, how: Reading, taken: Sequence[int]) -> tuple[Samples, dict[str, Any]]:
    """Samples and their labels."""
    signals, long = how.signals(table)
    if long is not None:
        axis = time_axis(table, long.time, how.clock, long.date)
        parts = how.parts(signals, None)
        span = span_of(how.start, how.stop, axis)
        samples = long_samples(table, long, parts, axis, span, how.rules)
        check_part(table.path, span, samples.time, axis)
        return samples, labels_of(signals, parts, axis.unit)
    parts = how.parts(table, [*taken, *how.rules.columns(table)])
    if how.dt is not None:
        _check_sample_time(table, how, [*taken, *parts.inputs, *parts.outputs])
    axis, rows = wide_axis(table, parts, how.clock)
    span = span_of(how.start, how.stop, axis)
    inside = (axis.seconds >= span[0]) & (axis.seconds <= span[1])
    check_part(table.path, span, axis.seconds[inside], axis)
    samples = wide_samples(table, parts, axis.seconds[inside], rows[inside], how.rules)
    return samples, labels_of(table, parts, axis.unit)


@np.errstate(over="ignore", invalid="ignore")  # the largest doubles
def _check_sample_time(table: Table, how: Reading, taken: Sequence[int]) -> None:
    """Refuse a sample time beside a time column of other steps; without a unit it is told."""
    clocks = clocks_of(table, taken)
    axis = TimeAxis(np.empty(0))  # what is no time, or not one: dt= is in its place
    with suppress(CtrlRealizeError), warnings.catch_warnings(action="ignore"):
        axis = time_axis(table, clocks[0], how.clock) if len(clocks) == 1 else axis
    steps = np.diff(axis.seconds)
    if not steps.size or np.mean(steps == 0) > COARSE:
        return
    usual = np.array([np.median(steps), steps.mean()])  # with samples missing, with rounded stamps
    if np.isclose(usual, how.dt, rtol=AS_STATED).any():
        return
    said = f"{table.at(clocks[0])} has times every {usual[0]:g}"
    if axis.unit == ASSUMED:
        warn_caller(f"{said}, without a unit; dt={how.dt:g} s is used in their place")
    else:
        raise OptionError(
            f"{said} s, and dt={how.dt:g} s is for files without times; omit dt=, or give "
            "time_unit= if the times are in another unit"
        )


def tests_in(table: Table, how: Reading, separating: Sequence[int]) -> list[tuple[str, Rows]]:
    """Name and rows of each test."""
    if separating:
        cells = np.array([str(cell).strip() for cell in table.columns[separating[0]].cells])
        values = [value for value in dict.fromkeys(cells.tolist()) if value]
        return [(value, np.flatnonzero(cells == value)) for value in values]
    parts = how.parts(table, how.rules.columns(table))
    if parts.time is None:
        raise OptionError(
            f"{table.path} has no time whose jumps would separate tests; give by=, the column "
            "that tells them apart"
        )
    seconds = time_axis(table, parts.time, how.clock, parts.date).seconds
    steps = np.diff(seconds)
    if np.sum(steps < 0) > steps.size / 2:  # the newest sample comes first
        steps = -steps
    usual = float(np.median(np.abs(steps))) if steps.size else 0.0
    cuts = np.flatnonzero((steps < 0) | (steps > _JUMP * usual)) + 1
    groups = np.split(np.arange(seconds.size), cuts)
    return [(str(number), rows) for number, rows in enumerate(groups, start=1)]
