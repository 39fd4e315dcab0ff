"""Read a measured record from a file."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from .._checks import one_of
from ..data import Record
from ..errors import DataError, OptionError, TimeAxisError
from ..numerics.arrays import FloatArray
from .checks import MAX_BYTES
from .columns import (
    Selector,
    check_lengths,
    find_column,
    find_columns,
    has_header,
    holds_numbers,
    named,
)
from .read import read_table
from .tables import Table
from .text_options import TextOptions
from .time_column import time_in_seconds

TIME_NAMES = frozenset(
    {"t", "time", "times", "timestamp", "timestamps", "datetime", "date time", "elapsed",
     "elapsed time", "time elapsed", "seconds", "sec", "zeit", "zeitstempel", "temps", "tiempo",
     "tempo", "tijd", "tid", "czas"}
)  # fmt: skip
INPUT_NAMES = frozenset(
    {"u", "in", "input", "inputs", "input signal", "drive", "command", "cmd", "excitation",
     "stimulus", "op", "controller output", "manipulated variable", "eingang", "entrée", "entree",
     "entrada", "ingresso"}
)  # fmt: skip
OUTPUT_NAMES = frozenset(
    {"y", "out", "output", "outputs", "output signal", "response", "measured", "measurement",
     "pv", "process variable", "process value", "ausgang", "sortie", "salida", "uscita"}
)  # fmt: skip
_DT_NAMES = frozenset({"dt", "ts", "sample time", "sampletime", "sampling time"})
_RATE_NAMES = frozenset({"fs", "sample rate", "samplerate", "sampling rate"})


def read_record(
    path: str | os.PathLike[str],
    *,
    time: str | int | None = None,
    input: Selector | None = None,
    output: Selector | None = None,
    dt: float | None = None,
    time_unit: str = "auto",
    time_format: str | None = None,
    delimiter: str = "auto",
    decimal: str = "auto",
    encoding: str = "auto",
    comment: str | None = "auto",
    header: bool | Literal["auto"] = "auto",
    skip_rows: int = 0,
    variable: str | None = None,
    missing: Literal["refuse", "keep"] = "refuse",
    resample: bool = False,
    name: str | None = None,
    max_bytes: float = MAX_BYTES,
) -> Record:
    r"""Read a measured record from a CSV, TSV, ``.npz``, ``.mat`` or Parquet file.

    Columns are identified by their names (``time_s``, ``t``, ``Zeit [ms]``; ``input``, ``u``;
    ``output``, ``y``; numbered ones are channels). Without a header, three columns are time, input
    and output, and two with `dt` are input and output. Ambiguous columns are an error that lists
    them.

    Parameters
    ----------
    path : path-like
        The file; its type is determined from its first bytes.
    time : str or int, optional
        Time column, by name or by number from 0: numbers, ISO dates or times of day.
    input, output : str, int or sequence of them, optional
        Columns of the signals; several make a record of several channels.
    dt : float, optional
        Sample time in s, instead of a time column.
    time_unit : str, optional
        ``"s"``, ``"ms"``, ``"us"``, ``"ns"``, ``"min"``, ``"h"`` or ``"day"``; ``"auto"``: that of
        the header, or s. For a clock such as ``12:34`` it is the unit of the first number.
    time_format : str, optional
        Format of dates, as for `datetime.strptime`, if it is not ISO 8601.
    delimiter, decimal, encoding, comment : str, optional
        Format of text; ``"auto"``: determined from the first lines.
    header : bool or "auto", optional
        Whether the first line contains the names.
    skip_rows : int, optional
        Number of lines to skip at the start.
    variable : str, optional
        Matrix or struct of a ``.mat`` or ``.npz`` file to use.
    missing : {"refuse", "keep"}, optional
        Treatment of empty cells and ``NaN`` in input and output; see `Record`.
    resample : bool, optional
        Resample samples with time jitter onto a uniform time axis, see `Record.resampled`.
    name : str, optional
        Name of the record; default: the file's, without its ending.
    max_bytes : float, optional
        Largest file, packed or unpacked; 2 GiB.

    Returns
    -------
    Record

    Raises
    ------
    MissingFileError
        There is no such file, or no permission to read it.
    FileFormatError
        The file is empty, too large, damaged, or not a table of numbers.
    DataError
        A cell is not a finite number; the message gives its line.
    TimeAxisError
        Time jitters, has gaps, repeats or decreases.
    OptionError
        The columns are ambiguous, or the requested ones do not exist.

    Warns
    -----
    DataWarning
        The last line is incomplete, as if writing was interrupted; it is left out.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import ctrl_realize as cr
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder) / "valve.csv"
    ...     _ = file.write_text("Zeit [ms];u;y\n0;0;1,5\n10;1;1,5\n20;1;1,75\n")
    ...     record = cr.read_record(file)
    >>> record
    <Record 'valve': 3 samples of 0.01 s, 1 input, 1 output>
    """
    options = TextOptions(delimiter, decimal, encoding, comment, header, skip_rows)
    if dt is not None and not (_is_number(dt) and dt > 0 and math.isfinite(dt)):
        raise OptionError(f"dt={dt!r} must be a positive number of seconds")
    keep = one_of(missing, "missing", ("refuse", "keep")) == "keep"
    if keep and resample:
        raise OptionError(
            "missing='keep' and resample=True exclude each other: expected one of them"
        )
    table = read_table(path, options, variable=variable, max_bytes=max_bytes)
    parts = _parts(table, time, input, output, dt)
    used = [*parts.inputs, *parts.outputs] + ([] if parts.time is None else [parts.time])
    check_lengths(table, used)
    signals = (_stacked(table, parts.inputs, keep), _stacked(table, parts.outputs, keep))
    if parts.time is None:
        stamps = parts.dt * np.arange(signals[0].shape[-1])
    else:
        stamps = time_in_seconds(table, parts.time, time_unit, time_format)
    labels: dict[str, Any] = {
        "name": Path(path).stem if name is None else name,
        "input_labels": _labels(table, parts.inputs),
        "output_labels": _labels(table, parts.outputs),
    }
    try:
        if resample:
            return Record.resampled(stamps, *signals, **labels)
        return Record(stamps, *signals, missing=missing, **labels)
    except TimeAxisError as error:
        row = re.search(r"row (\d+)", str(error))
        place = f" ({table.place(int(row[1]))})" if row else ""
        # many repeated time stamps: the samples are faster than the resolution of the clock
        coarse = np.mean(np.diff(stamps) == 0) > 0.2
        advice = "; the clock is coarser than the sample time, give dt= instead" if coarse else ""
        raise TimeAxisError(f"{table.path}{place}: {error}{advice}") from error
    except DataError as error:
        raise DataError(f"{table.path}: {error}") from error


@dataclass(frozen=True)
class _Parts:
    """Positions of the columns; ``dt`` is used if there is no time column."""

    time: int | None
    dt: float
    inputs: list[int]
    outputs: list[int]


def _parts(
    table: Table,
    time: str | int | None,
    input: Selector | None,
    output: Selector | None,
    dt: float | None,
) -> _Parts:
    if time is not None and dt is not None:
        raise OptionError("expected time= or dt=, got both")
    inputs = [] if input is None else find_columns(table, input, "input")
    outputs = [] if output is None else find_columns(table, output, "output")
    clock = None if time is None else find_column(table, time, "time")
    step = dt
    if clock is None and dt is None:
        clock, step = _guessed_clock(table, [*inputs, *outputs])
    # with dt= given, a time column in the file is still not a signal
    clocks = named(table, TIME_NAMES) if clock is None else [clock]
    inputs = inputs or named(table, INPUT_NAMES, [*clocks, *outputs])
    outputs = outputs or named(table, OUTPUT_NAMES, [*clocks, *inputs])
    rest = [
        k
        for k in range(len(table.columns))
        if k not in (*clocks, *inputs, *outputs) and holds_numbers(table, k)
    ]
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
    return _Parts(clock, math.nan if step is None else step, inputs, outputs)


def _guessed_clock(table: Table, taken: Sequence[int]) -> tuple[int | None, float | None]:
    """Time column by name, otherwise the sample time in the file, otherwise the first column."""
    clocks = named(table, TIME_NAMES, taken)
    if len(clocks) == 1:
        return clocks[0], None
    if len(clocks) > 1:
        raise OptionError(
            f"{table.path} has {len(clocks)} columns that could be time; give time=name or "
            f"number; it has {table.listing()}"
        )
    for key, value in table.constants.items():
        plain = key.rpartition(".")[2].replace("_", " ").lower()
        if plain in _DT_NAMES | _RATE_NAMES:
            step = value if plain in _DT_NAMES else 1 / value if value else math.inf
            if not (math.isfinite(step) and step > 0):
                raise DataError(f"{table.path}: {key}={value} is not a sample time; give dt=")
            return None, step
    if 0 not in taken and not has_header(table) and len(table.columns) >= 3:
        return 0, None
    raise OptionError(
        f"{table.path}: cannot tell which column is time; give time=name or number, or dt= in "
        f"s; it has {table.listing()}"
    )


def _stacked(table: Table, indices: list[int], keep_missing: bool) -> FloatArray:
    rows = [table.numbers(k, keep_missing=keep_missing) for k in indices]
    return rows[0] if len(rows) == 1 else np.stack(rows)


def _labels(table: Table, indices: list[int]) -> list[str] | None:
    names = [table.columns[k].name for k in indices]
    return names if all(names) and len(set(names)) == len(names) else None


def _is_number(value: object) -> bool:
    return isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool)
