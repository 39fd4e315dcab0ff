"""Kung's algorithm: state-space matrices from the Hankel matrix's leading pairs.

The steps of the paper [1]_ (section 2.1, step 5; Kung's algorithm [2]_, after that of Ho and
Kalman [3]_) with its misprints corrected read ``A = S^-1/2 U^T H_a V S^-1/2``,
``B = S^-1/2 U^T H_b``, ``C = H_c V S^-1/2`` with ``H_a = T(2:r+1, 1:r)``, ``H_b = T(1:r, 1)``,
``H_c = T(1, 1:r)``: the block size is r where ``rho`` is printed, and the transposes on ``V_rho``
do not belong there. No product with a Hankel matrix is needed: its leading rows and columns are
``U S`` and ``V S``.

The model of order j is the leading j x j part of the model of any higher
order, so one decomposition serves all orders.

References
----------
.. [1] J. van Helvoirt, O. Bosgra, B. de Jager and M. Steinbuch, Approximate realization of valve
   dynamics with time delay, Proc. 16th IFAC World Congress, 2005, section 2.1.
.. [2] S. Y. Kung, A new identification and model reduction algorithm via singular value
   decomposition, Proc. 12th Asilomar Conf. Circuits, Systems and Computers (1978) 705-714.
.. [3] B. L. Ho and R. E. Kalman, Effective construction of linear state-variable models from
   input/output functions, Regelungstechnik 14 (1966) 545-548, doi:10.1524/auto.1966.14.112.545.
.. [4] K. Glover, All optimal Hankel-norm approximations of linear multivariable systems and their
   L-infinity error bounds, Int. J. Control 39 (1984) 1115-1193, doi:10.1080/00207178408933239.
.. [5] U. M. Al-Saggaf and G. F. Franklin, An error bound for a discrete reduced order model of a
   linear multivariable system, IEEE Trans. Automat. Control 32 (1987) 815-819.
"""

from __future__ import annotations

import numpy as np

from ..arrays import FloatArray

SMALLEST = 1e-290
"""Singular values up to here are zero: the result of underflow."""

LARGEST_POLE = 1e150
"""Singular values that many times smaller than the sample after their matrix are zero, too."""


def realize_symmetric(
    values: FloatArray, vectors: FloatArray, last_row: FloatArray | None
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Compute A, B, C from the eigenpairs of many symmetric Hankel matrices.

    Parameters
    ----------
    values : ndarray, shape (D, k)
        Eigenvalues, by decreasing magnitude; zero beyond the numerical rank.
    vectors : ndarray, shape (D, k, r)
        Eigenvectors, as rows.
    last_row : ndarray, shape (D, r), or None
        Last row ``h[r], ..., h[2 r - 1]`` of the shifted matrix ``H_a``;
        None for the zero-padded matrix, where it is zero.

    Returns
    -------
    A, B, C : ndarray, shapes (D, k, k), (D, k), (D, k)
        States beyond the numerical rank have no effect: their rows and columns are zero.

    Notes
    -----
    With ``H = V diag(values) V^T`` the singular pairs are ``S = |values|``
    and ``U = V sign(values)``, so ``H_b = H e_1`` gives ``B = S^1/2 V[0]``.
    Vectors are turned so that B is not negative, which makes the model
    unique.
    """
    root = np.sqrt(np.abs(values))
    inverse = _inverse(root, None if last_row is None else np.abs(last_row).max(axis=1)[:, None])
    turn = np.where(vectors[:, :, 0] < 0, -1.0, 1.0)
    sign = np.where(values < 0, -1.0, 1.0)
    shifted = np.matmul(vectors[:, :, :-1], vectors[:, :, 1:].transpose(0, 2, 1))
    shifted *= values[:, np.newaxis, :]
    if last_row is not None:
        along = np.matmul(vectors, last_row[:, :, np.newaxis])[:, :, 0]
        shifted += vectors[:, :, -1, np.newaxis] * along[:, np.newaxis, :]
    # A = S^-1/2 U^T H_a V S^-1/2: H_a V is V S one row up, and the last row is its own.
    left = sign * turn * inverse
    A = left[:, :, np.newaxis] * shifted * (turn * inverse)[:, np.newaxis, :]
    B = root * np.abs(vectors[:, :, 0])
    return A, B, sign * B


def realize_block(
    U: FloatArray,
    singular_values: FloatArray,
    V: FloatArray,
    channels: tuple[int, int],
    last_rows: FloatArray | None,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Compute A, B, C from the singular triplets of a block Hankel matrix.

    Parameters
    ----------
    U, V : ndarray, shapes (rows p, k), (columns m, k)
        Singular vectors.
    singular_values : ndarray, shape (k,)
        Decreasing; zero beyond the numerical rank.
    channels : (p, m)
        Outputs and inputs.
    last_rows : ndarray, shape (p, columns m), or None
        Last block row of the shifted matrix; None for the zero-padded one.

    Returns
    -------
    A, B, C : ndarray, shapes (k, k), (k, m), (p, k)
    """
    p, m = channels
    root = np.sqrt(singular_values)
    inverse = _inverse(root, None if last_rows is None else np.abs(last_rows).max())
    largest = np.abs(V[:m]).argmax(axis=0)
    turn = np.where(V[largest, np.arange(V.shape[1])] < 0, -1.0, 1.0)
    shifted = (U[:-p].T @ U[p:]) * singular_values
    if last_rows is not None:
        shifted += U[-p:].T @ (last_rows @ V)
    # Step 5: A = S^-1/2 U^T H_a V S^-1/2, B = S^-1/2 U^T H_b = S^1/2 V_1^T, C = U_1 S^1/2.
    A = (turn * inverse)[:, np.newaxis] * shifted * (turn * inverse)
    B = (turn * root)[:, np.newaxis] * V[:m].T
    C = U[:p] * (turn * root)
    return A, B, C


def _inverse(root: FloatArray, next_sample: FloatArray | float | None) -> FloatArray:
    """Invert roots of singular values; states whose products with A overflow are set to zero."""
    smallest = np.sqrt(SMALLEST)
    if next_sample is not None:
        smallest = np.maximum(smallest, np.sqrt(next_sample / LARGEST_POLE))
    return np.divide(1.0, root, out=np.zeros_like(root), where=root > smallest)


def tail_bound(norm_squared: float, leading: FloatArray, size: int) -> float:
    """Bound twice the sum of the singular values that were not computed.

    For the zero-padded Hankel matrix, twice the tail bounds the largest gain
    of the error over all frequencies ([4]_, in discrete time [5]_; the padded matrix holds all
    of a finite response, whose balanced truncation this is). The tail has ``size - k`` values
    whose squares add up to what the leading ones leave of the squared
    Frobenius norm; equal values make the largest sum.

    Parameters
    ----------
    norm_squared : float
        Squared Frobenius norm of the Hankel matrix.
    leading : ndarray, shape (k,)
        Computed singular values.
    size : int
        Number of singular values of the matrix.
    """
    rest = max(norm_squared - float(leading @ leading), 4e-16 * norm_squared)
    missing = size - leading.size
    return 2.0 * float(np.sqrt(missing * rest)) if missing > 0 else 0.0
