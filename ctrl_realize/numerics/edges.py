"""Find the edges of a measured input signal."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter, rank_filter

from .arrays import FloatArray

REST_TOLERANCE = 0.02
"""The input has left its level when it is off by this part of the step (or 5 sigma of noise)."""


@dataclass(frozen=True)
class Edge:
    """Samples index...index + samples - 1 lead from `rest` to `rest + amplitude`."""

    index: int
    amplitude: float
    rest: float
    samples: int
    start: int
    stop: int


def difference_noise(values: FloatArray) -> float:
    """Noise level (sigma) from first differences, unmoved by steps, drift and rare spikes.

    Zero for a signal of which most neighbours are equal, such as a clean or coarse one.
    """
    if values.size < 3:
        return 0.0
    steps = np.diff(values)
    return float(np.median(np.abs(steps - np.median(steps))) / (0.6745 * np.sqrt(2)))


def despike(values: FloatArray, spike_samples: int) -> FloatArray:
    """Remove spikes of at most `spike_samples` samples; levels and edges stay in place.

    A median over 2 s + 1 samples keeps every level that lasts longer than s samples. The ends
    are continued with their own value, so a record that holds a single sample of rest keeps it.
    """
    if spike_samples < 1:
        return values
    return np.asarray(median_filter(values, size=2 * spike_samples + 1, mode="nearest"))


def find_edges(values: FloatArray, spike_samples: int, min_share: float) -> list[Edge]:
    """Find all edges whose height is at least `min_share` of the signal's range.

    Parameters
    ----------
    values : ndarray, shape (N,)
        Measured input; it may be noisy, drift slowly, ramp over some samples and have spikes.
    spike_samples : int
        Longest spike to ignore, in samples.
    min_share : float
        Smallest edge, as a part of the range of the input without spikes.

    Returns
    -------
    list of Edge
        In order of time; empty when the input holds still.
    """
    clean = despike(values, spike_samples)
    # A median over w samples leaves 1.25 / sqrt(w) of white noise.
    noise = difference_noise(values) * (
        1.25 / np.sqrt(2 * spike_samples + 1) if spike_samples else 1.0
    )
    span = _significant_range(clean, noise)
    if span == 0.0:
        return []
    if spike_samples and clean.size > 4 * spike_samples:
        # At the ends a spike cannot be told from a level. Where the rest of the record has a
        # step of its own it is taken for a spike; where not, it is the rest level of a record
        # that starts at its step.
        inner = clean.copy()
        inner[:spike_samples] = clean[spike_samples]
        inner[-spike_samples:] = clean[-spike_samples - 1]
        inner_span = _significant_range(inner, noise)
        if inner_span > 0.0:
            clean, span = inner, inner_span
    # An edge of just the share counts, however it is rounded: a ramp is not cut to pieces.
    threshold = max(min_share * span, 5 * noise) * (1 - 1e-9)
    width = spike_samples + 1
    # Level before and after each sample; an edge is where they differ.
    before, after = _side_medians(clean, width)
    jump = after - before
    edges: list[Edge] = []
    for k in _peaks(jump, threshold):
        edge = _measure(clean, jump, k, noise)
        if edge is not None and abs(edge.amplitude) >= threshold:
            edges.append(edge)
    return [
        Edge(
            e.index,
            e.amplitude,
            e.rest,
            e.samples,
            edges[i - 1].index + edges[i - 1].samples - 1 if i else 0,
            edges[i + 1].index if i + 1 < len(edges) else int(clean.size),
        )
        for i, e in enumerate(edges)
    ]


def _significant_range(values: FloatArray, noise: float) -> float:
    """Range of a signal; 0 when rounding (of a constant) or noise explains it."""
    span = float(values.max() - values.min())
    if span <= 1e-9 * float(np.abs(values).max()) or span <= 10 * noise:
        return 0.0
    return span


def _side_medians(values: FloatArray, width: int) -> tuple[FloatArray, FloatArray]:
    """Median of the `width` samples before each sample, and of those from it on."""
    padded = np.concatenate([np.full(width, values[0]), values, np.full(width, values[-1])])
    # A window that begins at sample k is centred at k + width // 2.
    low, high = (rank_filter(padded, rank, width) for rank in ((width - 1) // 2, width // 2))
    medians = (0.5 * (low + high) if width % 2 == 0 else low)[width // 2 :]
    return medians[: values.size], medians[width : width + values.size]


def _peaks(jump: FloatArray, threshold: float) -> list[int]:
    """Positions of the largest jump in each run of jumps of one sign."""
    found: list[int] = []
    above = np.abs(jump) >= threshold
    sign = np.sign(jump)
    reached = -1
    for k in np.flatnonzero(above).tolist():
        if k <= reached:
            continue
        end = k
        while end + 1 < jump.size and above[end + 1] and sign[end + 1] == sign[k]:
            end += 1
        run = np.abs(jump[k : end + 1])
        top = np.flatnonzero(run >= run.max() * (1 - 1e-12))
        found.append(k + int(top[top.size // 2]))
        reached = end
    return found


def _measure(values: FloatArray, jump: FloatArray, k: int, noise: float) -> Edge | None:
    """Find levels, first moved sample and length of the edge whose steepest point is k."""
    # The edge reaches as far as levels before and after differ by more than noise.
    still = np.abs(jump) <= max(0.02 * abs(jump[k]), 3 * noise)
    quiet_left, quiet_right = np.flatnonzero(still[:k]), np.flatnonzero(still[k:])
    low = int(quiet_left[-1]) if quiet_left.size else 0
    high = k + int(quiet_right[0]) if quiet_right.size else values.size - 1
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
