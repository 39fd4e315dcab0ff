"""Lines of a text table split into cells, and the kinds of cells."""

from __future__ import annotations

import csv
import math
import re
from pathlib import Path
from typing import Literal

from .._facts import facts
from ..errors import FileFormatError
from .units import stands_alone

DELIMITERS = ("\t", ";", "|", ",", " ")
_GROUPS = {"": "", ",": ",", ".": r"\.", "'": "['’]", " ": "[ \xa0\u202f]"}
"""Thousands separators, as patterns."""


_SIGN = "[+\u2212-]?"  # the minus of a typesetter, too


def _number(decimal: str, group: str) -> re.Pattern[str]:
    """Pattern of a number; each text matches in one way only, or time grows with its length."""
    whole = rf"(?:\d{{1,3}}(?:{group}\d{{3}})+|\d+)" if group else r"\d+"
    ends = r"\.\d*" if decimal == "." else r",\d+"
    return re.compile(rf"{_SIGN}({whole}({ends})?|[{decimal}]\d+)([eE]{_SIGN}\d+)?")


NUMBER = {
    decimal + mark: _number(decimal, group)
    for mark, group in _GROUPS.items()
    for decimal in ".,"
    if mark != decimal
}
"""Patterns of numbers by notation: decimal sign, then the separator of thousands if any."""
_CLOCK = r"\d{1,3}:\d{2}(:\d{2})?([.,]\d+)?( ?[AaPp]\.?[Mm]\.?)?( ?(Z|UTC|[+-]\d{2}:?\d{2}))?"
_MONTH = r"[^\W\d_]{3,9}\.?"
_DATE = rf"(\d{{1,4}}[-/.]\d{{1,2}}[-/.]\d{{1,4}}\.?|\d{{1,2}}[-/. ]{_MONTH}[-/. ]\d{{2,4}})"
_TIME = re.compile(rf"{_CLOCK}|{_DATE}([ T]+{_CLOCK})?")
_MEASURED = re.compile(
    rf"({_SIGN}[\d.,]+(?:[eE]{_SIGN}\d+)?)[ \xa0]?([^\W\d]\S{{0,7}}|[%°]\S{{0,3}})"
)
_THOUSANDS = re.compile(rf"{_SIGN}[1-9]\d{{0,2}}[.,]\d{{3}}")
_WORDS = facts("io/words.toml")
MISSING = frozenset(_WORDS["cells"]["missing"])
BAD_VALUES = frozenset(_WORDS["cells"]["bad"])
_NO_VALUES = MISSING.union(BAD_VALUES, _WORDS["cells"]["infinite"])
STATES = {word: number for number, words in _WORDS["states"].items() for word in words}
"""Positions of a switch, as numbers."""

ENDS = "\0\x1a"
"""What stands behind the last cell of a file: zeros of an interrupted writer, the mark of DOS."""

FILLED = ("number", "time")
"""Kinds of cells that hold data, see `kind_of`."""


def split_line(line: str, delimiter: str) -> list[str]:
    """Cells of a line; a quoted cell may contain the delimiter; runs of blanks are one."""
    if '"' not in line:
        cells = line.split() if delimiter == " " else line.split(delimiter)
        return [cell.strip() for cell in cells]
    around = None if delimiter == " " else " \t\r\n".replace(delimiter, "")  # a tab may be a cell
    try:
        (cells,) = csv.reader([line.strip(around)], delimiter=delimiter, skipinitialspace=True)
    except (csv.Error, ValueError):
        # a stray quote or a cell longer than csv's limit: not a line of numbers
        return line.split(delimiter)
    return [cell.strip() for cell in cells]


def refuse_thousands(path: Path, rows: list[list[str]], delimiter: str, mark: str) -> None:
    """Refuse a file whose decimal marks may be thousands separators as well.

    ``1,234`` is 1.234 if each cell of its column has the same number of decimals, and 1234 for
    ``"1,234"`` between commas, or together with ``999`` in its column: this is ambiguous. One cell
    like ``0,123``, ``12,5`` or ``1234,567`` anywhere shows that they are decimals. A point is the
    decimal mark of most files: only whole numbers from 100 to 999 beside it leave a doubt.
    """
    cells = {cell for row in rows for cell in row if mark in cell and NUMBER[mark].fullmatch(cell)}
    if not cells or not all(map(_THOUSANDS.fullmatch, cells)):
        return
    least = 1 if mark == "," else 3
    mixed = False
    for column in zip(*(row for row in rows if len(row) == len(rows[0])), strict=True):
        whole = {one for one in column if one.isdecimal()}
        mixed |= bool(cells.intersection(column) and whole) and all(
            least <= len(one) <= 3 for one in whole
        )
    if delimiter == mark or mixed:
        one, other, word = min(cells), ",."[mark == ","], "comma" if mark == "," else "point"
        raise FileFormatError(
            f"{path}: {one!r} may be {one.replace(',', '.')} or {one.replace(mark, '')}; give "
            f"decimal={mark!r} if the {word} is the decimal mark, "
            + (f"decimal={other!r} and " if mark == "." else "")
            + f"thousands={mark!r} if it separates thousands"
        )


def measured(cell: str) -> tuple[str, str]:
    """Number and unit of a cell such as ``12.5 %`` or ``61.0 °C``; other cells have no unit."""
    found = _MEASURED.fullmatch(cell)
    return (found[1], found[2]) if found and stands_alone(found[2]) else (cell, "")


def number_of(text: str, notation: str) -> float:
    """Value of a text in a notation; NaN if it is no number."""
    if not NUMBER[notation].fullmatch(text):
        return math.nan
    plain = "".join(text.split()).replace("’", "'").replace(notation[1:] or " ", "")
    return float(plain.replace(",", ".").replace("\u2212", "-"))


def complex_of(text: str, notation: str) -> complex:
    """Value of a text such as ``0.5-0.3i``, ``(0.5 - 0.3j)`` or ``0.5-j0.3``; NaN if it is none."""
    plain = "".join(text.strip("()").split()).lower().replace(notation[0], ".").replace("i", "j")
    try:
        return complex(re.sub(r"j\*?([\d.].*)|\*j", r"\1j", plain))
    except ValueError:
        return math.nan


def kind_of(cell: str, notation: str) -> Literal["number", "time", "missing", "text"]:
    """Return the kind of a cell."""
    if NUMBER[notation].fullmatch(measured(cell)[0]):
        return "number"
    if cell.lower() in _NO_VALUES:
        return "missing"
    return "time" if _TIME.fullmatch(cell) else "text"
