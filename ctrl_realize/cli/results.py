"""Output files and tables of the commands."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import control as ct
import pandas as pd

from .. import report
from ..data import Record
from ..delayed import DelayedStateSpace
from ..frequency.comparison import FRFComparison
from ..identification.campaign.campaign import Campaign
from ..io import save_model
from ..io.text.csv_files import write_csv
from ..report import tables as report_tables
from .manifest import Run
from .staging import appearing
from .terminal import complain, one_line, printable, say, table, working


class Provenance(NamedTuple):
    """What a model was made from and compared with, its controller, and whether a report tells."""

    files: Sequence[Path]
    frf: ct.FrequencyResponseData | None
    comparison: FRFComparison | None
    settings: Mapping[str, Any]
    calls: Sequence[tuple[str, str]]
    with_report: bool = True
    tuned: Mapping[str, Any] = MappingProxyType({})
    frf_file: Path | None = None


def write_record_files(
    folder: Path, system: DelayedStateSpace, record: Record, provenance: Provenance
) -> bool:
    """Write model, report and figures of one model; return whether they were written as asked."""
    names = ", ".join(file.name for file in dict.fromkeys(provenance.files))
    save_model(folder / "model.json", system, settings=provenance.settings, note=f"from {names}")
    write = partial(report.write_identification, system=system, record=record)
    return _write_files(folder, write, provenance)


def write_campaign_files(folder: Path, campaign: Campaign, provenance: Provenance) -> bool:
    """Write table, models, report and figures of many records; return if all were written."""
    note = f"from {len(campaign.good)} of {len(campaign.rows)} records"
    save_model(folder / "model.json", campaign.system, settings=provenance.settings, note=note)
    write_csv(folder / "records.csv", campaign.table(), index=True)
    save_models(folder, campaign, provenance.settings)
    title = f"Campaign of {len(campaign.rows)} records"
    write = partial(report.write_campaign, campaign=campaign, title=title)
    return _write_files(folder, write, provenance)


_SHOWN = ("frf", "comparison", "settings", "calls")


def _write_files(folder: Path, write: Callable[..., Path], provenance: Provenance) -> bool:
    if provenance.comparison is not None:
        write_csv(folder / "frf_comparison.csv", provenance.comparison.table(), index=False)
    if not provenance.with_report:
        return True
    files = list(dict.fromkeys(provenance.files))  # several tests may be in one
    if provenance.frf_file is not None:
        files.append(provenance.frf_file)
    shown = {name: getattr(provenance, name) for name in _SHOWN} | {**provenance.tuned}
    return _reported(folder, partial(write, files=files, **shown), "the model")


def write_results(
    output: Path | None,
    run: Run,
    tables: Mapping[str, tuple[pd.DataFrame, bool]],
    write: Callable[..., Path],
    result: str,
) -> int:
    """Write tables, by name and with or without their index, and a report, if one is wanted.

    Without a folder, nothing. Returns the exit code; `result` names what is written even if the
    report fails.
    """
    if output is None:
        return say_not_written()
    with appearing(output, run) as folder:
        for name, (table, index) in tables.items():
            write_csv(folder / name, table, index=index)
        reported = run.report and _reported(folder, write, result)
    say_written(output, tables, reported)
    return 0 if reported or not run.report else 1


def say_not_written() -> int:
    """Say how results are kept; return the exit code."""
    say("\nnothing was written: --output FOLDER keeps the results, a report and figures")
    return 0


def say_written(output: Path, names: Iterable[str], reported: bool) -> None:
    """Name the files of the results."""
    more = ["report.html", "figures/"] if reported else []
    say(f"\nwritten to {printable(str(output))}: {', '.join([*names, *more])}")


def _reported(folder: Path, write: Callable[..., Path], result: str) -> bool:
    """Write a report; return whether that was possible, since the results are kept in any case."""
    try:
        with working("drawing the figures of the report"):
            write(folder / "report.html", figures=folder / "figures")
    except Exception as error:  # for instance a defect of this program, or a full disk
        shutil.rmtree(folder / "figures", ignore_errors=True)
        complain(
            f"the report could not be written ({type(error).__name__}: {one_line(error)}); "
            f"{result} is"
        )
        return False
    return True


def save_models(folder: Path, campaign: Campaign, settings: Mapping[str, Any]) -> None:
    """Write the model of every record that has one."""
    models = folder / "models"
    models.mkdir()
    for number, row in enumerate(campaign.rows, start=1):
        system = row.system
        if system is not None:
            name = f"{number:03d}_{file_name(row.name)}.json"
            save_model(models / name, system, settings=settings, note=f"from {row.name}")


def file_name(name: str) -> str:
    """Make a name safe for files on any system, most of which allow 255 bytes."""
    safe = "".join(letter if letter.isalnum() or letter in "-_" else "_" for letter in name)
    return safe[:80].encode()[:200].decode(errors="ignore") or "record"


def campaign_table(campaign: Campaign) -> str:
    """Format a campaign for the terminal, as in its report: one line for each record."""
    shown = report_tables.campaign_table(campaign)
    return table(
        [column.name for column in shown.columns],
        [[printable(cell) for cell in row.cells] for row in shown.rows],
        numbers=[k for k, column in enumerate(shown.columns) if column.kind == "number"],
    )
