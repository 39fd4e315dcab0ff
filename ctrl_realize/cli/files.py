"""Input files of the commands, and the options for reading them as arguments."""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum
from pathlib import Path
from typing import Any

from ..errors import MissingFileError, OptionError

_COLUMNS = ("time", "input", "output", "quality", "by", "frequency", "magnitude", "phase", "real",
            "imag")  # fmt: skip


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


def given(**options: Any) -> dict[str, Any]:
    r"""Arguments of Python for the options that were given; the others keep their defaults.

    Examples
    --------
    >>> from ctrl_realize.cli.files import given
    >>> given(input=["2"], output=["a", "b"], start="10", time=None, delimiter="tab")
    {'input': 2, 'output': ['a', 'b'], 'start': 10.0, 'delimiter': '\t'}
    """
    found: dict[str, Any] = {}
    for name, value in options.items():
        if value is None or value is False or value in ("", []):
            continue
        if name == "no_header":
            found["header"] = False
        elif name == "quality" and value == "none":
            found["quality"] = None
        elif name in _COLUMNS:
            columns = [selector(one) for one in (value if isinstance(value, list) else [value])]
            found[name] = columns[0] if len(columns) == 1 else columns
        elif name in ("start", "stop"):
            found[name] = _second(value)
        elif name == "delimiter":
            found[name] = {"tab": "\t", r"\t": "\t"}.get(value, value)
        elif name == "comment" and value == "none":
            found[name] = None
        else:
            found[name] = value.value if isinstance(value, Enum) else value
    return found


def selector(text: str) -> str | int:
    """Convert a column to a number if it is one; ``=2`` is the column named "2"."""
    if text.startswith("="):
        return text[1:]
    # "²" is a digit but not a number
    return int(text) if text.isdecimal() and text.isascii() else text


def _second(text: str) -> float | str:
    """Time in s, or a date."""
    try:
        return float(text)
    except ValueError:
        return text
