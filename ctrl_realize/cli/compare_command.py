"""``ctrl-realize compare``: a model and a measured frequency response."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

from ..frequency import compare_frf
from ..io import load_model, read_frf
from ..report import write_comparison
from .manifest import Run
from .results import write_results
from .terminal import printable, say


def run_compare(
    model: Path,
    frf: Path,
    folder: Path | None,
    *,
    compared: Mapping[str, Any],
    response_file: Mapping[str, Any],
    run: Run,
) -> int:
    """Compare, write the results if a folder is given, and return the exit code."""
    system = load_model(model)
    measured = read_frf(frf, **response_file)
    comparison = compare_frf(system, measured, **compared)
    say(printable(f"{model}: {system!r}"))
    say(comparison.report())
    write = partial(
        write_comparison, system=system, frf=measured, comparison=comparison, files=[model, frf],
        calls=[("In a terminal", run.typed)],
    )  # fmt: skip
    tables = {"frf_comparison.csv": (comparison.table(), False)}
    return write_results(folder, run, tables, write, "the comparison")
