r"""Gaussian priors of pulse responses that decay: the kernels TC and SS.

The covariance is c D K D, where D = diag(lambda^(w i)) is the decay and K a stationary correlation
of neighbours:

- TC ("tuned/correlated" [1]_): lambda^max(i, j), so w = 1/2 and K = lambda^(\|i-j\|/2);
- SS ("stable spline" [2]_): w = 3/2 and
  K = (3 lambda^(\|i-j\|/2) - lambda^(3\|i-j\|/2)) / 2, smoother.

Hyper-parameters are the rows (log rate, log c / sigma^2), one for each input, where
lambda = exp(-rate).

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


def prior_factors(x: FloatArray, lags: int, group: int, kernel: str) -> list[FloatArray]:
    """Return sqrt(c / sigma^2) D L of every input: lower triangular, `lags` rows.

    Taps are `group` samples apart, the first one in the middle of its group.
    """
    factors = []
    index = group * np.arange(lags)
    apart = np.arange(lags)[:, None] - np.arange(lags)
    for rate, scale in zip(np.exp(x[::2]), np.exp(x[1::2] / 2), strict=True):
        if kernel == "SS":
            slow, fast = np.exp(-rate / 2 * index), np.exp(-1.5 * rate * index)
            K = ((3 * slow - fast) / 2)[np.abs(apart)]
            # Smooth kernels are singular to rounding if the decay is slow.
            K.flat[:: lags + 1] += 1e-11
            L = cholesky(K)
            decline = 1.5 * rate
        else:
            L = np.where(apart < 0, 0.0, np.exp(-rate / 2 * index)[np.abs(apart)])
            # Cholesky factor of rho^|i-j|: rho^(i-j) sqrt(1 - rho^2), that of a Markov chain.
            L[:, 1:] *= np.sqrt(-np.expm1(-rate * group))
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
