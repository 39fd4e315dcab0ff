"""An output that is not at rest before its step: what it does there, and how it would go on."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import median_filter

from .arrays import FloatArray
from .noise_level import correlation_time

FEWEST = 24
"""Samples before the step from which a curve can be told from a line."""
_SIGNIFICANT = 30.0  # chi-square by which an exponential must beat the line
_RATES = np.geomspace(0.5, 30.0, 24)  # decay over the samples before the step


def relaxation(output: FloatArray, edge: int) -> FloatArray | None:
    """Exponential on which an output comes to rest, continued over the whole record.

    A plant whose input moved not long before the record goes on moving: by its free response,
    which bends, where a drift does not.

    Parameters
    ----------
    output : ndarray, shape (N,)
    edge : int
        Samples before the step.

    Returns
    -------
    ndarray, shape (N,)
        Level and exponential; None where a line tells the samples before the step as well.
    """
    if edge < FEWEST:
        return None
    # Single wild samples are no curve, the first of a record least of all.
    before = median_filter(output[:edge], size=5, mode="mirror")
    time = np.arange(edge) / edge
    line = np.stack([np.ones(edge), time], axis=1)
    straight = before - line @ np.linalg.lstsq(line, before, rcond=None)[0]
    best, rate, residual = np.inf, 0.0, straight
    weights: FloatArray = np.zeros(2)
    for tried in _RATES:
        columns = _level_and_decay(tried, time)
        found = np.asarray(np.linalg.lstsq(columns, before, rcond=None)[0], dtype=np.float64)
        error = before - columns @ found
        left = float(np.sum(error**2))
        if left < best:
            best, rate, weights, residual = left, float(tried), found, error
    variance = best / (edge - 3) * correlation_time(residual)
    if float(straight @ straight) - best <= _SIGNIFICANT * variance:
        return None
    return np.asarray(_level_and_decay(rate, np.arange(output.size) / edge) @ weights)


def _level_and_decay(rate: float, time: FloatArray) -> FloatArray:
    return np.stack([np.ones(time.size), np.exp(-rate * time)], axis=1)
