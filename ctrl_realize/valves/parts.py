"""Parts of a valve test: steps, staircases, full strokes and ramps in the command."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from typing import Literal

import numpy as np

from .._checks import positive
from ..data import Record
from ..data.given import as_record
from ..errors import DataError
from ..numerics.arrays import FloatArray
from ..numerics.signals.edges import Edge, despike, difference_noise
from ..numerics.signals.noise import mad_sigma

PartKind = Literal["baseline", "step", "staircase", "stroke", "ramp"]

_LEAST_RAMP = 0.05
"""Smallest ramp, as a fraction of the command's range."""
_STROKE_SHARE = 0.8
"""A step over this fraction of the command's range is a full stroke."""
_STEP_SAMPLES = 8
"""A change of the command that takes longer is a ramp."""
_FLAT = 0.05
"""Largest scatter of the command about a level, as a fraction of the step."""
_BENT = 0.05
"""Largest distance of a ramp from a straight line, as a fraction of its height."""
_COVERED = 0.3
"""Least fraction of a test that its parts cover."""
_ALIKE = 0.2
"""Relative difference up to which steps have the same height."""
_LEAST_STAIRS = 3
_LEAST_HOLD = 5  # samples


@dataclass(frozen=True)
class TestPart:
    """One part of a valve test.

    The part consists of the samples ``start`` to ``stop - 1`` of its record. ``edges`` are the
    steps of the command in it; a ramp and a baseline have none.

    Attributes
    ----------
    kind : {"baseline", "step", "staircase", "stroke", "ramp"}
    start, stop : int
        Samples of the record.
    before, after : float
        Level of the command at the beginning and at the end, in its unit.
    edges : tuple of Edge
        Steps of the command.
    time : float
        Time of the first change of the command in s; of a baseline, its start.

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> t = 0.1 * np.arange(900)
    >>> u = 50 + 2.0 * np.digitize(t, [30, 60])
    >>> parts = cr.valves.split_test(cr.Record(t, u, u), command_range=(0, 100))
    >>> [(part.kind, part.before, part.after) for part in parts]
    [('baseline', 50.0, 50.0), ('step', 50.0, 52.0), ('step', 52.0, 54.0)]
    """

    __test__ = False  # not a test of pytest

    kind: PartKind
    start: int
    stop: int
    before: float
    after: float
    time: float
    edges: tuple[Edge, ...] = ()


def split_test(record: Record, *, command_range: Sequence[float] | None = None) -> list[TestPart]:
    """Split a record of a valve test by its command.

    A change of the command within eight samples between two levels is a step; over at least 80 % of
    the command's range it is a full stroke. Steps of the same height (within 20 %) in succession,
    of which at least three go the same way, are a staircase. A slower change along a straight line
    is a ramp. A record of which these parts, with the levels that the command holds, cover less
    than 30 % is one of operation, not of a test, and gives none of them; cut out a test that it
    contains.

    Parameters
    ----------
    record : Record
        Command (input) and position of the stem, or a process variable (output).
    command_range : (float, float), optional
        Command of the closed and of the open valve. Default: the range of the record.

    Returns
    -------
    list of TestPart
        In chronological order.

    Raises
    ------
    DataError
        Several channels, or missing samples of the command.

    Notes
    -----
    The rules are our own.

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> t = 0.1 * np.arange(2400)
    >>> u = np.interp(t, [0, 20, 120, 150, 150.05, 240], [20, 20, 80, 80, 20, 20])
    >>> for part in cr.valves.split_test(cr.Record(t, u, u)):
    ...     print(f"{part.kind} at {part.time:.0f} s: {part.before:.0f} to {part.after:.0f}")
    baseline at 0 s: 20 to 20
    ramp at 20 s: 20 to 80
    stroke at 150 s: 80 to 20
    """
    if not as_record(record).issiso():
        raise DataError(f"{record!r}; expected one input, the command, and one output, the stem")
    command = np.ravel(record.input)
    if np.isnan(command).any():
        raise DataError("the command has missing samples; cut the record or interpolate them")
    span = float(np.ptp(command)) if command_range is None else range_of(command_range)[2]
    if np.ptp(command) == 0:
        return [TestPart("baseline", 0, command.size, command[0], command[0], record.time[0])]
    found = _with_stairs(_changes(record, span))
    covered = np.zeros(command.size, dtype=bool)
    for part in found:
        covered[part.start : part.stop] = True
    if np.mean(covered) < _COVERED:
        return []
    if found:
        first = found[0]
        stop = first.edges[0].index if first.edges else first.start
        if stop >= _LEAST_HOLD:
            level = first.before
            found.insert(0, TestPart("baseline", 0, stop, level, level, float(record.time[0])))
    return found


def range_of(ends: Sequence[float]) -> tuple[float, float, float]:
    """Check a range; return its ends and its span."""
    if len(ends) != 2:
        raise DataError(f"range {ends!r}; expected two numbers: at closed and at open valve")
    low, high = (float(end) for end in ends)
    return low, high, positive(abs(high - low), "range", "difference of the two ends")


def _changes(record: Record, span: float) -> list[TestPart]:
    """Steps, strokes and ramps between the levels that the command holds."""
    command = np.ravel(record.input)
    noise = _noise_of(command)
    clean = despike(command, int(np.clip(command.size // 1000, 1, 6))) if noise else command
    half = 4 if noise else 1
    width = 2 * half + 1
    jump = _jumps(clean, width)
    # A median of w samples has 1.25 / sqrt(w) of the deviation of one; two of them differ here.
    threshold = max(5 * 1.25 * noise * np.sqrt(2 / width), 1e-6 * float(np.ptp(command)))
    moving = np.concatenate([[False], np.abs(jump) > threshold, [False]])
    bounds = np.flatnonzero(np.diff(moving)).reshape(-1, 2)
    found = []
    for k, (first, stop) in enumerate(bounds):
        start = int(bounds[k - 1][1]) - 1 - half if k else 0
        end = int(bounds[k + 1][0]) + half if k + 1 < len(bounds) else command.size
        # a median moves half a window before the sample that does
        low, high = int(first) + half, int(stop) - 1 - half
        before, after = clean[start:low], clean[high:end]
        if min(before.size, after.size) < 1:
            continue
        levels = float(np.median(before)), float(np.median(after))
        height = levels[1] - levels[0]
        held = min(before.size, after.size) >= _LEAST_HOLD
        limit = max(_FLAT * abs(height), 5 * noise)
        flat = [
            bool(side.size and np.subtract(*np.percentile(side, [95, 5])) <= limit)
            for side in (before, after)
        ]
        change = clean[low - 1 : high + 1]
        away = np.flatnonzero(np.abs(change - levels[0]) > max(0.02 * abs(height), 5 * noise))
        if not away.size or abs(height) <= threshold:
            continue
        index = low - 1 + int(away[0])
        there = np.flatnonzero(np.abs(clean[index:] - levels[1]) <= 0.02 * abs(height) + 5 * noise)
        samples = (int(there[0]) if there.size else command.size - index) + 1
        time = float(record.time[index])
        if samples <= _STEP_SAMPLES and held and all(flat):
            edge = Edge(index, height, levels[0], samples, start, end)
            kind: PartKind = "stroke" if abs(height) >= _STROKE_SHARE * span else "step"
            found.append(TestPart(kind, start, end, *levels, time, (edge,)))
        elif samples > _STEP_SAMPLES and abs(height) > _LEAST_RAMP * span:
            way = np.sign(height) * np.diff(change[:: max(change.size // 50, 1)])
            line = np.linspace(change[0], change[-1], change.size)
            bent = float(np.max(np.abs(change - line)))
            straight = bent <= max(_BENT * abs(height), 5 * noise)
            # it leads from one level to another, or back from where another ramp has led
            ends = any(flat) or bool(found and found[-1].kind == "ramp")
            if straight and ends and way.size and np.mean(way >= -3 * noise) > 0.95:
                time = float(record.time[low])
                found.append(TestPart("ramp", low, min(high + 1, command.size), *levels, time))
    return found


def _noise_of(command: FloatArray) -> float:
    """White noise of a command; third differences do not take a smooth motion for noise."""
    third = np.diff(command, 3)
    smooth = mad_sigma(third) / np.sqrt(20) if third.size else 0.0
    return min(difference_noise(command), smooth)


def _jumps(values: FloatArray, width: int) -> FloatArray:
    """Median of the `width` samples from each sample on, minus that of those before it."""
    padded = np.pad(values, width, mode="edge")
    medians = np.median(np.lib.stride_tricks.sliding_window_view(padded, width), axis=1)
    return np.asarray(medians[width : width + values.size] - medians[: values.size])


def _with_stairs(parts: list[TestPart]) -> list[TestPart]:
    """Join successive steps of the same height to staircases."""
    joined: list[TestPart] = []
    run: list[TestPart] = []

    def close() -> None:
        edges = tuple(edge for one in run for edge in one.edges)
        ways = [bool(edge.amplitude > 0) for edge in edges]
        longest = max((len(list(own)) for _, own in groupby(ways)), default=0)
        if longest >= _LEAST_STAIRS:
            joined.append(
                replace(run[0], kind="staircase", stop=run[-1].stop, after=run[-1].after,
                        edges=edges)
            )  # fmt: skip
        else:
            joined.extend(run)
        run.clear()

    for part in parts:
        heights = [abs(edge.amplitude) for one in (*run[:1], part) for edge in one.edges]
        alike = part.kind == "step" and max(heights) <= (1 + _ALIKE) * min(heights)
        if run and not (alike and part.edges[0].start <= run[-1].stop):
            close()
        if part.kind == "step":
            run.append(part)
        else:
            joined.append(part)
    close()
    return joined
