"""Start of the data in a text table, and the header above them."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from itertools import pairwise, zip_longest
from pathlib import Path

from ...errors import FileFormatError
from ..cells import DELIMITERS, FILLED, NUMBER, kind_of, number_of, split_line
from ..checks import MAX_NAME
from ..units import bare_unit, is_units_line, sample_time_unit, unit_of


@dataclass(frozen=True, eq=False)
class Head:
    """The first lines, split into cells: ``cells[k]`` are those of physical line ``rows[k]``."""

    path: Path
    lines: list[str]
    rows: list[int]
    cells: list[list[str]]
    delimiter: str
    decimal: str
    comment: str | None
    width: int

    def kinds(self, row: int) -> list[str]:
        """Return the kinds of the cells of a line."""
        return [kind_of(cell, self.decimal) for cell in self.cells[row]]

    def sample_times(self, first: int) -> dict[str, float]:
        """Sample times with a unit in the lines above the data, such as ``SampleTime[ms];1``.

        NaN if there are different ones.
        """
        found: dict[str, float] = {}
        rows = [*self.cells[:first], *zip_longest(*self.cells[:first], fillvalue="")]
        for name, value in (pair for cells in rows for pair in pairwise(cells)):
            if sample_time_unit(name) and NUMBER[self.decimal].fullmatch(value):
                number = number_of(value, self.decimal)
                found[name] = number if found.get(name, number) == number else math.nan
        return found

    def block(self) -> range:
        """Lines of a key and a cell for each column, as above the data of TwinCAT Scope.

        One of them is a sample time; the keys stand above the columns of time.
        """
        rows = range(len(self.cells))
        keyed = [
            len(cells) == self.width > 1 and kind_of(cells[0], self.decimal) == "text"
            for cells in self.cells
        ]
        keys = [cells[0] if good else "" for cells, good in zip(self.cells, keyed, strict=True)]
        stated = [k for k in rows if keys[k].endswith("]") and sample_time_unit(keys[k])]
        middle = next((k for k in stated if self.kinds(k)[1] == "number"), None)
        if middle is None:
            return range(0)
        start = next((k + 1 for k in range(middle, -1, -1) if not keyed[k]), 0)
        return range(start, next((k for k in rows[middle:] if not keyed[k]), len(rows) - 1))


def first_data_row(head: Head, header: bool | str) -> int:
    """Position in ``head.rows`` of the first line of data."""
    last = len(head.rows) - 1
    if block := head.block():
        return block.stop
    # for each line the kinds of its cells; none if it does not match the columns
    lines = [
        head.kinds(row) if len(cells) == head.width else [] for row, cells in enumerate(head.cells)
    ]
    lower = [line for line in lines[len(lines) // 2 :] if line]
    numeric = [
        column
        for column in range(head.width)
        if 2 * sum(line[column] in FILLED for line in lower) >= len(lower)
    ]
    # fraction of the numeric columns in which a line has a number
    share = [
        sum(line[column] in FILLED for column in numeric) / max(len(numeric), 1) if line else 0.0
        for line in lines
    ]
    if header is True:
        has_units = last > 1 and share[1] == 0 and is_units_line(head.cells[1])
        return min(2 if has_units else 1, last)
    first = next((row for row, part in enumerate(share) if part == 1), last)
    # a line above with some numbers is a bad line of data, to be reported, not a header
    while first > 0 and share[first - 1] > 0:
        first -= 1
    return first


def column_names(head: Head, first: int) -> tuple[list[str], list[str]]:
    """Names and units of the columns, from the lines above the first one of data."""
    if block := head.block():
        lines = {head.cells[row][0].lower(): head.cells[row] for row in reversed(block)}
        times = next(cells for key, cells in lines.items() if sample_time_unit(key))
        unit = sample_time_unit(times[0])
        called = [
            f"time [{unit}]" if key == times[0] else name
            for name, key in zip(lines.get("name", times), times, strict=True)
        ]
        return called, [unit_of(name[:MAX_NAME]) for name in called]
    texts = [_header_cells(head, row, first) for row in range(first)]
    names = texts[-1] if texts else None
    if names is not None:
        above = texts[-2] if len(texts) > 1 else None
        words = [cell for cell in names if kind_of(cell, head.decimal) != "number"]
        if above is not None and is_units_line(words):
            return above, [bare_unit(cell) for cell in names]
    elif texts and len(head.cells[first - 1]) > 1:
        raise FileFormatError(
            f"line {head.rows[first - 1] + 1} of {head.path} has {len(head.cells[first - 1])} "
            f"cells, the lines below have {head.width}; give delimiter=, decimal=, "
            "skip_rows=, or header=False and column numbers"
        )
    else:
        names = _names_in_comments(head, head.rows[first])
    return names, [unit_of(name[:MAX_NAME]) for name in names]


def _header_cells(head: Head, row: int, first: int) -> list[str] | None:
    """Cells of a line above the data, or None if they do not match the columns."""
    cells, line = head.cells[row], head.lines[head.rows[row]].strip()
    blanks = head.delimiter == " "
    if blanks and len(cells) != head.width:  # a unit in brackets belongs to the name before it
        cells = re.split(r"\s++(?![(\[])", line)
    if len(cells) == head.width:
        return cells
    if len(cells) == head.width - 1 > 1 and not any(
        line[-1] for line in head.cells[first:] if len(line) == head.width
    ):
        # the lines of data end with a delimiter, the header does not
        return [*cells, ""]
    if len(cells) == head.width + 1 and not blanks and (first == row + 1 or not cells[-1]):
        return cells[:-1]  # a column of remarks, of which there are none
    # names that contain blanks, above columns that are separated by blanks
    apart = re.split(r"\t+|\s{2,}", line)
    return apart if len(apart) == head.width else None


def _names_in_comments(head: Head, first_line: int) -> list[str]:
    """Return the last comment line above the data that has a name for each column."""
    comments = [
        line.strip().strip(head.comment).strip()
        for line in head.lines[:first_line]
        if head.comment and line.lstrip().startswith(head.comment)
    ]
    for line in reversed(comments):
        for delimiter in (head.delimiter, *DELIMITERS):
            cells = split_line(line, delimiter)
            if len(cells) == head.width and not any(
                kind_of(cell, ".") == "number" for cell in cells
            ):
                return cells
    return [""] * head.width
