"""Sheets of Excel workbooks (``.xlsx``), if openpyxl is installed.

A sheet is written as text, with one line for each of its rows, and read like a text table: titles,
headers, units, dates and bad cells follow the same rules.
"""

from __future__ import annotations

import datetime
import zipfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import FileFormatError, OptionError
from ..cells import NUMBER, refuse_thousands
from ..checks import MAX_COLUMNS, check_size, package_for, told_if_damaged
from ..text.source import TextSource
from ..text_options import TextOptions

_FEWEST_ROWS = 3
"""A sheet with fewer filled rows is no record."""
_FIRST_YEAR = 1904
"""Dates before it are durations: Excel shows 1.5 days as 12:00, and openpyxl as a date of 1900."""
_DAY_0 = datetime.datetime(1899, 12, 31)


def is_workbook(path: Path) -> bool:
    """Whether a zip file is a workbook."""
    try:
        with zipfile.ZipFile(path) as archive:
            return "xl/workbook.xml" in archive.namelist()
    except (zipfile.BadZipFile, OSError, ValueError):
        return False


def sheet_as_text(
    path: Path, name: str | None, options: TextOptions, max_bytes: float
) -> TextSource:
    """Return a sheet as tab-separated text, with points in all numbers.

    Parameters
    ----------
    path : pathlib.Path
    name : str or None
        Name of the sheet; None: the only one with data.
    options : TextOptions
        How numbers are written that are stored as text.
    max_bytes : float
        Largest size, unpacked.

    Raises
    ------
    FileFormatError
        openpyxl is not installed, or the workbook is damaged, too large or without data.
    OptionError
        There is no such sheet, or several have data; they are listed.
    """
    with package_for(path, "an Excel workbook", "excel", "openpyxl"):
        import openpyxl
    with told_if_damaged(path, "Excel workbook"):
        with zipfile.ZipFile(path) as archive:
            size = sum(member.file_size for member in archive.infolist())
        check_size(path, size, max_bytes, ", unpacked,")
        with path.open("rb") as file:
            book = openpyxl.load_workbook(file, read_only=True, data_only=True)
            sheets = {sheet.title: sheet for sheet in book.worksheets}
            if name is not None and name not in sheets:
                raise OptionError(f"variable={name!r}: {path} has the sheets {_listed(sheets)}")
            chosen = sheets if name is None else {name: sheets[name]}
            texts = {title: _text(path, sheet.rows, options) for title, sheet in chosen.items()}
    filled = {title: text for title, text in texts.items() if text.count("\n") >= _FEWEST_ROWS}
    if len(filled) > 1:
        raise OptionError(
            f"{path} has {len(filled)} sheets with data; give variable= one of {_listed(filled)}"
        )
    if not filled:
        raise FileFormatError(f"{path} has no sheet with data; it has {_listed(texts)}")
    (text,) = filled.values()
    return TextSource(path, text.encode("utf-8"), row_name="row")


def _text(path: Path, rows: Iterable[Iterable[Any]], options: TextOptions) -> str:
    """Rows as lines of tab-separated cells, without columns that are empty throughout."""
    import pandas as pd

    cells = [[_cell(cell) for cell in row] for row in rows]
    if options.decimal != "." and options.thousands != ",":
        if options.decimal == "auto":  # the numbers beside them do not tell
            refuse_thousands(path, cells, ",", ",")
        comma = NUMBER[","].fullmatch
        cells = [[one.replace(",", ".") if comma(one) else one for one in row] for row in cells]
    table = pd.DataFrame(cells, dtype=object).fillna("")
    if table.shape[1] > MAX_COLUMNS:
        raise FileFormatError(f"{path} has {table.shape[1]} columns, the limit is {MAX_COLUMNS}")
    rows, columns = np.nonzero(np.asarray(table != ""))
    used = table.iloc[: rows.max(initial=-1) + 1, np.unique(columns)]
    return used.to_csv(sep="\t", header=False, index=False, lineterminator="\n")


def _cell(cell: Any) -> str:
    """Text of a cell that the reader of text tables understands."""
    value = cell.value
    if value is None:
        return ""
    if isinstance(value, int | float) and "%" in str(cell.number_format):
        return f"{100 * value:.15g}%"  # what is shown as 20 % is stored as 0.2
    if isinstance(value, datetime.datetime) and value.year < _FIRST_YEAR:
        value -= _DAY_0  # a clock of more than 24 h
    elif isinstance(value, datetime.datetime) and value.time() == datetime.time():
        value = value.date()
    if isinstance(value, datetime.timedelta):
        minutes, seconds = divmod(value.total_seconds(), 60)
        return f"{int(minutes) // 60}:{int(minutes) % 60:02}:{seconds:09.6f}"
    return " ".join(str(value).split())


def _listed(names: Iterable[str]) -> str:
    return ", ".join(repr(name) for name in list(names)[:20])
