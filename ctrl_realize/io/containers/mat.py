"""MATLAB's ``.mat`` files: numbers, structs and cells, by SciPy; HDF5 and version 7.3 by h5py.

Both are compiled readers that a damaged file can crash: they run in a separate process, so that
such a file gives an error.
"""

from __future__ import annotations

import io
import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from ...errors import FileFormatError
from ..checks import read_head, unpacked_limit
from ..tables import Table
from .arrays import AnyArray, table_of_arrays

_WORKER = Path(__file__).with_name("mat_worker.py")
_TIMEOUT = 600.0  # s


def read_mat(path: Path, *, variable: str | None, max_bytes: float) -> Table:
    """Read the numbers of a ``.mat`` or HDF5 file as columns.

    Variables and fields are named as in MATLAB, ``run.time``, ``run.signals[0].values``, and
    datasets of HDF5 ``group.dataset``. Text, sparse matrices, objects and functions are left out.
    The fields of a compound dataset are columns; an attribute ``unit`` or ``units`` is the unit.

    Raises
    ------
    FileFormatError
        Damaged, too large when unpacked, without numbers, or h5py is needed and not installed.
    """
    head = read_head(path, 128)
    plain = head.startswith(b"\x89HDF")
    if not plain and head[126:128] not in (b"IM", b"MI") and not _is_version_4(head):
        raise FileFormatError(f"{path} is not a .mat file: it does not begin like one")
    kind = "an HDF5 file" if plain else "a .mat file"
    if plain or head.startswith(b"MATLAB 7.3"):
        # not imported here: its compiled part reads in a process of its own
        if find_spec("h5py") is None:
            found, extra = (kind, "hdf5") if plain else ("a v7.3 (HDF5) .mat file", "matlab")
            raise FileFormatError(
                f"{path} is {found}: pip install 'ctrl-realize[{extra}]' (h5py) to read it, or "
                "save it as .mat (in MATLAB with save(file, '-v7')), .npz, Parquet or CSV"
            )
        # HDF5 announces sizes that take no room in the file
        max_bytes = unpacked_limit(path, max_bytes)
    return table_of_arrays(path, _by_worker(path, max_bytes, kind), variable)


def _by_worker(path: Path, max_bytes: float, kind: str) -> dict[str, AnyArray]:
    """Read all arrays, those in structs and cells included, in a separate process."""
    try:
        done = subprocess.run(
            [sys.executable, "-P", str(_WORKER), str(path), str(max_bytes)],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=_TIMEOUT,
            env=os.environ | {"OPENBLAS_NUM_THREADS": "1"},
            check=False,
        )
    except subprocess.TimeoutExpired as error:
        raise FileFormatError(f"{path} could not be read within {_TIMEOUT:g} s") from error
    if done.returncode:
        words = done.stderr.decode("utf-8", "replace").strip().splitlines()
        if words and (refused := words[-1].partition("RefusedError: ")[2]) and done.returncode > 0:
            raise FileFormatError(f"{path}: {refused[:300]}")
        # a negative code is the signal that terminated the reader
        reason = words[-1][:300] if words and done.returncode > 0 else "its reader crashed"
        raise FileFormatError(
            f"{path} is not {kind}, or a damaged one: {reason}; expected a file that "
            f"{'h5py' if 'HDF5' in kind else 'SciPy'} opens, or .mat, .npz, Parquet, Excel or CSV"
        )
    with np.load(io.BytesIO(done.stdout), allow_pickle=False) as found:
        return {str(name): found[f"arr_{k}"] for k, name in enumerate(found["names"])}


def _is_version_4(head: bytes) -> bool:
    """Whether a file begins with type, size and name length of a matrix of version 4."""
    for order in ("<i4", ">i4") if len(head) >= 20 else ():
        kind, rows, columns, imaginary, letters = np.frombuffer(head[:20], order)
        if 0 <= kind < 5000 and min(rows, columns) >= 0 and imaginary in (0, 1) and letters > 0:
            return True
    return False
