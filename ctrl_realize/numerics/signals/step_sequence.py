"""Approximate a measured input by a short sequence of steps.

Our own rule: values that differ by less than the noise are one level.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import median_filter

from ..arrays import FloatArray, IntArray
from .edges import difference_noise, level_error

MOST_MOVES = 24  # of an exact input: each costs a response
_ALIKE = 3.0  # standard errors of the difference of two medians, up to which levels are one
_SEGMENT_GROWTH = 0.5  # of the distance from the edge, over which a droop is nearly straight


def input_moves(
    signal: FloatArray, edges: list[tuple[int, int]], stop: int
) -> tuple[IntArray, FloatArray]:
    """Steps of an input that is constant between its edges, up to noise and slow variation.

    Parameters
    ----------
    signal : ndarray, shape (N,)
        Measured input.
    edges : list of (index, samples)
        First sample of every edge, and its duration in samples.
    stop : int
        Samples from here on are not used.

    Returns
    -------
    index : ndarray, shape (L,)
        Samples at which the input moves.
    size : ndarray, shape (L,)
        Heights of the steps.

    Notes
    -----
    A clean input is returned exactly. A noisy one keeps its edges sample by sample; between them it
    is replaced by means over segments that grow from the edge on, if these means differ by more
    than their noise: the droop of an amplifier is followed, its noise is not. Levels that differ by
    less than their errors are one, or else a step and its way back would leave an offset that an
    integrator explains. Spikes of a few
    samples, too short to move the plant, are left out.
    """
    signal = signal[:stop]
    moves = np.diff(signal, prepend=signal[0])
    exact = np.flatnonzero(moves)
    if exact.size <= MOST_MOVES:
        return exact, moves[exact]
    noise = difference_noise(signal)
    level = np.empty_like(signal)
    bounds = [0, *[i for i, _ in edges if i < stop], stop]
    lengths = [0, *[n for i, n in edges if i < stop]]
    known: list[tuple[float, int]] = []
    for start, end, ramp in zip(bounds[:-1], bounds[1:], lengths, strict=True):
        settled = min(start + max(ramp - 1, 0), end)
        level[start:settled] = signal[start:settled]
        if settled < end:
            level[settled:end] = _steady(signal[settled:end], noise, grow=start > 0)
            if np.ptp(level[settled:end]) == 0:
                level[settled:end] = _known(known, level[settled], end - settled, noise)
    moves = np.diff(level, prepend=level[0])
    index = np.flatnonzero(moves)
    return index, moves[index]


def _steady(values: FloatArray, noise: float, grow: bool) -> FloatArray:
    """Piecewise means; a single mean if they do not differ significantly."""
    # Spikes: outliers from a running median of seven samples, at most three in a row.
    middle = median_filter(values, size=7, mode="nearest")
    values = np.where(np.abs(values - middle) > 6 * noise, middle, values)
    n = values.size
    mean = np.full(n, float(np.median(values)))
    if not grow or n < 16:
        return mean
    bounds = [0]
    while bounds[-1] < n:
        bounds.append(min(n, bounds[-1] + max(8, int(_SEGMENT_GROWTH * bounds[-1]))))
    widths = np.diff(bounds)
    means = np.add.reduceat(values, bounds[:-1]) / widths
    off = np.abs(means - mean[0])
    if np.all(off <= 6 * noise / np.sqrt(widths)):
        return mean
    return np.repeat(means, widths)


def _known(known: list[tuple[float, int]], level: float, count: int, noise: float) -> float:
    """Level of so many samples: an earlier one within its error, or a new one, which is kept."""
    for other, samples in known:
        if abs(level - other) <= _ALIKE * level_error(noise, count, samples):
            return other
    known.append((level, count))
    return level
