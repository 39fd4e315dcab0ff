"""Assignment of columns to signals: as requested, or by their names."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

import numpy as np

from ..errors import DataError, OptionError
from .cells import kind_of
from .tables import Table
from .units import split_unit

Selector = str | int | Sequence[str | int]
"""One column or several: names as in the file, or numbers from 0."""

_FAMILY = re.compile(r"^(.*?)[\s_]*(\[\d+\]|\(\d+\)|\d+)$")


def plain_name(name: str) -> str:
    """Reduce a column's name for comparison: ``"run.Input_Signal [V]" -> "input signal"``."""
    base = split_unit(name)[0].rpartition(".")[2] or name
    return re.sub(r"[\s_\-]+", " ", base).strip().lower()


def family(name: str) -> str:
    """Plain name without a channel number, for names like ``"output_2"`` and ``"y[1]"``."""
    plain = plain_name(name)
    numbered = _FAMILY.match(plain)
    return numbered[1].strip() if numbered and numbered[1].strip() else plain


def find_columns(table: Table, wanted: Selector, argument: str) -> list[int]:
    """Return the positions of the requested columns.

    Raises
    ------
    OptionError
        There is no such column, or there are several with that name; the columns are listed.
    """
    if isinstance(wanted, str | int | np.integer):
        return _one_choice(table, wanted, argument)
    if not isinstance(wanted, Iterable):
        raise OptionError(f"{argument}={wanted!r} must be a column's name or number, or several")
    chosen = [index for one in wanted for index in _one_choice(table, one, argument)]
    if not chosen or len(set(chosen)) != len(chosen):
        raise OptionError(f"{argument}={wanted!r} must name one or more different columns")
    return chosen


def find_column(table: Table, wanted: str | int, argument: str) -> int:
    """Return the position of the one requested column."""
    chosen = find_columns(table, wanted, argument)
    if len(chosen) != 1:
        raise OptionError(f"{argument}={wanted!r} selects {len(chosen)} columns, expected one")
    return chosen[0]


def _one_choice(table: Table, wanted: object, argument: str) -> list[int]:
    columns = table.columns
    if isinstance(wanted, int | np.integer) and not isinstance(wanted, bool):
        if not 0 <= wanted < len(columns):
            raise OptionError(
                f"{argument}={wanted}: {table.path} has {table.listing()}; count from 0"
            )
        return [int(wanted)]
    if not isinstance(wanted, str):
        raise OptionError(f"{argument}={wanted!r} must be a column's name or number")
    tests = (
        lambda name: name == wanted,
        lambda name: name.lower() == wanted.strip().lower(),
        lambda name: bool(name) and plain_name(name) == plain_name(wanted),
    )
    for fits in tests:
        found = [k for k, column in enumerate(columns) if fits(column.name)]
        if len(found) == 1:
            return found
        if found:
            raise OptionError(
                f"{argument}={wanted!r} matches {len(found)} columns of {table.path}; choose "
                f"by number from {table.listing()}"
            )
    # the channels of a matrix
    found = [k for k, column in enumerate(columns) if column.name.startswith(wanted + "[")]
    if not found:
        raise OptionError(f"{argument}={wanted!r}: {table.path} has {table.listing()}")
    return found


def named(table: Table, names: Iterable[str], taken: Iterable[int] = ()) -> list[int]:
    """Positions of the columns whose plain name is one of `names`."""
    wanted, used = set(names), set(taken)
    return [
        k
        for k, column in enumerate(table.columns)
        if k not in used and column.name and family(column.name) in wanted
    ]


def ambiguous(table: Table, found: Sequence[int], what: str, argument: str) -> OptionError:
    """Error for several columns of which one is needed."""
    return OptionError(
        f"{table.path} has {len(found)} columns that could be {what}; give {argument}=name or "
        f"number; it has {table.listing()}"
    )


def holds_numbers(table: Table, index: int) -> bool:
    """Whether a column contains numbers, even if some cells are bad."""
    cells = table.columns[index].first(100)
    if cells.dtype.kind in "biufc":
        return True
    return any(kind_of(str(cell).strip(), table.decimal) == "number" for cell in cells)


def has_header(table: Table) -> bool:
    """Whether the columns have names."""
    return any(column.name for column in table.columns)


def check_lengths(table: Table, indices: Iterable[int]) -> None:
    """Refuse arrays of different lengths, which text tables cannot have."""
    sizes = {k: table.columns[k].cells.size for k in indices}
    if len(set(sizes.values())) > 1:
        lengths = ", ".join(f"{table.title(k)} {size}" for k, size in sizes.items())
        raise DataError(f"{table.path}: the columns have different lengths: {lengths}")
