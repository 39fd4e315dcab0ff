"""MATLAB's ``.mat`` files: numbers, structs and cells, by SciPy; by h5py for version 7.3.

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
from ..checks import read_head
from ..tables import Table
from .arrays import AnyArray, table_of_arrays

_WORKER = Path(__file__).with_name("mat_worker.py")
_TIMEOUT = 600.0  # s


def read_mat(path: Path, *, variable: str | None, max_bytes: float) -> Table:
    """Read the numeric variables and struct fields of a ``.mat`` file as columns.

    Fields are named as in MATLAB: ``run.time``, ``run.signals[0].values``. Text, sparse matrices,
    objects and functions are left out.

    Raises
    ------
    FileFormatError
        Damaged, too large when unpacked, without numbers, or version 7.3 without h5py.
    """
    return table_of_arrays(path, _arrays(path, max_bytes), variable)


def _arrays(path: Path, max_bytes: float) -> dict[str, AnyArray]:
    """Read all numeric arrays of a ``.mat`` file, including those in structs and cells."""
    head = read_head(path, 128)
    if head[126:128] not in (b"IM", b"MI") and not _is_version_4(head):
        raise FileFormatError(f"{path} is not a .mat file: it does not begin like one")
    if head.startswith(b"MATLAB 7.3") and find_spec("h5py") is None:
        raise FileFormatError(
            f"{path} is a v7.3 (HDF5) .mat file: pip install 'ctrl-realize[matlab]' (h5py) to "
            "read it, or in MATLAB save it with save(file, '-v7')"
        )
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
        # a negative code is the signal that terminated the reader
        reason = words[-1][:300] if words and done.returncode > 0 else "its reader crashed"
        raise FileFormatError(f"{path} is not a .mat file, or a damaged one: {reason}")
    with np.load(io.BytesIO(done.stdout), allow_pickle=False) as found:
        return {str(name): found[f"arr_{k}"] for k, name in enumerate(found["names"])}


def _is_version_4(head: bytes) -> bool:
    """Whether a file begins with type, size and name length of a matrix of version 4."""
    words = head[:20]
    for order in ("<i4", ">i4"):
        if len(words) == 20:
            kind, rows, columns, imaginary, letters = np.frombuffer(words, order)
            if 0 <= kind < 5000 and min(rows, columns) >= 0 and imaginary in (0, 1) and letters > 0:
                return True
    return False
