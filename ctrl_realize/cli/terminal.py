"""Output to the terminal: tables on stdout, everything else on stderr."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from typing import Any

import typer

from .options import as_options

EXIT_CODES = (
    "Exit codes: 0 done; 1 done, but some records or the report failed; 2 wrong usage, unusable "
    "input or a disk error, no results written; 3 a defect of the program; 4 done, but a verdict "
    "that was required is not good; 130 interrupted; 143 terminated."
)


def say(text: str = "") -> None:
    """Write to stdout; a closed pipe (``| head``) is not an error."""
    _write(text, to_stderr=False)


def complain(text: str) -> None:
    """Write one line to stderr."""
    _write(f"ctrl-realize: {text}", to_stderr=True)


def _write(text: str, *, to_stderr: bool) -> None:
    # most texts contain names of records and files, which must not control the terminal
    lines = "\n".join(printable(line) for line in text.split("\n"))
    try:
        # progress bars are taken away while a text is written, and drawn again below it
        bars = sys.modules.get("tqdm")
        with nullcontext() if bars is None else bars.tqdm.external_write_mode(file=sys.stderr):
            typer.echo(lines, err=to_stderr)
    except BrokenPipeError:
        # the buffer, and everything that follows, is discarded
        stream = sys.stderr if to_stderr else sys.stdout
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)


def one_line(problem: object) -> str:
    """Convert the message of an error to one line; of our own errors, in terms of options."""
    if isinstance(problem, OSError) and problem.strerror and not _is_ours(problem):
        text = f"{problem.filename}: {problem.strerror}" if problem.filename else problem.strerror
    else:
        text = str(problem)
    text = " ".join(text.split())
    return as_options(text) if _is_ours(problem) else text


def _is_ours(problem: object) -> bool:
    return type(problem).__module__.startswith("ctrl_realize")


def plain_warning(message: Warning | str, *_: Any, **__: Any) -> None:
    """Show a warning as one line on stderr; replaces `warnings.showwarning`."""
    complain(f"warning: {one_line(message)}")


def progress(items: Iterable[Any], total: int, label: str) -> Iterable[Any]:
    """Show a progress bar on stderr for an iteration, if it is a terminal."""
    from tqdm import tqdm

    bar: Iterable[Any] = tqdm(items, total=total, desc=label, disable=None, file=sys.stderr)
    return bar


@contextmanager
def working(label: str) -> Iterator[None]:
    """Show on stderr, if it is a terminal, what takes a while; the line vanishes at the end."""
    from tqdm import tqdm

    with tqdm(desc=label, bar_format="{desc} ...", leave=False, disable=None, file=sys.stderr):
        yield


def table(columns: Sequence[str], rows: Sequence[Sequence[str]], numbers: Sequence[int]) -> str:
    """Format a table; the columns in `numbers` are right-aligned.

    Examples
    --------
    >>> from ctrl_realize.cli.terminal import table
    >>> print(table(["record", "delay"], [["a", "37"], ["bc", "4"]], numbers=[1]))
    record  delay
    ------  -----
    a          37
    bc          4
    """
    lines = [list(columns), *map(list, rows)]
    for k in range(len(columns)):
        width = max(len(line[k]) for line in lines)
        for line in lines:
            line[k] = line[k].rjust(width) if k in numbers else line[k].ljust(width)
    lines.insert(1, ["-" * len(cell) for cell in lines[0]])
    return "\n".join("  ".join(line).rstrip() for line in lines)


def printable(text: str) -> str:
    """Remove control characters from names of files and records."""
    return "".join(letter if letter.isprintable() else "?" for letter in text)
