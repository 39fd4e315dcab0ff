"""Input files of the commands, and the options for reading them."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TypedDict

from ..data import Record
from ..errors import MissingFileError, OptionError
from ..identification.methods import IdentifyOptions, Method
from ..io import read_record


class ReadOptions(TypedDict, total=False):
    """Arguments of `read_record` that the command line offers."""

    time: str | int
    input: str | int
    output: str | int
    dt: float
    time_unit: str
    delimiter: str
    decimal: str
    skip_rows: int
    resample: bool


@dataclass(frozen=True)
class Reading:
    """How to read records: the arguments of `read_record` that were given."""

    keywords: ReadOptions

    def source(self, path: Path) -> partial[Record]:
        """Return a function that reads one file; it can be sent to other processes."""
        return partial(read_record, path, **self.keywords)


@dataclass(frozen=True)
class Settings:
    """How to identify: the arguments of `identify` that the command line offers."""

    method: Method
    order: int | None = None
    max_delay: int | None = None

    @property
    def options(self) -> IdentifyOptions:
        """Given arguments except the method."""
        options: IdentifyOptions = {}
        if self.order is not None:
            options["order"] = self.order
        if self.max_delay is not None:
            options["max_delay"] = self.max_delay
        return options

    @property
    def given(self) -> dict[str, object]:
        """Names and values of the given arguments, for files and reports."""
        return {"method": self.method, **self.options}


def reading(
    *,
    time: str | None,
    input: str | None,
    output: str | None,
    dt: float | None,
    time_unit: str | None,
    delimiter: str | None,
    decimal: str | None,
    skip_rows: int,
    resample: bool,
) -> Reading:
    """Convert options to arguments of `read_record`; what was not given keeps its default."""
    keywords: ReadOptions = {}
    if (column := selector(time)) is not None:
        keywords["time"] = column
    if (column := selector(input)) is not None:
        keywords["input"] = column
    if (column := selector(output)) is not None:
        keywords["output"] = column
    if dt is not None:
        keywords["dt"] = dt
    if time_unit is not None:
        keywords["time_unit"] = time_unit
    if delimiter is not None:
        keywords["delimiter"] = {"tab": "\t", r"\t": "\t"}.get(delimiter, delimiter)
    if decimal is not None:
        keywords["decimal"] = decimal
    if skip_rows:
        keywords["skip_rows"] = skip_rows
    if resample:
        keywords["resample"] = True
    return Reading(keywords)


def selector(text: str | None) -> str | int | None:
    """Convert a column to a number if it is one; ``=2`` is the column named "2"."""
    if text is None or text == "":
        return None
    if text.startswith("="):
        return text[1:]
    # "²" is a digit but not a number
    return int(text) if text.isdecimal() and text.isascii() else text


def check_files(paths: Sequence[Path]) -> None:
    """Refuse files that do not exist before any work is done.

    Raises
    ------
    MissingFileError, OptionError
    """
    for path in paths:
        if not path.exists():
            raise MissingFileError(f"{path}: there is no such file")
        if path.is_dir():
            raise OptionError(f"{path} is a folder; give the files in it")


def typed_call(command: str, words: Sequence[str]) -> str:
    """Return a command line that can be typed again."""
    return shlex.join(["ctrl-realize", command, *words])


def python_keywords(keywords: Mapping[str, object]) -> str:
    """Return keyword arguments as Python text."""
    return "".join(f", {name}={value!r}" for name, value in keywords.items())


def words_again(
    files: list[Path],
    settings: Settings,
    how: Reading,
    frf: Path | None,
    separate: bool,
) -> list[str]:
    """Return the arguments that reproduce a run, without the output folder."""
    words = [*map(str, files)]
    for name, value in settings.given.items():
        words += [f"--{name.replace('_', '-')}", str(value)]
    if frf is not None:
        words += ["--frf", str(frf)]
    if separate:
        words.append("--separate")
    for name, value in how.keywords.items():
        # --output is the folder, so the output column has another option
        option = "--response" if name == "output" else f"--{name.replace('_', '-')}"
        if value is True:
            words.append(option)
        else:
            words += [option, "tab" if value == "\t" else str(value)]
    return words


def calls_again(
    files: list[Path], settings: Settings, how: Reading, words: list[str]
) -> list[tuple[str, str]]:
    """Return the commands that reproduce a run, for a terminal and in Python."""
    keywords = python_keywords(how.keywords)
    chosen = python_keywords(settings.given)
    if len(files) == 1:
        python = (
            "import ctrl_realize as cr\n"
            f"record = cr.read_record({str(files[0])!r}{keywords})\n"
            f"sys = cr.identify(record{chosen})"
        )
    else:
        names = ",\n    ".join(repr(str(file)) for file in files)
        python = (
            "import ctrl_realize as cr\n"
            f"files = [\n    {names},\n]\n"
            f"records = [cr.read_record(file{keywords}) for file in files]\n"
            f"campaign = cr.identify_campaign(records{chosen})\n"
            "sys = campaign.system"
        )
    return [("In a terminal", typed_call("identify", words)), ("In Python", python)]
