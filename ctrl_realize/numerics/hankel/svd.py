"""Singular values of dense matrices and of block Hankel operators.

Large matrices go through Golub-Kahan bidiagonalisation with FFT products
and full reorthogonalisation. It works on H itself, not on ``H^T H``, so small
singular values keep their digits. It stops by the residual of every wanted
triplet.

Bidiagonalisation as in [1]_ (its upper form), with the reorthogonalisation and the residual of
[2]_.

References
----------
.. [1] G. Golub and W. Kahan, Calculating the singular values and pseudo-inverse of a matrix, SIAM
   J. Numer. Anal. B 2 (1965) 205-224, doi:10.1137/0702016.
.. [2] R. M. Larsen, Lanczos bidiagonalization with partial reorthogonalization, DAIMI PB-537,
   Aarhus University 1998.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import scipy.linalg
from scipy.sparse.linalg import LinearOperator, svds

from ..arrays import FloatArray
from .matrix import BlockHankel, hankel_matrix


def thin_svd(matrix: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return U, the singular values in descending order, and V transposed.

    LAPACK's divide and conquer (``gesdd``, as in NumPy) is fast, but fails for rare matrices: about
    one in 30 000 random Hankel matrices with one outlier. The older ``gesvd`` is used then.

    Examples
    --------
    >>> import numpy as np
    >>> thin_svd(np.array([[0.0, 2.0], [3.0, 0.0], [0.0, 0.0]]))[1]
    array([3., 2.])
    """
    try:
        U, values, Vt = np.linalg.svd(matrix, full_matrices=False)
    except np.linalg.LinAlgError:
        U, values, Vt = scipy.linalg.svd(matrix, full_matrices=False, lapack_driver="gesvd")
    return U, values, Vt


Triple: TypeAlias = tuple[FloatArray, FloatArray, FloatArray]

DENSE_SIZE = 200
"""Shorter side up to which the dense SVD is used."""

DENSE_FALLBACK_SIZE = 1500
"""Shorter side up to which the fallback is dense, too; beyond it is ARPACK."""

FLOOR = 1e-14
"""Residual relative to the largest singular value that counts as rounding."""

MAX_STEPS = 400  # time and memory: both vectors of every step are kept

REST_TOL = 0.02
"""Accuracy of the first truncated singular value."""


@dataclass(frozen=True, eq=False)
class Triplets:
    """Leading singular triplets: ``H @ V[:, i] == values[i] * U[:, i]``.

    Attributes
    ----------
    U, V : ndarray, shapes (rows p, k), (columns m, k)
    values : ndarray, shape (k,)
        Decreasing; zero beyond the numerical rank.
    others : ndarray
        The singular values that follow: all of them after a dense decomposition, otherwise the
        first, to a few percent.
    complete : bool
        Whether `values` and `others` are all there are.
    """

    U: FloatArray
    values: FloatArray
    V: FloatArray
    others: FloatArray
    complete: bool


def leading_triplets(
    h: FloatArray, rows: int, columns: int, count: int, *, tol: float = 1e-12
) -> Triplets:
    """Compute the largest singular values of a block Hankel matrix with their vectors.

    Parameters
    ----------
    h : ndarray, shape (p, m, N)
        Blocks; block (i, j) of the matrix is ``h[:, :, i + j]``, zero beyond N.
    rows, columns : int
        Number of block rows and block columns.
    count : int
        Wanted triplets.
    tol : float
        Largest residual, relative to the smallest wanted singular value.
    """
    shorter = min(rows * h.shape[0], columns * h.shape[1])
    if shorter <= DENSE_SIZE or 4 * count >= shorter or not h.any():
        return _dense(h, rows, columns, count)
    exponent = int(np.frexp(np.abs(h).max())[1])
    H = BlockHankel(np.ldexp(h, -exponent), rows, columns)
    # One start vector finds one copy of a multiple singular value, as for equal channels. A second
    # start, orthogonal to the known ones, shows whether anything larger remains.
    starts = iter(np.random.default_rng(2005).spawn(2 * count + 2))
    found = _golub_kahan(H, count, tol, None, next(starts))
    rest = None if found is None else _golub_kahan(H, 1, REST_TOL, found, next(starts))
    for _ in range(count):
        if found is None or rest is None or not rest[1][0] > found[1][-1]:
            break
        more = _golub_kahan(H, count, tol, found, next(starts))
        found = None if more is None else _largest(found, more, count)
        rest = None if found is None else _golub_kahan(H, 1, REST_TOL, found, next(starts))
    if found is None or rest is None:
        if shorter <= DENSE_FALLBACK_SIZE:
            return _dense(h, rows, columns, count)
        found = _arpack(H, count)
        rest = found[0][:, :0], np.zeros(0), found[2][:, :0]
    U, values, V = found
    leading = np.ldexp(_without_rounding(values, shorter), exponent)
    return Triplets(U, leading, V, np.ldexp(rest[1], exponent), False)


def _without_rounding(values: FloatArray, size: int) -> FloatArray:
    """Set singular values beyond the numerical rank to zero."""
    return np.where(values > size * np.finfo(float).eps * values[0], values, 0.0)


def _dense(h: FloatArray, rows: int, columns: int, count: int) -> Triplets:
    U, values, Vt = thin_svd(hankel_matrix(h, rows, columns))
    leading = _without_rounding(values, values.size)[:count]
    return Triplets(U[:, :count], leading, Vt[:count].T, values[count:], True)


def _arpack(H: BlockHankel, count: int) -> Triple:
    """Solve by restarted iterations in little memory: for large matrices without a gap."""
    operator = LinearOperator(H.shape, matvec=H.times, rmatvec=H.transposed_times, dtype=np.float64)
    start = np.random.default_rng(2005).standard_normal(min(H.shape))
    U, values, Vt = svds(operator, k=count, v0=start)
    order = np.argsort(-values, kind="stable")
    return U[:, order], np.asarray(values[order], dtype=np.float64), Vt[order].T


def _largest(one: Triple, other: Triple, count: int) -> Triple:
    """Merge orthogonal sets of triplets."""
    values = np.concatenate([one[1], other[1]])
    order = np.argsort(-values, kind="stable")[:count]
    U = np.concatenate([one[0], other[0]], axis=1)[:, order]
    V = np.concatenate([one[2], other[2]], axis=1)[:, order]
    return U, values[order], V


def _golub_kahan(
    H: BlockHankel, count: int, tol: float, locked: Triple | None, start: np.random.Generator
) -> Triple | None:
    """Bidiagonalise H, orthogonal to known triplets, until the wanted ones have converged.

    After j steps ``H V_j = U_j B`` and ``H^T U_j = V_j B^T + above_j v e_j^T`` with B upper
    bidiagonal. None if that takes too many steps. If H has no more singular values, the rest are
    zero.
    """
    height, width = H.shape
    known = 0 if locked is None else locked[1].size
    steps = min(MAX_STEPS, height - known, width - known)
    U = np.empty((known + min(steps, 48), height))
    V = np.empty((known + min(steps, 48) + 1, width))
    scale = 0.0
    if locked is not None:
        U[:known], V[:known], scale = locked[0].T, locked[2].T, float(locked[1][0])
    diagonal, above = np.zeros(steps), np.zeros(steps)
    V[known] = _unit(start.standard_normal(width), V[:known])
    for j in range(steps):
        at = known + j
        if at == U.shape[0]:
            U = np.concatenate([U, np.empty((at, height))])
            V = np.concatenate([V, np.empty((at, width))])
        u = H.times(V[at])
        if j:
            u -= above[j - 1] * U[at - 1]
        u -= (U[:at] @ u) @ U[:at]
        diagonal[j] = np.linalg.norm(u)
        scale = max(scale, float(diagonal[j]))
        exhausted = diagonal[j] <= FLOOR * scale
        if not exhausted:
            U[at] = u / diagonal[j]
            v = H.transposed_times(U[at]) - diagonal[j] * V[at]
            v -= (V[: at + 1] @ v) @ V[: at + 1]
            above[j] = np.linalg.norm(v)
            scale = max(scale, float(above[j]))
            exhausted = above[j] <= FLOOR * scale
            V[at + 1] = v / (1.0 if exhausted else above[j])
        if not exhausted and (j + 1 < min(count + 2, steps) or (j + 1) % 4):
            continue
        # Where u has vanished, B has one column more than rows.
        rows, columns = (j, j + 1) if diagonal[j] <= FLOOR * scale else (j + 1, j + 1)
        if rows == 0:
            return np.zeros((height, count)), np.zeros(count), np.zeros((width, count))
        B = np.zeros((rows, columns))
        np.fill_diagonal(B, diagonal[:rows])
        np.fill_diagonal(B[:, 1:], above[:rows])
        left, values, right = thin_svd(B)
        residuals = above[j] * np.abs(left[-1, :count]) if not exhausted else np.zeros(1)
        if residuals.max() <= max(tol * values[:count][-1], FLOOR * scale):
            return (
                _columns(U[known : known + rows].T @ left[:, :count], count),
                np.pad(values[:count], (0, max(0, count - rows))),
                _columns(V[known : known + columns].T @ right[:count].T, count),
            )
    return None


def _columns(vectors: FloatArray, count: int) -> FloatArray:
    """Add zero columns up to the requested count."""
    return np.pad(vectors, ((0, 0), (0, count - vectors.shape[1])))


def _unit(vector: FloatArray, known: FloatArray) -> FloatArray:
    """Return a unit vector orthogonal to the known ones."""
    for _ in range(2):
        vector = vector - (known @ vector) @ known
    unit: FloatArray = vector / np.linalg.norm(vector)
    return unit
