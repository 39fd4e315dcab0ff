"""Parquet tables, where pyarrow is installed."""

from __future__ import annotations

from pathlib import Path

from ..errors import FileFormatError
from .checks import MAX_COLUMNS, MAX_NAME, check_size
from .tables import Column, Table
from .units import split_unit


def read_parquet(path: Path, *, max_bytes: float) -> Table:
    """Read the columns of a Parquet file.

    Raises
    ------
    FileFormatError
        If pyarrow is missing, the file is damaged, or too large when unpacked.
    """
    try:
        import pyarrow.parquet as pq
    except ImportError as error:
        raise FileFormatError(
            f"{path} is a Parquet file; reading it needs pyarrow: pip install pyarrow"
        ) from error
    try:
        with pq.ParquetFile(path) as file:
            size = sum(
                file.metadata.row_group(k).total_byte_size
                for k in range(file.metadata.num_row_groups)
            )
            # runs of equal values pack so well that the number of cells has to be looked at too
            cells = 8 * file.metadata.num_rows * file.metadata.num_columns
            check_size(path, max(size, cells), max_bytes, ", unpacked,")
            if file.metadata.num_columns > MAX_COLUMNS:
                raise FileFormatError(
                    f"{path} has {file.metadata.num_columns} columns, "
                    f"at most {MAX_COLUMNS} are read"
                )
            # without what pandas noted about its index: a named one is a column like any other
            frame = file.read().to_pandas(ignore_metadata=True)
    except FileFormatError:
        raise
    # damaged metadata end in every kind of exception, ArrowException and TypeError among them
    except Exception as error:
        reason = str(error).partition("\n")[0][:200]
        raise FileFormatError(f"{path} is a damaged Parquet file: {reason}") from error
    columns = tuple(
        Column(
            str(name)[:MAX_NAME], split_unit(str(name)[:MAX_NAME])[1], frame.iloc[:, k].to_numpy()
        )
        for k, name in enumerate(frame.columns)
    )
    if not columns:
        raise FileFormatError(f"{path} has no columns")
    return Table(path, columns)
