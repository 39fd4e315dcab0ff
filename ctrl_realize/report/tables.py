"""Tables of the reports."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from .._parameters import Parameter
from .._wording import (
    in_digits,
    interval_in_time,
    number_within,
    numbers_alike,
    time_unit,
    time_within,
)
from ..data import Record
from ..delayed import DelayedStateSpace
from ..frequency.comparison import FRFComparison
from ..identification.campaign.campaign import Campaign
from ..identification.campaign.rows import CampaignRow
from ..results import ModelFit
from .facts import FACTS
from .page import Table, headed, pairs
from .provenance import file_sha256, record_sha256

Paths = Sequence[str | os.PathLike[str]]

_IN_THE_HEADLINE = frozenset(
    {"transfer function", "dead time", "apparent dead time", "poles", "gain", "actuator"}
)
"""Rows of a fit with parameters that are in the headline of a report, or in their table."""


def fit_tables(fit: ModelFit | None) -> list[Table]:
    """List how a model was found, and what was chosen and why."""
    if fit is None:
        return []
    above = FACTS
    if fit.parameters:
        above |= {*_IN_THE_HEADLINE, fit.interval_label}
    choices = [("choice", choice) for choice in fit._choices()]
    rows = [row for row in fit._rows() if row[0] not in above]
    return [pairs("Details of the fit", [*rows, *choices])]


def parameter_table(fit: ModelFit) -> Table:
    """List gain, dead time, lags, ... and those of an actuator, with errors and 95 % intervals."""
    rows = [_parameter_row(one) for one in fit.parameters]
    actuator = fit.actuator
    if actuator is not None:
        rows += [_parameter_row(one, actuator.where) for one in actuator.parameters]
    return headed("parameters", rows)


def _parameter_row(one: Parameter, where: str = "") -> tuple[str, ...]:
    """Row of a parameter, of an actuator if it is told where that acts."""
    known = bool(np.isfinite([one.low, one.high]).all())
    if one.times == 1:
        ends = one.low, one.high
        factor, name = time_unit(max(map(abs, ends)) if known else abs(one.value))
        error = f"{factor * one.std:.2g} {name}" if np.isfinite(one.std) else ""
        value = time_within(one.value, *ends)
        interval = interval_in_time(*ends) if known else ""
    else:
        unit = one.unit and f" {one.unit}"
        error = f"{one.std:.2g}{unit}" if np.isfinite(one.std) else ""
        value = number_within(one.value, one.low, one.high) + unit
        interval = one.interval_text()
    holds = "all structures not ruled out" if one.all_structures else "this structure"
    if where:
        holds, interval = "this actuator", interval or "one end is not told"
    label = f"{one.label} (actuator, {where})" if where else one.label
    return label, value, error, interval, holds if interval else ""


def comparison_tables(comparison: FRFComparison | None) -> list[Table]:
    """List the errors of a model with respect to a measurement, if there is one."""
    title = "Comparison with the measured frequency response"
    return [] if comparison is None else [pairs(title, comparison._rows())]


def model_table(system: DelayedStateSpace) -> Table:
    """List the matrices of a model's core."""
    core = system.delay_free
    rows = [
        ("x[k+1] = A x[k] + B u[k-d]", f"d = {system.delay}, dt = {system.dt!r} s"),
        *((letter, _matrix(getattr(core, letter))) for letter in "ABCD"),
    ]
    return pairs(
        "State-space matrices of the model without its delay", rows, mono=True, folded=True
    )


def _matrix(values: Any) -> str:
    rows = [", ".join(f"{value:.10g}" for value in row) for row in np.atleast_2d(values)]
    return "[" + "; ".join(rows) + "]"


def settings_tables(settings: Mapping[str, Any] | None) -> list[Table]:
    """List the settings, if there are any."""
    rows = [(str(key), str(value)) for key, value in (settings or {}).items()]
    return [pairs("Settings", rows)] if rows else []


def data_table(records: Sequence[Record], files: Paths) -> Table:
    """List data with their checksums: of files if there are any, otherwise of samples."""
    rows = []
    if files:
        known = {os.fspath(file): record for file, record in zip(files, records, strict=False)}
        for file in files:
            record = known.get(os.fspath(file))
            rows.append((Path(file).name, *_extent(record), file_sha256(file)))
        sums = "the files"
    else:
        rows = [
            (record.name or "record", *_extent(record), record_sha256(record)) for record in records
        ]
        sums = "time, input, output and set point as little-endian float64"
    return headed("data", rows, sums=sums)


def _extent(record: Record | None) -> tuple[str, str, str]:
    if record is None:
        return ("", "", "")
    length = float(record.time[-1] - record.time[0])
    count = np.count_nonzero(record.seen) if record.irregular else record.n_samples
    return str(count), f"{record.sample_time:.6g}", f"{length:.6g}"


def campaign_table(campaign: Campaign) -> Table:
    """List the records of a campaign: delay, interval, residual, or the error."""
    waits = [row.dead_time for row in campaign.good]
    scale, unit = time_unit(float(np.median(waits)))
    best = campaign.best.name
    rows = []
    for row in campaign.rows:
        if row.error is not None:
            rows.append([row.name, in_digits(row.amplitude), "", "", "", "", "", row.error])
            continue
        low, dead_time, high = _dead_time_cells(row, scale)
        cells = [row.name, in_digits(row.amplitude), f"{row.delay:.4g}", dead_time]
        cells += [f"{low} to {high}", str(row.order), f"{row.residual:.3g}"]
        cells.append(", ".join([*(flag.code for flag in row.flags), *row.warnings]))
        rows.append(cells)
    kinds = ["failed" if row.error is not None else "best" if row.name == best else ""
             for row in campaign.rows]  # fmt: skip
    return headed("campaign", rows, kinds, unit=unit)


def _dead_time_cells(row: CampaignRow, scale: float) -> list[str]:
    """Lower end, estimate and upper end, rounded to the same digit."""
    low, high = row.interval
    seen = [scale * value for value in (low, row.dead_time, high)]
    if not np.isfinite(seen).all():
        return [f"{value:.4g}" for value in seen]
    return numbers_alike(seen, seen[0], seen[2])


def amplitude_table(campaign: Campaign) -> Table:
    """List delays and gains by the height of the step."""
    rows = []
    for amplitude, line in campaign.by_amplitude().iterrows():
        found = (in_digits(float(line[name])) for name in ("delay", "std", "gain", "gain_std"))
        rows.append((in_digits(float(str(amplitude))), str(int(line["records"])), *found))
    return headed("amplitudes", rows)
