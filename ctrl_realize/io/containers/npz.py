"""NumPy's ``.npz`` and ``.npy``, without pickles and decompression bombs."""

from __future__ import annotations

import math
import zipfile
from pathlib import Path
from typing import IO, Any

import numpy as np

from ...errors import FileFormatError
from ..checks import check_size, told_if_damaged
from ..tables import Table
from .arrays import AnyArray, table_of_arrays

MAX_ARRAYS = 1000


def read_npz(path: Path, *, variable: str | None, max_bytes: float) -> Table:
    """Read the arrays of an ``.npz`` (or the one of an ``.npy``) as columns.

    Sizes are read from the headers and checked before an array is unpacked; arrays of Python
    objects, which would need pickle, are refused.

    Raises
    ------
    FileFormatError
    """
    with told_if_damaged(path, ".npz or .npy file"):
        if zipfile.is_zipfile(path):
            arrays = _members(path, max_bytes)
        else:
            with path.open("rb") as file:
                arrays = {path.stem: _array(path, file, "", path.stat().st_size, max_bytes)}
    fields = {
        f"{name}.{key}" if key else name: array[key] if key else array
        for name, array in arrays.items()
        for key in (array.dtype.names or ("",))
    }
    return table_of_arrays(path, fields, variable)


def _members(path: Path, max_bytes: float) -> dict[str, AnyArray]:
    arrays: dict[str, AnyArray] = {}
    with zipfile.ZipFile(path) as archive:
        members = archive.infolist()
        if not any(member.filename.endswith(".npy") for member in members):
            raise FileFormatError(f"{path} is a zip file without arrays: unpack it first")
        if len(members) > MAX_ARRAYS:
            raise FileFormatError(f"{path} has {len(members)} arrays, the limit is {MAX_ARRAYS}")
        check_size(path, sum(member.file_size for member in members), max_bytes, ", unpacked,")
        for member in members:
            if member.filename.endswith(".npy"):
                name = member.filename.removesuffix(".npy")
                with archive.open(member) as file:
                    arrays[name] = _array(path, file, f" ({name})", member.file_size, max_bytes)
    return arrays


def _array(path: Path, file: IO[bytes], what: str, size: int, max_bytes: float) -> AnyArray:
    """Read one array whose data fit into the available `size` bytes."""
    version = np.lib.format.read_magic(file)
    read_header: Any = {
        (1, 0): np.lib.format.read_array_header_1_0,
        (2, 0): np.lib.format.read_array_header_2_0,
    }.get(version)
    if read_header is None:
        raise FileFormatError(
            f"{path}{what} has version {version} of the .npy format; expected 1 or 2"
        )
    shape, fortran, dtype = read_header(file)
    if dtype.hasobject:
        raise FileFormatError(
            f"{path}{what} holds Python objects, which can run code when read; save plain numbers"
        )
    n_bytes = math.prod(shape) * dtype.itemsize
    check_size(path, n_bytes, max_bytes, what)
    if n_bytes > size:
        raise FileFormatError(f"{path}{what} is truncated: {n_bytes} bytes expected, got {size}")
    flat = np.frombuffer(file.read(n_bytes), dtype=dtype)
    return flat.reshape(shape, order="F" if fortran else "C")
