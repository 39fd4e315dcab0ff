"""``ctrl-realize identify``: models of measured records."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias

from ..delayed import DelayedStateSpace, fit_of
from ..errors import CtrlRealizeError, DataError, OptionError, UnsuitableSystemError
from ..frequency import compare_frf
from ..identification.campaign.campaign import Campaign
from ..identification.campaign.run import identify_campaign
from ..identification.methods import METHODS
from ..identification.methods import identify as identify_record
from ..io import load_model, read_frf
from ..io.models import holds_model
from ..results import ModelFit
from .arguments import option_of
from .inputs import Reading, Source, python_keywords, reading_in_python
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
Calls: TypeAlias = list[tuple[str, str]]
"""How to do the same again: where, and what is typed there."""


def run_identify(
    files: list[Path], folder: Path | None, *, tune: str | None, json: str | None, **given: Any
) -> int:
    """Identify, write the results, and return the exit code."""
    given["tuning"] = None if tune is None else _tuning(tune)
    if json is not None:
        return told_as_json(
            json, lambda told: _identified(_Task(told=told, **given), files, folder)
        )
    code = _identified(_Task(**given), files, folder)
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
    saved = next(filter(holds_model, files), None)
    if saved is None:
        return _identified(_Task(joint=True, tuning=tuning, **given), files, folder)
    unused = [str(one) for one in files if one != saved]
    unused += [option_of(name) for kind in ("chosen", "tests", "record") for name in given[kind]]
    if folder is not None:
        unused.append("--output")
    if unused:
        raise OptionError(
            f"{saved} is a saved model: expected options of the controller and --require only, "
            f"got {', '.join(unused)}; give the records alone to have these"
        )
    system, required = load_model(saved), _required(given["require"])
    if not isinstance(system, DelayedStateSpace) or (required and system.fit is None):
        raise UnsuitableSystemError(
            f"{saved} holds no model of a plant that was identified; expected one written by "
            "identify, or without --require a DelayedStateSpace"
        )
    say(printable(f"{saved}: {system!r}"))
    tuning.of(system)
    return _judged(system, required) if required else 0


@dataclass
class _Task:
    """What a command is asked for: the same for all of its records."""

    run: Run
    chosen: Mapping[str, Any]
    tests: Mapping[str, Any]
    record: Mapping[str, Any]
    require: Sequence[str] | None
    frf: Path | None = None
    response: Mapping[str, Any] = field(default_factory=dict)
    joint: bool = False
    separate: bool = False
    jobs: int | None = None
    tuning: Tuning | None = None
    told: Told | None = None

    def __post_init__(self) -> None:
        """Check the options, and read the frequency response, before a record is read."""
        self.joint = self.joint or "gains" in self.chosen
        if self.joint and self.separate:
            raise OptionError("expected --joint or --separate, got both")
        if len(self.tests) > 1:
            raise OptionError("expected --by or --split, got both")
        self.required = _required(self.require)
        self.settings = {"method": METHODS[0], **self.chosen}
        self.how = Reading(self.record, self.tests)
        self.measured = None if self.frf is None else read_frf(self.frf, **self.response)

    def calls(self, files: Sequence[Path], test: int | None = None) -> Calls:
        """Return the commands that reproduce a run, for a terminal and in Python.

        `test` is the number of a test in its file, if that is identified alone.
        """
        chosen = python_keywords(self.settings)
        lines, name = reading_in_python(files, self.how)
        if self.joint and self.frf is not None:
            lines.append(f"frf = cr.read_frf({str(self.frf)!r}{python_keywords(self.response)})")
            chosen += ", frf=frf"
        if self.tests and test is not None:
            lines.append(f"sys = cr.identify(records[{test}]{chosen})")
        elif name == "records" and not self.joint:
            lines += [f"campaign = cr.identify_campaign(records{chosen})", "sys = campaign.system"]
        else:
            lines.append(f"sys = cr.identify({name}{chosen})")
        return [("In a terminal", self.run.typed), ("In Python", "\n".join(lines))]

    def told_of(self, system: DelayedStateSpace, sources: list[Source], calls: Calls) -> Provenance:
        """Tell of a model, compare and tune it if asked, and return what its files say."""
        comparison = None if self.measured is None else compare_frf(system, self.measured)
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
        shown = self.settings, calls, self.run.report, tuned, self.frf
        return Provenance(files, self.measured, comparison, *shown)


def _identified(task: _Task, files: list[Path], folder: Path | None) -> int:
    """Identify, and tune; results are written if there is a folder, and `told` is filled."""
    calls, sources = task.calls(files), task.how.sources(files)
    several = len(sources) > 1 and not task.joint
    if (folder is None or task.told is not None) and several:
        alone = "without --output" if task.told is None else "with --json"
        raise OptionError(
            f"{alone} there is one model: expected one record or --joint, got {len(sources)}"
        )
    if folder is None:
        return _one(task, sources, None, calls)
    if task.separate and several:
        return _each_alone(task, sources, folder)
    refuse_other_results(folder, task.run)
    if several:
        return _many(task, sources, folder, calls)
    with appearing(folder, task.run) as staged:
        code = _one(task, sources, staged, calls)
    say_written(folder, ["model.json"], task.run.report and code != 1)
    return code


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


def _one(task: _Task, sources: list[Source], folder: Path | None, calls: Calls) -> int:
    """Identify one model, into a folder if there is one; return the exit code.

    It is 1 if the report was not written.
    """
    records = [source.record() for source in sources]
    frf = {"frf": task.measured} if task.joint and task.measured is not None else {}
    with working("identifying"):
        given = records[0] if len(records) == 1 else records
        system = identify_record(given, **task.chosen, **frf)
    for source, record in zip(sources, records, strict=True):
        say(printable(f"{source.file}: {record!r}"))
    provenance = task.told_of(system, sources, calls)
    if task.told is not None:
        task.told.append({"system": system, "records": records, **provenance.tuned})
    if folder is None:
        return _judged(system, task.required)
    written = write_record_files(folder, system, records[0], provenance)
    return _judged(system, task.required) if written else 1


def _many(task: _Task, sources: list[Source], output: Path, calls: Calls) -> int:
    n_jobs = task.jobs if task.jobs is not None else -1 if len(sources) >= _MANY else 1
    with kept_rows(output) as store:
        campaign = identify_campaign(
            [source.content for source in sources], n_jobs=n_jobs, store=store, **task.chosen
        )
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


def _each_alone(task: _Task, sources: list[Source], output: Path) -> int:
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
                code = _one(task, [source], folder, task.calls([source.file], test))
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
