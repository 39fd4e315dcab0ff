"""Program that reads one ``.mat`` or HDF5 file and writes its arrays to stdout as ``.npz``.

``python mat_worker.py FILE MAX_BYTES``; the arrays are ``arr_0``, ``arr_1``, ... of ``names``. It
imports nothing from this package, so that it starts quickly.
"""

from __future__ import annotations

import io
import sys
from collections.abc import Iterator
from typing import Any

import numpy as np

_MAX_DEPTH = 8
_OWN_MEMORY = 2**30  # address space of the process itself; 0.2 GiB were measured
_COPIES = 4  # of the data, with those of the libraries: what is read, written and copied


class RefusedError(ValueError):
    """The file is not damaged, but asks for what is not done."""


class _HDF5:
    """Reads members of one HDF5 file, in this file alone and within a limit for all of them."""

    def __init__(self, limit: float) -> None:
        self.left = self.limit = limit

    def member(self, group: Any, name: str) -> Any:
        """Return a member of a group, which is no link to another file."""
        import h5py

        if isinstance(group.get(name, getlink=True), h5py.ExternalLink):
            raise RefusedError(_elsewhere(f"{name!r} is a link to another file"))
        return group[name]

    def load(self, dataset: Any, field: str = "") -> Any:
        """Read a dataset, or a field of it; a file may announce sizes that take no room in it."""
        if dataset.is_virtual or dataset.external:
            kind = "virtual" if dataset.is_virtual else "stored outside"
            raise RefusedError(_elsewhere(f"the dataset {dataset.name!r} is {kind}"))
        kind = dataset.dtype[field] if field else dataset.dtype
        self.left -= (dataset.size or 0) * kind.itemsize
        if self.left < 0:
            raise RefusedError(_too_large(self.limit))
        return dataset[field] if field else dataset[()]


def _elsewhere(what: str) -> str:
    return f"{what}; other files are not opened: copy the data into this one, by h5py for instance"


def _too_large(limit: float) -> str:
    return f"unpacked, it has more than max_bytes={limit:.0f}, or a thousand times its size"


def arrays_of(path: str, limit: float) -> Iterator[tuple[str, Any]]:
    """Yield name and values of every numeric array, including those in structs and cells."""
    with open(path, "rb") as file:
        head = file.read(10)
    if head.startswith((b"MATLAB 7.3", b"\x89HDF")):
        import h5py

        with h5py.File(path, "r") as hdf5:
            reader = _HDF5(limit)
            if head.startswith(b"\x89HDF"):
                yield from _datasets(reader, "", hdf5, _MAX_DEPTH)
                return
            for name in hdf5:
                if not name.startswith("#"):
                    value = reader.member(hdf5, name)
                    yield from _inside_hdf5(reader, hdf5, name, value, _MAX_DEPTH)
        return
    import scipy.io

    # not mat_dtype=True, which discards the imaginary part of complex numbers
    content = scipy.io.loadmat(path, struct_as_record=False)
    for name, value in content.items():
        if not name.startswith("__"):
            yield from _inside(name, value, _MAX_DEPTH)


def _inside(name: str, value: Any, depth: int) -> Iterator[tuple[str, Any]]:
    """Yield the arrays inside a value of SciPy's reader."""
    if depth == 0:
        raise ValueError(f"more than {_MAX_DEPTH} levels of structs")
    # a struct of SciPy's reader is recognised by this attribute; its class is private
    fields = getattr(value, "_fieldnames", None)
    if fields is not None:
        for field in fields:
            yield from _inside(f"{name}.{field}", getattr(value, field), depth - 1)
    elif type(value) is np.ndarray and value.dtype.hasobject and value.dtype.names is None:
        for k, entry in enumerate(value.ravel(order="F")):
            single = value.size == 1 and hasattr(entry, "_fieldnames")
            yield from _inside(name if single else f"{name}[{k}]", entry, depth - (not single))
    elif type(value) is np.ndarray and value.dtype.kind in "biufc":
        # MATLAB stores doubles in the smallest type that represents them; 64-bit integers are kept
        small = value.dtype.kind in "biu" and value.dtype.itemsize < 8
        yield name, value.astype(np.float64) if small else value


def _inside_hdf5(
    reader: _HDF5, file: Any, name: str, value: Any, depth: int
) -> Iterator[tuple[str, Any]]:
    """Yield the arrays inside a variable of version 7.3, which stores rows as columns."""
    import h5py

    if depth == 0:
        raise ValueError(f"more than {_MAX_DEPTH} levels of structs")
    kind = value.attrs.get("MATLAB_class", b"double")
    if isinstance(value, h5py.Group):
        fields = {} if "MATLAB_sparse" in value.attrs else value
        for field in fields:
            inner = reader.member(value, field)
            if (
                isinstance(inner, h5py.Dataset)
                and inner.dtype == h5py.ref_dtype
                and "MATLAB_class" not in inner.attrs
            ):
                # a struct array contains, for each field, references to the values of its entries
                for k, reference in enumerate(reader.load(inner).ravel()):
                    place = f"{name}[{k}].{field}"
                    yield from _inside_hdf5(reader, file, place, file[reference], depth - 1)
            else:
                yield from _inside_hdf5(reader, file, f"{name}.{field}", inner, depth - 1)
    elif kind == b"cell" and value.dtype == h5py.ref_dtype:
        for k, reference in enumerate(reader.load(value).ravel()):
            yield from _inside_hdf5(reader, file, f"{name}[{k}]", file[reference], depth - 1)
    elif kind != b"char" and not value.attrs.get("MATLAB_empty", 0):
        numbers = reader.load(value)
        if numbers.dtype.names == ("real", "imag"):
            numbers = numbers["real"] + 1j * numbers["imag"]
        if numbers.dtype.kind in "biufc":
            yield name, numbers.T


def _datasets(reader: _HDF5, name: str, group: Any, depth: int) -> Iterator[tuple[str, Any]]:
    """Yield the numbers and texts of a group of HDF5, with units from the attributes."""
    import h5py

    if depth == 0:
        raise ValueError(f"more than {_MAX_DEPTH} levels of groups")
    for key in group:
        value = reader.member(group, key)
        place = f"{name}.{key}" if name else str(key)
        if isinstance(value, h5py.Group):
            yield from _datasets(reader, place, value, depth - 1)
        elif isinstance(value, h5py.Dataset) and value.shape:
            unit = value.attrs.get("units", value.attrs.get("unit", b""))
            unit = unit.decode("utf-8", "replace") if isinstance(unit, bytes) else str(unit)
            for field in value.dtype.names or ("",):
                cells = reader.load(value, field)
                if cells.dtype.kind in "OS" and h5py.check_string_dtype(cells.dtype):
                    cells = np.array([_text(one) for one in cells.ravel()], dtype=str)
                if cells.dtype.kind in "biufcU":
                    called = ".".join(part for part in (place, field) if part)
                    yield called + (f" [{unit}]" if unit and not field else ""), cells
        elif isinstance(value, h5py.Dataset) and value.dtype.kind in "iuf":
            yield place, reader.load(value)


def _text(value: Any) -> str:
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)


def main(path: str, max_bytes: float) -> None:
    """Write all arrays; any error of a damaged file ends the process with its last line."""
    try:
        import resource

        # lengths of texts and of parts of a damaged file are not known before they are read
        most = int(_COPIES * max_bytes + _OWN_MEMORY)
        resource.setrlimit(resource.RLIMIT_AS, (most, most))
    except (ImportError, ValueError, OverflowError, OSError):
        pass  # a system without such limits
    names, values, size = [], [], 0.0
    for name, value in arrays_of(path, max_bytes):
        size += value.nbytes
        if size > max_bytes:
            raise RefusedError(_too_large(max_bytes))
        names.append(name)
        values.append(value)
    content = io.BytesIO()
    np.savez(content, *values, names=np.array(names, dtype=str))
    sys.stdout.buffer.write(content.getbuffer())


if __name__ == "__main__":
    main(sys.argv[1], float(sys.argv[2]))
