"""``ctrl-realize loop``: whether the valve makes a loop oscillate."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

from ...errors import OptionError
from ...io import read_record
from ...report.loops import write_loop_report
from ...valves.loops.diagnose import diagnose_loop
from ..inputs import Reading, python_keywords, reading_in_python
from ..manifest import Run, refuse_other_results
from ..results import write_results
from ..terminal import printable, say


def run_loop(
    files: list[Path],
    folder: Path | None,
    *,
    diagnosed: Mapping[str, Any],
    trend: Mapping[str, Any],
    run: Run,
) -> int:
    """Diagnose, write the results if a folder is given, and return the exit code."""
    if len(files) != 1:
        raise OptionError(f"{len(files)} files; expected one record of operation")
    # the longest complete part is judged
    reading = dict(trend) if "resample" in trend else {**trend, "missing": "keep"}
    refuse_other_results(folder, run)
    record = read_record(files[0], **reading)
    result = diagnose_loop(record, **diagnosed)
    say(printable(f"{files[0]}: {record!r}"))
    say(result.report())
    lines, name = reading_in_python(files, Reading(reading, {}))
    lines.append(f"print(cr.valves.diagnose_loop({name}{python_keywords(diagnosed)}).report())")
    calls = [("In a terminal", run.typed), ("In Python", "\n".join(lines))]
    write = partial(
        write_loop_report, diagnosis=result, files=files, settings=diagnosed, calls=calls
    )
    tables = {"methods.csv": (result.table(), True)}
    return write_results(folder, run, tables, write, "the table of methods")
