"""The level, and the drift, of an output before a step."""

from __future__ import annotations

import numpy as np

from .arrays import FloatArray
from .edges import difference_noise

FEW = 5
"""With fewer samples before the step, those after it that are still at rest are added."""

MIN_DRIFT_SAMPLES = 50
SIGNIFICANT = 5.0


def rest_line(
    before: FloatArray, after: FloatArray, remove_drift: bool | None
) -> tuple[float, float]:
    """Level at the step and slope per sample of an output at rest.

    Parameters
    ----------
    before, after : ndarray, shapes (P,), (N,)
        Output before and from the step on.
    remove_drift : bool or None
        None decides by the significance of the slope.

    Returns
    -------
    level, slope : float
        At sample 0 of `after`; the slope is 0 when no drift is removed.
    """
    if before.size < FEW:
        return _level_from_start(np.concatenate([before, after])), 0.0
    index = np.arange(-before.size, 0, dtype=np.float64)
    if remove_drift or (remove_drift is None and before.size >= MIN_DRIFT_SAMPLES):
        slope, level = np.polyfit(index, before, 1)
        if remove_drift or _slope_is_real(before - level - slope * index, slope):
            return float(level), float(slope)
    return float(np.mean(before)), 0.0


def _slope_is_real(residual: FloatArray, slope: float) -> bool:
    """Compare a slope with its standard error, correlated residuals allowed for."""
    n = residual.size
    sigma = float(residual.std())
    scale = float(np.abs(slope)) * n
    if sigma <= 1e-12 * scale:
        return scale > 0
    # Correlation over lags makes n samples worth less: the sum of the autocorrelation up to
    # its first zero says by how much.
    centred = residual - residual.mean()
    spectrum = np.abs(np.fft.rfft(centred, 2 * n)) ** 2
    correlation = np.fft.irfft(spectrum)[:n]
    correlation = correlation / correlation[0]
    negative = np.flatnonzero(correlation <= 0)
    lags = int(negative[0]) if negative.size else n
    inflation = max(1.0, 2 * float(correlation[:lags].sum()) - 1)
    error = sigma * np.sqrt(12 * inflation / n**3)
    # A drift that is lost in the noise over the record before the step does no harm.
    return bool(abs(slope) > SIGNIFICANT * error)


def _level_from_start(values: FloatArray) -> float:
    """Level of a record that starts at its step: the samples that have not moved yet."""
    start = values[:FEW]
    noise = difference_noise(values)
    still = [float(start[0])]
    for value in start[1:]:
        if abs(value - np.mean(still)) > max(3 * noise, 1e-12 * abs(float(start[0]))):
            break
        still.append(float(value))
    return float(np.mean(still))
