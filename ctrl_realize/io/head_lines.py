"""The first lines of a text table, counted with regard to quotes."""

from __future__ import annotations

import codecs
import re
from dataclasses import dataclass
from pathlib import Path

from ..errors import FileFormatError
from .cells import DELIMITERS, kind_of
from .units import is_units_line

HEAD_BYTES = 1 << 18
MAX_HEAD_LINES = 1000
_MOST_JOINED = 10
"""Largest number of lines of a quoted cell; a quote that is not closed by then is a stray one."""

_END = r"(?:\r\n|\n|\r)"
_BETWEEN = "".join(DELIMITERS).strip(" ")
_INSIDE = r'(?:[^"\r\n]++|"")*+'
_QUOTED = rf'(?<![^{_BETWEEN}\r\n]) *"{_INSIDE}(?:{_END}{_INSIDE}){{0,{_MOST_JOINED - 1}}}+"'
_QUOTING = re.compile(rf"((?:{_QUOTED}|[{_BETWEEN}]|[^{_BETWEEN}\r\n]++)*+)({_END}|$)")
_LINE = re.compile(rf"([^\r\n]*)({_END}|$)")


@dataclass(frozen=True)
class Line:
    """A line and its position: ``number`` counts line ends before it, ``start`` characters."""

    text: str
    number: int
    start: int


def holds_cells(line: str, comment: str | None) -> bool:
    """Whether a line is neither blank nor a comment.

    A line that begins with the cell ``#N/A`` of Excel is none, nor one of units that begins with %.
    """
    text = line.strip()
    if not text or not comment or not text.startswith(comment):
        return bool(text)
    first, between, _ = re.split(rf"([{_BETWEEN}])", f"{text}\t", maxsplit=1)
    units = first == "%" and is_units_line(text.split(between))
    return kind_of(first.strip(), ".") == "missing" or units


def head_lines(path: Path, head: bytes, encoding: str, skip: int) -> list[Line]:
    """Complete lines at the start of a file; a quoted cell with line ends is in one line.

    Quotes in the first `skip` lines are ignored.
    """
    try:
        text = codecs.getincrementaldecoder(encoding)("replace").decode(head)
    except (UnicodeError, ValueError) as error:
        raise FileFormatError(f"{path} is not text in {encoding}: {error}") from error
    lines, number, start = [], 0, 0
    while start < len(text):
        found = (_LINE if number < skip else _QUOTING).match(text, start)
        assert found is not None  # a line may have no end
        lines.append(Line(found[1], number, start))
        number, start = number + len(re.findall(_END, found[0])), found.end()
    if len(head) == HEAD_BYTES:
        if lines and not text.endswith(("\n", "\r")):
            lines.pop()  # incomplete
        if not lines:
            raise FileFormatError(
                f"the first line of {path} is longer than {HEAD_BYTES} bytes; expected a "
                "table with one row per sample"
            )
    return lines[:MAX_HEAD_LINES]
