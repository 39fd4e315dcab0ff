"""Dead times near samples: the sum of squares has a kink where the response starts at a sample.

Between two samples it is smooth, so a step ends at the next sample and continues on its other side;
a kink is a minimum if the cost decreases towards it on both sides. Our own rule.
"""

from __future__ import annotations

import numpy as np

from ..arrays import BoolArray, FloatArray, IntArray
from .varpro import Bounds

BESIDE = 1e-8
"""Distance in samples from a sample at which a dead time counts as being on one side of it."""


def cell(
    at: FloatArray, bounds: Bounds, dt: float, pinned: BoolArray, beyond: FloatArray | float = 0.0
) -> tuple[FloatArray, FloatArray]:
    """Bounds of every row; those of its dead time are `beyond` samples from the neighbouring."""
    low, high = (np.tile(bound, (len(at), 1)) for bound in (bounds.low, bounds.high))
    if bounds.smooth:
        low[pinned, 0] = high[pinned, 0] = at[pinned, 0]
        return low, high
    sample = np.ceil(at[:, 0] / dt)
    low[:, 0] = np.maximum(low[:, 0], (sample - 1 - beyond + BESIDE) * dt)
    high[:, 0] = np.minimum(high[:, 0], (sample + beyond - BESIDE) * dt)
    held = pinned | (low[:, 0] > high[:, 0])
    low[held, 0] = high[held, 0] = at[held, 0]
    return low, high


def beside_a_sample(dead_time: FloatArray, bounds: Bounds, dt: float) -> FloatArray:
    """Dead times (B,) within their bounds that do not coincide with a sample."""
    if bounds.smooth:
        return dead_time
    sample = np.round(dead_time / dt)
    at_one = np.abs(dead_time / dt - sample) < BESIDE
    earlier, later = (sample - BESIDE) * dt, (sample + BESIDE) * dt
    moved = np.where(earlier >= bounds.low[0], earlier, np.minimum(later, bounds.high[0]))
    return np.where(at_one, moved, dead_time)


def leaving(
    at: FloatArray,
    downhill: FloatArray,
    low: FloatArray,
    high: FloatArray,
    bounds: Bounds,
    pinned: BoolArray,
) -> IntArray:
    """-1 or 1 for rows with a dead time at a sample beyond which the cost decreases."""
    dead_time, way = at[:, 0], downhill[:, 0]
    later = (dead_time >= high[:, 0]) & (way > 0) & (high[:, 0] < bounds.high[0])
    earlier = (dead_time <= low[:, 0]) & (way < 0) & (low[:, 0] > bounds.low[0])
    return np.where(pinned, 0, later.astype(np.int64) - earlier.astype(np.int64))


def other_side(dead_time: FloatArray, way: IntArray, dt: float) -> FloatArray:
    """Dead times (B,) beyond the sample that is reached, -1 (earlier) or 1 (later)."""
    sample = np.round(dead_time / dt)
    return np.asarray((sample + way * BESIDE) * dt)


def snapped(dead_time: FloatArray, dt: float) -> FloatArray:
    """Remove the offset of a dead time from a sample."""
    sample = np.round(dead_time / dt)
    # Adding zero avoids a negative zero.
    return np.where(np.abs(dead_time / dt - sample) <= 2 * BESIDE, sample * dt + 0.0, dead_time)
