"""How fast a step response rises, in the presence of noise.

Rise time in its usual sense, 10 % to 90 %; the averaging is our own.
"""

from __future__ import annotations

import numpy as np

from ..arrays import FloatArray
from .filters import moving_mean


def rise_time(step: FloatArray, dt: float) -> float:
    """Time in s from 10 % to 90 % of the final change of a step response.

    The final level is the median of the last tenth. Crossings are those of the response
    averaged over a window that is shortened until it is small beside the rise itself, so that
    noise neither starts nor ends the rise early.

    Parameters
    ----------
    step : ndarray, shape (N,), N >= 5
        Starts at rest at 0.
    dt : float
        Sample time in s.
    """
    final = float(np.median(step[-max(step.size // 10, 3) :]))
    largest = float(step[np.argmax(np.abs(step))])
    if abs(final) <= 1e-100 * abs(largest):
        final = largest or 1.0
    shape = step / final
    window = max(step.size // 20, 1)
    while True:
        half = window // 2
        smooth = moving_mean(np.append(shape, np.full(half, shape[-1])), 2 * half + 1)[: shape.size]
        high = int(np.argmax(smooth >= 0.9)) if (smooth >= 0.9).any() else smooth.size - 1
        low_side = np.flatnonzero(smooth[: high + 1] <= 0.1)
        low = int(low_side[-1]) if low_side.size else 0
        best = max(_crossing(smooth, high, 0.9) - _crossing(smooth, low + 1, 0.1), 0.8)
        if window == 1 or window <= best / 5:
            break
        window = max(window // 2, 1)
    return best * dt


def _crossing(values: FloatArray, index: int, level: float) -> float:
    """Position between index - 1 and index where the level is crossed."""
    if index <= 0 or index >= values.size:
        return float(index)
    low, high = values[index - 1], values[index]
    if high == low or not min(low, high) <= level <= max(low, high):
        return float(index)
    return index - 1 + float((level - low) / (high - low))
