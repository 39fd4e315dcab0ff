"""Level and slope before a step: constant, drifting, or settling after an earlier change.

The significance of a slope is tested by `noise.is_drift`, with the correlation of the residual
after Geyer [1]_.

References
----------
.. [1] C. J. Geyer, Practical Markov chain Monte Carlo, Statist. Sci. 7 (1992) 473-483,
   doi:10.1214/ss/1177011137.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import median_filter

from ..arrays import FloatArray, IntArray
from ..rules import Rule
from .edges import difference_noise
from .noise import (
    DRIFT_ERRORS,
    LONG_REST,
    correlation_time,
    is_drift,
    mad_sigma,
    rounding_error,
    winsorised_sigma,
)

FEW = 5
"""With fewer samples before the step, those after it that are still at the baseline are added."""


def rest_line(
    before: FloatArray, after: FloatArray, remove_drift: bool | None
) -> tuple[float, float]:
    """Level at the step and slope per sample of the baseline.

    Parameters
    ----------
    before, after : ndarray, shapes (P,), (N,)
        Output before and from the step on.
    remove_drift : bool or None
        None: decided by the significance of the slope.

    Returns
    -------
    level, slope : float
        At sample 0 of `after`; the slope is 0 if no drift is removed.
    """
    if before.size < FEW:
        return _level_from_start(np.concatenate([before, after])), 0.0
    index = np.arange(-before.size, 0, dtype=np.float64)
    if remove_drift or (remove_drift is None and before.size >= LONG_REST):
        slope, level = np.polyfit(index, before, 1)
        residual = before - level - slope * index
        if remove_drift or is_drift(float(slope), float(residual.std()), residual):
            return float(level), float(slope)
    return float(np.mean(before)), 0.0


def _level_from_start(values: FloatArray) -> float:
    """Level of a record that starts at its step: the samples before the response starts."""
    start = values[:FEW]
    noise = difference_noise(values)
    still = [float(start[0])]
    for value in start[1:]:
        if abs(value - np.mean(still)) > max(3 * noise, 1e-12 * abs(float(start[0]))):
            break
        still.append(float(value))
    return float(np.mean(still))


FEWEST = 24
"""Samples before the step from which a curve can be distinguished from a line: four for every
parameter, after a median of five."""
_SIGNIFICANT = 30.0  # chi-square to beat the line; ablation: exponential before the step
_SMOOTH = 20.0
"""Deviation over that of the noise in fourth differences, from which on a baseline that no
polynomial describes is a motion. AR(1) noise with a pole of 0.99 has 13, a motor with hum 12, an
arm that swings 650. Ablation: swing before the step."""
_LEAST = 1e-4  # of a motion, that its noise is at least, as of a response
_ENOUGH = 4096  # samples that show a bend
_RATES = np.geomspace(0.5, 30.0, 24)  # decay over the samples before the step, next ones 20 % apart


def relaxation(output: FloatArray, edge: int, rows: IntArray | None = None) -> FloatArray | None:
    """Exponential before the step, extrapolated over the whole record.

    After an earlier change of its input a plant continues to move by its free response, which is
    curved, unlike a drift.

    Parameters
    ----------
    output : ndarray, shape (N,)
    edge : int
        Samples before the step.
    rows : ndarray, shape (N,), optional
        Samples that there are, relative to the step, if others are missing.

    Returns
    -------
    ndarray, shape (N,)
        Level and exponential; None if a straight line describes the samples before the step as
        well.
    """
    if edge < FEWEST:
        return None
    # Single outliers are not a curve, especially the first sample of a record.
    before = median_filter(output[:edge], size=5, mode="mirror")
    clock = np.arange(output.size) / edge if rows is None else 1 - rows / rows[0]
    time = clock[:edge]
    line = np.stack([np.ones(edge), time], axis=1)
    straight = before - line @ np.linalg.lstsq(line, before, rcond=None)[0]
    best, rate, residual = np.inf, 0.0, straight
    weights: FloatArray = np.zeros(2)
    for tried in _RATES:
        columns = _level_and_decay(tried, time)
        found = np.asarray(np.linalg.lstsq(columns, before, rcond=None)[0], dtype=np.float64)
        error = before - columns @ found
        left = float(np.sum(error**2))
        if left < best:
            best, rate, weights, residual = left, float(tried), found, error
    # On one level of a quantiser the residual is zero, and rounding would decide.
    noise = max(best / (edge - 3), rounding_error(output) ** 2)
    variance = noise * correlation_time(residual)
    if not (float(straight @ straight) - best > _SIGNIFICANT * variance and Rule.EXPONENTIAL.on):
        return None
    return np.asarray(_level_and_decay(rate, clock) @ weights)


def noise_about_a_motion(before: FloatArray, quantum: float, rows: IntArray | None = None) -> float:
    """Noise about a baseline that bends or swings, as after an earlier input; 0 if it does not.

    The free response of several lags may rise and fall, which neither a line nor an exponential
    does: a polynomial of degree four stands for it. That of a weakly damped pair swings, and is far
    smoother than its size.

    Parameters
    ----------
    before : ndarray, shape (P,)
        Samples before the step.
    quantum : float
        Quantisation step; the noise is at least ``quantum / sqrt(12)``.
    rows : ndarray, shape (P,), optional
        Their positions, if others are missing.
    """
    size = float(np.std(before))
    if before.size < FEWEST or np.ptp(before) <= rounding_error(before):
        return 0.0
    every = -(-before.size // _ENOUGH)
    time = np.linspace(-1, 1, before.size) if rows is None else rows / np.abs(rows).max()
    before, time = before[::every], time[::every]
    powers = np.linalg.qr(np.vander(time, 5, increasing=True))[0]
    tamed = median_filter(before, size=5, mode="mirror")
    weights = powers.T @ tamed
    left = before - powers @ weights
    sigma = max(winsorised_sigma(left, quantum, lost=5), quantum / np.sqrt(12))
    error = sigma * np.sqrt(correlation_time(left))
    if np.abs(weights[2:]).max() > DRIFT_ERRORS * error:
        return float(sigma) if Rule.BEND.on else 0.0
    if rows is not None:
        return 0.0
    # 70 is the sum of the squared coefficients of a fourth difference.
    rough = mad_sigma(np.diff(before, 4)) / np.sqrt(70)
    noise = max(rough, quantum / np.sqrt(12), _LEAST * size)
    return float(noise) if size > _SMOOTH * noise and Rule.SWING.on and Rule.BEND.on else 0.0


def _level_and_decay(rate: float, time: FloatArray) -> FloatArray:
    return np.stack([np.ones(time.size), np.exp(-rate * time)], axis=1)
