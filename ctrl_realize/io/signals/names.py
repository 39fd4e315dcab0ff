"""Which columns are time, input and output: as requested, or by their names."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from ...errors import DataError, OptionError
from ..columns import (
    Selector,
    family,
    find_column,
    find_columns,
    has_header,
    holds_numbers,
    named,
    plain_name,
)
from ..tables import Table
from ..units import SAMPLE_TIMES, is_no_time, sample_time_unit, to_seconds

TIME_NAMES = frozenset(
    {"t", "time", "times", "timestamp", "timestamps", "time stamp", "datetime", "date time",
     "date/time", "elapsed", "elapsed time", "time elapsed", "seconds", "sec", "secs", "ms",
     "t stamp", "millis", "milliseconds", "micros", "microseconds", "minutes", "hours", "x value",
     "zeit", "zeitstempel", "datum/zeit", "datum zeit", "uhrzeit", "temps", "tiempo", "tempo",
     "tijd", "tid", "czas"}
)  # fmt: skip
DATE_NAMES = frozenset({"date", "datum", "fecha", "data"})
"""Time if there is no other, or the date of a column with the time of day."""
INPUT_NAMES = frozenset(
    {"u", "in", "input", "inputs", "input signal", "drive", "command", "cmd", "excitation",
     "stimulus", "op", "mv", "co", "lmn", "pwm", "controller output", "control output",
     "control signal", "manipulated variable", "manipulated value", "eingang", "stellgröße",
     "stellgroesse", "stellgrösse", "stellwert", "stellsignal", "stellgrad", "entrée", "entree",
     "commande", "entrada", "ingresso"}
)  # fmt: skip
OUTPUT_NAMES = frozenset(
    {"y", "out", "output", "outputs", "output signal", "response", "measured", "measurement",
     "measured value", "actual value", "pv", "process variable", "process value",
     "controlled variable", "ausgang", "istwert", "regelgröße", "regelgroesse", "regelgrösse",
     "messwert", "sortie", "mesure", "salida", "uscita"}
)  # fmt: skip
SETPOINT_NAMES = frozenset(
    {"sp", "sv", "set point", "setpoint", "sollwert", "führungsgröße", "fuehrungsgroesse",
     "consigne", "consigna"}
)  # fmt: skip
"""Neither input nor output of a plant beside those."""
_TAGS_INPUT = frozenset({"op", "mv", "co", "lmn"})
_TAGS_OUTPUT = frozenset({"pv"})
_TAGS_SETPOINT = frozenset({"sp", "sv"})
"""Last part of a tag, such as ``TIC101_PV`` or ``Gas valve MV``."""
QUALITY_NAMES = frozenset(
    {"quality", "qualität", "qualitaet", "qual", "status", "opc quality", "opcquality",
     "quality code", "qualitycode", "quality detail", "qualitydetail", "status code",
     "statuscode", "good", "is good", "isgood"}
)  # fmt: skip
_RATE_NAMES = frozenset({"fs", "sample rate", "samplerate", "sampling rate"})


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
        setpoints = named(table, SETPOINT_NAMES) + _tagged(table, _TAGS_SETPOINT, known)
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
    names, tags = {
        "input": (INPUT_NAMES, _TAGS_INPUT),
        "output": (OUTPUT_NAMES, _TAGS_OUTPUT),
    }[kind]
    found = named(table, names, taken) or _tagged(table, tags, taken)
    parts = {family(table.columns[k].name) for k in found} & (_TAGS_INPUT | _TAGS_OUTPUT)
    # channels have one name with numbers; two different names of a loop are two candidates
    if len(found) > 1 and parts and len({family(table.columns[k].name) for k in found}) > 1:
        raise OptionError(
            f"{table.path} has {len(found)} columns that could be the {kind}; give {kind}=name or "
            f"number; it has {table.listing()}"
        )
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
    found = named(table, TIME_NAMES, taken)
    return [k for k in found if not is_no_time(table.columns[k].unit)]


def _dates(table: Table, clock: int | None, taken: Iterable[int]) -> list[int]:
    """Columns of dates beside that of time."""
    used = {*taken, *([] if clock is None else [clock])}
    return [k for k in named(table, DATE_NAMES, used) if not holds_numbers(table, k)]


def _guessed_clock(table: Table, taken: Sequence[int]) -> tuple[int | None, float | None]:
    """Time column by name, otherwise the sample time in the file, otherwise the first column."""
    clocks = _clocks(table, taken) or _dates(table, None, taken)
    if len(clocks) == 1:
        return clocks[0], None
    if len(clocks) > 1:
        raise OptionError(
            f"{table.path} has {len(clocks)} columns that could be time; give time=name or "
            f"number; it has {table.listing()}"
        )
    for key, value in table.constants.items():
        plain = key.rpartition(".")[2].replace("_", " ").lower()
        unit = sample_time_unit(key)
        if unit or plain in SAMPLE_TIMES | _RATE_NAMES:
            step = 1 / value if plain in _RATE_NAMES and value else value
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
