"""Names for the arrays that kernels take and return, and what is done to many of them."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

FloatArray: TypeAlias = NDArray[np.float64]
ComplexArray: TypeAlias = NDArray[np.complex128]
IntArray: TypeAlias = NDArray[np.int64]


def read_only(values: FloatArray) -> FloatArray:
    """Copy an array and lock the copy, so that a result cannot change under its owner."""
    locked = np.array(values, dtype=np.float64)
    locked.flags.writeable = False
    return locked
