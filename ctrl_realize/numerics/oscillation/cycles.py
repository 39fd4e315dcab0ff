"""Whether a signal oscillates, with which period and how regularly; its half cycles.

Three measures: the regularity of the zero crossings of the autocorrelation function [1]_, its decay
ratio [2]_, and the areas between zero crossings of the signal (IAE, [3]_), of which successive ones
are alike in an oscillation [4]_. Drift is removed by subtracting the moving average over one
period, which leaves the fundamental and its harmonics as they are; how the period is found, and
the smoothing, are our own.

References
----------
.. [1] N. F. Thornhill, B. Huang and H. Zhang, Detection of multiple oscillations in control loops,
   Journal of Process Control 13 (2003) 91-100.
.. [2] T. Miao and D. E. Seborg, Automatic detection of excessively oscillatory feedback control
   loops, IEEE International Conference on Control Applications, 1999, 359-364.
.. [3] T. Hägglund, A control-loop performance monitor, Control Engineering Practice 3 (1995)
   1543-1551.
.. [4] K. Forsman and A. Stattin, A new criterion for detecting oscillations in control loops,
   European Control Conference, Karlsruhe 1999, 2313-2316.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.signal import detrend, periodogram

from ..arrays import FloatArray
from ..signals.correlation import correlation

MOST_CROSSINGS = 11
"""Zero crossings of the autocorrelation function that are looked at [1]_."""
FEWEST_CYCLES = 4.0
"""Cycles in a record, without which the regularity of their length is not known."""
SHORTEST_PERIOD = 6.0
"""Samples of a period, below which half a cycle has no shape."""
_ALIKE_AREA, _ALIKE_LENGTH = 0.5, 0.7
"""Ratios from which on successive areas and lengths of half cycles are alike [4]_."""
_SMOOTHED = 0.25
"""Part of a period over which is averaged: 90 % of the fundamental are left."""
_HYSTERESIS = 0.1
"""Of the standard deviation: a signal that crosses zero by less has not crossed it."""


@dataclass(frozen=True, eq=False)
class Cycles:
    """Period in samples, and measures of the regularity of an oscillation.

    ``regularity`` is r of [1]_, ``decay_ratio`` that of the autocorrelation function,
    ``alike`` the part of successive half cycles that are alike, ``area`` the mean IAE of half a
    cycle in samples, ``count`` the number of periods in the signal.
    """

    period: float
    regularity: float
    decay_ratio: float
    alike: float
    area: float
    count: float


def without_drift(signal: FloatArray, period: float) -> FloatArray:
    """Subtract the moving average over one period; half a period at both ends is left out.

    `signal` is (..., N). An even number of samples is averaged with half weights at both ends.
    """
    n = signal.shape[-1]
    width = min(max(round(period), 2), n // 2)
    half = width // 2
    values = signal - signal[..., :1]  # so that the sums are small
    summed = np.concatenate([np.zeros_like(values[..., :1]), np.cumsum(values, axis=-1)], axis=-1)
    mean = (summed[..., width:] - summed[..., :-width]) / width
    if width % 2 == 0:
        mean = 0.5 * (mean[..., :-1] + mean[..., 1:])
    return np.asarray(values[..., half : half + mean.shape[-1]] - mean)


def smoothed(signal: FloatArray, period: float, part: float) -> FloatArray:
    """Average over a part of the period, with an odd number of samples."""
    width = 2 * round(0.5 * (part * period - 1)) + 1
    return signal if width < 3 else np.asarray(uniform_filter1d(signal, width))


def resolution(signal: FloatArray) -> float:
    """Smallest distance of two different values."""
    gaps = np.diff(np.unique(signal))
    return float(gaps[gaps > 1e-9 * np.abs(signal).max()].min(initial=np.inf))


def find_cycles(signal: FloatArray) -> Cycles | None:
    """Measure the strongest oscillation of `signal` (N,); None if nothing can be measured.

    Tried are the periods of the largest peaks of the periodogram and of the periodogram times the
    frequency, between two samples and a quarter of the record: the first may be drift, the second
    noise. The one whose autocorrelation function decays slower is taken.
    """
    n = signal.size
    if n < 4 * SHORTEST_PERIOD or np.ptp(signal) == 0:
        return None
    frequency, power = periodogram(detrend(signal), window="hann")
    inside = frequency >= FEWEST_CYCLES / n
    if not inside.any() or not power[inside].any():
        return None
    found = []
    for weight in (frequency, np.ones_like(frequency)):
        level = uniform_filter1d(power * weight, 3)[inside]
        cycles = _cycles(signal, 1 / float(frequency[inside][np.argmax(level)]))
        found += [] if cycles is None else [cycles]
    return max(found, key=lambda one: one.decay_ratio, default=None)


def _cycles(signal: FloatArray, period: float) -> Cycles | None:
    """Measure the oscillation whose period is about `period`."""
    n = signal.size
    regularity = decay = 0.0
    for _ in range(3):
        clean = smoothed(without_drift(signal, period), period, _SMOOTHED)
        rho = correlation(clean, clean, min(int(7 * period) + 2, clean.size - 1))
        found = _of_correlation(rho)
        if found is None or not 2 <= found[0] <= n / FEWEST_CYCLES:
            return None
        before, (period, regularity, decay) = period, found
        if abs(period - before) < 0.02 * before:
            break
    clean = smoothed(without_drift(signal, period), period, _SMOOTHED)
    alike, area = _alike(clean, crossings(clean))
    return Cycles(period, regularity, decay, alike, area, n / period)


def _of_correlation(rho: FloatArray) -> tuple[float, float, float] | None:
    """Period, regularity and decay ratio of an autocorrelation function."""
    where = np.flatnonzero(rho[:-1] * rho[1:] < 0)[:MOST_CROSSINGS]
    if where.size < 4:
        return None
    places = where + rho[where] / (rho[where] - rho[where + 1])
    lengths = np.diff(places)
    period = 2 * float(lengths.mean())
    spread = 2 * float(lengths.std(ddof=1))
    regularity = period / (3 * spread) if spread > 0 else np.inf
    # height of the second peak over the valley before it, against that of the valley over the first
    valley = float(rho[where[0] : where[1] + 2].min())
    peak = float(rho[where[1] : where[2] + 2].max())
    return period, regularity, (peak - valley) / (1 - valley)


def crossings(signal: FloatArray) -> FloatArray:
    """Zero crossings in samples, with hysteresis, interpolated between two samples."""
    least = _HYSTERESIS * float(signal.std())
    sides = np.flatnonzero(np.abs(signal) > least)
    if sides.size < 2:
        return np.empty(0)
    signs = np.sign(signal[sides])
    found = []
    for k in np.flatnonzero(np.diff(signs)):
        first, last = sides[k], sides[k + 1]
        part = signal[first : last + 1]
        # the middle of the crossings in between, if noise makes several
        zeros = np.flatnonzero(part[:-1] * part[1:] <= 0)
        fall = part[zeros] - part[zeros + 1]
        at = zeros + np.divide(part[zeros], fall, out=np.full(fall.shape, 0.5), where=fall != 0)
        found.append(first + float(np.mean(at)))
    return np.array(found)


def _alike(signal: FloatArray, edges: FloatArray) -> tuple[float, float]:
    """Part of successive half cycles on one side that are alike [4]_, and the mean area."""
    if edges.size < 6:
        return 0.0, 0.0
    summed = np.r_[0.0, np.cumsum(np.abs(signal))]
    areas = np.diff(np.interp(edges + 0.5, np.arange(summed.size), summed))
    lengths = np.diff(edges)
    score = 0.0
    for values, bound in ((areas, _ALIKE_AREA), (lengths, _ALIKE_LENGTH)):
        ratio = values[2:] / values[:-2]
        score += 0.5 * float(np.mean((ratio > bound) & (ratio < 1 / bound)))
    return score, float(areas.mean())
