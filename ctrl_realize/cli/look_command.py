"""``ctrl-realize look``: which column of a file is what, and the record that it gives."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from .._wording import in_time
from ..data import MeasuredFRF, Record
from ..errors import CtrlRealizeError
from ..io import read_frf, read_record
from ..io.frf import parts_of_frf
from ..io.records import asked
from ..io.signals.reading import Reading
from ..io.tables import Table
from .manifest import Run
from .terminal import complain, one_line, printable, say, table


def run_look(file: Path, *, record: Mapping[str, Any], run: Run) -> int:
    """Show columns and what they hold, and return the exit code: 2 if it is no record yet."""
    how = asked(file, record)
    shown, long = how.signals(how.table())
    used: dict[int, str] = {}
    failed = ""
    made: Record | MeasuredFRF
    response = {} if record else parts_of_frf(shown)
    try:
        if response:
            used, made = {k: part for part, k in response.items()}, read_frf(file)
        else:
            used = _uses(shown, how, is_long=long is not None)
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
    if not isinstance(made, Record):
        say(f"\n{printable(repr(made))}, a frequency response")
        say(f"in Python: cr.fit_frf(cr.read_frf({str(file)!r})) makes a model of it")
        return 0
    span = in_time(float(made.time[-1] - made.time[0]))
    say(f"\n{printable(repr(made))}, {span} long")
    return 0


def _uses(shown: Table, how: Reading, *, is_long: bool) -> dict[int, str]:
    """What each column is used as."""
    qualities = [] if is_long else how.rules.columns(shown)
    parts = how.parts(shown, None if is_long else qualities)
    named = (
        ("quality", qualities), ("time", [parts.time, parts.date]), ("input", parts.inputs),
        ("output", parts.outputs), ("set point", parts.references), ("mode", [parts.mode]),
    )  # fmt: skip
    return {k: name for name, columns in named for k in columns if k is not None}


def _ends(cells: np.ndarray[Any, np.dtype[Any]]) -> tuple[str, str]:
    """First and last cell, shortened."""
    ends = [str(cells[k])[:20] for k in (0, -1)] if cells.size else ["", ""]
    return ends[0], ends[1]
