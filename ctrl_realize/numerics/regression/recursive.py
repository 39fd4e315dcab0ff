"""Recursive least squares with forgetting, and recursive statistics of its residual.

The regressors phi[k] depend on the input alone, so those for delay d are the same numbers d samples
later: ``R_d[k] = sum lambda^(k-i) phi[i-d] phi[i-d]^T = R_0[k-d]``. One Gram matrix and its past
serve all candidates, and a candidate costs one scaled vector sum per sample. Equations are solved
on demand.

References
----------
.. [1] L. Ljung, System Identification: Theory for the User, 2nd ed., Prentice Hall 1999, section
   11.2 (recursive least squares, forgetting factor).
.. [2] J. von Neumann, Distribution of the ratio of the mean square successive difference to the
   variance, Ann. Math. Statist. 12 (1941) 367-395, doi:10.1214/aoms/1177731677.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

from ..arrays import FloatArray, Matrices
from ..constants import LARGEST


class RunningResidual:
    """Recursive sums that separate the correlated part of a residual from the rest.

    Sums of B white samples have B times the variance of one; slow model errors show in the sums
    long before they show in single samples. Differences over `lag` samples contain twice the
    variance of the part that is uncorrelated over so short a time, and little of slow errors (the
    ratio to the total is von Neumann's).

    Parameters
    ----------
    forgetting : float
        Factor by which a sample's weight decreases from one sample to the next.
    lag : int, optional
        Number of samples, small compared with the time in which a model's error changes.
    """

    def __init__(self, forgetting: float, lag: int = 1) -> None:
        self._forgetting = forgetting
        self._sum = self._squares = self._squared_sums = self._changes = self._weight = 0.0
        self._last: deque[float] = deque(maxlen=lag)

    def add(self, error: float) -> None:
        """Process the residual of one sample."""
        self._sum += error
        self._squares = self._forgetting * self._squares + error**2
        self._squared_sums *= self._forgetting
        if len(self._last) == self._last.maxlen:
            self._changes = self._forgetting * self._changes + (error - self._last[0]) ** 2 / 2
            self._weight = self._forgetting * self._weight + 1.0
        self._last.append(error)

    def close_sum(self) -> None:
        """Finish one sum and start the next."""
        self._squared_sums += self._sum**2
        self._sum = 0.0

    @property
    def inflation(self) -> float:
        """Number of samples that count as one independent sample, at least 1."""
        return max(self._squared_sums / self._squares, 1.0) if self._squares > 0 else 1.0

    @property
    def noise_std(self) -> float:
        """Standard deviation of differences over `lag` samples; inf before there are any."""
        return float((self._changes / self._weight) ** 0.5) if self._weight > 0 else float("inf")


FORGOTTEN = 1e-6
"""Fraction of its initial state at which a system counts as settled."""


@dataclass(frozen=True, eq=False)
class BankSolution:
    """Least squares of every candidate over the forgetting window.

    ``theta`` (D, q) minimizes ``misfit`` (D,) = weighted squares of the residual plus those of
    the distance to the prior; `offset` (D,) is the constant of y; ``inverse`` (D, q, q) the
    inverse of the normal matrix, so that the covariance is noise variance times it; `power` is
    the weighted sum of squares of y about its mean.
    """

    theta: FloatArray
    weighted_sse: FloatArray
    offset: FloatArray
    inverse: FloatArray
    power: float


class DelayBank:
    """Exponentially weighted sums for the regressors of every delay low...high.

    Parameters
    ----------
    system : tuple (A, B, C, D)
        From the input to the q regressors, with zero initial state: arrays of shapes (n, n), (n,),
        (q, n), (q,).
    low, high : int
        Candidate delays, in samples.
    forgetting : float
        Factor lambda by which a sample's weight decreases from one sample to the next.
    """

    def __init__(self, system: Matrices, low: int, high: int, forgetting: float) -> None:
        A, B, C, D = system
        q, n = C.shape
        self.low, self.high, self.forgetting = low, high, forgetting
        # One product a sample gives the next state and the regressors.
        self._step = np.block([[A, B[:, None]], [C, D[:, None]]])
        self._state = np.zeros(n + 1)
        self._n = n
        depth = high + 1
        self._depth = depth
        self._slot = 0
        # Written twice, so that the last `depth` rows are always contiguous.
        self._phi = np.zeros((2 * depth, q))
        self._gram = np.zeros((2 * depth, q, q))
        self._sums = np.zeros((2 * depth, q))
        self._cross = np.zeros((high - low + 1, q))
        self._old_gram = np.zeros((high - low + 1, q, q))
        self._old_sums = np.zeros((high - low + 1, q))
        self._old_weight = 0.0
        self._last_gram = np.zeros((q, q))
        self._last_sums = np.zeros(q)
        self.weight = self.weight_squared = self._total = self._power = 0.0

    def settling(self) -> int | None:
        """Return the duration of the system's transient in samples; None if it does not decay."""
        radius = np.abs(np.linalg.eigvals(self._step[: self._n, : self._n])).max(initial=0.0)
        if radius >= 1 - 1e-9:
            return None
        return int(np.ceil(np.log(FORGOTTEN) / np.log(radius))) if radius > 0 else 0

    def restart(self) -> None:
        """Restart at the next sample; the past input is kept.

        The present R_0 is stored: ``R_d[k]`` is then ``R_0[k-d]`` minus its decayed value at the
        restart.
        """
        self._old_gram = self._past(self._gram).copy()
        self._old_sums = self._past(self._sums).copy()
        self._old_weight = 1.0
        self._cross[:] = 0.0
        self.weight = self.weight_squared = self._total = self._power = 0.0

    def update(self, u: float, y: float) -> None:
        """Process one sample; the cost does not depend on the number of samples before."""
        keep, depth = self.forgetting, self._depth
        self._state[-1] = u
        out = self._step @ self._state
        self._state[: self._n] = out[: self._n]
        phi = out[self._n :]
        self._last_gram = keep * self._last_gram + phi[:, None] * phi
        self._last_sums = keep * self._last_sums + phi
        slot = self._slot = (self._slot + 1) % depth
        for ring, value in (
            (self._phi, phi),
            (self._gram, self._last_gram),
            (self._sums, self._last_sums),
        ):
            ring[slot] = ring[slot + depth] = value
        self._cross *= keep
        self._cross += y * self._past(self._phi)
        self._old_weight *= keep
        self.weight = keep * self.weight + 1.0
        self.weight_squared = keep**2 * self.weight_squared + 1.0
        self._total = keep * self._total + y
        self._power = keep * self._power + y * y

    def _past(self, ring: FloatArray) -> FloatArray:
        """Rows of low...high samples ago, in this order."""
        newest = self._slot + self._depth
        # Rows newest-high ... newest-low, turned around.
        return ring[newest - self.high : newest - self.low + 1][::-1]

    def predict(self, delay: int, theta: FloatArray) -> float:
        """Return the response of one candidate to the input so far, without the offset."""
        return float(self._phi[self._slot + self._depth - delay] @ theta)

    def solve(self, prior: FloatArray, precision: FloatArray) -> BankSolution:
        """Solve for every candidate, with ``(theta - prior)^T diag(precision) (theta - prior)``
        added to the weighted squares.
        """
        sums = self._past(self._sums) - self._old_weight * self._old_sums
        gram = self._past(self._gram) - self._old_weight * self._old_gram
        gram -= sums[:, :, None] * sums[:, None, :] / self.weight
        cross = self._cross - sums * (self._total / self.weight)
        power = max(self._power - self._total**2 / self.weight, 0.0)
        peak = float(np.einsum("dii->di", gram).max(initial=0.0))
        # An input that never moved leaves zeros, one that moved by an implausibly small amount
        # squares that underflow; the floor is far below any information.
        floor = 1e-13 * peak if peak > LARGEST**-2 else 1.0
        precision = np.maximum(precision, floor)
        matrix = gram + np.diag(precision)
        # Ljung, section 11.2: theta = R^-1 f, both sums weighted by powers of lambda.
        inverse = np.linalg.inv(matrix)
        right = cross + precision * prior
        theta = np.einsum("dij,dj->di", inverse, right)
        misfit = power + prior @ (precision * prior) - np.einsum("di,di->d", theta, right)
        offset = (self._total - np.einsum("di,di->d", sums, theta)) / self.weight
        least: FloatArray = np.maximum(misfit, 0.0)
        return BankSolution(theta, least, offset, np.asarray(inverse, np.float64), power)
