r"""Gaussian priors of pulse responses that decay: the kernels TC, DC and SS.

The covariance is c D K D, where D = diag(lambda^(w i)) is the decay and K a stationary correlation
of neighbours:

- TC ("tuned/correlated" [1]_): lambda^max(i, j), so w = 1/2 and K = lambda^(\|i-j\|/2);
- DC ("diagonal/correlated" [1]_): w = 1/2 and K = rho^\|i-j\| with rho free;
- SS ("stable spline" [2]_): w = 3/2 and
  K = (3 lambda^(\|i-j\|/2) - lambda^(3\|i-j\|/2)) / 2, smoother.

Hyper-parameters are the rows (log rate, [log rate of neighbours,] log c / sigma^2), one for each
input, where lambda = exp(-rate).

References
----------
.. [1] T. Chen, H. Ohlsson and L. Ljung, On the estimation of transfer functions, regularizations
   and Gaussian processes - revisited, Automatica 48 (2012) 1525-1535,
   doi:10.1016/j.automatica.2012.05.026.
.. [2] G. Pillonetto and G. De Nicolao, A new kernel-based approach for linear system
   identification, Automatica 46 (2010) 81-93, doi:10.1016/j.automatica.2009.10.031.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg.lapack import dpotrf

from ..arrays import FloatArray


def shape_count(kernel: str) -> int:
    """Count the hyper-parameters of one input that shape its prior, without the scale."""
    return 2 if kernel == "DC" else 1


def prior_of(x: FloatArray, m: int, kernel: str) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return lambda, the correlation of neighbours and c / sigma^2 of every input, (m,) each."""
    rows = x.reshape(m, -1)
    rate = np.exp(rows[:, 0])
    decay = np.exp(-rate)
    if kernel == "DC":
        correlation = np.exp(-np.exp(rows[:, 1]))
    elif kernel == "TC":
        correlation = np.exp(-rate / 2)
    else:
        correlation = (3 * np.exp(-rate / 2) - np.exp(-1.5 * rate)) / 2
    return decay, correlation, np.exp(rows[:, -1])


def prior_factors(x: FloatArray, m: int, lags: int, group: int, kernel: str) -> list[FloatArray]:
    """Return sqrt(c / sigma^2) D L of every input: lower triangular, `lags` rows.

    Taps are `group` samples apart, the first one in the middle of its group.
    """
    factors = []
    index = group * np.arange(lags)
    apart = np.arange(lags)[:, None] - np.arange(lags)
    for row in x.reshape(m, -1):
        rate, scale = np.exp(row[0]), np.exp(row[-1] / 2)
        if kernel == "SS":
            slow, fast = np.exp(-rate / 2 * index), np.exp(-1.5 * rate * index)
            K = ((3 * slow - fast) / 2)[np.abs(apart)]
            # Smooth kernels are singular to rounding if the decay is slow.
            K.flat[:: lags + 1] += 1e-11
            L = cholesky(K)
            decline = 1.5 * rate
        else:
            step = np.exp(row[1]) if kernel == "DC" else rate / 2
            L = np.where(apart < 0, 0.0, np.exp(-step * index)[np.abs(apart)])
            # Cholesky factor of rho^|i-j|: rho^(i-j) sqrt(1 - rho^2), that of a Markov chain.
            L[:, 1:] *= np.sqrt(-np.expm1(-2 * step * group))
            decline = rate / 2
        exponent = decline * (index + (group + 1) / 2)
        # Squares of numbers below 1e-154 are denormal numbers, which are slow.
        D = np.where(exponent < 350, np.exp(-np.minimum(exponent, 350)), 0.0)
        factors.append(np.asfortranarray(scale * D[:, None] * L))
    return factors


def cholesky(matrix: FloatArray) -> FloatArray:
    """Factorize in place if possible: LAPACK without SciPy's checks, a third of the time."""
    lower, failed = dpotrf(matrix, lower=1, clean=1, overwrite_a=1)
    if failed:
        raise np.linalg.LinAlgError("the matrix is not positive definite")
    return np.asarray(lower, dtype=np.float64)
