"""Frequency response from whole periods of a periodic input."""

from __future__ import annotations

import numpy as np

from ..errors import DataError
from ..numerics.arrays import BoolArray
from ..numerics.rational.spectra import PeriodStatistics, period_statistics
from .points import MeasuredPoints
from .welch import Stream

_MIN_LINE_POWER = 1e-4
"""Relative to the strongest line."""
_MIN_LINE_TO_NOISE = 10.0
"""Least power of a line relative to the variance of its mean."""
_MOST_SCATTER = 1 / 3
"""Part of the power of an input that may differ from period to period: half of that of a multisine
does over half of its period, more over any other wrong one, and 1/3 is noise of half its power."""


def from_periods(stream: Stream, period: int, skip: int) -> tuple[MeasuredPoints, float]:
    """MeasuredPoints by averaging whole periods; returns the estimate and the sample time."""
    stats, dt = _statistics(stream, period, skip)
    excited, count = _excited_lines(stats, period), stats.count
    U, Y = stats.mean_u[excited], stats.mean_y[excited]
    var_u, var_y, cov = stats.var_u[excited], stats.var_y[excited], stats.cov_yu[excited]
    response = Y / U
    relative = var_y / np.abs(Y) ** 2 + var_u / np.abs(U) ** 2 - 2 * (cov / (Y * U.conj())).real
    std = np.abs(response) * np.sqrt(np.maximum(relative, 0.0) / count)
    # Sums over the periods from means and variance: sum |U|^2 = P |mean|^2 + (P - 1) var.
    share = (count - 1) / count
    uu, yy = np.abs(U) ** 2 + share * var_u, np.abs(Y) ** 2 + share * var_y
    coherence = np.minimum(np.abs(Y * U.conj() + share * cov) ** 2 / (uu * yy), 1.0)
    frequency = np.asarray(np.fft.rfftfreq(period, dt)[excited], dtype=np.float64)
    return MeasuredPoints(frequency, response, coherence, std, count), dt


def _statistics(stream: Stream, period: int, skip: int) -> tuple[PeriodStatistics, float]:
    """Mean and variance over all whole periods; also the sample time."""
    inputs, outputs, dt, n_skipped = [], [], 0.0, 0
    for inputs_now, outputs_now, sample_time in stream:
        if (len(inputs_now), len(outputs_now)) != (1, 1):
            raise DataError(
                f"the records have {len(inputs_now)} inputs and {len(outputs_now)} outputs; "
                "expected one of each with period"
            )
        u, y, dt = inputs_now[0], outputs_now[0], sample_time
        whole_periods = u.size // period
        n_skipped += min(skip, whole_periods)
        span = slice(skip * period, whole_periods * period)
        inputs.append(u[span].reshape(-1, period))
        outputs.append(y[span].reshape(-1, period))
    count = sum(part.shape[0] for part in inputs)
    if count < 2:
        raise DataError(
            f"the records hold {count} periods of {period} samples after {n_skipped} were left "
            "out; at least two are needed"
        )
    return period_statistics(np.vstack(inputs), np.vstack(outputs)), dt


def _excited_lines(stats: PeriodStatistics, period: int) -> BoolArray:
    """Mark the lines that the input excites, between zero and the Nyquist frequency."""
    power = np.abs(stats.mean_u) ** 2
    lines = np.arange(power.size)
    inside = (lines > 0) & (lines < (period + 1) // 2)
    strongest = power[inside].max()
    if strongest == 0:
        raise DataError("the input is constant: it does not excite the plant")
    scatter = stats.var_u[inside].sum() / (stats.var_u + power)[inside].sum()
    if scatter > _MOST_SCATTER:
        raise DataError(
            f"{100 * scatter:.0f} % of the power of the input does not repeat after {period} "
            "samples; expected the samples of one period. Without period, the input may be any"
        )
    excited = inside & (power > _MIN_LINE_POWER * strongest)
    excited &= power > _MIN_LINE_TO_NOISE * stats.var_u / stats.count
    excited &= np.abs(stats.mean_y) > 0
    if not excited.any():
        raise DataError(
            f"the input has no significant harmonics; check that its period is {period} samples"
        )
    return np.asarray(excited, dtype=np.bool_)
