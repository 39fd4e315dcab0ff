"""MATLAB's ``.mat`` files of versions 4 to 7: numbers, structs and cells.

Read by hand because SciPy's reader, which is compiled, ends the process on damaged files (2 % of
files with three random changes; the type of an element is used as an index without a look). The
format is MathWorks' "MAT-File Format". Text, sparse matrices, objects and functions are skipped.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ...errors import FileFormatError
from ..checks import check_size, read_head
from ..tables import Table
from .arrays import AnyArray, table_of_arrays

_HEADER_BYTES = 128
_CHUNK = 1 << 20
_MAX_DEPTH = 8
_MAX_ARRAYS = 10_000
# an empty element takes eight bytes: a large file of zeros would be looked at for minutes
_MAX_ELEMENTS = 20 * _MAX_ARRAYS
_SPARE = 64

_MATRIX, _COMPRESSED = 14, 15
_TYPES = {
    1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8",
}  # fmt: skip
_CELL, _STRUCT = 1, 2
_CLASSES = {
    6: "f8", 7: "f4", 8: "i1", 9: "u1", 10: "i2", 11: "u2", 12: "i4", 13: "u4", 14: "i8", 15: "u8",
}  # fmt: skip
_COMPLEX = 0x0800
_OLD_TYPES = ("f8", "f4", "i4", "i2", "u2", "u1")


def read_mat(path: Path, *, variable: str | None, max_bytes: float) -> Table:
    """Read the numeric variables and struct fields of a ``.mat`` file as columns.

    Fields are named as in MATLAB: ``run.time``, ``run.signals[0].values``.

    Raises
    ------
    FileFormatError
        Version 7.3 (HDF5), damaged, too large when unpacked, or without numbers.
    """
    return table_of_arrays(path, mat_arrays(path, max_bytes), variable)


def mat_arrays(path: Path, max_bytes: float) -> dict[str, AnyArray]:
    """Read all numeric arrays of a ``.mat`` file, also those inside structs and cells."""
    head = read_head(path, _HEADER_BYTES)
    if head.startswith(b"MATLAB 7.3"):
        raise FileFormatError(
            f"{path} is a v7.3 (HDF5) .mat file: in MATLAB, save it with save(file, '-v7'), "
            "or write the signals as CSV"
        )
    order = {b"IM": "<", b"MI": ">"}.get(head[126:128])
    arrays: dict[str, AnyArray] = {}
    content = memoryview(path.read_bytes())
    try:
        if order is None:
            arrays.update(_old_variables(content))
        else:
            for element in _unpacked(path, content[_HEADER_BYTES:], order, max_bytes):
                _collect(element, order, arrays, "", _MAX_DEPTH)
    except _DamagedError as error:
        raise FileFormatError(f"{path} is no .mat file, or a damaged one: {error}") from error
    return arrays


class _DamagedError(Exception):
    """The bytes do not follow the format."""


def _elements(content: memoryview, order: str) -> Iterator[tuple[int, memoryview]]:
    """Give type and data of the elements that follow each other in `content`."""
    at = count = 0
    while at + 8 <= len(content):
        count += 1
        if count > _MAX_ELEMENTS:
            raise _DamagedError(f"more than {_MAX_ELEMENTS} elements in a row")
        kind, n_bytes = struct.unpack_from(order + "II", content, at)
        start = at + 8
        if kind >> 16:
            # small element: size and type share the first word, the data are the second
            kind, n_bytes, start = kind & 0xFFFF, kind >> 16, at + 4
            if n_bytes > 4:
                raise _DamagedError(f"a small element of {n_bytes} bytes")
        if start + n_bytes > len(content):
            raise _DamagedError(f"{n_bytes} bytes announced, {len(content) - start} left")
        yield kind, content[start : start + n_bytes]
        end = max(start + n_bytes, at + 8)
        at = end if kind == _COMPRESSED else -(-end // 8) * 8


def _unpacked(
    path: Path, content: memoryview, order: str, max_bytes: float
) -> Iterator[memoryview]:
    """Give the data of all variables; the packed ones are unpacked a piece at a time."""
    total = 0
    for kind, data in _elements(content, order):
        if kind == _MATRIX:
            yield data
        elif kind == _COMPRESSED:
            matrix = _unpack(path, data, order, max_bytes - total)
            total += len(matrix)
            yield matrix


def _unpack(path: Path, packed: memoryview, order: str, room: float) -> memoryview:
    """Unpack one matrix, as much as it says of its size; nothing if it is something else."""
    unpacker, content, size = zlib.decompressobj(), bytearray(), 0
    rest: bytes | memoryview = packed
    try:
        while not unpacker.eof and len(rest):
            content += unpacker.decompress(rest, min(_CHUNK, size + _SPARE - len(content)))
            rest = unpacker.unconsumed_tail
            if not size and len(content) >= 8:
                kind, announced = struct.unpack_from(order + "II", content)
                if kind != _MATRIX:
                    return memoryview(b"")
                size = 8 + announced
                check_size(path, size, room, ", unpacked,")
            if len(content) >= size + _SPARE:
                raise _DamagedError(f"more than the {size} bytes announced are packed")
    except zlib.error as error:
        raise _DamagedError(str(error)) from error
    if not unpacker.eof or len(content) < max(size, 8):
        raise _DamagedError("packed data end too early")
    return memoryview(content)[8:size]


def _collect(
    data: memoryview, order: str, arrays: dict[str, AnyArray], prefix: str, depth: int
) -> None:
    """Put the numbers in one matrix element, and in all that lies inside it, into `arrays`."""
    if not len(data):
        # how an empty field is written
        return
    if not depth or len(arrays) >= _MAX_ARRAYS:
        raise _DamagedError(f"more than {_MAX_ARRAYS} arrays, or {_MAX_DEPTH} levels of structs")
    parts = _elements(data, order)
    flags, *_ = _sizes(_next(parts), order)
    shape = _sizes(_next(parts), order)
    name = prefix or bytes(_next(parts)[1]).decode("ascii", "replace")
    if prefix:
        _next(parts)
    if min(shape) < 0:
        raise _DamagedError(f"the shape {shape}")
    kind, count = flags & 0xFF, math.prod(shape)
    if kind in _CLASSES and name:
        arrays[name] = _array(parts, flags, shape, order)
    elif kind == _CELL:
        for k, (_, cell) in zip(range(count), parts, strict=False):
            _collect(cell, order, arrays, f"{name}[{k}]", depth - 1)
    elif kind == _STRUCT:
        fields = _field_names(parts, order)
        for k in range(count if fields else 0):
            place = name if count == 1 else f"{name}[{k}]"
            for field in fields:
                _collect(_next(parts)[1], order, arrays, f"{place}.{field}", depth - 1)


def _array(
    parts: Iterator[tuple[int, memoryview]], flags: int, shape: list[int], order: str
) -> AnyArray:
    stored, kind = _numbers(_next(parts), order), _CLASSES[flags & 0xFF]
    if stored.dtype.kind == "f" and "f" not in kind:
        raise _DamagedError("whole numbers stored as fractions")
    values: AnyArray = stored.astype(kind)
    if flags & _COMPLEX:
        imaginary = _numbers(_next(parts), order)
        if imaginary.size != values.size:
            raise _DamagedError("real and imaginary parts of different lengths")
        values = _complex(values, imaginary)
    if values.size != math.prod(shape):
        raise _DamagedError(f"{values.size} numbers for the shape {shape}")
    return values.reshape(shape, order="F")


def _complex(real: AnyArray, imaginary: AnyArray) -> AnyArray:
    # not real + 1j * imaginary, which makes NaN of an infinite part
    values = np.empty(real.shape, dtype=np.complex128)
    values.real, values.imag = real, imaginary
    return values


def _field_names(parts: Iterator[tuple[int, memoryview]], order: str) -> list[str]:
    length, *_ = _sizes(_next(parts), order)
    names = bytes(_next(parts)[1])
    if length < 1 or len(names) > 64 * _MAX_ARRAYS:
        raise _DamagedError(f"names of fields with {length} letters")
    cut = [names[k : k + length] for k in range(0, len(names), length)]
    return [name.partition(b"\0")[0].decode("ascii", "replace") for name in cut]


def _next(parts: Iterator[tuple[int, memoryview]]) -> tuple[int, memoryview]:
    part = next(parts, None)
    if part is None:
        raise _DamagedError("a part is missing")
    return part


def _numbers(part: tuple[int, memoryview], order: str) -> AnyArray:
    kind, data = part
    dtype = np.dtype(order + _TYPES[kind]) if kind in _TYPES else None
    if dtype is None or len(data) % dtype.itemsize:
        raise _DamagedError(f"{len(data)} bytes of type {kind}")
    return np.frombuffer(data, dtype)


def _sizes(part: tuple[int, memoryview], order: str) -> list[int]:
    numbers = _numbers(part, order)
    if not numbers.size or numbers.dtype.kind == "f":
        raise _DamagedError("sizes are missing")
    return [int(number) for number in numbers]


def _old_variables(content: memoryview) -> Iterator[tuple[str, AnyArray]]:
    """Give the numeric matrices of a version 4 file, which is headers and numbers in turn."""
    at = 0
    while at < len(content):
        if at + 20 > len(content):
            raise _DamagedError("a header is cut off")
        order = "<" if struct.unpack_from("<i", content, at)[0] in range(5000) else ">"
        kind, rows, columns, imaginary, letters = struct.unpack_from(order + "5i", content, at)
        digits = f"{kind:04d}"
        plausible = (
            0 <= kind < 5000
            and digits[0] == ("0" if order == "<" else "1")
            and digits[1] == "0"
            and int(digits[2]) < len(_OLD_TYPES)
            and min(rows, columns) >= 0
            and imaginary in (0, 1)
            and 1 <= letters <= 1000
        )
        if not plausible:
            raise _DamagedError(f"no header at byte {at}")
        dtype = np.dtype(order + _OLD_TYPES[int(digits[2])])
        start = at + 20 + letters
        at = start + rows * columns * dtype.itemsize * (1 + imaginary)
        if at > len(content):
            raise _DamagedError(f"{at - start} bytes announced, {len(content) - start} left")
        name = bytes(content[start - letters : start]).rstrip(b"\0").decode("ascii", "replace")
        numbers: AnyArray = np.frombuffer(content[start:at], dtype)
        if imaginary:
            numbers = _complex(*np.split(numbers, 2))
        if digits[3] == "0":
            yield name, numbers.reshape(rows, columns, order="F")
