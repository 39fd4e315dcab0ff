"""A regularised finite impulse response whose dead time is one of the hyper-parameters.

After Kosters, Illg and Nelles [1]_, who put the dead time among the hyper-parameters of a
regularised FIR model; of their two methods we could read the abstract only, so this is the plain
form of the idea: taps that are zero for a dead time, then have the TC prior of Chen, Ohlsson and
Ljung [2]_, and dead time, size and decay from the largest marginal likelihood, noise variance in
closed form.

References
----------
.. [1] T. Kosters, C. Illg and O. Nelles, Handling of time delays in system identification with
   regularized FIR models, at - Automatisierungstechnik 71 (2023), doi:10.1515/auto-2023-0007.
.. [2] T. Chen, H. Ohlsson and L. Ljung, On the estimation of transfer functions, regularizations
   and Gaussian processes - revisited, Automatica 48 (2012) 1525-1535,
   doi:10.1016/j.automatica.2012.05.026.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.linalg import cho_solve, cholesky, toeplitz
from scipy.optimize import minimize

from .answers import Answer, of_polynomials
from .tasks import Task

TAPS = 800
"""Most taps behind the dead time; a slower record is averaged over blocks of samples first."""
LONG = 6.0
"""Length of a response, in times of 63 %, from which the size of the blocks follows."""
COARSE = 12
"""Dead times of the first round; then those around the best one."""
STARTS = ((2.0, -4.0), (2.0, -2.0))
"""Logarithms of the size, relative to the noise, and of the decay per sample."""
STEPS = 25
"""Evaluations of the likelihood for a dead time, from the hyper-parameters of the one before."""


class _Likelihood:
    """Marginal likelihood of the taps behind any dead time, from sums over the record."""

    def __init__(self, u: np.ndarray, y: np.ndarray, taps: int, most: int) -> None:
        self.taps, lags = taps, most + taps + 1
        lagged = toeplitz(u, np.zeros(lags))
        self.gram, self.cross = lagged.T @ lagged, lagged.T @ y
        self.power, self.rows = float(y @ y), y.size

    def of(self, delay: int) -> Callable[[np.ndarray], tuple[float, np.ndarray]]:
        """Return -2 log likelihood, but for a constant, and the taps, by hyper-parameters."""
        at = slice(delay + 1, delay + 1 + self.taps)
        # TC, min(lambda^i, lambda^j), is the covariance of a walk whose steps shrink: sums of taps
        gram = np.cumsum(np.cumsum(self.gram[at, at], axis=0), axis=1)
        cross = np.cumsum(self.cross[at])

        def parts(shape: np.ndarray) -> tuple[float, np.ndarray]:
            size, rate = np.exp(np.clip(shape, -30, (40, 2)))
            step = np.sqrt(size * -np.diff(np.exp(-rate * np.arange(self.taps + 1))))
            C = cholesky(np.eye(self.taps) + gram * np.outer(step, step), lower=True)
            weights = cho_solve((C, True), step * cross)
            left = max(self.power - float(step * cross @ weights), 1e-12 * self.power)
            value = self.rows * np.log(left) + 2 * np.log(np.diag(C)).sum()
            return float(value), np.cumsum((step * weights)[::-1])[::-1]

        return parts

    def best(self, delay: int, start: np.ndarray, steps: int = STEPS) -> tuple[float, np.ndarray]:
        """Return the smallest -2 log likelihood of a dead time and its hyper-parameters."""
        parts = self.of(delay)
        found = minimize(
            lambda shape: parts(shape)[0], start,
            method="Nelder-Mead", options={"maxfev": steps, "xatol": 1e-2, "fatol": 1e-2},
        )  # fmt: skip
        return float(found.fun), found.x


def from_regularised(task: Task) -> Answer:
    """Find dead time and hyper-parameters of largest marginal likelihood, coarse to fine."""
    after = task.y.size - task.edge
    rise = int(np.argmax(task.y[task.edge :] > 0.63))
    block = max(int(np.ceil(min(LONG * rise, after - 1) / TAPS)), 1)
    rows = task.y.size // block
    u, y = (one[: rows * block].reshape(rows, block).mean(axis=1) for one in (task.u, task.y))
    most = task.max_delay // block
    likelihood = _Likelihood(u, y, min(TAPS, after // block - 1), most)
    step = max(most // COARSE, 1)
    first = min((likelihood.best(0, np.array(start), 60) for start in STARTS), key=lambda f: f[0])
    tried, shape = {0: first}, first[1]
    for delay in range(step, most + 1, step):
        tried[delay] = likelihood.best(delay, shape)
        shape = tried[delay][1]
    while step > 1:
        best = min(tried, key=lambda d: tried[d][0])
        step = (step + 1) // 2
        for delay in (best - step, best + step):
            if 0 <= delay <= most and delay not in tried:
                tried[delay] = likelihood.best(delay, tried[best][1])
    best = min(tried, key=lambda d: tried[d][0])
    taps = likelihood.of(best)(likelihood.best(best, tried[best][1], 60)[1])[1]
    b = np.repeat(np.r_[np.zeros(best + 1), taps] / block, block)
    return of_polynomials(best * block, b, np.ones(1), task.dt)
