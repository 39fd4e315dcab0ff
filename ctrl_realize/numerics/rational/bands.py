"""Bands of a frequency grid in which a condition holds.

The band of good coherence is our own rule: the widest run in octaves, so that neither the many
points of a high octave nor one bad point is decisive.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from ..arrays import FloatArray, runs


def running_median(values: FloatArray, length: int) -> FloatArray:
    """Smooth by the median of `length` neighbours; the ends are extended by their last value.

    A single bad point does not end a good band, and a single good one does not make a band.

    Examples
    --------
    >>> import numpy as np
    >>> print(running_median(np.array([1.0, 1.0, 0.2, 1.0, 1.0]), 3))
    [1. 1. 1. 1. 1.]
    """
    half = min(length // 2, (values.size - 1) // 2)
    return np.asarray(median_filter(values, size=2 * half + 1, mode="nearest"))


def widest_run(good: NDArray[np.bool_], frequency: FloatArray) -> NDArray[np.bool_]:
    """Keep the contiguous run of true entries that spans the most octaves.

    Runs of equal width are decided by their number of points, then by the lower frequency.
    At least one entry must be true.

    Examples
    --------
    >>> import numpy as np
    >>> f = np.array([1.0, 2.0, 4.0, 8.0, 9.0, 10.0])
    >>> print(widest_run(np.array([1, 1, 1, 0, 1, 1], bool), f))
    [ True  True  True False False False]
    """
    starts, stops = runs(good)
    # Frequency zero has no octaves below the first positive one.
    lowest = frequency[frequency > 0].min() if np.any(frequency > 0) else 1.0
    octaves = np.log2(np.maximum(frequency, lowest))
    width = octaves[stops - 1] - octaves[starts]
    best = max(range(starts.size), key=lambda i: (width[i], stops[i] - starts[i], -starts[i]))
    kept = np.zeros(good.size, dtype=bool)
    kept[starts[best] : stops[best]] = True
    return kept
