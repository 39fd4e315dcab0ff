"""Pade approximation of a dead time.

The approximant of [1]_ in balanced coordinates, as in [2]_.

References
----------
.. [1] G. H. Golub and C. F. Van Loan, Matrix Computations, 4th ed., Johns Hopkins 2013, section
   9.3.1 (Pade approximation of the exponential).
.. [2] J. Lam, Balanced realization of Pade approximants of exp(-sT), IEEE Trans. Automat. Control
   36 (1991) 1096-1100.
"""

from __future__ import annotations

from fractions import Fraction
from math import factorial

import numpy as np

from ..arrays import Matrices


def pade_ladder(dead_time: float, order: int) -> Matrices:
    r"""Diagonal Pade approximant of exp(-s tau) in Schwarz form.

    The approximant is all-pass, Q(-s)/Q(s). The Routh array of Q, exact in integers, gives
    a tridiagonal A with ``A + A' = -B B'`` and ``C = -D B'``; both Gramians are then the identity
    and no polynomial coefficient (the largest is 40!/20! for order 20) is ever a float.

    Parameters
    ----------
    dead_time : float
        tau in s, > 0.
    order : int
        >= 1.

    Returns
    -------
    A, B, C, D : ndarray, shapes (n, n), (n, 1), (1, n), (1, 1)
    """
    n = order
    # Denominator of the diagonal approximant (Golub and Van Loan, section 9.3.1):
    # Q(s) = sum (2n-k)! / (k! (n-k)!) s^k for tau = 1, highest power first.
    falling = [
        Fraction(factorial(2 * n - k), factorial(k) * factorial(n - k)) for k in range(n, -1, -1)
    ]
    above, row = falling[0::2], falling[1::2]
    ratios = []
    for _ in range(n):
        ratio = above[0] / row[0]
        ratios.append(ratio)
        padded = row[1:] + [Fraction(0)] * (len(above) - len(row))
        above, row = row, [a - ratio * b for a, b in zip(above[1:], padded, strict=False)]
    # Q_even/Q_odd = h1 s + 1/(h2 s + 1/(h3 s + ...)): with Q = (h1 s + ...) form, the ladder has
    # damping 1/h1 at its first node and couplings 1/(h_i h_{i+1}) between neighbours.
    A = np.zeros((n, n))
    A[0, 0] = -float(1 / ratios[0])
    for i in range(n - 1):
        coupling = float(1 / (ratios[i] * ratios[i + 1])) ** 0.5
        A[i, i + 1], A[i + 1, i] = coupling, -coupling
    B = np.zeros((n, 1))
    B[0, 0] = np.sqrt(-2 * A[0, 0])
    D = np.array([[(-1.0) ** n]])
    root = np.sqrt(dead_time)
    return A / dead_time, B / root, -D * B.T / root, D
