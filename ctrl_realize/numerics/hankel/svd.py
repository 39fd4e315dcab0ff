"""Singular values of dense matrices and of block Hankel operators.

Large matrices go through ARPACK with FFT products.

References
----------
.. [1] R. B. Lehoucq, D. C. Sorensen and C. Yang, ARPACK Users' Guide, SIAM 1998,
   doi:10.1137/1.9780898719628.
"""

from __future__ import annotations

from dataclasses import dataclass

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


DENSE_SIZE = 200
"""Shorter side up to which the dense SVD is used."""


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
        first.
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
        Tolerance of ARPACK, relative to the singular values.
    """
    shorter = min(rows * h.shape[0], columns * h.shape[1])
    if shorter <= DENSE_SIZE or 4 * count >= shorter or not h.any():
        return _dense(h, rows, columns, count)
    exponent = int(np.frexp(np.abs(h).max())[1])
    H = BlockHankel(np.ldexp(h, -exponent), rows, columns)
    operator = LinearOperator(H.shape, matvec=H.times, rmatvec=H.transposed_times, dtype=np.float64)
    start = np.random.default_rng(2005).standard_normal(shorter)
    U, values, Vt = svds(operator, k=count + 1, tol=tol, v0=start)
    order = np.argsort(-values, kind="stable")
    leading, others = np.split(np.asarray(values[order], dtype=np.float64), [count])
    U, V, leading = U[:, order[:count]], Vt[order[:count]].T, _without_rounding(leading, shorter)
    return Triplets(U, np.ldexp(leading, exponent), V, np.ldexp(others, exponent), False)


def _without_rounding(values: FloatArray, size: int) -> FloatArray:
    """Set singular values beyond the numerical rank to zero."""
    return np.where(values > size * np.finfo(float).eps * values[0], values, 0.0)


def _dense(h: FloatArray, rows: int, columns: int, count: int) -> Triplets:
    U, values, Vt = thin_svd(hankel_matrix(h, rows, columns))
    leading = _without_rounding(values, values.size)[:count]
    return Triplets(U[:, :count], leading, Vt[:count].T, values[count:], True)
