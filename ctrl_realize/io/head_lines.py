"""The first lines of a text table, counted with regard to quotes."""

from __future__ import annotations

import codecs
import re
from dataclasses import dataclass
from pathlib import Path

from ..errors import FileFormatError
from .cells import DELIMITERS

HEAD_BYTES = 1 << 18
MAX_HEAD_LINES = 1000
_MOST_JOINED = 10
"""Largest number of lines of a quoted cell; a quote that is not closed by then is a stray one."""

_LINE = re.compile(r"([^\r\n]*)(\r\n|\n|\r|$)")
_START = rf"(^|[{''.join(DELIMITERS).strip(' ')}\r\n]) *"
_QUOTED = re.compile(rf'{_START}"(?:[^"]|"")*"(?!")')
_OPEN = re.compile(rf'{_START}"')


@dataclass(frozen=True)
class Line:
    """A line and its position: ``number`` counts line ends before it, ``start`` characters."""

    text: str
    number: int
    start: int


def head_lines(path: Path, head: bytes, encoding: str, skip: int) -> list[Line]:
    """Complete lines at the start of a file; a quoted cell with line ends is in one line.

    Quotes in the first `skip` lines are ignored.
    """
    try:
        text = codecs.getincrementaldecoder(encoding)("replace").decode(head)
    except (UnicodeError, ValueError) as error:
        raise FileFormatError(f"{path} is not text in {encoding}: {error}") from error
    found = list(_LINE.finditer(text))
    # the last match is empty, after the last line end, or a line without one
    lines = [Line(one[1], number, one.start()) for number, one in enumerate(found[:-1])]
    if len(head) == HEAD_BYTES:
        if lines and found[len(lines) - 1][2] == "":
            lines.pop()  # incomplete
        if not lines:
            raise FileFormatError(
                f"the first line of {path} is longer than {HEAD_BYTES} bytes; expected a "
                "table with one row per sample"
            )
    return _joined(lines[:MAX_HEAD_LINES], skip, text)


def _joined(lines: list[Line], skip: int, text: str) -> list[Line]:
    """Join lines that are one cell."""
    if not any('"' in line.text for line in lines[skip:]):
        return lines
    out = lines[:skip]
    at = skip
    while at < len(lines):
        last = at
        if _stays_open(lines[at].text):
            for stop in range(at + 1, min(at + _MOST_JOINED, len(lines))):
                whole = text[lines[at].start : lines[stop].start + len(lines[stop].text)]
                if not _stays_open(whole):
                    last = stop
                    break
        end = lines[last].start + len(lines[last].text)
        out.append(Line(text[lines[at].start : end], lines[at].number, lines[at].start))
        at = last + 1
    return out


def _stays_open(line: str) -> bool:
    """Whether a quoted cell is not closed within a line; a quote inside a cell is doubled."""
    return bool(_OPEN.search(_QUOTED.sub(r"\1", line)))
