"""``ctrl-realize identify``: models of measured records."""

from __future__ import annotations

from enum import Enum
from pathlib import Path
from typing import Annotated

import typer

from ..data import MeasuredFRF
from ..delayed import fit_of
from ..errors import CtrlRealizeError, DataError, OptionError
from ..frequency import compare_frf
from ..identification.campaign.campaign import Campaign
from ..identification.campaign.run import identify_campaign
from ..identification.methods import identify as identify_record
from ..io import read_frf
from ..results import ModelFit
from .inputs import (
    Reading,
    Settings,
    calls_again,
    check_files,
    reading,
    typed_call,
    words_again,
)
from .manifest import Run, refuse_other_results
from .results import campaign_table, write_campaign_files, write_record_files
from .staging import appearing, kept_rows, refuse_a_file
from .terminal import complain, one_line, printable, progress, say

_MANY = 12
"""Number of records from which on all cores are used."""
_OPTION = typer.Option


class Method(str, Enum):  # noqa: UP042  # typer shows the values of a plain str Enum
    """Ways to find a model."""

    output_error = "output_error"
    scan = "scan"
    paper = "paper"


def identify(
    files: Annotated[list[Path], typer.Argument(help="Records: CSV, TSV, .mat, .npz, Parquet.")],
    output: Annotated[Path, _OPTION("--output", "-o", help="Output folder.")],
    method: Annotated[
        Method, _OPTION(help="output_error fits the raw record; scan and paper use realization.")
    ] = Method.output_error,
    order: Annotated[
        int | None, _OPTION(min=1, help="Model order without the delay. Default: estimated.")
    ] = None,
    max_delay: Annotated[
        int | None, _OPTION(min=1, help="Largest delay to consider, in samples.")
    ] = None,
    frf: Annotated[
        Path | None, _OPTION(help="Measured frequency response to compare the model with.")
    ] = None,
    separate: Annotated[
        bool, _OPTION("--separate", help="Treat the records as different plants: one folder each.")
    ] = False,
    time: Annotated[str | None, _OPTION(help="Time column, name or number from 0.")] = None,
    input_column: Annotated[
        str | None, _OPTION("--input", help="Input column, name or number from 0.")
    ] = None,
    output_column: Annotated[
        str | None, _OPTION("--response", help="Output column, name or number from 0.")
    ] = None,
    dt: Annotated[
        float | None, _OPTION(help="Sample time in s, where there is no time column.")
    ] = None,
    time_unit: Annotated[str | None, _OPTION(help="s, ms, us, ns, min, h or day.")] = None,
    delimiter: Annotated[
        str | None, _OPTION(help="Column separator: ',' ';' tab. Default: detected.")
    ] = None,
    decimal: Annotated[str | None, _OPTION(help="'.' or ','. Default: detected.")] = None,
    skip_rows: Annotated[int, _OPTION(min=0, help="Lines to skip at the start.")] = 0,
    resample: Annotated[
        bool, _OPTION("--resample", help="Resample jittering samples onto a uniform time axis.")
    ] = False,
    jobs: Annotated[
        int | None,
        _OPTION(
            help="Number of processes; -1: all cores. Default: all cores for 12 records or more."
        ),
    ] = None,
    overwrite: Annotated[
        bool, _OPTION("--overwrite", help="Overwrite the results of another run in the folder.")
    ] = False,
) -> int:
    """Identify a model with dead time from one record, or from many of one plant.

    One record gives model.json, report.html and figures/. Several records of one plant are a
    campaign: the output also contains a table of their delays (records.csv), a model for each
    (models/) and a final model. A record that fails becomes a row of the table with its error. If a
    campaign is interrupted, the finished records are kept in rows/, and the same command resumes
    from there.

    \b
    Examples:
      ctrl-realize identify step.csv -o results
      ctrl-realize identify valve_*.csv -o valve --method scan --jobs 2
      ctrl-realize identify log.txt -o out --time 0 --input current --response position
      ctrl-realize identify step.csv -o out --frf frf.csv
    """  # noqa: D301  # \b keeps the lines of the examples apart
    given = [*files, *([frf] if frf else [])]
    check_files(given)
    settings = Settings(method.value, order, max_delay)
    how = reading(
        time=time,
        input=input_column,
        output=output_column,
        dt=dt,
        time_unit=time_unit,
        delimiter=delimiter,
        decimal=decimal,
        skip_rows=skip_rows,
        resample=resample,
    )
    measured = None if frf is None else read_frf(frf)
    words = words_again(files, settings, how, frf, separate)
    run = Run(typed_call("identify", words), tuple(given), overwrite)
    words += ["--output", str(output)]
    calls = calls_again(files, settings, how, words)
    if separate and len(files) > 1:
        return _each_alone(files, output, settings, how, measured, words, run)
    refuse_other_results(output, run)
    if len(files) > 1:
        return _many(files, output, settings, how, measured, calls, jobs, run)
    with appearing(output, run) as folder:
        reported = _one(files[0], folder, settings, how, measured, calls)
    _say_what_is_written(output, ["model.json"], reported)
    return 0 if reported else 1


def _one(
    file: Path,
    folder: Path,
    settings: Settings,
    how: Reading,
    frf: MeasuredFRF | None,
    calls: list[tuple[str, str]],
) -> bool:
    """Identify one file into a folder; return whether its report was written."""
    record = how.source(file)()
    system = identify_record(record, method=settings.method, **settings.options)
    comparison = None if frf is None else compare_frf(system, frf)
    reported = write_record_files(
        folder, system, record, file,
        frf=frf, comparison=comparison, settings=settings.given, calls=calls,
    )  # fmt: skip
    say(printable(f"{file}: {record!r}"))
    say(fit_of(system, ModelFit).report())
    if comparison is not None:
        say()
        say(comparison.report())
    return reported


def _say_what_is_written(output: Path, names: list[str], reported: bool) -> None:
    more = ["report.html", "figures/"] if reported else []
    say(f"\nwritten to {printable(str(output))}: {', '.join([*names, *more])}")


def _many(
    files: list[Path],
    output: Path,
    settings: Settings,
    how: Reading,
    frf: MeasuredFRF | None,
    calls: list[tuple[str, str]],
    jobs: int | None,
    run: Run,
) -> int:
    n_jobs = jobs if jobs is not None else -1 if len(files) >= _MANY else 1
    sources = [how.source(file) for file in files]
    with kept_rows(output) as store:
        campaign = identify_campaign(
            sources, n_jobs=n_jobs, method=settings.method, store=store, **settings.options
        )
        _refuse_useless(campaign)
        comparison = None if frf is None else compare_frf(campaign.system, frf)
        with appearing(output, run) as folder:
            reported = write_campaign_files(
                folder, campaign, files,
                frf=frf, comparison=comparison, settings=settings.given, calls=calls,
            )  # fmt: skip
    say(campaign_table(campaign))
    say()
    say(campaign.report())
    say()
    say("Final model")
    say(fit_of(campaign.system, ModelFit).report())
    if comparison is not None:
        say()
        say(comparison.report())
    _say_what_is_written(output, ["model.json", "records.csv", "models/"], reported)
    return 1 if campaign.failed or not reported else 0


def _refuse_useless(campaign: Campaign) -> None:
    """Raise an error if the records have no common result."""
    if not campaign.good:
        for row in campaign.rows:
            complain(printable(f"{row.name}: {row.error}"))
        raise DataError(f"none of the {len(campaign.rows)} records could be identified")
    try:
        _ = campaign.dt
    except DataError as error:
        raise DataError(f"{error}; --separate identifies each record on its own") from error


def _each_alone(
    files: list[Path],
    output: Path,
    settings: Settings,
    how: Reading,
    frf: MeasuredFRF | None,
    words: list[str],
    run: Run,
) -> int:
    """Identify each file into its own folder; failures do not stop the rest."""
    refuse_a_file(output)
    failed = 0
    names = unique_names([folder_name(file) for file in files])
    for name in names:
        refuse_other_results(output / name, run)
    for file, name in progress(zip(files, names, strict=True), len(files), "identify"):
        try:
            # each folder appears as soon as it is finished, so that an interruption loses no other
            with appearing(output / name, run) as folder:
                calls = calls_again([file], settings, how, words)
                failed += not _one(file, folder, settings, how, frf, calls)
        except (CtrlRealizeError, OSError) as error:
            failed += 1
            complain(f"{printable(str(file))}: {one_line(error)}")
        say()
    if failed == len(files):
        raise DataError(f"none of the {len(files)} records could be identified")
    say(f"written to {printable(str(output))}: a folder for each record")
    return 1 if failed else 0


def folder_name(file: Path) -> str:
    """Name of a record's folder: that of the file without extension, and never "." or ".."."""
    return file.stem if file.stem.strip(".") else "record"


def unique_names(names: list[str]) -> list[str]:
    """Number names that occur twice."""
    seen: dict[str, int] = {}
    out = []
    for name in names:
        seen[name] = seen.get(name, 0) + 1
        out.append(name if seen[name] == 1 else f"{name}_{seen[name]}")
    if len(set(out)) != len(out):
        raise OptionError(f"the files have the same name: {', '.join(names)}")
    return out
