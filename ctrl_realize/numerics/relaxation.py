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
    time = np.arange(output.size) / edge
    line = np.stack([np.ones(edge), time[:edge]], axis=1)
    straight = before - line @ np.linalg.lstsq(line, before, rcond=None)[0]
    best, curve = np.inf, straight
    for rate in _RATES:
        columns = np.stack([np.ones(output.size), np.exp(-rate * time)], axis=1)
        weights = np.linalg.lstsq(columns[:edge], before, rcond=None)[0]
        left = float(np.sum((before - columns[:edge] @ weights) ** 2))
        if left < best:
            best, curve = left, columns @ weights
    residual = before - curve[:edge]
    variance = best / (edge - 3) * correlation_time(residual)
    if float(straight @ straight) - best <= _SIGNIFICANT * variance:
        return None
    return np.asarray(curve)
