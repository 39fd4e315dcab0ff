"""Slew-rate limit, saturation, dead zone and resolution.

Definitions as in [1]_, which has saturation, dead zone and rate limits as standard nonlinearities.

References
----------
.. [1] H. K. Khalil, Nonlinear Systems, 3rd ed., Prentice Hall 2002, section 1.2.7 (Common
   nonlinearities).
"""

from __future__ import annotations

import numpy as np

from ..arrays import FloatArray


def slew_limited(
    position: FloatArray, opening: float, closing: float, dt: float, start: float | None = None
) -> FloatArray:
    """Follow `position` (N,) at no more than `opening` upwards and `closing` downwards.

    Rates are positive, in units of the position per second; `dt` is the sample time in s, `start`
    the position before the first sample, by default the first one. A step of height h is
    complete after ``h / opening``, exactly if this is a multiple of `dt`.
    """
    up, down = opening * dt, -closing * dt
    out = []
    current = float(position[0]) if start is None else start
    for wanted in position.tolist():
        move = wanted - current
        current = current + up if move > up else current + down if move < down else wanted
        out.append(current)
    return np.array(out)


def without_dead_zone(position: FloatArray, low: float, high: float) -> FloatArray:
    """Return what a dead zone between `low` and `high` lets through: 0 inside, slope 1 outside."""
    return np.asarray(position - np.clip(position, low, high))


def resolved(position: FloatArray, step: float, start: float | None = None) -> FloatArray:
    """Move in whole steps of a resolution, towards the input once it is a step away.

    Resolution as the standards of valves use it: the smallest change of the input that moves the
    output, without a reversal. The position (N,) begins at `start`, by default the first input.
    """
    out = []
    current = float(position[0]) if start is None else start
    near = step * (1 - 1e-9)  # whether a step is complete must not depend on rounding
    for wanted in position.tolist():
        away = wanted - current
        if abs(away) >= near:
            current += step * float(int(away / near))
        out.append(current)
    return np.array(out)
