"""``ctrl-realize valve``: metrics of a valve test."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from ...errors import OptionError
from ...report.valves import write_valve_report
from ...valves import valve_report
from ..inputs import Reading, python_keywords, reading_in_python
from ..manifest import Run, refuse_other_results
from ..results import write_results
from ..terminal import printable, say


def run_valve(
    files: list[Path],
    folder: Path | None,
    *,
    measured: Mapping[str, Any],
    limit: Sequence[str] | None,
    tests: Mapping[str, Any],
    record: Mapping[str, Any],
    run: Run,
) -> int:
    """Measure, write the results if a folder is given, and return the exit code."""
    how = Reading(record, tests)
    bounds = _limits(limit or ())
    options = {**measured, **({"limits": bounds} if bounds else {})}
    refuse_other_results(folder, run)
    sources = how.sources(files)
    records = [source.record() for source in sources]
    for source, read in zip(sources, records, strict=True):
        say(printable(f"{source.file}: {read!r}"))
    result = valve_report(records, **options)
    say(result.report())
    lines, name = reading_in_python(files, how)
    lines.append(f"report = cr.valves.valve_report({name}{python_keywords(options)})")
    calls = [("In a terminal", run.typed), ("In Python", "\n".join(lines))]
    tables = {
        "metrics.csv": (result.metric_table(), True),
        "sizes.csv": (result.table(), False),
        "steps.csv": (result.step_table(), False),
    }
    write = partial(
        write_valve_report, result=result, files=list(dict.fromkeys(files)), settings=options,
        calls=calls,
    )  # fmt: skip
    return write_results(folder, run, tables, write, "the table of metrics")


def _limits(given: Sequence[str]) -> dict[str, Any]:
    """Limits as ``t86=0.5``, ``dead_band=0.1:1`` or, for one step size, ``t86@2=0.4``."""
    found: dict[str, Any] = {}
    for text in given:
        name, equals, value = text.partition("=")
        key, at, size = name.strip().partition("@")
        if equals and key in found and isinstance(found[key], dict) != bool(at):
            raise OptionError(
                f"--limit {text!r}; expected limits of {key} either for all sizes or by size"
            )
        try:
            if not equals:
                raise ValueError
            ends = [float(end) if end.strip() else None for end in value.split(":")]
            limit = ends[0] if len(ends) == 1 else tuple(ends)
            if at:
                found.setdefault(key, {})[float(size)] = limit
            else:
                found[key] = limit
        except (ValueError, TypeError):
            raise OptionError(
                f"--limit {text!r}; expected metric=largest, metric=smallest:largest, or "
                "metric@size=largest, such as t86=0.5, gain=0.9:1.1 or t86@2=0.4"
            ) from None
    return found
