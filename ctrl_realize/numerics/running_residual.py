"""Correlation of a residual that comes sample by sample."""

from __future__ import annotations


class RunningResidual:
    """Sums that tell by how much correlation lowers the number of samples of a residual.

    Sums of B white samples have B times the variance of one; slow errors of a model show in the
    sums long before they show from sample to sample.

    Parameters
    ----------
    forgetting : float
        Factor by which a sample's weight falls from one sample to the next.
    """

    def __init__(self, forgetting: float) -> None:
        self._forgetting = forgetting
        self._sum = 0.0
        self._squares = 0.0
        self._squared_sums = 0.0

    def add(self, error: float) -> None:
        """Take in the residual of one sample."""
        self._sum += error
        self._squares = self._forgetting * self._squares + error**2
        self._squared_sums *= self._forgetting

    def close_sum(self) -> None:
        """End one sum and begin the next."""
        self._squared_sums += self._sum**2
        self._sum = 0.0

    @property
    def inflation(self) -> float:
        """How many samples count as one, at least 1."""
        return max(self._squared_sums / self._squares, 1.0) if self._squares > 0 else 1.0
