"""Which columns are time, input and output: as requested, or by their names."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from ..._facts import facts
from ...errors import DataError, OptionError
from ..columns import (
    Selector,
    ambiguous,
    family,
    find_column,
    find_columns,
    has_header,
    holds_numbers,
    named,
    plain_name,
)
from ..tables import Table
from ..units import is_no_time, sample_time_unit, to_seconds

NAMES = {key: frozenset(words) for key, words in facts("io/words.toml")["columns"].items()}
"""Names of columns by what they hold, and the last parts of tags, such as ``TIC101_PV``."""


@dataclass(frozen=True)
class Parts:
    """Positions of the columns.

    ``dt`` is used if there is no time column; ``date`` is the date of a time of day.
    """

    time: int | None
    date: int | None
    dt: float
    inputs: list[int]
    outputs: list[int]


def choose_columns(
    table: Table,
    time: str | int | None,
    input: Selector | None,
    output: Selector | None,
    dt: float | None,
    taken: Sequence[int] = (),
) -> Parts:
    """Assign columns to signals; `taken` are those with another meaning.

    Raises
    ------
    OptionError
        A requested column does not exist, or the names do not tell; the columns are listed.
    """
    if time is not None and dt is not None:
        raise OptionError("expected time= or dt=, got both")
    inputs = [] if input is None else find_columns(table, input, "input")
    outputs = [] if output is None else find_columns(table, output, "output")
    clock = None if time is None else find_column(table, time, "time")
    step = dt
    if clock is None and dt is None:
        clock, step = _guessed_clock(table, [*inputs, *outputs, *taken])
    # with dt= given, a time column in the file is still not a signal
    clocks = (_clocks(table, taken) if clock is None else [clock]) + _dates(table, clock, taken)
    known = [*clocks, *taken]
    inputs = inputs or _signals(table, "input", [*known, *outputs])
    outputs = outputs or _signals(table, "output", [*known, *inputs])
    rest = [
        k
        for k in range(len(table.columns))
        if k not in (*known, *inputs, *outputs) and holds_numbers(table, k)
    ]
    if len(rest) > 1:
        setpoints = named(table, NAMES["setpoint"]) + _tagged(table, NAMES["setpoint_tag"], known)
        rest = [k for k in rest if k not in setpoints]
    if not inputs and not outputs and not has_header(table) and len(rest) == 2:
        inputs, outputs = rest[:1], rest[1:]
    elif len(rest) == 1 and bool(inputs) != bool(outputs):
        inputs, outputs = inputs or rest, outputs or rest
    for signal, found in (("input", inputs), ("output", outputs)):
        if not found:
            raise OptionError(
                f"{table.path}: cannot tell which column is the {signal}; give {signal}=name or "
                f"number; it has {table.listing()}"
            )
    used = [*inputs, *outputs] + ([] if clock is None else [clock])
    if len(set(used)) != len(used):
        raise OptionError("a column is selected twice among time=, input= and output=")
    date = next((k for k in clocks if k != clock), None) if clock is not None else None
    return Parts(clock, date, math.nan if step is None else step, inputs, outputs)


def _signals(table: Table, kind: str, taken: Sequence[int]) -> list[int]:
    """Columns of a signal by their names: whole names first, then the last part of a tag."""
    found = named(table, NAMES[kind], taken) or _tagged(table, NAMES[f"{kind}_tag"], taken)
    families = {family(table.columns[k].name) for k in found}
    # channels have one name with numbers; two different names of a loop are two candidates
    if len(families) > 1 and families & (NAMES["input_tag"] | NAMES["output_tag"]):
        raise ambiguous(table, found, f"the {kind}", kind)
    return found


def _tagged(table: Table, tags: Iterable[str], taken: Iterable[int]) -> list[int]:
    """The one column whose name ends in one of `tags`; none if there are several."""
    used = set(taken)
    found = [
        k
        for k, column in enumerate(table.columns)
        if k not in used and re.split(r"[ _./:\\-]+", plain_name(column.name))[-1] in tags
    ]
    return found if len(found) == 1 else []


def _clocks(table: Table, taken: Iterable[int]) -> list[int]:
    found = named(table, NAMES["time"], taken)
    return [k for k in found if not is_no_time(table.columns[k].unit)]


def _dates(table: Table, clock: int | None, taken: Iterable[int]) -> list[int]:
    """Columns of dates beside that of time."""
    used = {*taken, *([] if clock is None else [clock])}
    return [k for k in named(table, NAMES["date"], used) if not holds_numbers(table, k)]


def _guessed_clock(table: Table, taken: Sequence[int]) -> tuple[int | None, float | None]:
    """Time column by name, otherwise the sample time in the file, otherwise the first column."""
    clocks = _clocks(table, taken) or _dates(table, None, taken)
    if len(clocks) == 1:
        return clocks[0], None
    if len(clocks) > 1:
        raise ambiguous(table, clocks, "time", "time")
    for key, value in table.constants.items():
        plain = key.rpartition(".")[2].replace("_", " ").lower()
        unit = sample_time_unit(key)
        if unit or plain in NAMES["sample_time"] | NAMES["sample_rate"]:
            step = 1 / value if plain in NAMES["sample_rate"] and value else value
            step = float(to_seconds(np.asarray(step), unit or "s"))
            if not (math.isfinite(step) and step > 0):
                raise DataError(f"{table.path}: {key}={value} is not a sample time; give dt=")
            return None, step
    if 0 not in taken and not has_header(table) and len(table.columns) >= 3:
        return 0, None
    raise OptionError(
        f"{table.path}: cannot tell which column is time; give time=name or number, or dt= in "
        f"s; it has {table.listing()}"
    )
