"""Phase of controller output and process value by their cross-correlation function.

The indices and limits are those of Horch [1]_ [2]_: for a loop with a self-regulating process the
function is odd if the valve sticks, and even if the oscillation comes from outside or from tight
tuning. The limits allow an error of the phase of 30 degrees.

References
----------
.. [1] A. Horch, A simple method for detection of stiction in control valves, Control Engineering
   Practice 7 (1999) 1221-1231.
.. [2] A. Horch, Condition monitoring of control loops, PhD thesis, Royal Institute of Technology,
   Stockholm 2000, chapter 4.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import FloatArray
from ..signals.correlation import correlation

ODD_SHIFT, EVEN_SHIFT = 2 / 3, 1 / 3
ODD_HEIGHT, EVEN_HEIGHT = 1 / 3, (2 - np.sqrt(3)) / (2 + np.sqrt(3))
"""Limits of the indices: a cosine shifted by 60 to 90 degrees is odd, by up to 30 even."""


@dataclass(frozen=True, eq=False)
class CrossCorrelation:
    """Cross-correlation function and its indices.

    ``lags`` in samples, ``values`` the correlation of the process value with the output `lags`
    later; ``shift`` and ``height`` are the indices of time and height, NaN if the function has
    no zeros on both sides.
    """

    lags: FloatArray
    values: FloatArray
    shift: float
    height: float


def cross_correlation(output: FloatArray, value: FloatArray, period: float) -> CrossCorrelation:
    """Correlate controller output and process value, both (N,), over one period on both sides."""
    most = min(int(np.ceil(period)) + 1, output.size - 1)
    right = correlation(output, value, most)
    left = correlation(value, output, most)
    values = np.r_[left[:0:-1], right]
    lags = np.arange(-most, most + 1, dtype=np.float64)
    after, before = _first_zero(right), _first_zero(left)
    if np.isnan(after + before) or after + before == 0:
        return CrossCorrelation(lags, values, np.nan, np.nan)
    inside = values[(lags >= -before) & (lags <= after)]
    middle = float(right[0])
    largest = float(inside[np.argmax(np.abs(inside))])
    shift = abs(after - before) / (after + before)
    height = abs(middle - largest) / abs(middle + largest) if middle + largest else np.inf
    return CrossCorrelation(lags, values, shift, height)


def _first_zero(values: FloatArray) -> float:
    """Lag of the first zero of a function that begins at lag zero."""
    if values[0] == 0:
        return 0.0
    where = np.flatnonzero(values[:-1] * values[1:] <= 0)
    if not where.size:
        return np.nan
    k = int(where[0])
    return k + float(values[k] / (values[k] - values[k + 1]))
