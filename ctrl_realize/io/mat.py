"""MATLAB's ``.mat`` files up to v7, read by SciPy."""

from __future__ import annotations

import math
import struct
import warnings
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import FileFormatError
from .arrays import AnyArray, table_of_arrays
from .checks import check_size, read_head
from .tables import Table

_CHUNK = 1 << 20
_MI_COMPRESSED = 15
_MAX_DEPTH = 5


def read_mat(path: Path, *, variable: str | None, max_bytes: float) -> Table:
    """Read the numeric variables and struct fields of a ``.mat`` file as columns.

    Fields are named as in MATLAB: ``run.time``, ``run.signals[0].values``.

    Raises
    ------
    FileFormatError
        Version 7.3 (HDF5), damaged, too large when unpacked, or without numbers.
    """
    import scipy.io

    head = read_head(path, 128)
    if head.startswith(b"MATLAB 7.3"):
        raise FileFormatError(
            f"{path} is a v7.3 (HDF5) .mat file: in MATLAB, save it with save(file, '-v7'), "
            "or write the signals as CSV"
        )
    _check_unpacked_size(path, head, max_bytes)
    try:
        with warnings.catch_warnings():
            # what SciPy has to say about odd variables is said below, if they are needed
            warnings.simplefilter("ignore")
            for name, shape, _ in scipy.io.whosmat(path, appendmat=False):
                check_size(path, 8 * math.prod(shape), max_bytes, f" ({name})")
            content = scipy.io.loadmat(
                path, appendmat=False, squeeze_me=True, struct_as_record=False
            )
    except FileFormatError:
        raise
    # SciPy's parser meets broken input with every kind of exception that Python has
    except Exception as error:
        reason = str(error).partition("\n")[0][:200]
        raise FileFormatError(f"{path} is no .mat file, or a damaged one: {reason}") from error
    arrays: dict[str, AnyArray] = {}
    for name, value in content.items():
        if not name.startswith("__"):
            _flatten(name, value, arrays, _MAX_DEPTH)
    return table_of_arrays(path, arrays, variable)


def _flatten(name: str, value: Any, arrays: dict[str, AnyArray], depth: int) -> None:
    """Collect arrays from structs, and from arrays and cells of structs."""
    fields = getattr(value, "_fieldnames", None)
    if fields is not None:
        if depth:
            for field in fields:
                _flatten(f"{name}.{field}", getattr(value, field), arrays, depth - 1)
        return
    array = np.asarray(value)
    if array.dtype.hasobject:
        if depth and array.dtype == np.dtype(object) and array.ndim == 1 and array.size <= 100:
            for k, entry in enumerate(array):
                _flatten(f"{name}[{k}]", entry, arrays, depth - 1)
        return
    arrays[name] = array


def _check_unpacked_size(path: Path, head: bytes, max_bytes: float) -> None:
    """Add up what the compressed variables unpack to, a piece at a time."""
    order = {b"IM": "<", b"MI": ">"}.get(head[126:128])
    if order is None:
        return
    total = 0
    with path.open("rb") as file:
        file.seek(128)
        while len(tag := file.read(8)) == 8:
            kind, n_bytes = struct.unpack(order + "II", tag)
            if kind != _MI_COMPRESSED:
                file.seek(n_bytes, 1)
                continue
            unpacker = zlib.decompressobj()
            end = file.tell() + n_bytes
            try:
                while file.tell() < end and (chunk := file.read(min(_CHUNK, end - file.tell()))):
                    while chunk:
                        total += len(unpacker.decompress(chunk, _CHUNK))
                        check_size(path, total, max_bytes, ", unpacked,")
                        chunk = unpacker.unconsumed_tail
            except zlib.error as error:
                raise FileFormatError(f"{path} is a damaged .mat file: {error}") from error
            file.seek(end)
