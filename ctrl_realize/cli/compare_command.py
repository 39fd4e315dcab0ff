"""``ctrl-realize compare``: a model and a measured frequency response."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..frequency import compare_frf
from ..io import load_model, read_frf
from ..io.text.csv_files import write_csv
from ..report import write_comparison
from .inputs import typed_call
from .manifest import Run
from .options import words_of
from .results import told_if_it_fails
from .staging import appearing
from .terminal import printable, say


def run_compare(
    model: Path,
    frf: Path,
    output: Path | None,
    *,
    trusted: Mapping[str, Any],
    hold: str,
    reading: Mapping[str, Any],
    report: bool,
    overwrite: bool,
) -> int:
    """Compare, write the results if a folder is given, and return the exit code."""
    system = load_model(model)
    measured = read_frf(frf, **reading)
    method: Any = None if hold == "none" else hold
    comparison = compare_frf(system, measured, hold=method, **trusted)
    say(printable(f"{model}: {system!r}"))
    say(comparison.report())
    names = ["frf_comparison.csv"]
    if output is not None:
        words = [str(model), str(frf)]
        words += words_of({**trusted, **({} if hold == "auto" else {"hold": hold}), **reading})
        run = Run(typed_call("compare", words), (model, frf), overwrite)
        words += ["--output", str(output)]
        with appearing(output, run) as folder:
            write_csv(folder / "frf_comparison.csv", comparison.table(), index=False)
            if report:
                with told_if_it_fails(folder, "the comparison") as written:
                    write_comparison(
                        folder / "report.html",
                        system,
                        measured,
                        comparison,
                        files=[model, frf],
                        calls=[("In a terminal", typed_call("compare", words))],
                        figures=folder / "figures",
                    )
                    written.append("report.html, figures/")
                names += written
        say(f"\nwritten to {printable(str(output))}: {', '.join(names)}")
    return 0 if output is None or not report or len(names) > 1 else 1
