"""Lines of a text table split into cells, and the kinds of cells."""

from __future__ import annotations

import csv
import re
from pathlib import Path
from typing import Literal

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
MISSING = frozenset({"", "nan", "-nan", "na", "n/a", "#n/a", "null", "none", "-", "--", "?"})
_NOT_NAMES = MISSING | {"inf", "+inf", "-inf", "infinity", "-infinity"}
BAD_VALUES = frozenset(
    {"bad", "bad data", "bad input", "bad quality", "bad value", "i/o timeout", "i/o-timeout",
     "io timeout", "no data", "no sample", "no result", "not available", "not connect",
     "not connected", "comm fail", "comm error", "calc failed", "pt created", "configure",
     "intf shut", "interface shut", "shutdown", "scan off", "scan timeout", "over range",
     "under range", "out of serv", "out of service", "arc off-line", "failed", "error", "invalid",
     "timeout", "fault", "ungültig", "#value!", "#ref!", "#div/0!", "#num!", "#name?", "#null!",
     "#n/a n/a", "[-11059] no good data for calculation"}
)  # fmt: skip
"""States that historians (the system digital states of AVEVA PI, OPC qualities) and spreadsheets
write in place of a value."""

STATES = {
    "on": "1", "true": "1", "open": "1", "yes": "1", "ein": "1", "an": "1", "auf": "1",
    "wahr": "1", "ja": "1", "running": "1", "opened": "1",
    "off": "0", "false": "0", "closed": "0", "no": "0", "aus": "0", "zu": "0", "falsch": "0",
    "nein": "0", "stopped": "0", "close": "0",
}  # fmt: skip
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
    if cell.lower() in _NOT_NAMES or cell.lower() in BAD_VALUES:
        return "missing"
    return "time" if _TIME.fullmatch(cell) else "text"
