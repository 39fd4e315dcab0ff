"""Lines of a text table split into cells, and the kinds of cells."""

from __future__ import annotations

import csv
import re
from pathlib import Path
from typing import Literal

from .._facts import facts
from ..errors import FileFormatError

DELIMITERS = ("\t", ";", "|", ",", " ")
NUMBER = {
    # Each text matches in one way only: with two ways, time grows with the square of its length.
    ".": re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?"),
    ",": re.compile(r"[+-]?(\d+(,\d+)?|,\d+)([eE][+-]?\d+)?"),
}
_CLOCK = r"\d{1,3}:\d{2}(:\d{2})?([.,]\d+)?( ?[AaPp]\.?[Mm]\.?)?( ?(Z|UTC|[+-]\d{2}:?\d{2}))?"
_MONTH = r"[^\W\d_]{3,9}\.?"
_DATE = rf"(\d{{1,4}}[-/.]\d{{1,2}}[-/.]\d{{1,4}}\.?|\d{{1,2}}[-/. ]{_MONTH}[-/. ]\d{{2,4}})"
_TIME = re.compile(rf"{_CLOCK}|{_DATE}([ T]+{_CLOCK})?")
_PERCENT = re.compile(r"(?P<number>[+-]?[\d.,]+([eE][+-]?\d+)?) ?%")
_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2},\d{3}")
_WORDS = facts("io/words.toml")
MISSING = frozenset(_WORDS["cells"]["missing"])
BAD_VALUES = frozenset(_WORDS["cells"]["bad"])
_NO_VALUES = MISSING.union(BAD_VALUES, _WORDS["cells"]["infinite"])
STATES = {word: number for number, words in _WORDS["states"].items() for word in words}
"""Positions of a switch, as numbers."""

FILLED = ("number", "time")
"""Kinds of cells that hold data, see `kind_of`."""


def split_line(line: str, delimiter: str) -> list[str]:
    """Cells of a line; a quoted cell may contain the delimiter; runs of blanks are one."""
    if delimiter == " ":
        return line.split()
    if '"' not in line:
        return [cell.strip() for cell in line.split(delimiter)]
    try:
        (cells,) = csv.reader([line], delimiter=delimiter, skipinitialspace=True)
    except (csv.Error, ValueError):
        # a stray quote or a cell longer than csv's limit: not a line of numbers
        return line.split(delimiter)
    return [cell.strip() for cell in cells]


def refuse_thousands(path: Path, rows: list[list[str]], delimiter: str) -> None:
    """Refuse a file whose commas may be thousands separators as well as decimal signs.

    ``1,234`` is 1.234 if each cell of its column has the same number of decimals, and 1234 for
    ``"1,234"`` between commas, or together with ``999`` in its column: this is ambiguous. One cell
    like ``0,123``, ``12,5`` or ``1234,567`` anywhere shows that they are decimals.
    """
    numbers = [[cell for cell in row if NUMBER[","].fullmatch(cell)] for row in rows]
    commas = [cell for row in numbers for cell in row if "," in cell]
    if not commas or not all(_THOUSANDS.fullmatch(cell) for cell in commas):
        return
    columns = zip(*(row for row in rows if len(row) == len(rows[0])), strict=True)
    mixed = any(
        any("," in cell for cell in column)
        and any(cell.isdecimal() and len(cell) <= 3 for cell in column)
        for column in columns
    )
    if delimiter == "," or mixed:
        raise FileFormatError(
            f"{path}: {commas[0]!r} may be {commas[0].replace(',', '.')} or "
            f"{commas[0].replace(',', '')}; give decimal=',' if the comma is the decimal "
            "mark; otherwise write the numbers without thousands separators"
        )


def without_percent(cell: str) -> str:
    """Return the number of a cell such as ``12.5 %``; other cells as they are."""
    found = _PERCENT.fullmatch(cell)
    return found["number"] if found else cell


def kind_of(cell: str, decimal: str) -> Literal["number", "time", "missing", "text"]:
    """Return the kind of a cell."""
    if NUMBER[decimal].fullmatch(without_percent(cell)):
        return "number"
    if cell.lower() in _NO_VALUES:
        return "missing"
    return "time" if _TIME.fullmatch(cell) else "text"
