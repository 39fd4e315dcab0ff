"""Text tables, parsed by pandas in the format determined by `sniff`."""

from __future__ import annotations

import codecs
import math
import re
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any

from ...errors import FileFormatError, warn_caller
from ..cells import ENDS, NUMBER, kind_of, number_of, split_line
from ..head_lines import holds_cells
from ..tables import Column, Table
from ..text_options import TextOptions
from .sniff import TextLayout, sniff
from .source import TextSource

_TAIL_BYTES = 1 << 16
_TAIL_LINES = 50


def read_delimited(source: TextSource, options: TextOptions) -> Table:
    """Read a text table (CSV, TSV, columns between blanks).

    An incomplete last line, as if writing was interrupted, is left out with a `DataWarning`.

    Raises
    ------
    FileFormatError
        It is not a table: binary, without numbers, or with rows longer than the others.
    """
    path, layout = source.path, sniff(source, options)
    head = layout.head
    frame = _parse(source, layout)
    _check_parsed(path, layout, frame)
    texts = [k for k in frame if layout.names[k] and frame[k].dtype.kind == "O"]
    if texts:  # the header may stand above each part of the table
        frame = frame[frame[texts[0]] != layout.names[texts[0]]]
    cut = _cut_last_line(source, layout)
    if cut and len(frame) > 1:
        warn_caller(f"{path}: the last line is skipped: {cut}")
        # columns that are text only because of the incomplete line become numbers in Table.numbers
        frame = frame.iloc[:-1]
    while len(frame) and _is_blank(frame.iloc[-1]):
        frame = frame.iloc[:-1]
    columns = [
        Column(layout.names[k], layout.units[k], frame.iloc[:, k].to_numpy())
        for k in range(head.width)
    ]
    if len(columns) > 1 and not columns[-1].name and _is_blank(columns[-1].cells):
        # every line ends in a delimiter
        columns.pop()
    place = partial(_place, source, layout)
    return Table(path, tuple(columns), head.sample_times(layout.first), head.decimal, place)


def _parse(source: TextSource, layout: TextLayout) -> Any:
    import pandas as pd

    path, head = source.path, layout.head
    separator = r"\s+" if head.delimiter == " " else head.delimiter
    keywords: dict[str, Any] = {"low_memory": False}
    if not (head.delimiter + (head.comment or "")).isascii():
        # the faster parser accepts delimiters of one byte only
        keywords = {"engine": "python"}
    elif tuple(map(int, pd.__version__.split(".")[:2])) < (3, 1):
        # the default of later versions; without it, the last digit could be wrong
        keywords["float_precision"] = "round_trip"
    comment, cells = head.comment, (cell for row in head.cells[layout.first :] for cell in row)
    if comment and any(one.startswith(comment) and kind_of(one, ".") == "missing" for one in cells):
        comment = None  # the parser would take what stands behind #N/A for one
    try:
        with source.open(layout.encoding, newline="") as file:
            # Not by skiprows: the parser counts lines differently, and would leave out more.
            file.read(layout.begin.start)
            frame = pd.read_csv(
                file,
                sep=separator,
                decimal=head.decimal[0],
                header=None,
                comment=comment,
                # numbers are ASCII in all encodings here; a wrong character in a name is harmless
                skipinitialspace=True,
                # an empty cell or "NaN" makes its column text, and is reported there
                na_filter=False,
                **keywords,
            )
    except (pd.errors.ParserError, pd.errors.EmptyDataError, UnicodeError, OverflowError) as error:
        reason = str(error).strip().removeprefix("Error tokenizing data. C error: ")
        # it counts from where parsing begins
        reason = re.sub(
            r"\bline (\d+)", lambda found: f"line {int(found[1]) + layout.begin.number}", reason
        )
        raise FileFormatError(f"{path} is not a table: {reason}") from error
    if frame.shape[1] != head.width:
        raise FileFormatError(
            f"{path}: line {layout.begin.number + 1} has {frame.shape[1]} cells, most lines "
            f"have {head.width}; give delimiter=, or skip_rows= if the table starts "
            "further down"
        )
    return frame


def _check_parsed(path: Path, layout: TextLayout, frame: Any) -> None:
    """Compare the parsed table with the lines of the file, so that no sample is lost silently."""
    cells = layout.head.cells[layout.first :]
    for cell, parsed in zip(cells[0], frame.iloc[0], strict=False):
        number = number_of(cell, layout.head.decimal)
        same = str(parsed).strip() == cell or math.isnan(number)
        if not same and (isinstance(parsed, str) or float(parsed) != number):
            raise FileFormatError(
                f"{path}: line {layout.begin.number + 1} is the first data line, and its cell "
                f"{cell!r} was read as {str(parsed)[:60]!r}; check its quotes and line ends"
            )
    if layout.whole and len(frame) < len(cells):
        raise FileFormatError(
            f"{path} has {len(cells)} lines of data, of which {len(frame)} were read; "
            "check its quotes and line ends"
        )


def _is_blank(cells: Any) -> bool:
    return all(isinstance(cell, str) and not cell.strip() for cell in cells)


def _cut_last_line(source: TextSource, layout: TextLayout) -> str:
    """Return why the last line seems incomplete, or ``""``."""
    raw, head = source.tail(_TAIL_BYTES), layout.head
    # the byte order mark is not in the tail; UTF-16 without it is recognised by its zeros
    encoding = layout.encoding
    if encoding == "utf-16":
        encoding = "utf-16-be" if raw[:64:2].count(0) > raw[1:64:2].count(0) else "utf-16-le"
    text = codecs.getincrementaldecoder(encoding)("replace").decode(raw)
    lines = re.split(r"\r\n|\n|\r", text)[-_TAIL_LINES:]
    lines = [line for line in lines if holds_cells(line, head.comment)]
    # An interrupted writer may leave zeros: at the end they are an incomplete line.
    rows = [split_line(line.rstrip(ENDS), head.delimiter) for line in lines]
    before, last = [row for row in rows[:-1] if any(row)], rows[-1] if rows else []
    if not before:
        return ""
    if len(last) < min(head.width, len(before[-1])):
        return f"it has {len(last)} of {head.width} cells"
    if text.endswith(("\n", "\r")) or len(last) != head.width:
        return ""
    pattern = NUMBER[head.decimal]
    if not pattern.fullmatch(last[-1]) and pattern.fullmatch(before[-1][-1]):
        return f"it ends in {last[-1][:20]!r} and has no line end"
    # written with a fixed number of decimals, except here: 27.02 of 27.0223
    ends = [row[-1] for row in before if pattern.fullmatch(row[-1])]
    decimals = {len(end.partition(head.decimal[0])[2]) for end in ends}
    written = len(last[-1].partition(head.decimal[0])[2])
    if len(ends) >= 3 and len(decimals) == 1 and written < min(decimals):
        return f"it ends in {last[-1]!r}, with fewer decimals than all others and no line end"
    return ""


def _place(source: TextSource, layout: TextLayout, row: int) -> str:
    """Line of the file that contains a row of the table."""
    with source.open(layout.encoding) as file:
        data = (
            number
            for number, line in enumerate(file, start=1)
            if number > layout.begin.number and holds_cells(line, layout.head.comment)
        )
        number = next(islice(data, row, None), None)
    return f"row {row}" if number is None else f"{source.row_name} {number}"
