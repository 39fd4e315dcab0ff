"""Gramians, balanced coordinates and modal blocks.

Modes are split as in [1]_, Gramians summed by the squared iteration of [2]_, models truncated by
the square-root method of [3]_; in discrete time balanced parts of a stable model are stable [4]_.

References
----------
.. [1] G. H. Golub and C. F. Van Loan, Matrix Computations, 4th ed., Johns Hopkins 2013, section
   7.6.3 (block diagonalization).
.. [2] R. A. Smith, Matrix equation XA + BX = C, SIAM J. Appl. Math. 16 (1968) 198-201,
   doi:10.1137/0116017.
.. [3] M. S. Tombs and I. Postlethwaite, Truncated balanced realization of a stable non-minimal
   state-space system, Int. J. Control 46 (1987) 1319-1330, doi:10.1080/00207178708933971.
.. [4] L. Pernebo and L. M. Silverman, Model reduction via balanced state space representations,
   IEEE Trans. Automat. Control 27 (1982) 382-387, doi:10.1109/TAC.1982.1102945.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.linalg import schur, solve_sylvester

from ..arrays import FloatArray
from ..hankel.svd import thin_svd
from .sampling import state_units

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
        Either may have no states.
    """
    n = A.shape[0]
    if n == 0:
        return (A, B, C), (A, B, C)

    def select(re: float, im: float = 0.0) -> bool:
        return first(complex(re, im))

    units = state_units(A)
    T, Q, count = schur(A * units / units[:, None], "real", sort=select)
    k = int(count)
    right, left = Q.T @ (B / units[:, None]), C * units @ Q
    # [I X; 0 I] decouples T when T11 X - X T22 = -T12.
    if 0 < k < n:
        X = np.asarray(solve_sylvester(T[:k, :k], -T[k:, k:], -T[:k, k:]), dtype=np.float64)
    else:
        X = np.zeros((k, n - k))
    part1 = (T[:k, :k], right[:k] - X @ right[k:], left[:, :k])
    part2 = (T[k:, k:], right[k:], left[:, k:] + left[:, :k] @ X)
    return part1, part2


MAX_DOUBLINGS = 60  # 2^60 samples: no pole that a double tells from 1 is slower


def gramian_factor(A: FloatArray, B: FloatArray) -> FloatArray:
    """Factor L with L L' = sum_k A^k B B' A'^k, by doubling.

    ``[L, A^s L]`` contains twice as many terms; a QR step keeps it n columns wide. The Gramian
    itself is not formed, so small directions keep their digits.

    Parameters
    ----------
    A : ndarray, shape (n, n)
        All eigenvalues inside the unit circle.
    B : ndarray, shape (n, m)

    Returns
    -------
    ndarray, shape (n, r), r <= n
    """
    factor, power = B, A
    for _ in range(MAX_DOUBLINGS):
        more = power @ factor
        factor = np.asarray(np.linalg.qr(np.hstack([factor, more]).T, mode="r")).T
        if np.linalg.norm(more) <= 1e-17 * np.linalg.norm(factor):
            break
        power = power @ power
    return np.asarray(factor, dtype=np.float64)


def balanced_truncation(
    A: FloatArray, B: FloatArray, C: FloatArray, order: int
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Truncate a stable model in balanced coordinates (square-root method [1]_).

    Parameters
    ----------
    A, B, C : ndarray, shapes (n, n), (n, m), (p, n)
    order : int
        0...n; lower if fewer directions are reachable and observable.

    Returns
    -------
    A, B, C : ndarray
        Reduced; both Gramians are the diagonal of the kept singular values.
    singular_values : ndarray, shape (n,)
        All Hankel singular values, descending.

    References
    ----------
    .. [1] M. S. Tombs and I. Postlethwaite, Truncated balanced realization of a stable non-minimal
       state-space system, Int. J. Control 46 (1987) 1319-1330, doi:10.1080/00207178708933971.
    """
    n = A.shape[0]
    if n == 0:
        return A, B, C, np.zeros(0)
    reach, observe = gramian_factor(A, B), gramian_factor(A.T, C.T)
    U, s, V = thin_svd(observe.T @ reach)
    values = np.zeros(n)
    values[: s.size] = s
    kept = min(order, int(np.sum(s > n * np.finfo(float).eps * s[0])) if s[0] > 0 else 0)
    root = np.sqrt(s[:kept])
    right = reach @ V[:kept].T / root
    left = (U[:, :kept] / root).T @ observe.T
    return left @ A @ right, left @ B, C @ right, values
