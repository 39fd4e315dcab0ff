"""Reports of an identification and of a campaign."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypedDict, Unpack

import control as ct

from .._checks import check_type
from .._facts import version_of
from .._wording import times_in
from ..data import Record
from ..data.given import as_record
from ..data.shown_units import in_shown_units, shown_time_unit
from ..delayed import DelayedStateSpace
from ..design.tuning.controller import PIDController
from ..design.tuning.forms import PIDForm
from ..errors import UnsuitableSystemError
from ..frequency.comparison import FRFComparison
from ..identification.campaign.campaign import Campaign
from ..io.atomic import write_text
from ..results import ModelFit
from .controller import controller_of
from .page import Controller, Table, pairs, rendered
from .provenance import versions
from .sketches import (
    Sketch,
    campaign_sketches,
    frf_sketches,
    identification_sketches,
    save_sketches,
)
from .tables import (
    Paths,
    amplitude_table,
    campaign_table,
    comparison_tables,
    data_table,
    fit_tables,
    model_table,
    parameter_table,
    settings_tables,
)
from .verdict import Verdict, campaign_verdict, comparison_verdict, verdict_of


class About(TypedDict, total=False):
    """What every report tells of its data, beside its result; see `write_identification`."""

    files: Paths
    settings: Mapping[str, Any] | None
    calls: Sequence[tuple[str, str]]
    simulated: bool
    figures: str | os.PathLike[str] | None


@in_shown_units
def write_identification(
    path: str | os.PathLike[str],
    system: DelayedStateSpace,
    record: Record,
    *,
    frf: ct.FrequencyResponseData | None = None,
    comparison: FRFComparison | None = None,
    controller: PIDController | None = None,
    form: PIDForm | None = None,
    **about: Unpack[About],
) -> Path:
    """Write the report of one identification as a self-contained HTML file.

    Parameters
    ----------
    path : path-like
        File to write, atomically.
    system : DelayedStateSpace
        The model, with its `fit`.
    record : Record
        Record that it was identified from.
    frf : FrequencyResponseData, optional
        Measured frequency response to show with the model.
    comparison : FRFComparison, optional
        Comparison of the model with `frf`.
    controller : PIDController, optional
        From `design.pid` for `system`: what to enter, the closed loop on all models that the data
        do not rule out, and what would make it unstable.
    form : PIDForm, optional
        The parameters of `controller` as they are entered, from its `as_form`.
    **about
        `files`, a sequence of data files, for their checksums; `settings`, a mapping to list;
        `calls`, pairs (name, text) of commands that reproduce the result; ``simulated=True`` states
        at the top that the data are simulated; `figures`, a folder in which the figures are saved
        as PNG files, too.

    Returns
    -------
    pathlib.Path

    Raises
    ------
    UnsuitableSystemError, DataError
        `system` is not a model with dead time, or `record` is not a record.
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
    ...     print(written.read_text(encoding="utf-8").count("<svg "), "figures")
    7 figures
    """
    as_record(record)
    expected = "a model with dead time, as returned by identify, followed by its record"
    check_type(system, DelayedStateSpace, "system", expected, UnsuitableSystemError)
    return write_report(
        path,
        title=f"Model of {record.name}" if record.name else "Identified model",
        subtitle="model with dead time" if system.fit is None else system.fit._method,
        verdict=verdict_of(system, comparison=comparison),
        sketches=identification_sketches(system, record, frf=frf, comparison=comparison),
        tables=[*fit_tables(system.fit), *comparison_tables(comparison), model_table(system)],
        records=[record],
        fit=system.fit,
        controller=controller_of(system, controller, form),
        **about,
    )


def write_campaign(
    path: str | os.PathLike[str],
    campaign: Campaign,
    *,
    records: Sequence[Record] = (),
    frf: ct.FrequencyResponseData | None = None,
    comparison: FRFComparison | None = None,
    controller: PIDController | None = None,
    form: PIDForm | None = None,
    title: str = "Campaign",
    truth: float | None = None,
    **about: Unpack[About],
) -> Path:
    """Write the report of a campaign as a self-contained HTML file.

    Parameters
    ----------
    path : path-like
    campaign : Campaign
    records : sequence of Record, optional
        The records, for their checksums if there are no files.
    frf, comparison, controller, form
        As for `write_identification`; comparison and controller are those of ``campaign.system``.
    title : str, optional
    truth : float, optional
        Known delay in samples of simulated data, drawn with the estimates.
    **about
        As for `write_identification`.

    Returns
    -------
    pathlib.Path

    Raises
    ------
    DataError
        No record of the campaign was identified.
    OSError
        The folder is missing or cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import ctrl_realize as cr
    >>> from ctrl_realize import report
    >>> valve = cr.bench.valve()
    >>> records = [valve.step_record(16.0, seed) for seed in range(3)]
    >>> campaign = cr.identify_campaign(records, method="scan")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = report.write_campaign(Path(folder) / "valve.html", campaign, simulated=True)
    ...     print(path.read_text().count("<svg "), "figures")
    5 figures
    """
    check_type(campaign, Campaign, "campaign", "that of identify_campaign")
    system = campaign.system
    with times_in(shown_time_unit(system)):
        tables = [campaign_table(campaign), amplitude_table(campaign)]
        tables += comparison_tables(comparison)
        sketches = campaign_sketches(campaign, truth=truth)
        if frf is not None:
            sketches += frf_sketches([system], frf, comparison)
        return write_report(
            path,
            title=title,
            subtitle=f"{len(campaign.rows)} records, method {campaign.method}",
            verdict=campaign_verdict(campaign, comparison=comparison),
            sketches=sketches,
            tables=[*tables, *fit_tables(system.fit), model_table(system)],
            records=records,
            fit=system.fit,
            controller=controller_of(system, controller, form),
            **about,
        )


@in_shown_units
def write_comparison(
    path: str | os.PathLike[str],
    system: DelayedStateSpace,
    frf: ct.FrequencyResponseData,
    comparison: FRFComparison,
    **about: Unpack[About],
) -> Path:
    """Write the report of a comparison with a measured frequency response as a self-contained file.

    Parameters
    ----------
    path : path-like
    system : DelayedStateSpace
    frf : FrequencyResponseData
        Measured.
    comparison : FRFComparison
        Comparison of `system` with `frf`.
    **about
        As for `write_identification`.

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
    >>> import control as ct
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> from ctrl_realize import report
    >>> model = cr.delayed_ss(ct.tf([1], [0.08, 1]), dead_time=0.03, dt=0.001, name="valve")
    >>> f = np.geomspace(0.1, 10, 40)
    >>> s = 2j * np.pi * f
    >>> frf = cr.MeasuredFRF(1.02 * np.exp(-0.03 * s) / (0.08 * s + 1), f)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "comparison.html"
    ...     path = report.write_comparison(path, model, frf, cr.compare_frf(model, frf))
    ...     print(path.read_text().count("<svg "), "figures")
    2 figures
    """
    check_type(frf, ct.FrequencyResponseData, "frf", "a frequency response")
    check_type(comparison, FRFComparison, "comparison", "that of compare_frf")
    return write_report(
        path,
        title=f"{system.name} and {frf.name}",
        subtitle="model and measured frequency response",
        verdict=comparison_verdict(system, comparison),
        sketches=frf_sketches([system], frf, comparison),
        tables=[*comparison_tables(comparison), model_table(system)],
        fit=system.fit,
        **about,
    )


def write_report(
    path: str | os.PathLike[str],
    *,
    title: str,
    subtitle: str,
    verdict: Verdict,
    sketches: Sequence[Sketch],
    tables: Sequence[Table],
    records: Sequence[Record] = (),
    fit: ModelFit | None = None,
    controller: Controller | None = None,
    files: Paths = (),
    settings: Mapping[str, Any] | None = None,
    calls: Sequence[tuple[str, str]] = (),
    simulated: bool = False,
    figures: str | os.PathLike[str] | None = None,
) -> Path:
    """Write a page, with tables of data and settings, and, if a folder is given, its figures.

    The template reads its arguments by name, and what is made of them here. The file is written
    atomically.
    """
    target, version = Path(path), version_of("ctrl-realize")
    parameters = parameter_table(fit) if fit is not None and fit.parameters else None
    data = [data_table(records, files)] if files or records else []
    below = [*data, *settings_tables(settings), pairs("Versions", versions(), folded=True)]
    tables = [*tables, *below]
    if figures is not None:
        save_sketches(figures, sketches)
    write_text(target, rendered(locals()))
    return target
