"""Correlation and noise level of a residual that comes sample by sample."""

from __future__ import annotations

from collections import deque


class RunningResidual:
    """Sums that tell what of a residual is correlated, and how large the rest is.

    Sums of B white samples have B times the variance of one; slow errors of a model show in the
    sums long before they show from sample to sample. Differences over `lag` samples hold twice
    the variance of what is uncorrelated over so short a time, and little of slow errors (the
    ratio to the whole is von Neumann's, Annals of Mathematical Statistics 12, 1941).

    Parameters
    ----------
    forgetting : float
        Factor by which a sample's weight falls from one sample to the next.
    lag : int, optional
        Samples, few beside the time in which a model's error changes.
    """

    def __init__(self, forgetting: float, lag: int = 1) -> None:
        self._forgetting = forgetting
        self._sum = 0.0
        self._squares = 0.0
        self._squared_sums = 0.0
        self._last: deque[float] = deque(maxlen=lag)
        self._changes = 0.0
        self._weight = 0.0

    def add(self, error: float) -> None:
        """Take in the residual of one sample."""
        self._sum += error
        self._squares = self._forgetting * self._squares + error**2
        self._squared_sums *= self._forgetting
        if len(self._last) == self._last.maxlen:
            self._changes = self._forgetting * self._changes + (error - self._last[0]) ** 2 / 2
            self._weight = self._forgetting * self._weight + 1.0
        self._last.append(error)

    def close_sum(self) -> None:
        """End one sum and begin the next."""
        self._squared_sums += self._sum**2
        self._sum = 0.0

    @property
    def inflation(self) -> float:
        """How many samples count as one, at least 1."""
        return max(self._squared_sums / self._squares, 1.0) if self._squares > 0 else 1.0

    @property
    def noise_std(self) -> float:
        """Standard deviation of what differs over `lag` samples; inf before there are any."""
        return float((self._changes / self._weight) ** 0.5) if self._weight > 0 else float("inf")
