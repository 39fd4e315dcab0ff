"""Output files and tables of the commands."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import control as ct
import numpy as np
import pandas as pd

from .. import report
from .._wording import in_digits, time_unit
from ..data import Record
from ..delayed import DelayedStateSpace
from ..frequency.comparison import FRFComparison
from ..identification.campaign.campaign import Campaign
from ..io import save_model
from ..io.text.csv_files import write_csv
from ..report.tables import dead_time_cells
from .manifest import Run
from .staging import appearing
from .terminal import complain, one_line, printable, say, table, working


def write_record_files(
    folder: Path,
    system: DelayedStateSpace,
    record: Record,
    files: Sequence[Path],
    *,
    frf: ct.FrequencyResponseData | None,
    comparison: FRFComparison | None,
    settings: Mapping[str, Any],
    calls: Sequence[tuple[str, str]],
    with_report: bool = True,
) -> bool:
    """Write model, report and figures of one model; return whether they were written as asked."""
    names = ", ".join(file.name for file in dict.fromkeys(files))
    save_model(folder / "model.json", system, settings=settings, note=f"from {names}")
    return _write_files(
        folder,
        partial(report.write_identification, system=system, record=record),
        files=files, frf=frf, comparison=comparison, settings=settings, calls=calls,
        with_report=with_report,
    )  # fmt: skip


def write_campaign_files(
    folder: Path,
    campaign: Campaign,
    files: Sequence[Path],
    *,
    frf: ct.FrequencyResponseData | None,
    comparison: FRFComparison | None,
    settings: Mapping[str, Any],
    calls: Sequence[tuple[str, str]],
    with_report: bool = True,
) -> bool:
    """Write table, models, report and figures of many records; return if all were written."""
    note = f"from {len(campaign.good)} of {len(campaign.rows)} records"
    save_model(folder / "model.json", campaign.system, settings=settings, note=note)
    write_csv(folder / "records.csv", campaign.table(), index=True)
    save_models(folder, campaign, settings)
    return _write_files(
        folder,
        partial(report.write_campaign, campaign=campaign,
                title=f"Campaign of {len(campaign.rows)} records"),
        files=files, frf=frf, comparison=comparison, settings=settings, calls=calls,
        with_report=with_report,
    )  # fmt: skip


def _write_files(
    folder: Path,
    write: Callable[..., Path],
    *,
    files: Sequence[Path],
    comparison: FRFComparison | None,
    settings: Mapping[str, Any],
    with_report: bool,
    **shown: Any,
) -> bool:
    if comparison is not None:
        write_csv(folder / "frf_comparison.csv", comparison.table(), index=False)
    if not with_report:
        return True
    files = list(dict.fromkeys(files))  # several tests may be in one
    with told_if_it_fails(folder, "the model") as written:
        write(
            folder / "report.html", files=files, comparison=comparison, settings=settings,
            figures=folder / "figures", **shown,
        )  # fmt: skip
        written.append("report.html")
    return bool(written)


def write_results(
    output: Path,
    run: Run,
    tables: Mapping[str, tuple[pd.DataFrame, bool]],
    write: Callable[..., Path] | None,
    result: str,
) -> int:
    """Write tables, by name and with or without their index, and a report; return the exit code.

    `result` names what is written even if the report fails.
    """
    written: list[str] = []
    with appearing(output, run) as folder:
        for name, (table, index) in tables.items():
            write_csv(folder / name, table, index=index)
        if write is not None:
            with told_if_it_fails(folder, result) as written:
                write(folder / "report.html", figures=folder / "figures")
                written.append("report.html, figures/")
    say(f"\nwritten to {printable(str(output))}: {', '.join([*tables, *written])}")
    return 0 if written or write is None else 1


@contextmanager
def told_if_it_fails(folder: Path, result: str) -> Iterator[list[str]]:
    """Report an error while a report is written, but keep the results: the list stays empty."""
    written: list[str] = []
    try:
        with working("drawing the figures of the report"):
            yield written
    except Exception as error:  # for instance a defect of this program, or a full disk
        shutil.rmtree(folder / "figures", ignore_errors=True)
        complain(
            f"the report could not be written ({type(error).__name__}: {one_line(error)}); "
            f"{result} is"
        )


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
    """Format a campaign for the terminal: one line for each record."""
    scale, unit = time_unit(float(np.median([row.dead_time for row in campaign.good])))
    rows = []
    for row in campaign.rows:
        if row.system is None:
            rows.append([printable(row.name), in_digits(row.amplitude), "", "", "", "",
                         printable(row.error or "failed")])  # fmt: skip
            continue
        low, dead_time, high = dead_time_cells(row, scale)
        remarks = ", ".join(flag.code for flag in row.flags)
        rows.append(
            [
                printable(row.name),
                in_digits(row.amplitude),
                f"{row.delay:.4g}",
                dead_time,
                f"{low} ... {high}",
                str(row.order),
                remarks,
            ]
        )
    columns = ["record", "step", "delay", f"dead time [{unit}]", f"interval [{unit}]"]
    columns += ["order", "remarks"]
    return table(columns, rows, numbers=(1, 2, 3, 4, 5))
