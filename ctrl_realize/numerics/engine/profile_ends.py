"""Ends of a profile-likelihood interval: where the excess of the misfit crosses a threshold.

References
----------
.. [1] D. J. Venzon and S. H. Moolgavkar, A method for computing profile-likelihood-based confidence
   intervals, Appl. Statist. 37 (1988) 87-94, doi:10.2307/2347496.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..arrays import FloatArray
from ..constants import CHI2_95


def bracket_ends(excess: Mapping[float, float]) -> list[tuple[float, float]]:
    """Pairs of neighbours, inside and outside, at the lower and upper end, if there are any."""
    dead_times = sorted(excess)
    inside = [i for i, at in enumerate(dead_times) if excess[at] <= CHI2_95]
    first, last = inside[0], inside[-1]
    found = [(dead_times[first], dead_times[first - 1])] if first > 0 else []
    return found + (
        [(dead_times[last], dead_times[last + 1])] if last < len(dead_times) - 1 else []
    )


def root_of(excess: float) -> float:
    """Square root of an excess that may be negative by rounding."""
    return float(np.sqrt(max(excess, 0.0)))


def profile_limits(
    dead_time: FloatArray, excess: FloatArray, threshold: float = CHI2_95
) -> tuple[float, float]:
    """Ends of the set of dead times with an excess below the threshold (default: 95 %)."""
    inside = np.flatnonzero(excess <= threshold)
    first, last = int(inside[0]), int(inside[-1])
    root = np.sqrt(np.maximum(excess, 0.0))
    edge = float(np.sqrt(threshold))
    low = float(dead_time[0])
    if first > 0:
        low = float(np.interp(edge, root[[first, first - 1]], dead_time[[first, first - 1]]))
    high = float(dead_time[-1])
    if last < dead_time.size - 1:
        high = float(np.interp(edge, root[[last, last + 1]], dead_time[[last, last + 1]]))
    return low, high
