"""Types of the arrays in the kernels, and common operations on them."""

from __future__ import annotations

from typing import TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

FloatArray: TypeAlias = NDArray[np.float64]
ComplexArray: TypeAlias = NDArray[np.complex128]
IntArray: TypeAlias = NDArray[np.int64]
BoolArray: TypeAlias = NDArray[np.bool_]
Matrices: TypeAlias = tuple[FloatArray, FloatArray, FloatArray, FloatArray]
"""A, B, C and D of a state-space model."""

Entry = TypeVar("Entry", bound=np.generic)


def read_only(values: FloatArray) -> FloatArray:
    """Copy real numbers to a read-only array."""
    return locked(np.asarray(values, dtype=np.float64))


def lock_fields(result: object, *names: str) -> None:
    """Make fields of a frozen dataclass, real numbers, read-only copies of what was given."""
    for name in names:
        object.__setattr__(result, name, read_only(getattr(result, name)))


def unit_columns(columns: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Columns (N, k) of norm 1, zero columns unchanged, and their norms (k,)."""
    norm = np.linalg.norm(columns, axis=0)
    norm[norm == 0] = 1.0
    return columns / norm, norm


def without_gaps(values: FloatArray) -> FloatArray:
    """Interpolate missing values (NaN) of a signal (N,), for starting values and displays only."""
    missing = np.isnan(values)
    if not missing.any():
        return values
    index = np.arange(values.size)
    return np.interp(index, index[~missing], values[~missing])


def runs(true: BoolArray) -> tuple[IntArray, IntArray]:
    """First positions of runs of True, and the positions after them."""
    ends = np.flatnonzero(np.diff(np.concatenate([[False], true, [False]]).astype(np.int8)))
    return ends[::2], ends[1::2]


def later(values: FloatArray, samples: int) -> FloatArray:
    """Delay signals (..., N) that were zero before their first sample."""
    if samples == 0:
        return values
    out = np.zeros_like(values)
    out[..., samples:] = values[..., : max(values.shape[-1] - samples, 0)]
    return out


def block_powers(first: FloatArray, A: FloatArray, count: int) -> tuple[FloatArray, FloatArray]:
    """Stack C, CA, ..., CA^(count-1) by doubling; also return a power of A.

    Parameters
    ----------
    first : ndarray, shape (..., p, n)
        C.
    A : ndarray, shape (..., n, n)
    count : int

    Returns
    -------
    stack : ndarray, shape (..., count, p, n)
    power : ndarray, shape (..., n, n)
        A^count if count is a power of two, a higher one otherwise.
    """
    *many, p, n = first.shape
    stack = np.empty((*many, count * p, n))
    stack[..., :p, :] = first
    power, have = A, p
    while have < count * p:
        more = min(have, count * p - have)
        np.matmul(stack[..., :more, :], power, out=stack[..., have : have + more, :])
        power = power @ power
        have += more
    return stack.reshape(*many, count, p, n), power


def whole_power(points: ComplexArray, exponent: int) -> ComplexArray:
    """Raise points to a whole power, >= 0, by repeated squaring.

    Ten times as fast as the operator for exponents from 100 on, and as accurate. Points should not
    be outside the unit circle, where the squares overflow.
    """
    out = np.ones_like(points)
    square = points
    while exponent:
        if exponent & 1:
            out = out * square
        exponent >>= 1
        if exponent:
            square = square * square
    return out


def locked(values: NDArray[Entry]) -> NDArray[Entry]:
    """Copy an array of any type to a read-only one."""
    kept = np.array(values)
    kept.flags.writeable = False
    return kept
