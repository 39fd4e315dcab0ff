"""Find the edges of a measured input signal.

Levels are medians and noise is a median absolute deviation [1]_, both insensitive to a minority of
samples. The definition of the beginning and end of an edge is our own: within `REST_TOLERANCE` of
its height from the neighbouring levels.

References
----------
.. [1] F. R. Hampel, The influence curve and its role in robust estimation, J. Amer. Statist. Assoc.
   69 (1974) 383-393, doi:10.1080/01621459.1974.10482962.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import median_filter, rank_filter

from ..arrays import FloatArray
from ..constants import PIECE

REST_TOLERANCE = 0.02
"""The input has left its level if the difference is this fraction of the step (or 5 sigma)."""


@dataclass(frozen=True)
class Edge:
    """Samples index...index + samples - 1 lead from `baseline` to `baseline + amplitude`.

    The level before it is valid from sample `start` on, that after it up to sample `stop`.
    """

    index: int
    amplitude: float
    baseline: float
    samples: int
    start: int
    stop: int


def difference_noise(values: FloatArray) -> float:
    """Noise level (sigma) from first differences, insensitive to steps, drift and rare spikes.

    Zero for a signal in which most neighbours are equal, such as a clean or coarse one.
    """
    if values.size < 3:
        return 0.0
    steps = np.diff(values)
    steps -= np.median(steps)
    np.abs(steps, out=steps)
    return float(np.median(steps, overwrite_input=True) / (0.6745 * np.sqrt(2)))


def level_error(noise: float, first: int, second: int) -> float:
    """Standard error of the difference of two levels, medians of so many samples with noise."""
    return float(noise * np.sqrt(np.pi / 2 * (1 / max(first, 1) + 1 / max(second, 1))))


def despike(values: FloatArray, spike_samples: int) -> FloatArray:
    """Remove spikes of at most `spike_samples` samples; levels and edges are not changed.

    A median over 2 s + 1 samples preserves every level that lasts longer than s samples. At the
    ends the signal is extended by its own value, so a single baseline sample is preserved.
    """
    if spike_samples < 1:
        return values
    return np.asarray(median_filter(values, size=2 * spike_samples + 1, mode="nearest"))


def find_edges(
    values: FloatArray, spike_samples: int, min_share: float = 0.1, most: int | None = None
) -> list[Edge]:
    """Find all edges whose height is at least `min_share` of the signal's range.

    Parameters
    ----------
    values : ndarray, shape (N,)
        Measured input; it may be noisy, drift slowly, ramp over some samples and have spikes.
    spike_samples : int
        Longest spike to ignore, in samples.
    min_share : float, default 0.1
        Smallest edge, as a fraction of the range of the input without spikes.
    most : int, optional
        Stop after one edge more than these: an input that moves all the time has millions.

    Returns
    -------
    list of Edge
        In chronological order; empty if the input is constant.
    """
    clean = despike(values, spike_samples)
    # A median over w samples has a standard deviation of 1.25 / sqrt(w) for white noise.
    noise = difference_noise(values) * (
        1.25 / np.sqrt(2 * spike_samples + 1) if spike_samples else 1.0
    )
    span = _significant_range(clean, noise)
    if span == 0.0:
        return []
    if spike_samples and clean.size > 4 * spike_samples:
        # At the ends a spike cannot be distinguished from a level. If the rest of the record has a
        # step, it is treated as a spike; otherwise it is the baseline of a record that starts at
        # its step.
        inner_span = _significant_range(clean[spike_samples:-spike_samples], noise)
        if inner_span > 0.0:
            span = inner_span
            clean[:spike_samples] = clean[spike_samples]
            clean[-spike_samples:] = clean[-spike_samples - 1]
    # An edge of exactly this height counts, whatever the rounding: a ramp is not divided.
    threshold = max(min_share * span, 5 * noise) * (1 - 1e-9)
    width = spike_samples + 1
    # Level before and after each sample; they differ at an edge.
    jump = median_jumps(clean, width)
    edges: list[Edge] = []
    for k in _peaks(jump, threshold):
        edge = _measure(clean, jump, k, noise)
        if edge is not None and abs(edge.amplitude) >= threshold:
            edges.append(edge)
            if most is not None and len(edges) > most:
                break
    starts = [0, *(edge.index + edge.samples - 1 for edge in edges[:-1])]
    stops = [*(edge.index for edge in edges[1:]), int(clean.size)]
    around = zip(edges, starts, stops, strict=False)  # without edges there is nothing between them
    return [replace(edge, start=start, stop=stop) for edge, start, stop in around]


def _significant_range(values: FloatArray, noise: float) -> float:
    """Range of a signal; 0 if rounding (of a constant) or noise explains it."""
    span = float(values.max() - values.min())
    if span <= 1e-9 * float(np.abs(values).max()) or span <= 10 * noise:
        return 0.0
    return span


def median_jumps(values: FloatArray, width: int) -> FloatArray:
    """Median of the `width` samples from each sample on, minus that of those before it."""
    jump = np.empty(values.size)
    # in pieces, because intermediate arrays would take several times the memory of a long record
    for start in range(0, values.size, PIECE):
        stop = min(start + PIECE, values.size)
        part = values[max(start - width, 0) : stop + width]
        lacking = max(width - start, 0), max(stop + width - values.size, 0)
        padded = np.pad(part, lacking, mode="edge")
        before, after = _side_medians(padded, width)
        jump[start:stop] = after - before
    return jump


def _side_medians(padded: FloatArray, width: int) -> tuple[FloatArray, FloatArray]:
    """Medians of `width` samples before each sample and from it on, `width` more on each side."""
    # A window that begins at sample k is centred at k + width // 2.
    low, high = (rank_filter(padded, rank, width) for rank in ((width - 1) // 2, width // 2))
    medians = (0.5 * (low + high) if width % 2 == 0 else low)[width // 2 :]
    count = padded.size - 2 * width
    return medians[:count], medians[width : width + count]


def _peaks(jump: FloatArray, threshold: float) -> Iterator[int]:
    """Positions of the largest jump in each run of jumps of one sign."""
    for start in range(0, jump.size, PIECE):
        sign = np.sign(jump[start : start + PIECE])
        sign[np.abs(jump[start : start + PIECE]) < threshold] = 0.0
        bounds = np.flatnonzero(np.diff(sign, prepend=0.0)) + start
        for first in bounds.tolist():
            own = np.sign(jump[first])
            if abs(jump[first]) < threshold or (
                # the run began in the piece before
                first == start > 0 and own * jump[first - 1] >= threshold
            ):
                continue
            end = first + 1
            while end < jump.size and own * jump[end] >= threshold:
                end += 1
            run = np.abs(jump[first:end])
            top = np.flatnonzero(run >= run.max() * (1 - 1e-12))
            yield first + int(top[top.size // 2])


def _quiet_after(jump: FloatArray, limit: float) -> int:
    """First position with a jump up to a limit; the length if there is none."""
    start, count = 0, 64
    while start < jump.size:
        quiet = np.flatnonzero(np.abs(jump[start : start + count]) <= limit)
        if quiet.size:
            return start + int(quiet[0])
        start, count = start + count, 2 * count
    return int(jump.size)


def _measure(values: FloatArray, jump: FloatArray, k: int, noise: float) -> Edge | None:
    """Find levels, first moved sample and length of the edge whose steepest point is k."""
    # The edge extends as far as the levels before and after differ by more than noise.
    limit = max(0.02 * abs(jump[k]), 3 * noise)
    low = max(k - 1 - _quiet_after(jump[:k][::-1], limit), 0)
    high = min(k + _quiet_after(jump[k:], limit), values.size - 1)
    reach = max(20, 2 * (high - low))
    rest = float(np.median(values[max(low - reach, 0) : low + 1]))
    level = float(np.median(values[high : high + reach]))
    amplitude = level - rest
    if amplitude == 0.0:
        return None
    slack = min(max(REST_TOLERANCE * abs(amplitude), 5 * noise), 0.5 * abs(amplitude))
    moved = np.sign(amplitude) * (values[low : high + 1] - rest)
    arrived = np.flatnonzero(moved >= abs(amplitude) - slack)
    there = int(arrived[0]) if arrived.size else moved.size - 1
    resting = np.flatnonzero(moved[:there] <= slack)
    first = int(resting[-1]) + 1 if resting.size else 0
    return Edge(low + first, amplitude, rest, there - first + 1, 0, 0)
