"""``ctrl-realize identify``: models of measured records."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..data import MeasuredFRF
from ..delayed import DelayedStateSpace, fit_of
from ..errors import CtrlRealizeError, DataError, OptionError, UnsuitableSystemError
from ..frequency import compare_frf
from ..identification.campaign.campaign import Campaign
from ..identification.campaign.run import identify_campaign
from ..identification.methods import identify as identify_record
from ..io import load_model, read_frf
from ..io.models import holds_model
from ..results import ModelFit
from .arguments import option_of
from .inputs import Reading, Settings, Source, calls_again
from .machine import Told, told_as_json
from .manifest import Run, refuse_other_results
from .results import (
    Provenance,
    campaign_table,
    say_not_written,
    say_written,
    write_campaign_files,
    write_record_files,
)
from .staging import appearing, kept_rows, refuse_a_file
from .terminal import complain, one_line, printable, progress, say, working
from .tuning import Tuning

_QUESTIONS = {"dead-time": "dead time", "gain": "gain", "tuning": "tuning"}
"""Questions as options -> as verdicts."""
_MANY = 12
"""Number of records from which on all cores are used."""


def run_identify(
    files: list[Path], folder: Path | None, *, tune: str | None, json: str | None, **given: Any
) -> int:
    """Identify, write the results, and return the exit code."""
    tuning = None if tune is None else _tuning(tune)
    if json is not None:
        return told_as_json(
            json, lambda told: identified(files, folder, tuning=tuning, told=told, **given)
        )
    code = identified(files, folder, tuning=tuning, **given)
    if folder is None:
        say_not_written()
    return code


def _tuning(form: str) -> Tuning:
    try:
        return Tuning({}, {"form": form}, optional=True)
    except OptionError as error:
        raise OptionError(str(error).replace(f"form={form!r}", f"--tune {form}")) from None


def run_tune(
    files: list[Path],
    folder: Path | None,
    *,
    tuned: Mapping[str, Any],
    entered: Mapping[str, Any],
    **given: Any,
) -> int:
    """Tune for one model of all records, or for a saved one, and return the exit code."""
    tuning = Tuning(tuned, entered)
    if len(files) > 1 or not holds_model(files[0]):
        return identified(files, folder, joint=True, tuning=tuning, **given)
    unused = [option_of(name) for kind in ("chosen", "tests", "record") for name in given[kind]]
    if folder is not None:
        unused.append("--output")
    if unused:
        raise OptionError(
            f"{files[0]} is a saved model: expected options of the controller and --require only, "
            f"got {', '.join(unused)}; give the records to have these"
        )
    system, required = load_model(files[0]), _required(given["require"])
    if not isinstance(system, DelayedStateSpace) or (required and system.fit is None):
        raise UnsuitableSystemError(
            f"{files[0]} holds no model of a plant that was identified; expected one written by "
            "identify, or without --require a DelayedStateSpace"
        )
    say(printable(f"{files[0]}: {system!r}"))
    tuning.of(system)
    return _judged(system, required) if required else 0


def identified(
    files: list[Path],
    folder: Path | None,
    *,
    chosen: Mapping[str, Any],
    frf: Path | None = None,
    joint: bool = False,
    separate: bool = False,
    tests: Mapping[str, Any],
    record: Mapping[str, Any],
    response: Mapping[str, Any] | None = None,
    jobs: int | None = None,
    require: Sequence[str] | None,
    run: Run,
    tuning: Tuning | None = None,
    told: Told | None = None,
) -> int:
    """Identify, and tune; results are written if there is a folder, and `told` is filled."""
    joint = joint or "gains" in chosen
    if joint and separate:
        raise OptionError("expected --joint or --separate, got both")
    if len(tests) > 1:
        raise OptionError("expected --by or --split, got both")
    required = _required(require)
    settings = Settings(chosen, joint)
    how = Reading(record, tests)
    response = response or {}
    measured = None if frf is None else read_frf(frf, **response)
    calls = calls_again(files, settings, how, run.typed, None if frf is None else (frf, response))
    sources = how.sources(files)
    task = _Task(settings, measured, frf, required, run, tuning, told)
    if (folder is None or told is not None) and len(sources) > 1 and not joint:
        alone = "without --output" if told is None else "with --json"
        raise OptionError(
            f"{alone} there is one model: expected one record or --joint, got {len(sources)}"
        )
    if folder is None:
        return _one(task, sources, None, calls)
    if separate and len(sources) > 1:
        return _each_alone(task, sources, folder, how)
    refuse_other_results(folder, run)
    if len(sources) > 1 and not joint:
        return _many(task, sources, folder, calls, jobs)
    with appearing(folder, run) as staged:
        code = _one(task, sources, staged, calls)
    say_written(folder, ["model.json"], run.report and code != 1)
    return code


@dataclass(frozen=True)
class _Task:
    """What is the same for all records of a command."""

    settings: Settings
    frf: MeasuredFRF | None
    frf_file: Path | None
    required: list[str]
    run: Run
    tuning: Tuning | None = None
    told: Told | None = None

    def told_of(
        self, system: DelayedStateSpace, sources: list[Source], calls: list[tuple[str, str]]
    ) -> Provenance:
        """Tell of a model, compare and tune it if asked, and return what its files say."""
        comparison = None if self.frf is None else compare_frf(system, self.frf)
        say(fit_of(system, ModelFit).report())
        if comparison is not None:
            say(f"\n{comparison.report()}")
        tuned: dict[str, Any] = {}
        if self.tuning is not None:
            try:
                tuned = self.tuning.of(system)
            except UnsuitableSystemError as error:
                if not self.tuning.optional:
                    raise
                complain(f"no controller: {one_line(error)}")
            terminal, (name, lines) = calls
            calls = [terminal, (name, f"{lines}\n{self.tuning.in_python()}")]
        files = [source.file for source in sources]
        shown = self.settings.given, calls, self.run.report, tuned, self.frf_file
        return Provenance(files, self.frf, comparison, *shown)


def _required(require: Sequence[str] | None) -> list[str]:
    for name in require or ():
        if name.casefold() not in _QUESTIONS:
            raise OptionError(
                f"--require {name}: expected {', '.join(_QUESTIONS)}; "
                "of several each with --require before it"
            )
    return [name.casefold() for name in require or ()]


def _judged(system: DelayedStateSpace, required: Sequence[str]) -> int:
    """Exit code by the verdicts that are required."""
    levels = {one.question: one.level for one in fit_of(system, ModelFit).verdicts}
    missed = [name for name in required if levels.get(_QUESTIONS[name]) != "good"]
    for name in missed:
        level = levels.get(_QUESTIONS[name], "not judged by this method")
        complain(f"--require {name}: the verdict is {level!r}")
    return 4 if missed else 0


def _one(
    task: _Task, sources: list[Source], folder: Path | None, calls: list[tuple[str, str]]
) -> int:
    """Identify one model, into a folder if there is one; return the exit code.

    It is 1 if the report was not written.
    """
    settings, records = task.settings, [source.record() for source in sources]
    frf = {"frf": task.frf} if settings.joint and task.frf is not None else {}
    with working("identifying"):
        given = records[0] if len(records) == 1 else records
        system = identify_record(given, **settings.choices, **frf)
    for source, record in zip(sources, records, strict=True):
        say(printable(f"{source.file}: {record!r}"))
    provenance = task.told_of(system, sources, calls)
    if task.told is not None:
        task.told.append({"system": system, "records": records, **provenance.tuned})
    if folder is None:
        return _judged(system, task.required)
    written = write_record_files(folder, system, records[0], provenance)
    return _judged(system, task.required) if written else 1


def _many(
    task: _Task, sources: list[Source], output: Path, calls: list[tuple[str, str]], jobs: int | None
) -> int:
    n_jobs = jobs if jobs is not None else -1 if len(sources) >= _MANY else 1
    with kept_rows(output) as store:
        campaign = identify_campaign(
            [source.content for source in sources],
            n_jobs=n_jobs, store=store, **task.settings.choices,
        )  # fmt: skip
        _refuse_useless(campaign)
        say(f"{campaign_table(campaign)}\n\n{campaign.report()}\n\nFinal model")
        provenance = task.told_of(campaign.system, sources, calls)
        with appearing(output, task.run) as folder:
            written = write_campaign_files(folder, campaign, provenance)
    say_written(output, ["model.json", "records.csv", "models/"], task.run.report and written)
    return 1 if campaign.failed or not written else _judged(campaign.system, task.required)


def _refuse_useless(campaign: Campaign) -> None:
    """Raise an error if the records have no common result."""
    if not campaign.good:
        for row in campaign.rows:
            complain(printable(f"{row.name}: {one_line(DataError(row.error or ''))}"))
        raise DataError(f"none of the {len(campaign.rows)} records could be identified")
    try:
        _ = campaign.dt
    except DataError as error:
        raise DataError(f"{error}; --separate identifies each record on its own") from error


def _each_alone(task: _Task, sources: list[Source], output: Path, how: Reading) -> int:
    """Identify each record into its own folder; failures do not stop the rest."""
    refuse_a_file(output)
    failed = unlike = 0
    names = unique_names([source.name for source in sources])
    for name in names:
        refuse_other_results(output / name, task.run)
    for source, name in progress(zip(sources, names, strict=True), len(sources), "identify"):
        try:
            # each folder appears as soon as it is finished, so that an interruption loses no other
            with appearing(output / name, task.run) as folder:
                # number of a test in its file
                test = [one for one in sources if one.file == source.file].index(source)
                typed = task.run.typed
                calls = calls_again([source.file], task.settings, how, typed, None, test)
                code = _one(task, [source], folder, calls)
                failed, unlike = failed + (code == 1), unlike + (code == 4)
        except (CtrlRealizeError, OSError) as error:
            failed += 1
            complain(f"{printable(str(source.file))}: {one_line(error)}")
        say()
    if failed == len(sources):
        raise DataError(f"none of the {len(sources)} records could be identified")
    say(f"written to {printable(str(output))}: a folder for each record")
    return 1 if failed else 4 if unlike else 0


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
