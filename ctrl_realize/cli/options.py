"""Options of the commands, and how arguments of Python are spelled as options."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, TypeAlias

import typer

from .._facts import facts
from .arguments import option_of, options_of

_OPTION = typer.Option


Files = Annotated[
    list[Path],
    typer.Argument(help="Records: CSV, TSV, LVM, .xlsx, .mat, .npz, Parquet, HDF5, TDMS."),
]
MaybeFiles = Annotated[
    list[Path] | None, typer.Argument(help="Records, a measured frequency response, or saved work.")
]
NoBrowser = Annotated[bool, _OPTION("--no-browser", help="Say the address, and open no browser.")]
Port = Annotated[int, _OPTION("--port", min=0, max=65535, help="Port; 0: a free one.")]


def _folder(text: str) -> Path:
    if not text.strip():  # as from an unset variable of a script; Path("") is the current folder
        raise typer.BadParameter("expected a folder, got an empty name; '.' is the current folder")
    return Path(text)


_INTO = {"parser": _folder, "metavar": "PATH"}
Folder = Annotated[
    Path | None,
    _OPTION("--output", "-o", help="Output folder for tables, report and figures.", **_INTO),
]

# how to identify
Frf = Annotated[Path | None, _OPTION(help="Measured frequency response to compare the model with.")]
Joint = Annotated[
    bool, _OPTION("--joint", help="Fit one model to all records, and to the --frf if given.")
]
Separate = Annotated[
    bool, _OPTION("--separate", help="Treat the records as different plants: one folder each.")
]
Jobs = Annotated[
    int | None,
    _OPTION(help="Number of processes; -1: all cores. Default: all cores for 12 records or more."),
]
Require = Annotated[
    list[str] | None,
    _OPTION(help="Exit with 4 unless the verdict on dead-time, gain or tuning is good; "
            "repeatable."),
]  # fmt: skip


def _form(name: str | None) -> str | None:
    if name is not None and name.startswith("-"):  # the name was left out, and this is an option
        raise typer.BadParameter(
            f"expected a form, such as ideal or siemens_pid_compact; got {name}"
        )
    return name


Tune = Annotated[
    str | None,
    _OPTION(metavar="FORM", callback=_form, help="Tune a PI, too, and tell what to enter in "
            "this form, such as siemens_pid_compact; see the command tune."),
]  # fmt: skip

Json = Annotated[
    str | None,
    _OPTION("--json", metavar="FILE", help="Write model, verdicts and flags as JSON; -: to "
            "stdout, with everything else on stderr."),
]  # fmt: skip

# how to judge a valve
Limit = Annotated[
    list[str] | None,
    _OPTION(help="Permitted values, such as t86=0.5, gain=0.9:1.1, t86@2=0.4 (steps of 2 %); "
            "repeatable."),
]  # fmt: skip

Given: TypeAlias = dict[str, Any]
"""Arguments of Python for the options of a group that were given, see `files.with_options`."""


def _option(kind: Any, said: str, *names: str) -> Any:
    """Return an option of a group; its name is that in the group, unless it is given."""
    return Annotated[kind, typer.Option(*names, help=said)]


_RECORD = options_of("io/records.py", "read_record", "name")
_RESPONSE = options_of("io/frf.py", "read_frf", "response coherence std name")
GROUPS: dict[str, dict[str, Any]] = {
    "chosen": options_of(
        "identification/methods.py", "identify", "known loss noise include_known feedthrough frf"
    ),
    "tests": {
        **options_of("io/records.py", "read_records"),
        "split": _option(bool, "A file holds several tests: split it where its time jumps.",
                         "--split"),
    },
    "record": _RECORD,
    "trend": options_of("io/records.py", "read_record", "name missing rest"),
    "response": {name: one for name, one in _RESPONSE.items() if name not in _RECORD},
    "response_file": {name: _RECORD.get(name, one) for name, one in _RESPONSE.items()},
    "tuned": {
        "rule": _option(
            str | None, "simc (default: as fast as is robust), lambda, imc, amigo, "
            "ziegler_nichols, cohen_coon, tyreus_luyben, optimal, ...; see design.pid.",
        ),
        "kind": _option(str | None, "P, PI (default), PD or PID."),
        **options_of("design/tuning/pid.py", "pid", "method dt name"),
    },
    "entered": {
        "form": _option(
            str | None, "Form in which the numbers are entered: ideal (default), series, "
            "parallel, proportional_band, siemens_pid_compact, rockwell_pide_dependent, "
            "emerson_deltav_series, ...; see design.pid_forms.",
        ),
        **options_of("design/tuning/controller.py", "as_form", "time_unit"),
    },
    "compared": options_of("frequency/compare.py", "compare_frf"),
    "measured": options_of("valves/evaluate.py", "valve_report", "limits"),
    "diagnosed": options_of("valves/loops/diagnose.py", "diagnose_loop"),
    "written": {
        "no_report": _option(
            bool, "Write models and tables alone, without report and figures.", "--no-report"
        ),
        "overwrite": _option(
            bool, "Overwrite the results of another run in the folder.", "--overwrite"
        ),
    },
}  # fmt: skip
"""Options that several commands share, or that go together to one function of Python."""

_OWN = {"split", "report", "overwrite"}
"""Options that are no arguments of Python."""

ARGUMENTS = {name.removeprefix("no_") for group in GROUPS.values() for name in group} - _OWN
"""Arguments of Python that have an option."""

COLUMNS = ("time", "input", "output", "quality", "by", "frequency", "magnitude", "phase", "real",
           "imag")  # fmt: skip
"""Arguments that select columns, by name or number."""

_CALLS = {row["python"]: row["option"] for row in facts("cli/advice.toml")["advice"]}
"""Advice for Python, and for the command line."""

_ARGUMENT = re.compile(
    r"(?<![\w'\"/.\-%])(?P<name>" + "|".join(sorted(ARGUMENTS, key=len, reverse=True)) + r")="
    r"(?P<value>'[^']*'|\"[^\"]*\"|\([-+.\w, ]+\)|[\w.+\-]*[\w])?"
)


_PID = re.compile(r"design\.pid\(sys, '([\w-]+)'(?:, '(\w+)')?([^()]*)\)")
"""A call with rule, kind and other arguments."""

_BARE = re.compile(r"[\w.,;+-]+", re.ASCII)
"""A value that needs no quotes on a command line."""


def as_options(message: str) -> str:
    """Return a message that speaks of options in place of arguments of Python.

    Examples
    --------
    >>> from ctrl_realize.cli.options import as_options
    >>> print(as_options("a.csv: give time_unit='ms', or dt= to ignore the column"))
    a.csv: give --time-unit ms, or --dt to ignore the column
    >>> print(as_options("dead_time=(80.0, 20.0); expected two times"))
    --dead-time 80.0 20.0; expected two times
    >>> print(as_options("Try design.pid(sys, 'lambda', reduction='half_rule'): Ms 1.35"))
    Try --rule lambda --reduction half_rule: Ms 1.35
    """
    message = _PID.sub(_tuned, message)
    for call, option in _CALLS.items():
        message = message.replace(call, option)
    return _ARGUMENT.sub(_spelled, message)


def _tuned(found: re.Match[str]) -> str:
    rule, kind, rest = found.groups()
    return f"rule={rule}{f' kind={kind}' if kind else ''}{rest.replace(',', '')}"


def _spelled(found: re.Match[str]) -> str:
    option, value = option_of(found["name"]), found["value"]
    if value is None or value in ("True", "False"):
        return option
    if value[0] == "(":
        return f"{option} {value[1:-1].replace(',', '')}"
    plain = value[1:-1] if value[0] in "'\"" else value
    return f"{option} {plain if _BARE.fullmatch(plain) else value}"


def words_of(keywords: Mapping[str, Any]) -> list[str]:
    """Return keyword arguments as words of a command line.

    Examples
    --------
    >>> from ctrl_realize.cli.options import words_of
    >>> print(*words_of({"input": ["u", 2], "output": "3", "rest": (0.0, 20.3), "resample": True}))
    --input u --input 2 --output-column =3 --rest 0.0 20.3 --resample
    >>> print(*words_of({"frequency": 0, "phase": "2"}))
    --frequency 0 --phase =2
    """
    words: list[str] = []
    for name, value in keywords.items():
        option = option_of(name)
        if isinstance(value, bool):
            words.append(option)
        elif isinstance(value, tuple):
            words += [option, *map(str, value)]
        elif isinstance(value, list):
            words += [word for one in value for word in (option, _word(name, one))]
        else:
            words += [option, _word(name, value)]
    return words


def _word(name: str, value: object) -> str:
    """One value as it is typed; a column whose name is a number is ``=2``."""
    if value is None:
        return "none"
    text = "tab" if value == "\t" else str(value)
    named_by_number = name in COLUMNS and isinstance(value, str) and text.isdecimal()
    return f"={text}" if named_by_number else text
