"""Samples that are marked bad by a column of their quality, and cells without a value."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from numbers import Real
from typing import Any

import numpy as np

from ...errors import DataError, OptionError
from ...numerics.arrays import BoolArray, FloatArray
from ..cells import BAD_VALUES, NUMBER
from ..columns import find_column
from ..tables import Table
from .names import QUALITY_NAMES

_GOOD_FROM, _BAD_BELOW = 192, 64
"""Qualities of OPC DA 3.0, section 6.8: 192 and above are good, those below 64 bad."""
_MARKS = " _./:-"


@dataclass(frozen=True)
class Rules:
    """What counts as a missing value.

    ``missing`` are words and numbers besides the usual ones; ``quality`` selects the column of the
    quality, ``good`` its good values; ``keep`` makes missing values NaN instead of an error.
    """

    keep: bool
    missing: tuple[str, ...] = ()
    quality: str | int | None = "auto"
    good: tuple[str, ...] = ()

    def columns(self, table: Table) -> list[int]:
        """Columns that hold qualities."""
        if self.quality is None:
            return []
        if self.quality != "auto":
            return [find_column(table, self.quality, "quality")]
        return [k for k in range(len(table.columns)) if _quality_of(table, k) is not None]

    def values(self, table: Table, index: int) -> FloatArray:
        """Return a column as numbers, with NaN where a value is missing or bad.

        Raises
        ------
        DataError
            A cell is no number, or a value is missing and is not to be kept.
        """
        marked = self._marked(table, index)
        if marked.any() and not self.keep:
            row = int(np.argmax(marked))
            raise DataError(
                f"{table.path}: {table.title(index)}, {table.place(row)}: its quality is bad; "
                "missing='keep' leaves such samples out, quality=None ignores the quality"
            )
        values = table.numbers(
            index, keep_missing=self.keep, words=frozenset(self.missing), ignored=marked
        )
        return np.where(marked, np.nan, values) if marked.any() else values

    def _marked(self, table: Table, index: int) -> BoolArray:
        """Rows in which the quality of a column is bad."""
        out = np.zeros(table.columns[index].cells.size, dtype=bool)
        for column in self.columns(table):
            if self.quality == "auto" and _quality_of(table, column) not in (
                "", plain_tag(table.columns[index].name),
            ):  # fmt: skip
                continue
            cells = table.columns[column].cells
            out |= self._bad(cells) if cells.size == out.size else False
        return out

    def _bad(self, cells: np.ndarray[Any, np.dtype[Any]]) -> BoolArray:
        if self.good:
            numbers = {float(word) for word in self.good if NUMBER["."].fullmatch(word)}
            if cells.dtype.kind in "biuf":
                return ~np.isin(cells, list(numbers))
            words = {word.casefold() for word in self.good}
            return np.array([str(cell).strip().casefold() not in words for cell in cells], bool)
        if cells.dtype.kind in "iuf":
            codes = np.nan_to_num(cells.astype(np.float64))
            # other numbers, such as a count or a flag of 0 and 1, say nothing by themselves
            are_codes = bool(np.max(codes, initial=0) >= _GOOD_FROM)
            return np.asarray(codes < _BAD_BELOW) & are_codes
        return np.array([_is_bad(str(cell)) for cell in cells], dtype=bool)


def rules_of(keep: bool, na_values: object, quality: str | int | None, good: object) -> Rules:
    """Check the arguments of a reading function.

    Raises
    ------
    OptionError
    """
    if quality is not None and (isinstance(quality, bool) or not isinstance(quality, str | int)):
        raise OptionError(
            f"quality={quality!r}; expected the name or number of a column, 'auto' or None"
        )
    return Rules(keep, _words(na_values, "na_values"), quality, _words(good, "good"))


def plain_tag(name: str) -> str:
    """Reduce a tag for comparison: all of its parts, without a unit and capital letters."""
    return " ".join(name.partition("[")[0].lower().split())


def _quality_of(table: Table, index: int) -> str | None:
    """Signal whose quality a column holds: "" for all of them, None if it holds none."""
    name = plain_tag(table.columns[index].name)
    for word in sorted(QUALITY_NAMES, key=len, reverse=True):
        if name == word:
            return ""
        if name.endswith(word) and name[-len(word) - 1] in _MARKS:
            return name[: -len(word)].rstrip(_MARKS)
    return None


def _is_bad(cell: str) -> bool:
    word = cell.strip().lower()
    return word in BAD_VALUES or word.startswith("bad")


def _words(given: object, name: str) -> tuple[str, ...]:
    if given is None:
        return ()
    if isinstance(given, str | Real):
        several: tuple[Any, ...] = (given,)
    else:
        several = tuple(given) if isinstance(given, Iterable) else (None,)
    if not all(isinstance(word, str | Real) for word in several):
        raise OptionError(f"{name}={given!r}; expected a word or number, or several")
    return tuple(word if isinstance(word, str) else f"{float(word):.17g}" for word in several)
