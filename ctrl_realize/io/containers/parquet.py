"""Parquet tables, if pyarrow is installed; columns are read on demand."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import FileFormatError
from ..checks import MAX_COLUMNS, MAX_NAME, check_size, package_for, told_if_damaged, unpacked_limit
from ..tables import Column, Table
from ..units import unit_of

if TYPE_CHECKING:
    import pyarrow as pa

AnyArray = np.ndarray[Any, np.dtype[Any]]

_KIND = "Parquet file"
_OBJECT_BYTES = 64
"""Memory of a cell that becomes a Python object: a pointer and a small object."""


class LateColumn(Column):
    """A column that is read on demand; its first cells can be read before."""

    def __init__(self, name: str, load: Callable[[int | None], AnyArray]) -> None:
        object.__setattr__(self, "name", name)
        object.__setattr__(self, "unit", unit_of(name))
        object.__setattr__(self, "_load", load)

    @cached_property
    def cells(self) -> AnyArray:
        """All cells."""
        return self._load(None)  # type: ignore[attr-defined, no-any-return]

    def first(self, count: int) -> AnyArray:
        """Return the first cells without reading the others."""
        return self._load(count)  # type: ignore[attr-defined, no-any-return]


def read_parquet(path: Path, *, max_bytes: float, variable: str | None = None) -> Table:
    """Find the columns of a Parquet file; their cells are read on demand.

    All columns together may take `max_bytes`, and at most a thousand times the size of the file:
    runs of equal values are packed so well that a few kB may fill any memory.

    Raises
    ------
    FileFormatError
        pyarrow is not installed, or the file is damaged, or too large when unpacked.
    """
    with package_for(path, "a Parquet file", "parquet", "pyarrow"):
        import pyarrow.parquet as pq
    with told_if_damaged(path, _KIND), pq.ParquetFile(path) as file:
        fields = list(file.schema_arrow)
        if len(fields) > MAX_COLUMNS:
            raise FileFormatError(f"{path} has {len(fields)} columns, the limit is {MAX_COLUMNS}")
    if not fields:
        raise FileFormatError(f"{path} has no columns")
    reader = _Reader(path, unpacked_limit(path, max_bytes))
    columns = tuple(
        LateColumn(str(field.name)[:MAX_NAME], partial(reader.load, field)) for field in fields
    )
    return Table(path, columns)


class _Reader:
    """Reads columns of one file, within the limit for all of them."""

    def __init__(self, path: Path, limit: float) -> None:
        self.path = path
        self.limit = limit
        self.taken = 0

    def load(self, field: pa.Field, count: int | None) -> AnyArray:
        """Return the first `count` cells of a column, or all."""
        import pyarrow.parquet as pq

        kind = _kind(field.type)
        if kind == "other":
            if count is not None:
                return _NOTHING
            raise FileFormatError(
                f"{self.path}: column {field.name!r} holds {str(field.type)[:60]} values; "
                "expected numbers or times"
            )
        # equal texts are stored once
        once = [field.name] if kind == "text" else None
        safely = told_if_damaged(self.path, _KIND)
        with safely, pq.ParquetFile(self.path, read_dictionary=once) as file:
            if [one.name for one in file.schema_arrow].count(field.name) > 1:
                raise FileFormatError(f"{self.path} has several columns {field.name!r}")
            if count is not None:
                parts = file.iter_batches(count, columns=[field.name], use_threads=False)
                return next((_cells(part.column(0)) for part in parts), _NOTHING)
            self._take(file, field, kind)
            return _cells(file.read(columns=[field.name], use_threads=False).column(0))

    def _take(self, file: Any, field: pa.Field, kind: str) -> None:
        """Refuse a column that exceeds the limit."""
        groups = [file.metadata.row_group(k) for k in range(file.metadata.num_row_groups)]
        packed = sum(
            group.column(k).total_uncompressed_size
            for group in groups
            for k in range(group.num_columns)
            if group.column(k).path_in_schema.split(".")[0] == field.name
        )
        each = 8 if kind == "number" else _OBJECT_BYTES
        self.taken += max(packed, each * file.metadata.num_rows)
        check_size(self.path, self.taken, self.limit, ", unpacked,")


_NOTHING = np.empty(0, dtype=object)


def _cells(values: Any) -> AnyArray:
    """Convert a column of Arrow to an array; integers with gaps become floats with NaN."""
    import pandas as pd
    import pyarrow as pa
    import pyarrow.types as kinds

    if kinds.is_decimal(values.type):
        values = values.cast(pa.float64())
    found = values.to_pandas()
    if not kinds.is_dictionary(values.type):
        return np.asarray(found)
    # one object for all cells with the same text; the last entry is for empty cells
    texts = pd.Categorical(found)
    cells: AnyArray = np.array([*texts.categories, None], dtype=object)[texts.codes]
    return cells


def _kind(of: pa.DataType) -> str:
    """Kind of the values of a type: a "number", an "object", "text" or "other"."""
    import pyarrow.types as kinds

    if kinds.is_dictionary(of):
        return "object" if _kind(of.value_type) in ("number", "text") else "other"
    if kinds.is_integer(of) or kinds.is_floating(of) or kinds.is_timestamp(of):
        return "number"
    if kinds.is_string(of) or kinds.is_large_string(of):
        return "text"
    plain = (kinds.is_boolean, kinds.is_null, kinds.is_temporal, kinds.is_decimal)
    return "object" if any(one(of) for one in plain) else "other"
