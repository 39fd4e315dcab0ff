"""Lines of a text table, cut into cells, and what a cell looks like."""

from __future__ import annotations

import csv
import re
from typing import Literal

DELIMITERS = ("\t", ";", "|", ",", " ")
NUMBER = {
    # one way only to match any text: two ways make the time grow with the square of its length
    ".": re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?"),
    ",": re.compile(r"[+-]?(\d+(,\d+)?|,\d+)([eE][+-]?\d+)?"),
}
_TIME = re.compile(r"\d{1,4}[-/.:]\d{1,2}[-/.:]\d{1,4}([ T].*|[.,]\d+)?|\d{1,2}:\d{2}([.,]\d+)?")
MISSING = frozenset({"", "nan", "-nan", "na", "n/a", "#n/a", "null", "none", "-", "--", "?"})
_NOT_NAMES = MISSING | {"inf", "+inf", "-inf", "infinity", "-infinity"}
FILLED = ("number", "time")
"""Kinds of cells that hold data, see `kind_of`."""


def split_line(line: str, delimiter: str) -> list[str]:
    """Cells of a line; a quoted cell may hold the delimiter, runs of blanks are one delimiter."""
    if delimiter == " ":
        return line.split()
    if '"' not in line:
        return [cell.strip() for cell in line.split(delimiter)]
    try:
        (cells,) = csv.reader([line], delimiter=delimiter, skipinitialspace=True)
    except (csv.Error, ValueError):
        # a stray quote or a cell longer than csv's limit: not a line of numbers anyway
        return line.split(delimiter)
    return [cell.strip() for cell in cells]


def kind_of(cell: str, decimal: str) -> Literal["number", "time", "missing", "text"]:
    """Tell what a cell looks like."""
    if NUMBER[decimal].fullmatch(cell):
        return "number"
    if cell.lower() in _NOT_NAMES:
        return "missing"
    return "time" if _TIME.fullmatch(cell) else "text"
