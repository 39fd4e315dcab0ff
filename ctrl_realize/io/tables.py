"""Columns from files of any type, before they are assigned to signals."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from ..errors import DataError
from ..numerics.arrays import BoolArray
from .cells import BAD_VALUES, ENDS, MISSING, NUMBER, STATES, complex_of, measured, number_of

_NOTHING = np.empty(0)
_LONGEST_WORD = 60
"""Letters of the longest word in place of a value."""


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

    @property
    def told_unit(self) -> str:
        """Unit of the header, or of the first cell."""
        cells: Any = [] if self.unit else self.first(1)
        return measured(str(cells[0]).strip())[1] if len(cells) else self.unit

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
        Notation of cells that are still text, see `cells.NUMBER`.
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

    def at(self, index: int, row: int | None = None) -> str:
        """File and column, and the place of a row, as messages begin."""
        place = "" if row is None else f", {self.place(row)}"
        return f"{self.path}: {self.title(index)}{place}"

    def listing(self) -> str:
        """List of the columns for a message, at most twenty."""
        names = [f"{k} {column.name!r}" for k, column in enumerate(self.columns) if column.name]
        if not names:
            return f"{len(self.columns)} columns without a header (0...{len(self.columns) - 1})"
        more = f", ... ({len(names)} in all)" if len(names) > 20 else ""
        return "columns " + ", ".join(names[:20]) + more

    def rows(self, chosen: np.ndarray[Any, np.dtype[Any]], columns: Iterable[int]) -> Table:
        """Return the table with the chosen rows of some columns; the others are empty."""
        kept = set(columns)
        parts = tuple(
            Column(one.name, one.unit, one.cells[chosen] if k in kept else _NOTHING)
            for k, one in enumerate(self.columns)
        )
        return replace(self, columns=parts, place=lambda row: self.place(int(chosen[row])))

    def numbers(
        self,
        index: int,
        *,
        keep_missing: bool = False,
        words: frozenset[str] = frozenset(),
        ignored: BoolArray | None = None,
        complex_too: bool = False,
    ) -> np.ndarray[Any, np.dtype[Any]]:
        """Return a column as finite real numbers; missing ones are refused, or become NaN.

        Parameters
        ----------
        index : int
        keep_missing : bool, optional
        words : frozenset of str, optional
            Further words and numbers that stand for a missing value.
        ignored : ndarray of bool, shape (N,), optional
            Cells that become NaN, whatever they are.
        complex_too : bool, optional
            Allow complex numbers.

        Raises
        ------
        DataError
            A cell is not a finite number; the message names the first one.
        """
        cells = self.columns[index].cells
        skipped = np.zeros(cells.size, dtype=bool) if ignored is None else ignored
        if cells.dtype.kind in "biufc":
            standing = [float(word) for word in words if NUMBER["."].fullmatch(word)]
            values, missing = cells, np.isnan(cells) | np.isin(cells, standing)
        else:
            values, missing = self._parsed(index, words, skipped, complex_too)
        bad = ~(np.isfinite(values) & ~missing | skipped)
        if keep_missing:
            bad &= ~missing
        if bad.any():
            row = int(np.argmax(bad))
            self._refuse(index, row, missing=missing[row], infinite=np.isinf(values[row]))
        if np.iscomplexobj(values) and not complex_too:
            raise DataError(f"{self.at(index)} is complex; expected real numbers")
        kind = np.complex128 if complex_too else np.float64
        return np.where(missing | skipped, np.nan, values).astype(kind)

    def _parsed(
        self, index: int, words: frozenset[str], skipped: BoolArray, complex_too: bool
    ) -> tuple[np.ndarray[Any, np.dtype[Any]], BoolArray]:
        """Numbers of a column of text, NaN for other cells, and which of them have no value."""
        import pandas as pd

        # cells that are equal are read once
        texts = [str(cell).strip().rstrip(ENDS) for cell in self.columns[index].cells]
        place, kinds = pd.factorize(np.array(texts, dtype=object))
        low = [kind[:_LONGEST_WORD].lower() for kind in kinds]
        missing = MISSING | BAD_VALUES | {word.strip().lower() for word in words}
        # positions of a switch, if the cells hold nothing else
        others = set(low) - missing
        positions = STATES if others <= STATES.keys() else {}
        parts = [measured(positions.get(word, kind)) for word, kind in zip(low, kinds, strict=True)]
        empty = np.array([word in missing for word in low], dtype=bool)
        value_of = complex_of if complex_too else number_of
        found = np.array([value_of(one, self.decimal) for one, _ in parts])
        values = np.where(empty, np.nan, found)[place]
        units = np.array([unit for _, unit in parts], dtype=object)[place]
        self._check_units(index, units, np.where(skipped, np.nan, values))
        return values, empty[place]

    def _check_units(
        self, index: int, units: np.ndarray[Any, Any], values: np.ndarray[Any, Any]
    ) -> None:
        """Refuse a column whose numbers have two units; a zero is the same in all."""
        seen = np.isfinite(values) & (values != 0)
        kinds = sorted(set(units[seen]), reverse=True)
        if len(kinds) > 1:
            first, other = (np.flatnonzero(seen & (units == kind)) for kind in kinds[:2])
            shown = " and ".join(
                f"{str(self.columns[index].cells[at[0]])!r} ({self.place(int(at[0]))})"
                for at in (first, other)
            )
            name = "a percent sign" if kinds[0] == "%" else f"the unit {kinds[0]!r}"
            raise DataError(
                f"{self.at(index)} has {first.size} cells with {name} and {other.size} without, "
                f"such as {shown}; expected one unit in all of them (in a spreadsheet: one number "
                "format for the column)"
            )

    def _refuse(self, index: int, row: int, *, missing: bool, infinite: bool) -> NoReturn:
        text = str(self.columns[index].cells[row]).strip()
        advice = "; try decimal=',' or '.'" if "," in text or "." in text else ""
        if "," in text and "." in text:
            advice = f"; thousands={min(',.', key=text.find)!r} if it separates thousands"
        if not advice and not any(letter.isdigit() for letter in text):
            advice = f"; na_values={text[:60]!r} if it stands for a missing value"
            advice += "; expected ON and OFF, or 1 and 0, in a column of a switch"
        what = f"{text[:60]!r}: is not a number{advice}"
        if infinite:
            what = f"{text[:60]} is not finite (or too large for double precision)"
        elif missing:
            what = f"{text[:60]!r}: a value is missing; missing='keep' keeps gaps in a record"
            what += ", a row of a frequency response can be deleted"
        raise DataError(f"{self.at(index, row)}: {what}")
