"""``ctrl-realize look``: which column of a file is what, and the record that it gives."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from .._wording import in_time
from ..errors import CtrlRealizeError
from ..io import read_record
from ..io.checks import MAX_BYTES
from ..io.read import read_table
from ..io.signals.long_format import long_table, tags_as_columns
from ..io.signals.names import choose_columns
from ..io.signals.quality import rules_of
from ..io.tables import Table
from ..io.text_options import TextOptions
from .manifest import Run
from .terminal import complain, one_line, printable, say, table

_TEXT = ("delimiter", "decimal", "encoding", "comment", "header", "skip_rows", "thousands")


def run_look(file: Path, *, record: Mapping[str, Any], run: Run) -> int:
    """Show columns and record, and return the exit code: 2 if the file is no record yet."""
    options = TextOptions(**{name: record[name] for name in _TEXT if name in record})
    found = read_table(file, options, variable=record.get("variable"), max_bytes=MAX_BYTES)
    signals = record.get("input"), record.get("output")
    long = long_table(found, record.get("time"), signals)
    shown = found if long is None else tags_as_columns(found, long)
    used: dict[int, str] = {}
    failed = ""
    try:
        used = _uses(shown, record, is_long=long is not None)
        made = read_record(file, **record)
    except CtrlRealizeError as error:
        failed = one_line(error)
    rows = [
        [str(k), printable(one.name), one.told_unit, *_ends(one.cells), used.get(k, "")]
        for k, one in enumerate(shown.columns)
    ]
    name = "column" if long is None else "tag"
    say(table([name, "name", "unit", "first", "last", "used as"], rows, numbers=[0]))
    if failed:
        complain(failed)
        return 2
    span = in_time(float(made.time[-1] - made.time[0]))
    say(f"\n{printable(repr(made))}, {span} long")
    return 0


def _uses(shown: Table, record: Mapping[str, Any], *, is_long: bool) -> dict[int, str]:
    """What each column is used as."""
    rules = rules_of(True, None, record.get("quality", "auto"), None)
    qualities = [] if is_long else rules.columns(shown)
    time, dt = (None, 1.0) if is_long else (record.get("time"), record.get("dt"))
    parts = choose_columns(shown, time, record.get("input"), record.get("output"), dt, qualities)
    clock = [k for k in (parts.time, parts.date) if k is not None]
    named = (("quality", qualities), ("time", clock), ("input", parts.inputs),
             ("output", parts.outputs))  # fmt: skip
    return {k: name for name, columns in named for k in columns}


def _ends(cells: np.ndarray[Any, np.dtype[Any]]) -> tuple[str, str]:
    """First and last cell, shortened."""
    ends = [str(cells[k])[:20] for k in (0, -1)] if cells.size else ["", ""]
    return ends[0], ends[1]
