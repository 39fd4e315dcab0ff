"""Operating data of a loop: controller output, process value, set point."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from ..._checks import numbers, positive
from ...data import Record
from ...errors import DataError
from ...numerics.arrays import FloatArray, locked, runs
from ...numerics.constants import LARGEST

LONGEST_GAP = 3
"""Missing samples in a row that are interpolated."""
FEWEST = 24
"""Samples without which there is nothing to look at."""


@dataclass(frozen=True, eq=False)
class LoopData:
    """Controller output, process value and set point, complete, with a fixed sample time.

    `filled` counts the samples in short gaps, which are interpolated; `left_out` those before and
    after the longest part without long gaps.
    """

    op: FloatArray
    pv: FloatArray
    sp: FloatArray | None
    dt: float
    left_out: int
    filled: int

    @property
    def deviation(self) -> FloatArray:
        """Process value minus set point, or the process value if there is none."""
        return self.pv if self.sp is None else self.pv - self.sp

    @property
    def record(self) -> Record:
        """The same as a record from time zero, OP as input and PV as output."""
        time = self.dt * np.arange(self.op.size)
        return Record(
            time, self.op, self.pv, name="loop", input_labels=["OP"], output_labels=["PV"]
        )


def loop_data(loop: Any, pv: Any, sp: Any, dt: Any) -> LoopData:
    """Take a record, or arrays.

    Raises
    ------
    DataError
        Several inputs or outputs, arrays of different lengths, or too few samples without gaps.
    """
    if isinstance(loop, Record):
        if pv is not None or dt is not None:
            raise DataError(
                "expected a Record, which contains pv and dt, or the arrays op, pv and dt; got both"
            )
        if loop.input.ndim > 1 or loop.output.ndim > 1:
            raise DataError(
                f"{loop!r}; expected one input, the controller output, and one output, the "
                "process value: choose them when reading, or give arrays"
            )
        op, pv, dt = loop.input, loop.output, loop.dt
        sp = loop.reference if sp is None else sp
    elif pv is None or dt is None:
        raise DataError(
            f"pv={'None' if pv is None else '...'}, dt={dt!r}; expected a Record, or the arrays "
            "op and pv with dt in s"
        )
    else:
        op = loop
    signals = {"op": numbers(op, "op"), "pv": numbers(pv, "pv")}
    if sp is not None:
        given = numbers(sp, "sp")
        signals["sp"] = np.full(signals["pv"].shape, float(given)) if given.ndim == 0 else given
    shapes = {name: each.shape for name, each in signals.items()}
    if any(len(shape) != 1 for shape in shapes.values()) or len(set(shapes.values())) > 1:
        told = ", ".join(f"{name} has shape {shape}" for name, shape in shapes.items())
        raise DataError(f"{told}; expected one dimension and equal lengths")
    step = positive(dt, "dt", "sample time in s")
    table = np.stack(list(signals.values()))
    complete = np.isfinite(table)
    largest = float(np.abs(table[complete]).max(initial=0.0))
    if largest > LARGEST:
        raise DataError(f"values up to {largest:.3g}; expected at most {LARGEST:.0e}")
    good = np.asarray(complete.all(axis=0))
    first, last = _longest_part(_without_short_gaps(good))
    size = signals["op"].size
    if last - first < FEWEST:
        raise DataError(
            f"the longest part without long gaps has {last - first} of {size}; expected at "
            f"least {FEWEST}, and some cycles of the oscillation"
        )
    place, known = np.arange(size, dtype=np.float64), np.flatnonzero(good)
    cut = {
        name: locked(np.interp(place[first:last], place[known], each[known]))
        for name, each in signals.items()
    }
    left_out, filled = size - (last - first), int(np.sum(~good[first:last]))
    return LoopData(cut["op"], cut["pv"], cut.get("sp"), step, left_out, filled)


def _without_short_gaps(good: np.ndarray) -> np.ndarray:
    """Mark the samples of short gaps between complete parts as good, too."""
    bridged = good.copy()
    known = np.flatnonzero(good)
    for before, after in pairwise(known.tolist()):
        if 1 < after - before <= LONGEST_GAP + 1:
            bridged[before:after] = True
    return bridged


def _longest_part(good: np.ndarray) -> tuple[int, int]:
    """First and last index of the longest run of true values."""
    parts = zip(*(ends.tolist() for ends in runs(good)), strict=True)
    return max(parts, key=lambda part: part[1] - part[0], default=(0, 0))
