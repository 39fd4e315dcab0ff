"""Output files and tables of the commands."""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import control as ct
import numpy as np

from .. import report
from .._wording import in_digits, time_unit
from ..data import Record
from ..delayed import DelayedStateSpace
from ..frequency.comparison import FRFComparison
from ..identification.campaign.campaign import Campaign
from ..io import save_model
from ..io.text.csv_files import write_csv
from ..report.tables import dead_time_cells
from .terminal import complain, one_line, printable, table, working


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
    files = list(dict.fromkeys(files))  # several tests may be in one
    names = ", ".join(file.name for file in files)
    save_model(folder / "model.json", system, settings=settings, note=f"from {names}")
    if comparison is not None:
        write_csv(folder / "frf_comparison.csv", comparison.table(), index=False)
    if not with_report:
        return True
    with told_if_it_fails(folder, "the model") as written:
        report.write_identification(
            folder / "report.html",
            system,
            record,
            files=files,
            frf=frf,
            comparison=comparison,
            settings=settings,
            calls=calls,
            figures=folder / "figures",
        )
        written.append("report.html")
    return bool(written)


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
    files = list(dict.fromkeys(files))
    system = campaign.system
    note = f"from {len(campaign.good)} of {len(campaign.rows)} records"
    save_model(folder / "model.json", system, settings=settings, note=note)
    write_csv(folder / "records.csv", campaign.table(), index=True)
    save_models(folder, campaign, settings)
    if comparison is not None:
        write_csv(folder / "frf_comparison.csv", comparison.table(), index=False)
    if not with_report:
        return True
    with told_if_it_fails(folder, "the model") as written:
        report.write_campaign(
            folder / "report.html",
            campaign,
            files=files,
            frf=frf,
            comparison=comparison,
            settings=settings,
            calls=calls,
            title=f"Campaign of {len(campaign.rows)} records",
            figures=folder / "figures",
        )
        written.append("report.html")
    return bool(written)


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
        if row.model is None:
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
