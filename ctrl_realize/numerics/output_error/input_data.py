"""Several records with any input as one problem, with local terms for each record.

The number of fitted samples is limited by computing time, by our own rule.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import FloatArray, IntArray
from ..separable.local_terms import Segments
from ..separable.responses import SampledInput, SeveralInputs
from ..separable.varpro import KnownFactor, Problem
from ..signals.excitation import lively_start

MOST_SAMPLES = 4000
"""Of longer records a stretch is taken: every sample counts, so that time grows with its length.
Where their response ends in time all samples are fitted afterwards (`condensed`)."""

MOST_IN_ALL = 12000
"""Samples of all records together; beyond that every record is shortened proportionally."""


@dataclass(frozen=True, eq=False)
class SampledData:
    """Shortened records with any input, without the samples that depend on unknown past input.

    Attributes
    ----------
    inputs, outputs : tuple of ndarray
        Of every record, from its first sample on; without the mean of the input.
    starts : tuple of int
        Samples before these depend on the input before the record.
    scales : tuple of float
        Noise level of every record relative to the mean one. A linear plant is the same for input
        and output divided by it, and the records are then weighted correctly.
    dt : float
        Sample time in s.
    period : float
        Shortest period, in s, of the slow disturbances that are modelled; infinite: none.
    offsets : tuple of int
        First sample of each within its record.
    """

    inputs: tuple[FloatArray, ...]
    outputs: tuple[FloatArray, ...]
    starts: tuple[int, ...]
    scales: tuple[float, ...]
    dt: float
    period: float = np.inf
    offsets: tuple[int, ...] = ()

    @property
    def counts(self) -> list[int]:
        """Number of samples of every record that are fitted."""
        return [y.size - start for y, start in zip(self.outputs, self.starts, strict=True)]

    @property
    def edges(self) -> IntArray:
        """Bounds of the records in the concatenated data."""
        return np.concatenate([[0], np.cumsum(self.counts)]).astype(np.int64)

    def problem(self, known: KnownFactor) -> Problem:
        """Set up the fit of all records together."""
        clocks = [self.dt * np.arange(count, dtype=np.float64) for count in self.counts]
        shapes = [_own_shapes(clock, known, self.period) for clock in clocks]
        m = int(self.edges[-1])
        drive = SeveralInputs(
            tuple(
                SampledInput(u / scale, self.dt)
                for u, scale in zip(self.inputs, self.scales, strict=True)
            ),
            self.starts,
        )
        joined = np.concatenate(
            [
                y[start:] / scale
                for y, start, scale in zip(self.outputs, self.starts, self.scales, strict=True)
            ]
        )
        most = max(shape.shape[1] for shape in shapes)
        # A shorter record has fewer cosines.
        shapes = [np.pad(shape, ((0, 0), (0, most - shape.shape[1]))) for shape in shapes]
        segments = Segments(self.edges, np.concatenate(clocks), np.concatenate(shapes))
        return Problem(joined, np.ones(m), drive, np.empty((m, 0)), known, segments)


def cut(outputs: Sequence[FloatArray], inputs: Sequence[FloatArray], dt: float) -> SampledData:
    """Shorten long records to a part in which the input moves; the shortest are kept complete."""
    lengths = np.minimum([y.size for y in outputs], MOST_SAMPLES)
    share = MOST_SAMPLES
    while np.minimum(lengths, share).sum() > MOST_IN_ALL:
        share = max(int(0.9 * share), MOST_IN_ALL // len(lengths))
    lengths = np.minimum(lengths, share)
    offsets = tuple(
        lively_start(u[None], int(n)) if n < u.size else 0
        for u, n in zip(inputs, lengths, strict=True)
    )
    parts = [slice(first, first + int(n)) for first, n in zip(offsets, lengths, strict=True)]
    return SampledData(
        tuple(u[part] - float(np.mean(u[part])) for u, part in zip(inputs, parts, strict=True)),
        tuple(y[part] for y, part in zip(outputs, parts, strict=True)),
        (0,) * len(lengths),
        (1.0,) * len(lengths),
        dt,
        offsets=offsets,
    )


def _own_shapes(clock: FloatArray, known: KnownFactor, period: float) -> FloatArray:
    """Level, drift, the free responses of known dynamics, and slow cosines, shape (m, q)."""
    length = max(float(clock[-1]), 1e-300)
    shapes = [np.ones_like(clock), clock / length]
    for pole in known.poles[known.poles.imag >= 0]:
        wave = np.exp(pole * clock)
        shapes += [wave.real] if pole.imag == 0 else [wave.real, wave.imag]
    # Cosines of half periods: with a straight line they represent anything slow.
    shapes += [np.cos(np.pi * k * clock / length) for k in range(1, int(2 * length / period) + 1)]
    return np.stack(shapes, axis=1)
