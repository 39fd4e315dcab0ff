"""Visible onset of a response, onset of a correlation, and rise time of a step response.

Prewhitened correlation as in [1]_ and [2]_, slope of the phase as in [3]_. The visible onset is our
own rule: a threshold in standard deviations, and extrapolation of the line through two thresholds
to the baseline. Rise time in the usual sense, 10 % to 90 %; the averaging is our own.

References
----------
.. [1] G. E. P. Box and G. M. Jenkins, Time Series Analysis: Forecasting and Control, Holden-Day
   1970, chapter 11.
.. [2] C. H. Knapp and G. C. Carter, The generalized correlation method for estimation of time
   delay, IEEE Trans. Acoust. Speech Signal Process. 24 (1976) 320-327,
   doi:10.1109/TASSP.1976.1162830.
.. [3] S. Bjorklund and L. Ljung, A review of time-delay estimation techniques, Proc. 42nd IEEE
   Conf. Decision and Control (2003) 2502-2507, doi:10.1109/CDC.2003.1272997.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter
from scipy.special import ndtri

from ..arrays import FloatArray, IntArray
from ..constants import PIECE
from ..rules import Rule
from .correlation import autoregression, correlation
from .filters import moving_mean


@dataclass(frozen=True, eq=False)
class CorrelationOnset:
    """Cross-correlation of the prewhitened input with the output, filtered alike.

    ``onset`` is the first lag where the correlation exceeds its bound (-1 if there is none), and
    `peak` the lag of the largest.
    """

    onset: int
    peak: int


def correlation_onset(
    drive: FloatArray, output: FloatArray, lags: int, confidence: float
) -> CorrelationOnset:
    """Correlate input and output after prewhitening of the input.

    After prewhitening, the correlation is proportional to the pulse response (Box and Jenkins, Time
    Series Analysis, chapter 11); the bound is for all lags together.

    Parameters
    ----------
    drive, output : ndarray, shape (N,)
    lags : int
        Lags 0...lags.
    confidence : float
        Confidence: probability of no significant correlation if there is none.
    """
    c = autoregression(drive, min(20, drive.size // 20))
    whiten = np.concatenate([[1.0], -c])
    white = lfilter(whiten, [1.0], drive - drive.mean())[c.size :]
    alike = lfilter(whiten, [1.0], output - output.mean())[c.size :]
    rho = correlation(alike, white, lags)
    # An input that is held for many samples is zero between its changes after prewhitening: few
    # products then contribute to a lag, and their squares determine its scatter (White 1980).
    drive2, output2 = (white - white.mean()) ** 2, (alike - alike.mean()) ** 2
    pairs = np.array([drive2[: white.size - k] @ output2[k:] for k in range(lags + 1)])
    total = float(drive2.sum() * output2.sum())
    spread = np.sqrt(np.maximum(pairs / total if total > 0 else 0.0, 1 / white.size))
    bound = -ndtri((1 - confidence) / 2 / (lags + 1)) * spread
    # The remaining autocorrelation of the prewhitened input shows a late response early as well.
    left = np.abs(correlation(white, white, lags))
    left[left < 4 / np.sqrt(white.size)] = 0.0
    bound += [left[1 : lags + 1 - k] @ np.abs(rho[k + 1 :]) for k in range(lags + 1)]
    seen = np.flatnonzero(np.abs(rho) > bound)
    onset = int(seen[0]) if seen.size else -1
    return CorrelationOnset(onset, int(np.abs(rho).argmax()))


def phase_slope(omega: FloatArray, phase: FloatArray, share: float) -> tuple[float, float]:
    """Fit a line to the phase over the top of the band: its negative slope in s, and the std.

    Parameters
    ----------
    omega : ndarray, shape (K,), K >= 3
        Rising, rad/s.
    phase : ndarray, shape (K,)
        Unwrapped, rad.
    share : float
        Part of the band, from its upper end in rad/s; at least three points are used.
    """
    count = max(int(np.count_nonzero(omega >= omega[-1] - share * np.ptp(omega))), 3)
    x, y = omega[-count:], phase[-count:]
    (slope, _), covariance = np.polyfit(x, y, 1, cov=True)
    return -float(slope), float(np.sqrt(covariance[0, 0]))


_SMOOTHINGS = (1, 8, 64)
"""Samples; a small step in much noise shows only in means. Ablation: first motion in means."""


@dataclass(frozen=True)
class FirstMotion:
    """Time at which an output leaves its baseline, in samples after the input's edge.

    `crossing` is the first sample of a lasting excursion beyond 5 sigma (1.5 quantisation steps,
    0.5 % of the whole response); `onset` extrapolates the rise from there back to the baseline, at
    most to the last sample inside one sigma.
    """

    crossing: int
    onset: float
    rest: float
    sign: float
    span: float


def first_motion(
    output: FloatArray,
    edge: int,
    sigma: float,
    quantum: float,
    drift: float,
    rows: IntArray | None = None,
) -> FirstMotion | None:
    """Find the visible onset of a record; None if the output does not move.

    Parameters
    ----------
    output : ndarray, shape (N,)
    edge : int
        Sample at which the input has moved.
    sigma, quantum : float
        Noise level and quantisation step of the output.
    drift : float
        Slope before the step, per sample. It is extrapolated for as long as it was observed.
    rows : ndarray, shape (N,), optional
        Samples that there are, relative to the edge of the input, if others are missing. Slope and
        times are then in these units, and every duration is one of existing samples.
    """
    n = output.size
    quantum *= 1 + 1e-6  # levels lie on its halves, and on thresholds: rounding would decide
    if edge >= 8:
        level = output - drift * _clipped_index(n, edge, rows) if drift else output
        rest = float(np.median(level[max(edge - 200, 0) : edge]))
    else:
        level = output
        rest = float(np.median(output[: edge + 5]))
    moved = level - rest
    end = max(5, (n - edge) // 50)
    size = np.abs(moved[edge:])
    span = float(np.percentile(size, 80, overwrite_input=True))
    span = max(abs(float(np.median(moved[-end:]))), span)
    del size, level  # to save the memory of a long record
    single, noise = moved, sigma
    for smoothing in _SMOOTHINGS:
        if smoothing > 1:
            moved = moving_mean(single, smoothing)
            sigma = noise / np.sqrt(smoothing)
        threshold = max(5 * sigma, 1.5 * quantum, 0.005 * span)
        crossing = _lasting_excursion(moved[edge:], threshold, smoothing)
        if crossing is not None or not Rule.MEANS.on:
            break
    if crossing is None:
        return None
    lasting = int(_lasting(np.array(crossing), smoothing))
    stretch = moved[edge + crossing : edge + crossing + lasting]
    sign = float(np.sign(np.mean(stretch)))
    rise = np.multiply(moved, sign, out=moved)
    width = max(1, round(0.03 * crossing))
    if width > 1:
        rise = moving_mean(rise, width)
    inside = max(sigma, 0.5 * quantum) / np.sqrt(width)
    still = np.flatnonzero(rise[edge : edge + crossing + 1] <= inside)
    last = float(still[-1]) if still.size else 0.0
    onset = max(_extrapolate(rise[edge:], crossing, threshold), last)
    if rows is not None:
        after = rows[edge:]
        onset = float(np.interp(onset, np.arange(after.size), after))
        crossing = int(after[crossing])
    return FirstMotion(crossing, onset, rest, sign, span)


def _clipped_index(n: int, edge: int, rows: IntArray | None) -> FloatArray:
    """Samples from the edge on, at most as many as before it."""
    if rows is not None:
        return np.clip(rows.astype(np.float64), rows[0], -rows[0])
    index = np.arange(-edge, n - edge, dtype=np.float64)
    return np.clip(index, -edge, edge, out=index)


def _lasting(crossing: IntArray, smoothing: int) -> IntArray:
    """Required duration of an excursion: a quarter of the time until it started."""
    return np.asarray(np.maximum(3 * smoothing, np.ceil(0.25 * crossing).astype(np.int64)))


def _lasting_excursion(moved: FloatArray, threshold: float, smoothing: int) -> int | None:
    size = np.abs(moved)
    over = size > threshold
    if not over.any():
        return None
    # Sums up to every sample, so that many short excursions cost no more than a few.
    outside = np.cumsum(size > 0.6 * threshold, dtype=np.int32)
    del size
    upward = np.cumsum(np.sign(moved).astype(np.int8), dtype=np.int32)
    for start in range(0, moved.size, PIECE):
        beyond = start + np.flatnonzero(over[start : start + PIECE])
        last = np.minimum(beyond + _lasting(beyond, smoothing), moved.size) - 1
        count = last + 1 - beyond
        # The first of them is outside, and the sign is not zero there.
        part = (outside[last] - outside[beyond] + 1) / count
        balance = np.abs(upward[last] - upward[beyond] + np.sign(moved[beyond])) / count
        lasting = beyond[(part > 0.8) & (balance > 0.7)]
        if lasting.size:
            return int(lasting[0])
    return None


def _extrapolate(rise: FloatArray, crossing: int, threshold: float) -> float:
    """Extrapolate the line through one and three thresholds to the baseline."""
    higher = np.flatnonzero(rise[crossing:] > 3 * threshold)
    if not higher.size:
        return float(crossing)
    second = min(crossing + max(int(higher[0]), 1), rise.size - 1)
    low, high = float(rise[crossing]), float(rise[second])
    if high <= low:
        return float(crossing)
    return crossing - low * (second - crossing) / (high - low)


def rise_time(step: FloatArray, dt: float) -> float:
    """Time in s from 10 % to 90 % of the final change of a step response.

    The final level is the median of the last tenth. The crossings are those of the response
    averaged over a window that is shortened until it is short compared with the rise, so that noise
    affects neither end.

    Parameters
    ----------
    step : ndarray, shape (N,), N >= 5
        Starts at 0.
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
