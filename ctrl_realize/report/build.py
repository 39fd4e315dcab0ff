"""Reports of an identification and of a campaign."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import control as ct
import numpy as np

from ..delayed import DelayedStateSpace
from ..frequency.comparison import FRFComparison
from ..identification.campaign import Campaign
from ..plots.style import time_unit
from ..results import Result
from ..signals import Record
from .page import Column, Page, Row, Table, pairs, write_page
from .provenance import file_sha256, own_version, record_sha256, versions
from .sketches import (
    Sketch,
    campaign_sketches,
    frf_sketches,
    identification_sketches,
    save_sketches,
)
from .verdict import campaign_verdict, comparison_verdict, verdict_of

Paths = Sequence[str | os.PathLike[str]]


def write_identification(
    path: str | os.PathLike[str],
    system: DelayedStateSpace,
    record: Record,
    *,
    files: Paths = (),
    frf: ct.FrequencyResponseData | None = None,
    comparison: FRFComparison | None = None,
    settings: Mapping[str, Any] | None = None,
    calls: Sequence[tuple[str, str]] = (),
    simulated: bool = False,
    figures: str | os.PathLike[str] | None = None,
) -> Path:
    """Write the report of one identification: one HTML file that needs nothing else.

    Parameters
    ----------
    path : path-like
        File to write; it is written whole or not at all.
    system : DelayedStateSpace
        The model; what is known of its origin is taken from its `fit`.
    record : Record
        What it was identified from.
    files : sequence of path-like, optional
        Files that the data came from, for their checksums.
    frf : FrequencyResponseData, optional
        Measured frequency response to show beside the model.
    comparison : FRFComparison, optional
        Of the model with `frf`.
    settings : mapping, optional
        Settings to list.
    calls : sequence of (name, text), optional
        What to type to do it again.
    simulated : bool, default False
        Whether the data are simulated; it is then said at the top.
    figures : path-like, optional
        Folder to save the figures to as well, as PNG files.

    Returns
    -------
    pathlib.Path

    Raises
    ------
    OSError
        The folder is missing or cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import ctrl_realize as cr
    >>> from ctrl_realize import report
    >>> record = cr.bench.valve().step_record(16, rng=5)
    >>> system = cr.identify(record, method="scan")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     written = report.write_identification(
    ...         Path(folder) / "valve.html", system, record, simulated=True
    ...     )
    ...     print("Dead time" in written.read_text(encoding="utf-8"))
    True
    """
    flags = () if comparison is None else comparison.flags
    sketches = identification_sketches(system, record, frf=frf, comparison=comparison)
    tables = [*_fit_tables(system.fit)]
    if comparison is not None:
        tables.append(pairs("Against the measured frequency response", comparison._rows()))
    tables += [
        _model_table(system),
        _data_table([record], files),
        *_settings_tables(settings),
        pairs("Versions", versions()),
    ]
    if figures is not None:
        save_sketches(figures, sketches)
    page = Page(
        title=f"Model of {record.name}" if record.name else "Identified model",
        subtitle=_kind(system),
        verdict=verdict_of(system, flags),
        version=own_version(),
        figures=[sketch.on_page() for sketch in sketches],
        tables=tables,
        calls=calls,
        simulated=simulated,
    )
    return write_page(path, page)


def write_campaign(
    path: str | os.PathLike[str],
    campaign: Campaign,
    *,
    files: Paths = (),
    records: Sequence[Record] = (),
    frf: ct.FrequencyResponseData | None = None,
    comparison: FRFComparison | None = None,
    settings: Mapping[str, Any] | None = None,
    calls: Sequence[tuple[str, str]] = (),
    more_tables: Sequence[Table] = (),
    more_sketches: Sequence[Sketch] = (),
    title: str = "Campaign",
    truth: float | None = None,
    simulated: bool = False,
    figures: str | os.PathLike[str] | None = None,
) -> Path:
    """Write the report of a campaign: one HTML file that needs nothing else.

    Parameters
    ----------
    path : path-like
    campaign : Campaign
    files : sequence of path-like, optional
        Files that the data came from, for their checksums.
    records : sequence of Record, optional
        The records, for theirs, where there are no files.
    frf, comparison, settings, calls, simulated, figures
        As for `write_identification`; the comparison is that of ``campaign.system``.
    more_tables, more_sketches : sequence, optional
        Further tables and figures, behind the campaign's own.
    title : str, optional
    truth : float, optional
        Known delay of a simulation in samples, to draw beside the estimates.

    Returns
    -------
    pathlib.Path

    Raises
    ------
    DataError
        No record of the campaign was identified.
    OSError
        The folder is missing or cannot be written.
    """
    system = campaign.system
    sketches = campaign_sketches(campaign, truth=truth)
    if frf is not None:
        sketches += frf_sketches([system], frf, comparison)
    sketches += more_sketches
    if figures is not None:
        save_sketches(figures, sketches)
    tables = [_campaign_table(campaign), _amplitude_table(campaign), *more_tables]
    if comparison is not None:
        tables.append(pairs("Against the measured frequency response", comparison._rows()))
    tables += [*_fit_tables(system.fit), _model_table(system)]
    if files or records:
        tables.append(_data_table(records, files))
    tables += [*_settings_tables(settings), pairs("Versions", versions())]
    page = Page(
        title=title,
        subtitle=f"{len(campaign.rows)} records, method {campaign.method}",
        verdict=campaign_verdict(campaign),
        version=own_version(),
        figures=[sketch.on_page() for sketch in sketches],
        tables=tables,
        calls=calls,
        simulated=simulated,
    )
    return write_page(path, page)


def write_comparison(
    path: str | os.PathLike[str],
    system: DelayedStateSpace,
    frf: ct.FrequencyResponseData,
    comparison: FRFComparison,
    *,
    files: Paths = (),
    calls: Sequence[tuple[str, str]] = (),
    simulated: bool = False,
    figures: str | os.PathLike[str] | None = None,
) -> Path:
    """Write the report of a model beside a measured frequency response: one HTML file.

    Parameters
    ----------
    path : path-like
    system : DelayedStateSpace
    frf : FrequencyResponseData
        Measured.
    comparison : FRFComparison
        Of `system` with `frf`.
    files, calls, simulated, figures
        As for `write_identification`.

    Returns
    -------
    pathlib.Path

    Raises
    ------
    OSError
        The folder is missing or cannot be written.
    """
    sketches = frf_sketches([system], frf, comparison)
    if figures is not None:
        save_sketches(figures, sketches)
    page = Page(
        title=f"{system.name} beside {frf.name}",
        subtitle="a model and a measured frequency response",
        verdict=comparison_verdict(system, comparison),
        version=own_version(),
        figures=[sketch.on_page() for sketch in sketches],
        tables=[
            pairs("Against the measured frequency response", comparison._rows()),
            _model_table(system),
            *([_data_table([], files)] if files else []),
            pairs("Versions", versions()),
        ],
        calls=calls,
        simulated=simulated,
    )
    return write_page(path, page)


def _kind(system: DelayedStateSpace) -> str:
    names = {
        "DelayFit": "output-error fit of the raw record",
        "DelayScan": "delay scan by approximate realization",
        "Realization": "approximate realization",
    }
    return names.get(type(system.fit).__name__, "model with dead time")


def _fit_tables(fit: Any) -> list[Table]:
    if not isinstance(fit, Result):
        return []
    return [pairs("How it was found", [*fit._rows(), *_choices(fit)])]


def _choices(fit: Any) -> list[tuple[str, str]]:
    return [("choice", str(choice)) for choice in getattr(fit, "choices", ())]


def _model_table(system: DelayedStateSpace) -> Table:
    core = system.delay_free
    rows = [
        ("x[k+1] = A x[k] + B u[k-d]", f"d = {system.delay}, dt = {system.dt!r} s"),
        *((name, _matrix(getattr(core, name))) for name in "ABCD"),
    ]
    return pairs("Matrices of the model without its delay", rows, mono=True)


def _matrix(values: Any) -> str:
    rows = [", ".join(f"{value:.10g}" for value in row) for row in np.atleast_2d(values)]
    return "[" + "; ".join(rows) + "]"


def _settings_tables(settings: Mapping[str, Any] | None) -> list[Table]:
    if not settings:
        return []
    return [pairs("Settings", [(str(key), str(value)) for key, value in settings.items()])]


def _data_table(records: Sequence[Record], files: Paths) -> Table:
    columns = (
        Column("data"),
        Column("samples", "number"),
        Column("sample time [s]", "number"),
        Column("length [s]", "number"),
        Column("SHA-256", "mono"),
    )
    rows = []
    if files:
        known = {os.fspath(file): record for file, record in zip(files, records, strict=False)}
        for file in files:
            record = known.get(os.fspath(file))
            rows.append(Row((Path(file).name, *_extent(record), file_sha256(file))))
        note = "Checksums of the files."
    else:
        rows = [
            Row((record.name or "record", *_extent(record), record_sha256(record)))
            for record in records
        ]
        note = "Checksums of time, input and output as little-endian float64."
    return Table("Data", tuple(rows), columns, note=note)


def _extent(record: Record | None) -> tuple[str, str, str]:
    if record is None:
        return ("", "", "")
    return (
        str(record.n_samples),
        f"{record.dt:.6g}",
        f"{record.time[-1] - record.time[0]:.6g}",
    )


def _campaign_table(campaign: Campaign) -> Table:
    waits = [row.dead_time for row in campaign.good]
    scale, unit = time_unit(float(np.median(waits)))
    columns = (
        Column("record", "name"),
        Column("step", "number"),
        Column("delay [samples]", "number"),
        Column(f"dead time [{unit}]", "number"),
        Column(f"interval [{unit}]", "number"),
        Column("order", "number"),
        Column("misfit", "number"),
        Column("remarks"),
    )
    best = campaign.best.name
    rows = []
    for row in campaign.rows:
        if row.system is None:
            cells = (row.name, _number(row.amplitude), "", "", "", "", "", row.error or "")
            rows.append(Row(cells, "failed"))
            continue
        low, high = row.interval
        remarks = [flag.code.replace("_", " ") for flag in row.flags]
        cells = (
            row.name,
            _number(row.amplitude),
            f"{row.delay:.4g}",
            f"{scale * row.dead_time:.4g}",
            f"{scale * low:.4g} to {scale * high:.4g}",
            str(row.system.delay_free.nstates),
            f"{row.misfit:.3g}",
            ", ".join([*remarks, *row.warnings]),
        )
        rows.append(Row(cells, "best" if row.name == best else ""))
    return Table("Records", tuple(rows), columns, note="In bold: the record of least misfit.")


def _amplitude_table(campaign: Campaign) -> Table:
    table = campaign.by_amplitude()
    columns = (
        Column("step", "number"),
        Column("records", "number"),
        Column("mean delay [samples]", "number"),
        Column("std [samples]", "number"),
        Column("gain", "number"),
        Column("std of the gain", "number"),
    )
    rows = tuple(
        Row(
            (
                _number(float(str(amplitude))),
                str(int(line["records"])),
                *(_number(float(line[name])) for name in ("delay", "std", "gain", "gain_std")),
            )
        )
        for amplitude, line in table.iterrows()
    )
    return Table(
        "By the height of the step",
        rows,
        columns,
        note="Delays or gains that follow the height are the sign of a nonlinear plant.",
    )


def _number(value: float) -> str:
    return f"{value:.4g}" if np.isfinite(value) else ""
