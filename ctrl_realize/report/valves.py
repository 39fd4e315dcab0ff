"""Report of a valve test as a page."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, Unpack

from .. import plots
from .._checks import check_type
from .._wording import in_digits
from ..valves.definitions import DEFINITIONS
from ..valves.metrics import words_of
from ..valves.result import ValveReport
from ..valves.words import in_words, limit_in_words
from .build import About, write_report
from .page import Table, headed, pairs
from .sketches import Sketch, sketch
from .verdict import JUDGEMENTS, Verdict

_SHOWN = ("dead_time", "t63", "t86", "t98", "overshoot", "gain")
_FACTS = ("dead_time", "t63", "t86", "overshoot", "dead_band", "resolution",
          "stroke_time_opening", "stroke_time_closing")  # fmt: skip


def write_valve_report(
    path: str | os.PathLike[str],
    result: ValveReport,
    *,
    title: str = "Valve test",
    **about: Unpack[About],
) -> Path:
    """Write the report of a valve test as a self-contained HTML file.

    Parameters
    ----------
    path : path-like
        File to write, atomically.
    result : ValveReport
        From `valve_report`.
    title : str, optional
    **about
        As for `write_identification`.

    Returns
    -------
    pathlib.Path

    Raises
    ------
    DataError
        `result` is not the report of a valve test.
    OSError
        The folder is missing or cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import ctrl_realize as cr
    >>> from ctrl_realize import report
    >>> records = cr.bench.valve().step_campaign(1, amplitudes=(16.0, 4.0), repeats=2)
    >>> result = cr.valves.valve_report(records, command_range=(4, 20), fit=False)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = report.write_valve_report(Path(folder) / "valve.html", result, simulated=True)
    ...     print(path.read_text(encoding="utf-8").count("<svg "), "figures")
    6 figures
    """
    check_type(result, ValveReport, "result", "that of valve_report")
    many = len(result.records)
    tables = [_metric_table(result), _size_table(result)]
    return write_report(
        path,
        title=title,
        subtitle=f"{many} record{'s' if many > 1 else ''}, {len(result.steps)} steps",
        verdict=_verdict(result),
        sketches=_sketches(result),
        tables=[*tables, *_missing_tables(result), _step_table(result), _definition_table()],
        records=result.records,
        **about,
    )


def _verdict(result: ValveReport) -> Verdict:
    facts = []
    for key in _FACTS:
        one = result.metric(key)
        if one.interval.is_known:
            value, interval = in_words(one.interval, one.definition.unit)
            facts.append((one.definition.name, f"{value} {interval}"))
    reasons = (*map(str, result.flags), *result.choices)
    judgement = JUDGEMENTS["valve"][result.level]
    return Verdict(result.level, result.verdict, tuple(facts), reasons, judgement)


def _sketches(result: ValveReport) -> list[Sketch]:
    sketches = [sketch("steps", plots.valve_plot, result, panel="steps")]
    for key in ("t86", "dead_time", "gain"):
        sketches.append(sketch(key, plots.valve_plot, result, panel="sizes", metric=key))
    for key in ("loop", "signature"):
        sketches.append(sketch(key, plots.valve_plot, result, panel=key))
    return sketches


def _metric_table(result: ValveReport) -> Table:
    rows, kinds = [], []
    for one in result.metrics:
        value, interval = in_words(one.interval, one.definition.unit)
        limit = limit_in_words(one) if one.limit != (None, None) else ""
        name = one.definition.name
        rows.append((name, value, interval.strip("()"), one.where, limit, one.judgement))
        kinds.append({"met": "best", "not met": "failed"}.get(one.judgement, ""))
    return headed("metrics", rows, kinds)


def _size_table(result: ValveReport) -> Table:
    rows = [
        (
            words_of(group), str(group.count), f"{group.moved}, {group.settled}",
            *(_cell(group.estimates[name], DEFINITIONS[name].unit) for name in _SHOWN),
            _cell(group.fitted_dead_time, "s"),
        )
        for group in result.groups
    ]  # fmt: skip
    return headed("sizes", rows, **DEFINITIONS)


def _cell(found: Any, unit: str) -> str:
    return " ".join(in_words(found, unit)).strip() if found.is_known else ""


def _missing_tables(result: ValveReport) -> list[Table]:
    rows = [(test, ", ".join(names)) for test, names in result.missing_tests.items()]
    return [pairs("Missing tests, and what they would tell", rows)] if rows else []


def _step_table(result: ValveReport) -> Table:
    rows = [
        (
            result.records[one.record].name or str(one.record + 1), f"{one.time:.5g}",
            f"{one.before:.4g} to {one.after:.4g}", "yes" if one.moved else "no",
            "yes" if one.settled else "no", *(in_digits(one.values[name]) for name in _SHOWN),
        )
        for one in result.steps
    ]  # fmt: skip
    return headed("steps", rows, **DEFINITIONS)


def _definition_table() -> Table:
    rows = [(one.name, one.sentence, one.source, one.needs) for one in DEFINITIONS.values()]
    return headed("definitions", rows)
