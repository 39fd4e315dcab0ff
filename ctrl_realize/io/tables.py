"""Columns from files of any kind, before anybody knows what they mean."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import DataError, FileFormatError
from ..numerics.arrays import FloatArray
from .checks import read_head, usable_file
from .text_cells import MISSING, NUMBER
from .text_options import TextOptions

_NOT_READABLE = {
    b"\x89HDF": "an HDF5 file (MATLAB's v7.3 is one): save with save(..., '-v7') or as CSV",
    b"\xd0\xcf\x11\xe0": "an old Excel workbook: save it as CSV",
    b"\x1f\x8b": "compressed with gzip: unpack it first",
    b"BZh": "compressed with bzip2: unpack it first",
    b"\xfd7zXZ": "compressed with xz: unpack it first",
    b"7z\xbc\xaf": "a 7z archive: unpack it first",
    b"\x80\x04\x95": "a Python pickle: these run code when read, and are not read here",
    b"TDSm": "a LabVIEW TDMS file: export it as CSV",
    b"%PDF": "a PDF document",
}


@dataclass(frozen=True, eq=False)
class Column:
    """One column as it stands in the file.

    Attributes
    ----------
    name : str
        Name in the file, empty without a header.
    unit : str
        Unit in the file, in plain spelling, or empty.
    cells : ndarray, shape (N,)
        Numbers, or text where at least one cell is no number.
    """

    name: str
    unit: str
    cells: np.ndarray[Any, np.dtype[Any]]

    def first(self, count: int) -> np.ndarray[Any, np.dtype[Any]]:
        """Return the first cells."""
        return self.cells[:count]


@dataclass(frozen=True, eq=False)
class Table:
    """Columns of a file, with what is needed to complain about them well.

    Attributes
    ----------
    path : pathlib.Path
    columns : tuple of Column
    constants : mapping of str to float
        Single numbers that lie beside the columns (``dt`` in ``.npz`` and ``.mat``).
    decimal : str
        Decimal sign of cells that are still text.
    place : callable
        Turns a row index into words for a message: ``"line 17"``.
    """

    path: Path
    columns: tuple[Column, ...]
    constants: Mapping[str, float] = field(default_factory=dict)
    decimal: str = "."
    place: Callable[[int], str] = "row {}".format

    def title(self, index: int) -> str:
        """Name a column for a message: its name, or its number without a header."""
        name = self.columns[index].name
        return f"column {name!r}" if name else f"column {index}"

    def listing(self) -> str:
        """List the columns for a message, at most twenty of them."""
        names = [f"{k} {column.name!r}" for k, column in enumerate(self.columns) if column.name]
        if not names:
            return f"{len(self.columns)} columns without a header (0...{len(self.columns) - 1})"
        more = f", ... ({len(names)} in all)" if len(names) > 20 else ""
        return "columns " + ", ".join(names[:20]) + more

    def numbers(self, index: int, *, keep_missing: bool = False) -> FloatArray:
        """Return a column as finite real numbers; missing ones are refused, or kept as NaN.

        Raises
        ------
        DataError
            If a cell is not a finite number; the first one is named.
        """
        values = self.values(index, keep_missing=keep_missing)
        if np.iscomplexobj(values):
            raise DataError(f"{self.path}: {self.title(index)} is complex, real numbers are needed")
        return np.asarray(values, dtype=np.float64)

    def values(self, index: int, *, keep_missing: bool = False) -> np.ndarray[Any, np.dtype[Any]]:
        """Return a column as finite numbers, real or complex."""
        cells = self.columns[index].cells
        if cells.dtype.kind not in "biufc":
            cells = self._parsed(index, keep_missing)
        finite = ~np.isinf(cells) if keep_missing else np.isfinite(cells)
        if not finite.all():
            row = int(np.argmin(finite))
            raise DataError(
                f"{self.path}: {self.title(index)}, {self.place(row)}: {cells[row]} is not finite"
                " (or too large for a double)"
            )
        return cells

    def _parsed(self, index: int, keep_missing: bool) -> FloatArray:
        pattern = NUMBER[self.decimal]
        values = np.empty(self.columns[index].cells.size)
        for row, cell in enumerate(self.columns[index].cells):
            text = str(cell).strip()
            missing = text.lower() in MISSING
            if missing and keep_missing:
                values[row] = np.nan
                continue
            if not pattern.fullmatch(text):
                what = "a value is missing" if missing else "is not a number"
                advice = "; decimal=',' or '.' may help" if "," in text or "." in text else ""
                if "," in text and "." in text:
                    advice = "; write it without a separator of thousands"
                if missing:
                    advice = "; missing='keep' keeps a gap in a record"
                raise DataError(
                    f"{self.path}: {self.title(index)}, {self.place(row)}: {text[:60]!r}"
                    f": {what}{advice}"
                )
            values[row] = float(text.replace(",", "."))
        return values


def read_table(
    path: str | os.PathLike[str],
    options: TextOptions,
    *,
    variable: str | None,
    max_bytes: float,
) -> Table:
    """Read the columns of a text table, ``.npz``, ``.mat`` or Parquet file.

    What kind of file it is, is told by its first bytes; the ending of its name only matters for
    the oldest ``.mat`` files, which have no such mark.

    Parameters
    ----------
    path : path-like
    options : TextOptions
        How text is written.
    variable : str or None
        The variable of a ``.mat`` or ``.npz`` file (a matrix or a struct) to use alone.
    max_bytes : float
        Largest size, in the file and unpacked.

    Raises
    ------
    MissingFileError, FileFormatError, DataError
    """
    # each reader brings its own heavy library; none is loaded before it is needed
    file = usable_file(path, max_bytes)
    head = read_head(file, 128)
    for mark, what in _NOT_READABLE.items():
        if head.startswith(mark):
            raise FileFormatError(f"{file} is {what}")
    if head.startswith((b"PK\x03\x04", b"\x93NUMPY")):
        from .npz import read_npz

        return read_npz(file, variable=variable, max_bytes=max_bytes)
    if head.startswith(b"PAR1"):
        from .parquet import read_parquet

        return read_parquet(file, max_bytes=max_bytes)
    if head.startswith(b"MATLAB 5.0 MAT-file") or file.suffix.lower() == ".mat":
        from .mat import read_mat

        return read_mat(file, variable=variable, max_bytes=max_bytes)
    from .delimited import read_delimited

    return read_delimited(file, options)
