"""Input files of the commands, and the options for reading them as arguments."""

from __future__ import annotations

import inspect
import shlex
from collections.abc import Callable, Sequence
from enum import Enum
from functools import wraps
from importlib import import_module
from pathlib import Path
from typing import Any, get_args, get_type_hints

from typer.models import ArgumentInfo

from ..errors import MissingFileError, OptionError
from .loading import loading
from .options import COLUMNS, GROUPS, Given, words_of

_NO_RESULT = ("folder", "jobs", "json")


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


def command(module: str, function: str) -> Callable[[Callable[..., None]], Callable[..., int]]:
    """Make a command of a signature: a function of a module runs it with the same arguments.

    Groups among the arguments become options; the function receives them as the arguments of
    Python that were given. Files must exist. In place of `overwrite` and `no_report` it receives
    the `run`.
    """

    def complete(declared: Callable[..., None]) -> Callable[..., int]:
        @wraps(declared)
        def run(**values: Any) -> int:
            for group in groups:
                values[group] = given(**{name: values.pop(name) for name in GROUPS[group]})
            folder, written = values.get("folder"), values.pop("written", {})
            named = [value for name, value in values.items() if name != "folder"]
            several = [value if isinstance(value, list) else [value] for value in named]
            paths = [path for each in several for path in each if isinstance(path, Path)]
            if values.get("json") is None:  # that says itself what it refuses
                check_files(paths)
            words = _words(values, hints)
            with loading():
                from .manifest import Run

                call = getattr(import_module(module, __package__), function)
            whole = [*words, *([] if folder is None else ["--output", str(folder)])]
            program = ["ctrl-realize", declared.__name__]
            command, typed = (shlex.join(program + one) for one in (words, whole))
            code: int = call(**values, run=Run(command, tuple(paths), typed, **written))
            return code

        hints = get_type_hints(declared, include_extras=True)
        signature = inspect.signature(declared)
        groups = [name for name in signature.parameters if name in GROUPS]
        parameters = _options(signature, hints)
        run.__signature__ = signature.replace(parameters=parameters)  # type: ignore[attr-defined]
        run.__annotations__ = {one.name: one.annotation for one in parameters}
        return run

    return complete


def _words(values: dict[str, Any], hints: dict[str, Any]) -> list[str]:
    """Words that were typed, without the folder and options that change no result."""
    words: list[str] = []
    options: dict[str, Any] = {}
    for name, value in values.items():
        if name in GROUPS:
            options |= value
        elif isinstance(get_args(hints[name])[1], ArgumentInfo):
            words += map(str, value if isinstance(value, list) else [value])
        elif name not in _NO_RESULT and value not in (None, False):
            options[name] = value
    return words + words_of(options)


def _options(signature: inspect.Signature, hints: dict[str, Any]) -> list[inspect.Parameter]:
    """Parameters of a signature, and those of its groups."""
    parameters = []
    for name, one in signature.parameters.items():
        if name not in GROUPS:
            parameters.append(one.replace(annotation=hints[name], kind=one.KEYWORD_ONLY))
        for option, kind in GROUPS.get(name, {}).items():
            default = False if get_args(kind)[0] is bool else None
            parameters.append(
                inspect.Parameter(option, one.KEYWORD_ONLY, default=default, annotation=kind)
            )
    return parameters


def given(**options: Any) -> Given:
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
        if name.startswith("no_"):
            found[name.removeprefix("no_")] = False
        elif value == "none" and name in ("quality", "comment", "hold"):
            found[name] = None
        elif name in COLUMNS:
            columns = [selector(one) for one in (value if isinstance(value, list) else [value])]
            found[name] = columns[0] if len(columns) == 1 else columns
        elif name in ("start", "stop"):
            found[name] = _second(value)
        elif name == "delimiter":
            found[name] = {"tab": "\t", r"\t": "\t"}.get(value, value)
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
