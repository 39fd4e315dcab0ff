"""Installed characteristics of valves: static maps from travel to flow.

Inherent characteristics as defined in [1]_: with equal percentages the relative change of the
flow is proportional to the change of the travel. Which curve is installed depends on the pressures.

References
----------
.. [1] IEC 60534-2-4, Industrial-process control valves, Part 2-4: Flow capacity, inherent flow
   characteristics and rangeability.
"""

from __future__ import annotations

import numpy as np

from ..arrays import FloatArray


def equal_percentage(travel: FloatArray, rangeability: float) -> FloatArray:
    """Relative flow ``R^(h - 1)`` at relative travels h, 0...1; R is the rangeability."""
    return np.asarray(rangeability ** (travel - 1.0))


def quick_opening(travel: FloatArray, exponent: float = 0.5) -> FloatArray:
    """Relative flow ``h^a`` at relative travels h >= 0, a < 1 (square root by default)."""
    return np.asarray(np.maximum(travel, 0.0) ** exponent)


def piecewise_linear(travel: FloatArray, at: FloatArray, flow: FloatArray) -> FloatArray:
    """Interpolate a measured characteristic, flows (K,) at travels (K,), level outside."""
    return np.asarray(np.interp(travel, at, flow))
