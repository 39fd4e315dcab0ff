"""Options of the commands, and how arguments of Python are spelled as options."""

from __future__ import annotations

import re
from collections.abc import Mapping
from enum import Enum
from pathlib import Path
from typing import Annotated, Any, TypeAlias

import typer

_OPTION = typer.Option

SPELLED = {
    "output": "--output-column", "start": "--from", "stop": "--to", "header": "--no-header",
    "band_hz": "--band",
}  # fmt: skip
"""Options that are not spelled like their argument: ``--output`` is the folder."""


class Method(str, Enum):  # noqa: UP042  # typer shows the values of a plain str Enum
    """Ways to find a model."""

    output_error = "output_error"
    scan = "scan"
    paper = "paper"


class Gains(str, Enum):  # noqa: UP042
    """Gains of several records that are fitted together."""

    common = "common"
    own = "own"


class ActuatorKind(str, Enum):  # noqa: UP042
    """What is fitted beside the linear part."""

    auto = "auto"
    slew_rate = "slew_rate"
    dead_band = "dead_band"
    stiction = "stiction"
    resolution = "resolution"
    saturation = "saturation"
    characteristic = "characteristic"


class Missing(str, Enum):  # noqa: UP042
    """Treatment of missing samples."""

    refuse = "refuse"
    keep = "keep"
    hold = "hold"


class LoopKind(str, Enum):  # noqa: UP042
    """Kinds of the process in a loop."""

    self_regulating = "self-regulating"
    flow = "flow"
    integrating = "integrating"


class Hold(str, Enum):  # noqa: UP042
    """Treatment of the model's zero-order hold."""

    auto = "auto"
    zoh = "zoh"
    none = "none"


Files = Annotated[
    list[Path],
    typer.Argument(help="Records: CSV, TSV, LVM, .xlsx, .mat, .npz, Parquet, HDF5, TDMS."),
]
Folder = Annotated[Path, _OPTION("--output", "-o", help="Output folder.")]
MaybeFolder = Annotated[
    Path | None, _OPTION("--output", "-o", help="Output folder for table, report and figures.")
]
Overwrite = Annotated[
    bool, _OPTION("--overwrite", help="Overwrite the results of another run in the folder.")
]

# how to identify
MethodOption = Annotated[
    Method, _OPTION("--method", help="output_error fits the raw record; scan and paper use "
                    "realization."),
]  # fmt: skip
Order = Annotated[
    int | None, _OPTION(min=1, help="Model order without the delay. Default: estimated.")
]
MaxDelay = Annotated[int | None, _OPTION(min=1, help="Largest delay to consider, in samples.")]
Structures = Annotated[
    list[str] | None, _OPTION(help="Process model: P1D, P2DZ, FOPDT, SOPDT, ...; repeatable.")
]
Samples = Annotated[
    int | None, _OPTION(min=1, help="scan, paper: number of samples of the impulse response.")
]
CutoffHz = Annotated[float | None, _OPTION(help="scan, paper: cutoff of the filter, in Hz.")]
Frf = Annotated[Path | None, _OPTION(help="Measured frequency response to compare the model with.")]
Joint = Annotated[
    bool, _OPTION("--joint", help="Fit one model to all records, and to the --frf if given.")
]
GainsOption = Annotated[
    Gains | None,
    _OPTION("--gains", help="own: each record of a joint fit has its own gain. Implies --joint."),
]
ActuatorOption = Annotated[
    ActuatorKind | None,
    _OPTION(
        "--actuator",
        help="Fit the limits of a valve or drive as well; auto: choose by information criterion.",
    ),
]
Separate = Annotated[
    bool, _OPTION("--separate", help="Treat the records as different plants: one folder each.")
]
By = Annotated[
    str | None, _OPTION(help="A file holds several tests: the column that separates them.")
]
Split = Annotated[
    bool, _OPTION("--split", help="A file holds several tests: split it where its time jumps.")
]
Jobs = Annotated[
    int | None,
    _OPTION(help="Number of processes; -1: all cores. Default: all cores for 12 records or more."),
]
NoReport = Annotated[
    bool, _OPTION("--no-report", help="Write models and tables alone, without report and figures.")
]

# how to judge a valve
CommandRange = Annotated[
    tuple[float, float] | None,
    _OPTION(metavar="CLOSED OPEN", help="Command of the closed and the open valve. Default: 0 100 "
            "for %, 4 20 for mA, otherwise the range of the records."),
]  # fmt: skip
TravelRange = Annotated[
    tuple[float, float] | None,
    _OPTION(metavar="CLOSED OPEN", help="Position of the closed and the open valve. Default: 0 100 "
            "for %, otherwise such that the gain of the larger steps is one."),
]  # fmt: skip
Limit = Annotated[
    list[str] | None,
    _OPTION(help="Permitted values, such as t86=0.5, gain=0.9:1.1, t86@2=0.4 (steps of 2 %); "
            "repeatable."),
]  # fmt: skip
NoFit = Annotated[
    bool, _OPTION("--no-fit", help="Do not fit the dead time of each size and direction.")
]
# how to judge a loop
ProcessOption = Annotated[LoopKind, _OPTION("--process", help="What the process value is.")]
SetPoint = Annotated[
    str | None, _OPTION("--set-point", help="Column of the set point, if it moves.")
]

# how to read records
Time = Annotated[str | None, _OPTION(help="Time column, name or number from 0.")]
Input = Annotated[
    list[str] | None, _OPTION("--input", help="Input column or tag, name or number; repeatable.")
]
OutputColumn = Annotated[
    list[str] | None,
    _OPTION("--output-column", "--response", help="Output column or tag; repeatable."),
]
Dt = Annotated[float | None, _OPTION(help="Sample time in s, where there is no time column.")]
TimeUnit = Annotated[str | None, _OPTION(help="s, ms, us, ns, min, h or day.")]
TimeFormat = Annotated[
    str | None, _OPTION(help="Format of dates, such as '%d.%m.%Y %H:%M:%S'. Default: detected.")
]
TimeZone = Annotated[
    str | None, _OPTION(help="Zone of a clock that has summer time, such as Europe/Berlin.")
]
Wrap = Annotated[
    float | None, _OPTION(help="Number of values of a counter that starts again: its turns join.")
]
From = Annotated[str | None, _OPTION("--from", help="First time to use, in s or as a date.")]
To = Annotated[str | None, _OPTION("--to", help="Last time to use, in s or as a date.")]
MissingOption = Annotated[
    Missing | None,
    _OPTION(
        "--missing",
        help="keep: use records with bad cells, gaps or irregular times as they are; hold: the "
        "input holds its last value meanwhile.",
    ),
]
NaValues = Annotated[
    list[str] | None, _OPTION(help="Further word or number without a value; repeatable.")
]
Quality = Annotated[str | None, _OPTION(help="Column of the quality; none: ignore qualities.")]
Good = Annotated[list[str] | None, _OPTION(help="Good quality; repeatable. Default: not Bad.")]
Resample = Annotated[
    bool, _OPTION("--resample", help="Resample jittering samples onto a uniform time axis.")
]
Rest = Annotated[
    tuple[float, float] | None,
    _OPTION(metavar="INPUT OUTPUT", help="Steady state before a record that begins with its step."),
]

# how to read any file
Delimiter = Annotated[str | None, _OPTION(help="Column separator: ',' ';' tab. Default: detected.")]
Decimal = Annotated[str | None, _OPTION(help="'.' or ','. Default: detected.")]
Encoding = Annotated[str | None, _OPTION(help="Encoding of text. Default: detected.")]
Comment = Annotated[str | None, _OPTION(help="Sign that begins comments. Default: detected.")]
NoHeader = Annotated[bool, _OPTION("--no-header", help="The first line holds no names.")]
SkipRows = Annotated[int | None, _OPTION(min=0, help="Lines to skip at the start.")]
Variable = Annotated[
    str | None, _OPTION(help="Variable of a .mat or .npz file, group, or sheet of a workbook.")
]
MaxBytes = Annotated[float | None, _OPTION(help="Largest file, packed or not. Default: 2 GiB.")]

# how to read frequency responses
Frequency = Annotated[str | None, _OPTION(help="Column of the frequency.")]
Magnitude = Annotated[str | None, _OPTION(help="Column of the magnitude.")]
Phase = Annotated[str | None, _OPTION(help="Column of the phase.")]
Real = Annotated[str | None, _OPTION(help="Column of the real part.")]
Imag = Annotated[str | None, _OPTION(help="Column of the imaginary part.")]
FrequencyUnit = Annotated[str | None, _OPTION(help="Hz, kHz, MHz or rad/s.")]
MagnitudeUnit = Annotated[str | None, _OPTION(help="abs or dB.")]
PhaseUnit = Annotated[str | None, _OPTION(help="deg or rad.")]

# comparison
MinCoherence = Annotated[
    float | None, _OPTION(help="Smallest coherence of a trusted point. Default: 0.95.")
]
Band = Annotated[
    tuple[float, float] | None,
    _OPTION("--band", metavar="LOW HIGH", help="Compare in this band, in Hz."),
]
HoldOption = Annotated[
    Hold,
    _OPTION(
        "--hold",
        help="zoh divides the zero-order hold out of the model; auto does so for sampled models.",
    ),
]

Given: TypeAlias = dict[str, Any]
"""Arguments of Python for the options of a group that were given, see `files.with_options`."""

_FREQUENCY_RESPONSE: dict[str, Any] = {
    "frequency": Frequency, "magnitude": Magnitude, "phase": Phase, "real": Real, "imag": Imag,
    "frequency_unit": FrequencyUnit, "magnitude_unit": MagnitudeUnit, "phase_unit": PhaseUnit,
}  # fmt: skip
_ANY_FILE: dict[str, Any] = {
    "delimiter": Delimiter, "decimal": Decimal, "encoding": Encoding, "comment": Comment,
    "no_header": NoHeader, "skip_rows": SkipRows, "variable": Variable, "max_bytes": MaxBytes,
}  # fmt: skip
_RECORD: dict[str, Any] = {
    "time": Time, "input": Input, "output": OutputColumn, "dt": Dt, "time_unit": TimeUnit,
    "time_format": TimeFormat, "time_zone": TimeZone, "start": From, "stop": To,
    "missing": MissingOption, "na_values": NaValues, "quality": Quality, "good": Good,
    "wrap": Wrap, "resample": Resample, "rest": Rest, **_ANY_FILE,
}  # fmt: skip
GROUPS: dict[str, dict[str, Any]] = {
    "chosen": {
        "order": Order, "max_delay": MaxDelay, "structures": Structures, "samples": Samples,
        "cutoff_hz": CutoffHz, "gains": GainsOption, "actuator": ActuatorOption,
    },
    "tests": {"by": By, "split": Split},
    "record": _RECORD,
    "valve_test": {name: one for name, one in _RECORD.items() if name != "missing"},
    "trend": {name: one for name, one in _RECORD.items() if name not in ("missing", "rest")},
    "response": _FREQUENCY_RESPONSE,
    "response_file": {**_FREQUENCY_RESPONSE, **_ANY_FILE},
    "trusted": {"min_coherence": MinCoherence, "band_hz": Band},
    "ranges": {"command_range": CommandRange, "travel_range": TravelRange},
}  # fmt: skip
"""Options that several commands share, or that go together to one function of Python."""

ARGUMENTS = frozenset(
    name.removeprefix("no_")
    for group in ("chosen", "tests", "record", "response", "trusted")
    for name in GROUPS[group]
    if name != "split"
) | {"method", "hold"}
"""Arguments of Python that have an option."""

_COLUMNS = ("time", "input", "output", "quality", "by")

_CALLS = {
    "Record needs a uniform time axis: Record.from_samples(...) takes gaps and irregular samples "
    "as they are, Record.resampled(...) or read_record(..., resample=True) interpolates small "
    "jitter": "--resample interpolates small jitter",
    "record.with_baseline(u0, y0) or read_record(..., rest=(u0, y0))": "--rest U0 Y0",
    "read_records(path, by=)": "--by COLUMN or --split",
    "record.between(t0, t1)": "--from and --to",
    "time=name or number": "--time NAME-OR-NUMBER",
    "input=name or number": "--input NAME-OR-NUMBER",
    "output=name or number": "--output-column NAME-OR-NUMBER",
    "quality=None": "--quality none",
    "header=False and column numbers": "--no-header and column numbers",
    "fit_output_error needs": "the fit needs",
    "Record.from_samples(record.time, record.input, record.output) or read_record(..., "
    "missing='hold')": "--missing hold",
}
"""Advice for Python, and for the command line."""

_ARGUMENT = re.compile(
    r"(?<![\w'\"/.\-%])(?P<name>" + "|".join(sorted(ARGUMENTS, key=len, reverse=True)) + r")="
    r"(?P<value>'[^']*'|\"[^\"]*\"|[\w.+\-]*[\w])?"
)


_BARE = re.compile(r"[\w.,;+-]+", re.ASCII)
"""A value that needs no quotes on a command line."""


def as_options(message: str) -> str:
    """Return a message that speaks of options in place of arguments of Python.

    Examples
    --------
    >>> from ctrl_realize.cli.options import as_options
    >>> print(as_options("a.csv: give time_unit='ms', or dt= to ignore the column"))
    a.csv: give --time-unit ms, or --dt to ignore the column
    """
    for call, option in _CALLS.items():
        message = message.replace(call, option)
    return _ARGUMENT.sub(_spelled, message)


def _spelled(found: re.Match[str]) -> str:
    option, value = option_of(found["name"]), found["value"]
    if value is None or value in ("True", "False"):
        return option
    plain = value[1:-1] if value[0] in "'\"" else value
    return f"{option} {plain if _BARE.fullmatch(plain) else value}"


def option_of(argument: str) -> str:
    """Option of an argument."""
    return SPELLED.get(argument, f"--{argument.replace('_', '-')}")


def words_of(keywords: Mapping[str, Any]) -> list[str]:
    """Return keyword arguments as words of a command line.

    Examples
    --------
    >>> from ctrl_realize.cli.options import words_of
    >>> print(*words_of({"input": ["u", 2], "output": "3", "rest": (0.0, 20.3), "resample": True}))
    --input u --input 2 --output-column =3 --rest 0.0 20.3 --resample
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
    named_by_number = name in _COLUMNS and isinstance(value, str) and text.isdecimal()
    return f"={text}" if named_by_number else text
