"""Parts of a valve test: steps, staircases, full strokes and ramps in the command."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import groupby

import numpy as np

from .._checks import band, positive
from ..data import Record
from ..data.given import as_record
from ..errors import DataError
from .changes import LEAST_HOLD, changes_of
from .part import TestPart

_COVERED = 0.3
"""Least fraction of a test that its parts cover."""
_ALIKE = 0.2
"""Relative difference up to which steps have the same height."""
_LEAST_STAIRS = 3
_MOST_STAIRS = 32
"""Steps in one direction from which a staircase is a ramp."""


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
    found = _with_stairs(changes_of(record, span))
    covered = np.zeros(command.size, dtype=bool)
    for part in found:
        covered[part.start : part.stop] = True
    if np.mean(covered) < _COVERED:
        return []
    if found:
        first = found[0]
        stop = first.edges[0].index if first.edges else first.start
        if stop >= LEAST_HOLD:
            level = first.before
            found.insert(0, TestPart("baseline", 0, stop, level, level, float(record.time[0])))
    return found


def range_of(ends: Sequence[float]) -> tuple[float, float, float]:
    """Check a range; return its ends and its span."""
    low, high = band(ends, "range", "at closed and at open valve")
    return low, high, positive(abs(high - low), "range", "difference of the two ends")


def _stairs_that_are_ramps(run: list[TestPart]) -> list[TestPart]:
    """Long flights of steps one way, as the ramp of a control system with its rounding."""
    parts: list[TestPart] = []
    for _, own in groupby(run, key=lambda one: one.after > one.before):
        flight = list(own)
        if len(flight) > _MOST_STAIRS:
            first, last = flight[0], flight[-1]
            start, stop = first.edges[0].index, last.edges[0].index + 1
            parts.append(TestPart("ramp", start, stop, first.before, last.after, first.time))
        else:
            parts += flight
    return parts


def _with_stairs(parts: list[TestPart]) -> list[TestPart]:
    """Join successive steps of the same height to staircases."""
    joined: list[TestPart] = []
    run: list[TestPart] = []

    def close() -> None:
        edges = tuple(edge for one in run for edge in one.edges)
        ways = [bool(edge.amplitude > 0) for edge in edges]
        longest = max((len(list(own)) for _, own in groupby(ways)), default=0)
        if longest > _MOST_STAIRS:
            joined.extend(_stairs_that_are_ramps(run))
        elif longest >= _LEAST_STAIRS:
            first, last = run[0], run[-1]
            joined.append(
                replace(first, kind="staircase", stop=last.stop, after=last.after, edges=edges)
            )
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
