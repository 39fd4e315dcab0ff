"""Find out how a text table is written, from its first lines.

The rules, in the order in which they are applied; every one can be overruled by the caller:

1. The encoding is told by the byte order mark, by zero bytes in every other place (UTF-16), or
   by the text being valid UTF-8; otherwise it is Latin-1.
2. The delimiter and the decimal sign are the pair for which the largest part of the cells in
   the lower half of the first lines are numbers or times.
3. The data begin with the line from which on all columns that hold numbers do so.
4. The header is the line above, if it has as many cells and no numbers in them; a line of units
   may lie between. Without one, the last comment line above the data is tried (NumPy's
   ``savetxt`` writes its header so).
"""

from __future__ import annotations

import codecs
import csv
import re
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from ..checks import whole
from ..errors import FileFormatError, OptionError
from .checks import read_head
from .units import is_units_line, plain_unit, split_unit

HEAD_BYTES = 1 << 18
MAX_HEAD_LINES = 1000
MAX_COLUMNS = 10_000
MAX_NAME = 200
_SAMPLE_LINES = 60

DELIMITERS = ("\t", ";", "|", ",", " ")
NUMBER = {
    # one way only to match any text: two ways make the time grow with the square of its length
    ".": re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?"),
    ",": re.compile(r"[+-]?(\d+(,\d+)?|,\d+)([eE][+-]?\d+)?"),
}
_IN_NUMBERS = {"delimiter": frozenset("0123456789eE"), "comment": frozenset("0123456789eE.,+-")}
_TIME = re.compile(r"\d{1,4}[-/.:]\d{1,2}[-/.:]\d{1,4}([ T].*|[.,]\d+)?|\d{1,2}:\d{2}([.,]\d+)?")
MISSING = frozenset({"", "nan", "-nan", "na", "n/a", "#n/a", "null", "none", "-", "--", "?"})
_NOT_NAMES = MISSING | {"inf", "+inf", "-inf", "infinity", "-infinity"}
_BOMS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    # before that of UTF-16, with which it begins
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)


@dataclass(frozen=True)
class TextOptions:
    """What the caller says about a text table; ``"auto"`` is found out."""

    delimiter: str = "auto"
    decimal: str = "auto"
    encoding: str = "auto"
    comment: str | None = "auto"
    header: bool | str = "auto"
    skip_rows: int = 0

    def __post_init__(self) -> None:
        for name in ("delimiter", "decimal", "encoding"):
            if not isinstance(getattr(self, name), str):
                raise OptionError(f"{name}={getattr(self, name)!r} must be text, such as 'auto'")
        if self.delimiter != "auto" and (len(self.delimiter) != 1 or self.delimiter in "\r\n\"'"):
            raise OptionError(f"delimiter={self.delimiter!r} must be one character or 'auto'")
        if self.decimal not in ("auto", ".", ","):
            raise OptionError(f"decimal={self.decimal!r} must be '.', ',' or 'auto'")
        if self.comment not in ("auto", None) and not (
            isinstance(self.comment, str) and len(self.comment) == 1
        ):
            raise OptionError(f"comment={self.comment!r} must be one character, None or 'auto'")
        for name in ("delimiter", "comment"):
            if str(getattr(self, name)) in _IN_NUMBERS[name]:
                raise OptionError(f"{name}={getattr(self, name)!r} would cut numbers in two")
        if self.header not in (True, False, "auto"):
            raise OptionError(f"header={self.header!r} must be True, False or 'auto'")
        whole(self.skip_rows, "skip_rows", 0)
        if self.encoding != "auto":
            try:
                # also refuses the codecs of Python that are no encodings of text: zlib, rot13
                b"1".decode(self.encoding)
            except UnicodeError:
                pass
            except (LookupError, ValueError, TypeError) as error:
                raise OptionError(f"encoding={self.encoding!r} is not known") from error


@dataclass(frozen=True)
class TextLayout:
    """How a text table is written.

    ``names`` and ``units`` have ``n_columns`` entries; the names are empty without a header.
    The data begin with physical line ``first_line`` (0-based).
    """

    encoding: str
    delimiter: str
    decimal: str
    comment: str | None
    first_line: int
    n_columns: int
    names: tuple[str, ...]
    units: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class _Head:
    """The first lines, cut into cells: ``cells[k]`` are those of physical line ``rows[k]``."""

    path: Path
    lines: list[str]
    rows: list[int]
    cells: list[list[str]]
    delimiter: str
    decimal: str
    comment: str | None
    width: int

    def kinds(self, row: int) -> list[str]:
        return [_kind(cell, self.decimal) for cell in self.cells[row]]


def sniff(path: Path, options: TextOptions) -> TextLayout:
    """Find out how the text table in `path` is written.

    Raises
    ------
    FileFormatError
        If it is not text, or no columns of numbers are found in its first lines.
    """
    head_bytes = read_head(path, HEAD_BYTES)
    encoding = _encoding(path, head_bytes) if options.encoding == "auto" else options.encoding
    lines = head_lines(path, head_bytes, encoding)
    comment = _comment(lines) if options.comment == "auto" else options.comment
    rows = [
        index
        for index in range(min(options.skip_rows, len(lines)), len(lines))
        if lines[index].strip() and not (comment and lines[index].lstrip().startswith(comment))
    ]
    if not rows:
        raise FileFormatError(f"{path} has no lines of data in its first {len(head_bytes)} bytes")
    lower = [lines[index] for index in rows[len(rows) // 2 :]]
    delimiter, decimal = _delimiter_and_decimal(path, lower[:_SAMPLE_LINES], options)
    cells = [split_line(lines[index], delimiter) for index in rows]
    width = Counter(map(len, cells[len(rows) // 2 :])).most_common(1)[0][0]
    if width > MAX_COLUMNS:
        raise FileFormatError(f"{path} has {width} columns, at most {MAX_COLUMNS} are read")
    head = _Head(path, lines, rows, cells, delimiter, decimal, comment, width)
    first = _first_data_row(head, options.header)
    names, units = ([""] * width,) * 2 if options.header is False else _names(head, first)
    names = [name[:MAX_NAME] for name in names]
    return TextLayout(
        encoding, delimiter, decimal, comment, rows[first], width, tuple(names), tuple(units)
    )


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


def head_lines(path: Path, head: bytes, encoding: str) -> list[str]:
    """Complete lines of the first bytes of a file."""
    try:
        text = codecs.getincrementaldecoder(encoding)("replace").decode(head)
    except (UnicodeError, ValueError) as error:
        raise FileFormatError(f"{path} is not text in {encoding}: {error}") from error
    lines = re.split(r"\r\n|\n|\r", text)
    if len(head) == HEAD_BYTES:
        lines.pop()
        if not lines:
            raise FileFormatError(
                f"the first line of {path} is longer than {HEAD_BYTES} bytes; "
                "a table with one row per sample is needed"
            )
    return lines[:MAX_HEAD_LINES]


def _encoding(path: Path, head: bytes) -> str:
    for mark, encoding in _BOMS:
        if head.startswith(mark):
            return encoding
    if b"\0" in head:
        # numbers in UTF-16 have a zero in every second byte, and nowhere else
        for first, encoding in ((1, "utf-16-le"), (0, "utf-16-be")):
            if head[first::2].count(0) > 0.9 * (len(head) // 2) and 0 not in head[1 - first :: 2]:
                return encoding
        head_text = head.rstrip(b"\0")
        if b"\0" in head_text or not head_text:
            raise FileFormatError(
                f"{path} is binary; text (CSV, TSV), .npz, .mat and Parquet can be read"
            )
    try:
        codecs.getincrementaldecoder("utf-8")().decode(head)
    except UnicodeDecodeError:
        return "latin-1"
    return "utf-8"


def _comment(lines: list[str]) -> str | None:
    starts = Counter(line.lstrip()[0] for line in lines if line.strip())
    return max("#%", key=lambda sign: starts[sign]) if starts["#"] + starts["%"] else None


def _kind(cell: str, decimal: str) -> str:
    if NUMBER[decimal].fullmatch(cell):
        return "number"
    if cell.lower() in _NOT_NAMES:
        return "missing"
    return "time" if _TIME.fullmatch(cell) else "text"


def _delimiter_and_decimal(path: Path, sample: list[str], options: TextOptions) -> tuple[str, str]:
    delimiters = DELIMITERS if options.delimiter == "auto" else (options.delimiter,)
    decimals = (".", ",") if options.decimal == "auto" else (options.decimal,)
    best, best_score = ("", ""), (0.0, False)
    for delimiter in delimiters:
        rows = [split_line(line, delimiter) for line in sample]
        width = Counter(map(len, rows)).most_common(1)[0][0]
        for decimal in decimals:
            kinds = [_kind(cell, decimal) for row in rows if len(row) == width for cell in row]
            good = sum(kind in ("number", "time") for kind in kinds)
            filled = sum(map(len, rows)) - kinds.count("missing")
            # one column of whole lines counts only if no delimiter splits them into numbers
            score = (round(good / max(filled, 1), 3), width > 1)
            if good and score > best_score:
                best, best_score = (delimiter, decimal), score
    if best_score[0] < 0.3:
        raise FileFormatError(
            f"{path} has no columns of numbers that could be found; a line in its first ones is "
            f"{sample[0][:60]!r}; try delimiter=, decimal= and skip_rows="
        )
    return best


def _first_data_row(head: _Head, header: bool | str) -> int:
    """Position in ``head.rows`` of the first line of data."""
    last = len(head.rows) - 1
    kinds = [
        head.kinds(row) if len(cells) == head.width else [] for row, cells in enumerate(head.cells)
    ]
    lower = [kind for kind in kinds[len(kinds) // 2 :] if kind]
    numeric = [
        column
        for column in range(head.width)
        if 2 * sum(kind[column] in ("number", "time") for kind in lower) >= len(lower)
    ]
    # part of the columns of numbers in which a line has a number
    share = [
        sum(kind[column] in ("number", "time") for column in numeric) / max(len(numeric), 1)
        if kind
        else 0.0
        for kind in kinds
    ]
    if header is True:
        has_units = last > 1 and share[1] == 0 and is_units_line(head.cells[1])
        return min(2 if has_units else 1, last)
    first = next((row for row, part in enumerate(share) if part == 1), last)
    # a line above with some numbers is a bad line of data, to be complained about, not a header
    while first > 0 and share[first - 1] > 0:
        first -= 1
    return first


def _names(head: _Head, first: int) -> tuple[list[str], list[str]]:
    """Names and units of the columns, from the lines above the first one of data."""
    texts = [_header_cells(head, row, first) for row in range(first)]
    names = texts[-1] if texts else None
    if names is not None:
        above = texts[-2] if len(texts) > 1 else None
        if above is not None and is_units_line(names):
            return above, [plain_unit(cell) for cell in names]
    elif texts and len(head.cells[first - 1]) > 1:
        raise FileFormatError(
            f"line {head.rows[first - 1] + 1} of {head.path} has {len(head.cells[first - 1])} "
            f"cells, the lines below have {head.width}; say delimiter=, decimal=, skip_rows=, "
            "or header=False and column numbers"
        )
    else:
        names = _names_in_comments(head, head.rows[first])
    return names, [split_unit(name[:MAX_NAME])[1] for name in names]


def _header_cells(head: _Head, row: int, first: int) -> list[str] | None:
    """Cells of a line above the data, or None if they do not fit the columns."""
    cells = head.cells[row]
    if len(cells) == head.width:
        return cells
    if len(cells) == head.width - 1 > 1 and not any(
        line[-1] for line in head.cells[first:] if len(line) == head.width
    ):
        # the lines of data end in a delimiter, the header does not
        return [*cells, ""]
    # names with blanks in them, above columns that are split at blanks
    apart = re.split(r"\t+|\s{2,}", head.lines[head.rows[row]].strip())
    return apart if len(apart) == head.width else None


def _names_in_comments(head: _Head, first_line: int) -> list[str]:
    comments = [
        line.strip().strip(head.comment).strip()
        for line in head.lines[:first_line]
        if head.comment and line.lstrip().startswith(head.comment)
    ]
    for line in reversed(comments):
        for delimiter in (head.delimiter, *DELIMITERS):
            cells = split_line(line, delimiter)
            if len(cells) == head.width and not any(_kind(cell, ".") == "number" for cell in cells):
                return cells
    return [""] * head.width
