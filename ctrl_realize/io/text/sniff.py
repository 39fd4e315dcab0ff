"""Determine the format of a text table from its first lines.

The rules, in this order; each can be overruled by the caller:

1. The encoding is determined by the byte order mark, by zero bytes in every second place (UTF-16),
   or by valid UTF-8; otherwise it is Latin-1.
2. The delimiter and the decimal sign are the pair that gives the most cells with numbers or times
   in the lower half of the first lines; of those, the pair with the largest fraction of them.
3. The data begin with the line from which on all numeric columns contain numbers.
4. The header is the line above, if it has as many cells and no numbers; a line of units may be
   between. Without one, the last comment line above the data is used (as written by NumPy's
   ``savetxt``).
"""

from __future__ import annotations

import codecs
import re
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from ...errors import FileFormatError
from ..cells import DELIMITERS, FILLED, kind_of, refuse_thousands, split_line
from ..checks import MAX_COLUMNS, MAX_NAME
from ..head_lines import HEAD_BYTES, MAX_HEAD_LINES, Line, head_lines, holds_cells
from ..text_options import TextOptions
from .header import Head, column_names, first_data_row
from .source import TextSource

_SAMPLE_LINES = 60
"""Number of lines on which every pair of delimiter and decimal sign is tried."""

_FEWEST_NUMBERS = 0.3
"""Smallest fraction of the cells of a table that are numbers or times."""

_BOMS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    # before that of UTF-16, which is its beginning
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)


@dataclass(frozen=True, eq=False)
class TextLayout:
    """Format of a text table.

    ``names`` and ``units`` have an entry for each column; the names are empty without a header. The
    data begin with row ``first`` of the head, which is line ``begin`` of the file. The head is all
    of the text if ``whole`` is true.
    """

    encoding: str
    head: Head
    names: list[str]
    units: list[str]
    first: int
    begin: Line
    whole: bool


def sniff(source: TextSource, options: TextOptions) -> TextLayout:
    """Determine the format of a text table.

    Raises
    ------
    FileFormatError
        It is not text, or there are no columns of numbers in its first lines.
    """
    path, head_bytes = source.path, source.head(HEAD_BYTES)
    encoding = _encoding(path, head_bytes) if options.encoding == "auto" else options.encoding
    found = head_lines(path, head_bytes, encoding, options.skip_rows)
    lines = [line.text for line in found]
    comment = _comment(lines) if options.comment == "auto" else options.comment
    rows = [
        index
        for index in range(len(lines))
        if found[index].number >= options.skip_rows and holds_cells(lines[index], comment)
    ]
    if not rows:
        raise FileFormatError(f"{path} has no data lines in its first {len(head_bytes)} bytes")
    if lines[rows[0]].lstrip()[:2] in ('{"', "[{", "[["):
        raise FileFormatError(
            f"{path} is JSON; expected a table such as CSV. In Python json.load reads it, and "
            "Record(time, input, output) makes a record of its lists"
        )
    lower = [lines[index] for index in rows[len(rows) // 2 :]]
    delimiter, decimal = _delimiter_and_decimal(path, lower[:_SAMPLE_LINES], options)
    cells = [split_line(lines[index], delimiter) for index in rows]
    width = Counter(map(len, cells[len(rows) // 2 :])).most_common(1)[0][0]
    if width > MAX_COLUMNS:
        raise FileFormatError(f"{path} has {width} columns, the limit is {MAX_COLUMNS}")
    head = Head(path, lines, rows, cells, delimiter, decimal, comment, width)
    first = first_data_row(head, options.header)
    names, units = ([""] * width,) * 2 if options.header is False else column_names(head, first)
    names = [re.sub(r"\s*[\r\n]\s*", " ", name)[:MAX_NAME] for name in names]
    if options.decimal == options.thousands == "auto":
        refuse_thousands(path, cells[first:], delimiter, decimal)
    whole = len(head_bytes) < HEAD_BYTES and len(lines) < MAX_HEAD_LINES
    return TextLayout(encoding, head, names, units, first, found[rows[first]], whole)


def _encoding(path: Path, head: bytes) -> str:
    for mark, encoding in _BOMS:
        if head.startswith(mark):
            return encoding
    if b"\0" in head:
        # only numbers in UTF-16 have a zero in every second byte
        for first, encoding in ((1, "utf-16-le"), (0, "utf-16-be")):
            if head[first::2].count(0) > 0.9 * (len(head) // 2) and 0 not in head[1 - first :: 2]:
                return encoding
        head_text = head.rstrip(b"\0")
        if b"\0" in head_text or not head_text:
            raise FileFormatError(
                f"{path} is binary; expected text (CSV, TSV), .xlsx, .npz, .mat, Parquet, HDF5 or "
                "TDMS"
            )
    try:
        codecs.getincrementaldecoder("utf-8")().decode(head)
    except UnicodeDecodeError:
        return "latin-1"
    return "utf-8"


def _comment(lines: list[str]) -> str | None:
    counts = {
        sign: sum(bool(line.strip()) and not holds_cells(line, sign) for line in lines)
        for sign in "#%"
    }
    return max(counts, key=lambda sign: counts[sign]) if any(counts.values()) else None


def _delimiter_and_decimal(path: Path, sample: list[str], options: TextOptions) -> tuple[str, str]:
    delimiters = DELIMITERS if options.delimiter == "auto" else (options.delimiter,)
    text = " ".join(sample)
    notations = [one for one in options.notations if not one[1:] or one[1:] in text]
    best, best_score = ("", ""), (0.0, 0.0, False)
    for delimiter in delimiters:
        if delimiter == " " and best_score[2] and _blanks_inside(sample, *best):
            continue
        rows = [split_line(line, delimiter) for line in sample]
        width = Counter(map(len, rows)).most_common(1)[0][0]
        for notation in notations:
            kinds = [kind_of(cell, notation) for row in rows if len(row) == width for cell in row]
            good = sum(kind in FILLED for kind in kinds)
            filled = sum(map(len, rows)) - kinds.count("missing")
            # a single column counts only if no delimiter splits the lines into numbers
            share = round(good / max(filled, 1), 3)
            score = (round(good / len(rows), 1), share, width > 1)
            if good and share >= _FEWEST_NUMBERS and score > best_score:
                best, best_score = (delimiter, notation), score
    if not best_score[0]:
        raise FileFormatError(
            f"{path} has no recognisable numeric columns; one of its first lines is "
            f"{sample[0][:60]!r}; try delimiter=, decimal= and skip_rows="
        )
    return best


def _blanks_inside(sample: list[str], delimiter: str, notation: str) -> bool:
    """Whether blanks are parts of cells, as in dates and remarks, and do not separate numbers."""
    return not any(
        kind_of(cell, notation) == "text"
        and all(kind_of(word, notation) in FILLED for word in cell.split())
        for line in sample
        for cell in split_line(line, delimiter)
        if " " in cell
    )
