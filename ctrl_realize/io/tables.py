"""Columns from files of any type, before they are assigned to signals."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import DataError
from ..numerics.arrays import FloatArray
from .cells import MISSING, NUMBER


@dataclass(frozen=True, eq=False)
class Column:
    """One column of a file.

    Attributes
    ----------
    name : str
        Name in the file; empty without a header.
    unit : str
        Unit in the file, in plain spelling, or empty.
    cells : ndarray, shape (N,)
        Numbers, or text if at least one cell is not a number.
    """

    name: str
    unit: str
    cells: np.ndarray[Any, np.dtype[Any]]

    def first(self, count: int) -> np.ndarray[Any, np.dtype[Any]]:
        """Return the first cells."""
        return self.cells[:count]


@dataclass(frozen=True, eq=False)
class Table:
    """Columns of a file, with the information needed for error messages.

    Attributes
    ----------
    path : pathlib.Path
    columns : tuple of Column
    constants : mapping of str to float
        Single numbers beside the columns (``dt`` in ``.npz`` and ``.mat``).
    decimal : str
        Decimal sign of cells that are still text.
    place : callable
        Describes a row for a message: ``"line 17"``.
    """

    path: Path
    columns: tuple[Column, ...]
    constants: Mapping[str, float] = field(default_factory=dict)
    decimal: str = "."
    place: Callable[[int], str] = "row {}".format

    def title(self, index: int) -> str:
        """Name of a column for a message, or its number without a header."""
        name = self.columns[index].name
        return f"column {name!r}" if name else f"column {index}"

    def listing(self) -> str:
        """List of the columns for a message, at most twenty."""
        names = [f"{k} {column.name!r}" for k, column in enumerate(self.columns) if column.name]
        if not names:
            return f"{len(self.columns)} columns without a header (0...{len(self.columns) - 1})"
        more = f", ... ({len(names)} in all)" if len(names) > 20 else ""
        return "columns " + ", ".join(names[:20]) + more

    def numbers(self, index: int, *, keep_missing: bool = False) -> FloatArray:
        """Return a column as finite real numbers; missing ones are refused, or become NaN.

        Raises
        ------
        DataError
            A cell is not a finite number; the message names the first one.
        """
        values = self.values(index, keep_missing=keep_missing)
        if np.iscomplexobj(values):
            raise DataError(f"{self.path}: {self.title(index)} is complex; expected real numbers")
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
                f"{self.path}: {self.title(index)}, {self.place(row)}: {cells[row]} is not "
                "finite (or too large for double precision)"
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
                advice = "; try decimal=',' or '.'" if "," in text or "." in text else ""
                if "," in text and "." in text:
                    advice = "; write it without thousands separators"
                if missing:
                    advice = "; missing='keep' keeps gaps in a record"
                raise DataError(
                    f"{self.path}: {self.title(index)}, {self.place(row)}: {text[:60]!r}"
                    f": {what}{advice}"
                )
            values[row] = float(text.replace(",", "."))
        return values
