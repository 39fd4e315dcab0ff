"""Columns from files of any type, before they are assigned to signals."""

from __future__ import annotations

import os
from dataclasses import replace
from importlib import import_module
from typing import cast

from ..errors import FileFormatError
from .checks import read_head, usable_file
from .containers.excel import is_workbook, sheet_as_text
from .tables import Table
from .text.delimited import read_delimited
from .text.source import TextSource, keyed_as_table
from .text_options import TextOptions

_NOT_READABLE = {
    b"\xd0\xcf\x11\xe0": "an old Excel workbook (.xls): save it as .xlsx or CSV",
    b"\x1f\x8b": "compressed with gzip: unpack it first",
    b"BZh": "compressed with bzip2: unpack it first",
    b"\xfd7zXZ": "compressed with xz: unpack it first",
    b"7z\xbc\xaf": "a 7z archive: unpack it first",
    b"\x80\x04\x95": "a Python pickle: these can run code when read and are refused",
    b"%PDF": "a PDF document",
}
_READERS = {
    "npz:read_npz": (b"PK\x03\x04", b"\x93NUMPY"),
    "parquet:read_parquet": (b"PAR1",),
    "tdms:read_tdms": (b"TDSm",),
    "mat:read_mat": (b"MATLAB 5.0 MAT-file", b"MATLAB 7.3 MAT-file", b"\x89HDF"),
}
"""Readers by the first bytes of a file; each needs its own heavy library, loaded on demand."""


def read_table(
    path: str | os.PathLike[str], options: TextOptions, *, variable: str | None, max_bytes: float
) -> Table:
    """Read the columns of a text, Excel, ``.npz``, ``.mat``, Parquet, HDF5 or TDMS file.

    The type is determined from the first bytes; the file name only matters for the oldest ``.mat``
    files, which have no signature.

    Parameters
    ----------
    path : path-like
    options : TextOptions
        Format of text.
    variable : str or None
        The only variable of a ``.mat`` or ``.npz`` file (a matrix or a struct), group of an HDF5 or
        TDMS file, or sheet of a workbook to use.
    max_bytes : float
        Largest size, in the file and unpacked.

    Raises
    ------
    MissingFileError, FileFormatError, DataError
    """
    file = usable_file(path, max_bytes)
    head = read_head(file, 128)
    for mark, what in _NOT_READABLE.items():
        if head.startswith(mark):
            raise FileFormatError(f"{file} is {what}")
    if head.startswith(b"PK\x03\x04") and is_workbook(file):
        sheet = sheet_as_text(file, variable, options, max_bytes)
        plain = replace(options, delimiter="\t", decimal=".", encoding="utf-8", comment=None)
        return read_delimited(sheet, plain)
    kind = next((kind for kind, marks in _READERS.items() if head.startswith(marks)), "")
    if kind or file.suffix.lower() == ".mat":
        module, name = (kind or "mat:read_mat").split(":")
        reader = getattr(import_module(f".containers.{module}", __package__), name)
        return cast("Table", reader(file, variable=variable, max_bytes=max_bytes))
    return read_delimited(keyed_as_table(TextSource(file)), options)
