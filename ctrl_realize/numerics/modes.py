"""Split a state-space model into two that share no pole."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.linalg import schur, solve_sylvester

from .arrays import FloatArray

Part = tuple[FloatArray, FloatArray, FloatArray]


def split_modes(
    A: FloatArray, B: FloatArray, C: FloatArray, first: Callable[[complex], bool]
) -> tuple[Part, Part]:
    """Write C (zI - A)^-1 B as a sum of two models with disjoint poles.

    Ordered Schur form, then a Sylvester equation to decouple the blocks.

    Parameters
    ----------
    A, B, C : ndarray, shapes (n, n), (n, m), (p, n)
    first : callable
        True for the poles of the first part; the same for both of a complex pair.

    Returns
    -------
    (A1, B1, C1), (A2, B2, C2)
        Either may have no state.
    """
    n = A.shape[0]
    if n == 0:
        return (A, B, C), (A, B, C)

    def select(re: float, im: float = 0.0) -> bool:
        return first(complex(re, im))

    T, Q, count = schur(A, "real", sort=select)
    k = int(count)
    right, left = Q.T @ B, C @ Q
    # [I X; 0 I] decouples T when T11 X - X T22 = -T12.
    if 0 < k < n:
        X = np.asarray(solve_sylvester(T[:k, :k], -T[k:, k:], -T[:k, k:]), dtype=np.float64)
    else:
        X = np.zeros((k, n - k))
    part1 = (T[:k, :k], right[:k] - X @ right[k:], left[:, :k])
    part2 = (T[k:, k:], right[k:], left[:, k:] + left[:, :k] @ X)
    return part1, part2
