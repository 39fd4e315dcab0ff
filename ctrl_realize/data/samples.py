"""Samples of input and output with their time stamps, and the record that they make."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import DataError, OptionError, TimeAxisError, warn_caller
from ..numerics.arrays import FloatArray
from ..numerics.signals.counters import counter_period
from ..numerics.signals.sample_grid import held, regular_step, usual_step
from ..numerics.signals.time_axis import axis_fault
from .record import Record

COARSE = 0.2
"""Share of repeated stamps above which the clock is coarser than the sample time."""
_APART, _FEW = 0.5, 20
"""Share of rows with one of both signals, in a union of their stamps, and rows that tell it."""
_GAP, _LONG = 1.5, 2.5
"""Usual steps that are a gap, and in which an input may move unseen."""


def _in_words(time: FloatArray) -> str:
    """What is irregular about time stamps, which do not decrease."""
    once = np.unique(time)
    why = "samples are missing"
    if once.size > 1 and not regular_step(once):
        why = f"samples are about {usual_step(once):g} s apart"
    elif time.size > once.size:
        why = f"{time.size - once.size} stamps repeat, of which the later sample counts"
    return f"{why}: some stamps are irregular"


@dataclass(frozen=True, eq=False)
class Samples:
    """Input and output with the stamps of each, as they stand in a file.

    ``input_time`` is None where the samples of the input are those of the output. `reference` is
    the set point at the stamps of the output, NaN where it is not in force.
    """

    time: FloatArray
    input: FloatArray
    output: FloatArray
    input_time: FloatArray | None
    place: Callable[[int], str]
    reference: FloatArray | None = None

    def record(self, labels: dict[str, Any], *, treatment: str, resample: bool) -> Record:
        """Make a record: as it is, with gaps on a finer time axis, or interpolated."""
        labels = labels | {"reference": self.reference}
        if resample:
            return Record.resampled(self.time, self.at_outputs(), self.output, **labels)
        if treatment == "refuse":
            return Record(self.time, self.at_outputs(), self.output, **labels)
        time, input, output = self.time, self.input, self.output
        if self.input_time is None:
            # a stamp that comes twice was stored twice, or corrected: the later one holds
            last = np.r_[np.diff(time) != 0, True]
            time, input, output = time[last], input[..., last], output[..., last]
            if self.reference is not None:
                labels["reference"] = self.reference[..., last]
            holds = treatment == "hold" and np.isnan(input).any()
            if axis_fault(time) is None and not holds:
                return Record(time, input, output, missing="keep", **labels)
        return Record.from_samples(time, input, output, input_time=self.input_time, **labels)

    def as_found(self, path: Path) -> tuple[Samples, str]:
        """Samples and their treatment where none is asked for; what is missing is told.

        An input holds its value through a gap if it has the same behind it; where it moved
        meanwhile, a gap in time is refused, and a missing value stays missing.
        """
        if self.time.size < 2:
            return self, "refuse"
        for what, values in (("input", self.input), ("output", self.output)):
            if np.isnan(values).all():
                raise DataError(
                    f"{path}: the {what} has no value in any of {self.time.size} rows; choose "
                    f"another column with {what}="
                )
        fault = axis_fault(self.time)
        lost = [np.isnan(np.atleast_2d(one)) for one in (self.input, self.output)]
        gaps, back = any(one.any() for one in lost), bool(np.any(np.diff(self.time) < 0))
        if fault is not None and (
            fault.kind not in ("gap", "not_uniform", "repeated")
            or np.mean(np.diff(self.time) == 0) > COARSE
            or back
        ):
            # The fault of the clock is told before missing values, which another call would keep.
            return self, "keep" if back and gaps else "refuse"
        if fault is None and not gaps:
            return self, "refuse" if self.input_time is None else "keep"
        said = "" if fault is None else _in_words(self.time)
        samples = self
        if self.input_time is None:
            no_input, no_output = (one.all(axis=0) for one in lost)
            if no_input.size > _FEW and np.mean(no_input != no_output) > _APART:
                said = "input and output have their own stamps, between which the input holds"
                wanted = self.reference
                samples = replace(
                    self, time=self.time[~no_output], output=self.output[..., ~no_output],
                    input=self.input[..., ~no_input], input_time=self.time[~no_input],
                    reference=None if wanted is None else wanted[..., ~no_output],
                )  # fmt: skip
            else:
                samples = replace(self, input=self._held(fault is not None))
                rows = np.flatnonzero(no_input | lost[1].any(axis=0))
                if rows.size:
                    first = self.place(int(rows[0]))
                    have = "sample has" if rows.size == 1 else "samples have"
                    said = f"{rows.size} {have} missing values, the first in {first}" + (
                        f", and {said}" if said else ""
                    )
                said += samples._late()
        if said:
            warn_caller(
                f"{path}: {said}; they are kept as they are (missing='refuse' refuses them)"
            )
        return samples, "keep"

    def _held(self, in_time: bool) -> FloatArray:
        """Input with its values through gaps; in gaps of time it must not have moved."""
        input = np.array(self.input)
        long = _LONG * float(np.median(np.diff(self.time)))
        for row in np.atleast_2d(input):
            known = np.flatnonzero(~np.isnan(row))
            gaps = (np.diff(known) > 1) | (np.diff(self.time[known]) > long)
            for place in np.flatnonzero(gaps):
                before, after = known[place : place + 2]
                if row[before] == row[after]:
                    row[before:after] = row[before]
                elif in_time and self.time[after] - self.time[before] > long:
                    raise TimeAxisError(
                        f"there are no values between {self.time[before]:g} s and "
                        f"{self.time[after]:g} s ({self.place(int(after))}), and the input moved "
                        "meanwhile; missing='hold' holds its value, as a historian stores it"
                    )
        return input

    def _late(self) -> str:
        """What an input that moved in a gap of a row or so means; empty if it did not.

        Where samples are regular an input moves at one of them; at others anywhere between them.
        """
        steps = np.diff(self.time)
        usual = regular_step(np.unique(self.time))
        late = np.where(np.abs(np.diff(np.atleast_2d(self.input))) > 0, steps - usual, 0.0).max(0)
        row = int(np.argmax(late))
        if late[row] <= (_GAP - 1) * usual:
            return ""
        return (
            f"; the input moved in the gap before {self.place(row + 1)}, up to {late[row]:g} s "
            "before the sample from which it counts: a dead time may be as much longer"
        )

    def joined(self, period: float) -> Samples:
        """Return the samples with the turns of counters among the outputs joined.

        Raises
        ------
        OptionError
            The range of the outputs is longer than a turn.
        """
        output = np.array(self.output)
        rows = [row[~np.isnan(row)] for row in np.atleast_2d(output)]
        fitting = [row.size > 0 and np.ptp(row) <= period for row in rows]
        if not any(fitting):
            raise OptionError(
                f"wrap={period:g}: the output runs from {np.nanmin(output):g} to "
                f"{np.nanmax(output):g}; expected the number of values of its counter, such as 4096"
            )
        for row, joins in zip(np.atleast_2d(output), fitting, strict=True):
            if joins:
                row[~np.isnan(row)] = np.unwrap(row[~np.isnan(row)], period=period)
        return replace(self, output=output)

    def without_turns(self, path: Path, wrap: float | None) -> Samples:
        """Samples with the turns of counters joined; those that are found are told."""
        if wrap is not None:
            return self.joined(wrap) if wrap else self
        periods = {counter_period(row) for row in np.atleast_2d(self.output)} - {None}
        if not periods:
            return self
        period = min(map(float, periods))  # type: ignore[arg-type]
        warn_caller(
            f"{path}: the output jumps like a counter that starts again after {period:.6g}, whose "
            "turns are joined; wrap=0 takes it as it is"
        )
        return self.joined(period)

    def at_outputs(self) -> FloatArray:
        """Input at the stamps of the output; it holds its value between its own."""
        if self.input_time is None:
            return self.input
        return held(self.input_time, self.input, self.time)
