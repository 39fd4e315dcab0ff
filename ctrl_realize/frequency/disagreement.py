"""Flag for a measured frequency response that contradicts a model."""

from __future__ import annotations

import numpy as np

from .._flags import Flag, flagged
from ..numerics.rational.bands import running_median, widest_run
from .comparison import FRFComparison, hertz

CLOSE, FAR = 0.05, 0.2
"""Relative errors (rms, in the trusted band) below which a model agrees, above which it does
not."""

_SMOOTHED_POINTS = 3  # a single bad point is not a disagreement


def disagreement(comparison: FRFComparison) -> Flag | None:
    """Flag for a model whose error exceeds the noise of the measurement.

    ``"frf_differs"`` from 5 % (rms in the trusted band), ``"frf_disagrees"`` from 20 %.
    """
    error, noise = comparison.rms_relative_error, comparison.relative_noise or 0.0
    beyond = float(np.sqrt(max(error**2 - noise**2, 0.0)))
    if beyond < CLOSE:
        return None
    return flagged(
        "frf_differs" if beyond < FAR else "frf_disagrees",
        error=100 * error,
        worst=_worst(comparison),
    )


def _worst(comparison: FRFComparison) -> str:
    """Name the widest band in which the error exceeds the limit."""
    inside = comparison.trusted
    hz, error = comparison.frequency_hz[inside], comparison.relative_error[inside]
    worst = int(np.argmax(error))
    at = f"{100 * error[worst]:.3g} % at {hertz(hz[worst])}"
    limit = FAR if np.sqrt(np.mean(error**2)) >= FAR else CLOSE
    off = running_median(error, _SMOOTHED_POINTS) > limit
    if not off.any():
        return f"largest error {at}"
    band = hz[widest_run(off, hz)]
    decibels, degrees = (
        values[inside][worst] for values in (comparison.gain_error_db, comparison.phase_error_deg)
    )
    return (
        f"by more than {100 * limit:.0f} % from {hertz(band[0])} to {hertz(band[-1])}, "
        f"largest error {at} ({decibels:+.1f} dB, {degrees:+.0f} deg)"
    )
