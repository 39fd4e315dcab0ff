"""Long tables, with one row for each sample of each tag, as historians export them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from ...errors import DataError
from ..columns import Selector, holds_numbers, named
from ..tables import Column, Table
from ..units import unit_of
from .names import NAMES, clocks_of, dates_of

_MOST_TAGS = 1000


class LongTable(NamedTuple):
    """A long table: columns of time, its date and values, and the rows of each tag."""

    time: int
    date: int | None
    value: int
    rows: dict[str, np.ndarray[tuple[int], np.dtype[np.intp]]]


def long_table(
    table: Table, time: str | int | None, signals: Sequence[Selector | None]
) -> LongTable | None:
    """Rows of each tag, or None if the table is not long.

    It is long if it has one column of tags, one of values and one of time by their names, and no
    column has the name of a requested signal.
    """
    tags = [k for k in named(table, NAMES["tag"]) if not holds_numbers(table, k)]
    values = named(table, NAMES["value"])
    clocks = clocks_of(table) or named(table, NAMES["date"])
    if isinstance(time, str):
        clocks = [k for k, one in enumerate(table.columns) if one.name == time]
    names = {column.name for column in table.columns}
    plain = (
        one if isinstance(one, Iterable) and not isinstance(one, str) else [one] for one in signals
    )
    asked = {column for each in plain for column in each if isinstance(column, str)}
    if not len(tags) == len(values) == len(clocks) == 1 or asked & names:
        return None
    cells = np.array([str(cell).strip() for cell in table.columns[tags[0]].cells])
    found = list(dict.fromkeys(cells.tolist()))
    if len(found) > _MOST_TAGS:
        raise DataError(f"{table.path} has {len(found)} tags; the limit is {_MOST_TAGS}")
    date = next(iter(dates_of(table, clocks[0])), None)
    return LongTable(
        clocks[0], date, values[0], {tag: np.flatnonzero(cells == tag) for tag in found}
    )


def tags_as_columns(table: Table, long: LongTable) -> Table:
    """Table with a column for each tag, from which those of the signals are chosen."""
    cells = table.columns[long.value].cells
    columns = [Column(tag, unit_of(tag), cells[rows]) for tag, rows in long.rows.items()]
    return Table(table.path, tuple(columns), decimal=table.decimal)
