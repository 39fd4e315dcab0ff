"""Band in which a measured frequency response can be trusted."""

from __future__ import annotations

from typing import Literal

import numpy as np

from .._checks import rising, within
from ..errors import DataError, OptionError
from ..numerics.arrays import BoolArray
from ..numerics.rational.bands import running_median, widest_run
from .comparison import hertz
from .points import MeasuredPoints

DEFAULT_MIN_COHERENCE = 0.95
DEFAULT_MAX_RELATIVE_STD = 0.1
_SMOOTHED_POINTS = 5

Source = Literal["coherence", "std", "all", "given"]


def trusted_points(
    points: MeasuredPoints, min_coherence: float | None, band_hz: tuple[float, float] | None
) -> tuple[BoolArray, Source]:
    """Mark the points of the trusted band, and name its criterion."""
    if min_coherence is not None:
        within(min_coherence, "min_coherence", "coherence", 0, 1)
        if points.coherence is None:
            raise OptionError(
                "min_coherence is given, but the FRF has no coherence; pass band_hz=(low, high)"
            )
    if band_hz is not None:
        return _inside(points, band_hz), "given"
    if points.coherence is not None:
        limit = DEFAULT_MIN_COHERENCE if min_coherence is None else min_coherence
        good = running_median(points.coherence, _SMOOTHED_POINTS) >= limit
        missing = f"the coherence is below {limit:g} everywhere; lower min_coherence"
        return _widest(points, good, missing), "coherence"
    if points.std is not None:
        relative = running_median(points.std / np.abs(points.response), _SMOOTHED_POINTS)
        missing = f"the standard deviation is above {DEFAULT_MAX_RELATIVE_STD:.0%} everywhere"
        return _widest(points, relative <= DEFAULT_MAX_RELATIVE_STD, missing), "std"
    return np.ones(points.frequency_hz.size, dtype=np.bool_), "all"


def _inside(points: MeasuredPoints, band_hz: tuple[float, float]) -> BoolArray:
    low, high = rising(band_hz, "band_hz", "frequencies in Hz")
    frequency = points.frequency_hz
    inside = (frequency >= low) & (frequency <= high)
    if not inside.any():
        raise DataError(
            f"band_hz={band_hz!r} contains no point; the FRF covers {hertz(frequency[0])} to "
            f"{hertz(frequency[-1])}"
        )
    return inside


def _widest(points: MeasuredPoints, good: BoolArray, missing: str) -> BoolArray:
    """Return the widest band of good points; `missing` is for the message if there is none."""
    if not good.any():
        raise DataError(f"there is no trusted band: {missing}, or pass band_hz=(low, high)")
    return widest_run(good, points.frequency_hz)
