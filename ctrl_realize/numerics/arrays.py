"""Names for the arrays that kernels take and return, and what is done to many of them."""

from __future__ import annotations

from typing import TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

FloatArray: TypeAlias = NDArray[np.float64]
ComplexArray: TypeAlias = NDArray[np.complex128]
IntArray: TypeAlias = NDArray[np.int64]
BoolArray: TypeAlias = NDArray[np.bool_]

Entry = TypeVar("Entry", bound=np.generic)


def read_only(values: FloatArray) -> FloatArray:
    """Copy real numbers and lock the copy, so that a result cannot change under its owner."""
    return locked(np.asarray(values, dtype=np.float64))


def locked(values: NDArray[Entry]) -> NDArray[Entry]:
    """Copy an array of any kind and lock the copy."""
    kept = np.array(values)
    kept.flags.writeable = False
    return kept
