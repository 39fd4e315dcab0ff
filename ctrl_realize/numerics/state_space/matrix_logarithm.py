"""Principal logarithm of a matrix, reproducible in every call.

References
----------
.. [1] A. H. Al-Mohy and N. J. Higham, Improved inverse scaling and squaring algorithms for the
   matrix logarithm, SIAM J. Sci. Comput. 34 (2012) C153-C169, sections 2 and 5,
   doi:10.1137/110852553.
.. [2] N. J. Higham, Functions of Matrices, SIAM 2008, chapter 11 (Matrix logarithm),
   doi:10.1137/1.9780898717778.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import schur, solve_triangular, sqrtm

from ..arrays import ComplexArray, FloatArray

_DEGREE = 7  # of the Pade approximant, which reaches to
_REACH = 0.288  # theta_7 in Table 2.1 of Al-Mohy and Higham
_MOST_ROOTS = 64


def principal_logarithm(A: FloatArray) -> FloatArray:
    """Find the real X with exp(X) = A whose eigenvalues have imaginary parts within +-pi.

    Inverse scaling and squaring [1]_: square roots of the triangular Schur factor until the Padé
    approximant of degree 7 is exact to rounding, with diagonals from the eigenvalues themselves.
    The matrices are small, so norms of powers are computed; SciPy's `logm` estimates them with
    random numbers from NumPy's global generator.

    Parameters
    ----------
    A : ndarray, shape (n, n)
        No eigenvalue is zero or real and negative.

    References
    ----------
    .. [1] A. H. Al-Mohy and N. J. Higham, Improved inverse scaling and squaring algorithms for the
       matrix logarithm, SIAM J. Sci. Comput. 34 (2012) C153-C169, sections 2 and 5,
       doi:10.1137/110852553.
    """
    n = A.shape[0]
    T, Z = schur(A, output="complex")
    eye = np.eye(n)
    logs = np.log(np.diag(T))
    root, count = T, 0
    while _reach(root - eye) > _REACH and count < _MOST_ROOTS:
        root, count = np.triu(sqrtm(root)), count + 1
    R = root - eye
    # a root minus one without cancellation
    np.fill_diagonal(R, np.expm1(logs / 2.0**count))
    # The approximant as partial fractions: Gauss-Legendre nodes on 0...1 (their eq. 1.1).
    nodes, weights = np.polynomial.legendre.leggauss(_DEGREE)
    X = np.zeros_like(R)
    for node, weight in zip(0.5 + 0.5 * nodes, 0.5 * weights, strict=True):
        X += solve_triangular(eye + node * R, weight * R)
    X *= 2.0**count
    np.fill_diagonal(X, logs)
    for i in range(n - 1):
        X[i, i + 1] = T[i, i + 1] * _divided_difference(T[i, i], T[i + 1, i + 1])
    return np.asarray((Z @ X @ Z.conj().T).real, dtype=np.float64)


def _reach(R: ComplexArray) -> float:
    """The larger of ``norm(R^p)^(1/p)``, p = 2 and 3: what decides on the degree (Alg. 5.2)."""
    square = R @ R
    norms = [np.linalg.norm(power, 1) for power in (square, square @ R)]
    return float(max(norms[0] ** (1 / 2), norms[1] ** (1 / 3)))


def _divided_difference(a: complex, b: complex) -> complex:
    """(log b - log a) / (b - a), also if they are close (their eq. 5.6)."""
    if a == b:
        return 1 / a
    apart = np.log(b) - np.log(a)
    if abs(apart) > 0.5:  # no cancellation; on different sides of the cut only this is valid
        return complex(apart / (b - a))
    return complex(2 * np.arctanh((b - a) / (b + a)) / (b - a))
