"""Hyper-parameters of the prior of a pulse response, by the marginal likelihood of the data.

With the prior's factor F, F F^T its covariance relative to the noise variance, estimate, covariance
and likelihood need one Cholesky factorization of ``M = I + F^T R F``, with the Gram matrix R of the
lagged input; the noise variance is eliminated in closed form. The inverse of a kernel, with entries
up to lambda^-n, is not formed.

The marginal likelihood is that of [1]_; avoiding the inverse of a kernel follows [2]_.

References
----------
.. [1] T. Chen, H. Ohlsson and L. Ljung, On the estimation of transfer functions, regularizations
   and Gaussian processes - revisited, Automatica 48 (2012) 1525-1535,
   doi:10.1016/j.automatica.2012.05.026.
.. [2] T. Chen and L. Ljung, Implementation of algorithms for tuning parameters in regularized least
   squares problems in system identification, Automatica 49 (2013) 2213-2220,
   doi:10.1016/j.automatica.2013.03.030.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg.blas import dtrmm
from scipy.linalg.lapack import dtrtrs
from scipy.optimize import Bounds, minimize

from ..arrays import FloatArray
from .kernel_prior import cholesky, prior_factors
from .normal_equations import NormalEquations

FEW = 40
"""Number of grouped taps in the coarse search for hyper-parameters."""

COARSE = 100
"""Number of taps up to which hyper-parameters are searched at full resolution."""

FLOOR = 1e-13
"""Least noise variance, relative to that of the output: rounding of the sums."""

_WORST = 1e300  # misfit of a prior too wide to be computed
_ROUNDING = 1e-13
"""Added to the squares of an input, relative to their mean: rounding makes none negative then."""

WIDE, CLOSE = 0.7, 0.15
"""Initial steps of a search from a guess, and of one that starts near its end."""


@dataclass(frozen=True, eq=False)
class Likelihood:
    """Likelihood for one set of hyper-parameters.

    ``value`` is -2 log marginal likelihood up to a constant, ``C`` the lower factor of M, ``half``
    is C^-1 F^T b, and ``least`` the weighted misfit.
    """

    value: float
    C: FloatArray
    half: FloatArray
    least: float


@dataclass(frozen=True, eq=False)
class KernelProblem:
    """Sums over the data of one output, and the prior of its pulse responses.

    ``gram`` (m n, m n) and ``cross`` (m n,) are those of m inputs with n taps each, which are
    `group` samples apart; ``power`` is the output's sum of squares.
    """

    gram: FloatArray
    cross: FloatArray
    power: float
    freedom: int
    inputs: int
    taps: int
    group: int
    kernel: str

    @classmethod
    def of(cls, equations: NormalEquations, lags: int, kernel: str) -> KernelProblem:
        """Correct the sums for rounding of the squares, of every input in its own unit."""
        squares = np.diag(equations.gram).reshape(-1, lags).mean(axis=1)
        gram = equations.gram + np.diag(_ROUNDING * np.repeat(squares, lags))
        cross, power = equations.cross[:, 0], float(equations.power[0, 0])
        return cls(gram, cross, power, equations.freedom, squares.size, lags, 1, kernel)

    def tied(self, group: int) -> KernelProblem:
        """Group neighbouring taps: the same data with `group` times fewer unknowns."""
        edges = np.arange(0, self.taps, group)
        where = (np.arange(self.inputs)[:, None] * self.taps + edges).ravel()
        gram = np.add.reduceat(np.add.reduceat(self.gram, where, axis=0), where, axis=1)
        cross = np.add.reduceat(self.cross, where)
        return replace(self, gram=gram, cross=cross, taps=edges.size, group=group)

    def factors(self, x: FloatArray) -> list[FloatArray]:
        """Lower-triangular F of every input."""
        return prior_factors(x, self.taps, self.group, self.kernel)

    def likelihood(self, factors: list[FloatArray]) -> Likelihood:
        """Evaluate the likelihood of a prior with these factors."""
        n = self.taps
        M = np.empty_like(self.gram, order="F")
        right = np.empty_like(self.cross)
        for i, Fi in enumerate(factors):
            rows = slice(i * n, (i + 1) * n)
            right[rows] = Fi.T @ self.cross[rows]
            for j, Fj in enumerate(factors[: i + 1]):
                columns = slice(j * n, (j + 1) * n)
                half = dtrmm(1.0, Fj, self.gram[rows, columns], side=1, lower=1)
                M[rows, columns] = dtrmm(1.0, Fi, half, side=0, trans_a=1, lower=1, overwrite_b=1)
        M[np.diag_indices(M.shape[0])] += 1.0
        C = cholesky(M)
        half = dtrtrs(C, right, lower=1)[0]
        least = max(self.power - float(half @ half), FLOOR * self.power)
        # -2 log p(y) with the noise variance at its best: N log(least) + log det M.
        value = self.freedom * np.log(least) + 2.0 * float(np.log(np.diag(C)).sum())
        return Likelihood(value, C, half, least)

    def start(self) -> FloatArray:
        """Guess: the response decays within a third of the window and explains the output."""
        energy = np.diag(self.gram).reshape(self.inputs, self.taps).mean(axis=1)
        signal = 20.0 * self.freedom / np.maximum(energy, 1e-300) / self.taps
        rate = np.full(self.inputs, 6.0 / self.taps)
        guess: FloatArray = np.log(np.stack([rate, signal], axis=1))
        return guess.ravel()

    def roughly(self) -> tuple[FloatArray, float]:
        """Search with grouped taps, which is fast."""
        return self.tied(-(-self.taps // FEW)).search(self.start(), WIDE)

    def best(self) -> FloatArray:
        """Search for the hyper-parameters of the largest likelihood."""
        group = -(-self.taps // COARSE)
        if group == 1:
            return self.search(self.start(), WIDE)[0]
        # Most of the search is done with grouped neighbouring taps, at a fraction of the cost.
        return self.search(self.tied(group).search(self.start(), WIDE)[0], CLOSE)[0]

    def search(self, start: FloatArray, size: float) -> tuple[FloatArray, float]:
        """Minimize -2 log marginal likelihood over the logarithms of the hyper-parameters.

        The simplex starts with steps of `size`, and ends with a thirtieth of that.
        """
        m, span = self.inputs, self.taps * self.group
        low = np.tile([np.log(0.1 / span), -80.0], m)
        high = np.tile([np.log(3.0), 80.0], m)
        # If one point has 1e77 times the weight of another, the prior is narrow from the start.
        low[1::2] = np.minimum(-80.0, start[1::2] - 40.0)

        def misfit(x: FloatArray) -> float:
            try:
                return self.likelihood(self.factors(x)).value
            except np.linalg.LinAlgError:
                # a prior so wide that the rounding of `gram` exceeds the identity: no improvement.
                # Not infinity, because the search computes differences.
                return _WORST

        steps = np.tile([size, 2 * size], m)
        inside = np.clip(start, low, high)
        while misfit(inside) >= _WORST and (inside[1::2] > low[1::2]).any():
            inside[1::2] = np.maximum(inside[1::2] - 3.0, low[1::2])
        # From a start at a bound, steps go inward; otherwise the simplex would be flat there.
        steps = np.where(inside + steps > high, -steps, steps)
        simplex = np.vstack([inside, inside + np.diag(steps)])
        # A difference of 0.1 in -2 log likelihood is far inside what the data can tell.
        fine, most = (0.02, 300 * m) if size == WIDE else (0.1, 40 * m)
        near = max(size / 30, 0.02)
        found = minimize(
            misfit,
            inside,
            method="Nelder-Mead",
            bounds=Bounds(low, high),
            options={"initial_simplex": simplex, "xatol": near, "fatol": fine, "maxfev": most},
        )
        return np.asarray(found.x, dtype=np.float64), float(found.fun)
