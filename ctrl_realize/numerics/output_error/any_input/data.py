"""Several records with any input as one problem, with local terms for each record.

The number of fitted samples is limited by computing time, by our own rule.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.signal import lfilter

from ...arrays import FloatArray, IntArray
from ...separable.local_terms import Segments
from ...separable.responses import HeldInput, SampledInput, SeveralInputs, StepSequence
from ...separable.varpro import KnownFactor, Problem
from ...signals.excitation import lively_start

MOST_SAMPLES = 4000
"""Of longer records a stretch is taken: every sample counts, so that time grows with its length.
Where their response ends in time all samples are fitted afterwards (`condensed`)."""

_SPARSEST = 20
"""Samples, of which one is there, up to which a part is lengthened for what is missing in it. It is
lengthened fully if the input moves seldom: time then grows with the samples that there are."""

MOST_MOVES = 200
"""Of an input that holds its values: beyond that the recursion over all samples takes less time."""

MOST_IN_ALL = 12000
"""Samples of all records together; beyond that every record is shortened proportionally."""


@dataclass(frozen=True, eq=False)
class SampledData:
    """Shortened records with any input, without the samples that depend on unknown past input.

    Attributes
    ----------
    inputs, outputs : tuple of ndarray
        Of every record, from its first sample on; without the mean of the input. The output is NaN
        where a sample is missing.
    starts : tuple of int
        Samples before these depend on the input before the record.
    scales : tuple of float
        Noise level of every record relative to the mean one. A linear plant is the same for input
        and output divided by it, and the records are then weighted correctly.
    dt : float
        Sample time in s.
    offsets : tuple of int
        First sample of each within its record.
    """

    inputs: tuple[FloatArray, ...]
    outputs: tuple[FloatArray, ...]
    starts: tuple[int, ...]
    scales: tuple[float, ...]
    dt: float
    offsets: tuple[int, ...] = ()

    @cached_property
    def rows(self) -> tuple[IntArray, ...]:
        """Numbers of the samples of every record that are fitted, from its first one on."""
        return tuple(
            start + np.flatnonzero(~np.isnan(y[start:]))
            for y, start in zip(self.outputs, self.starts, strict=True)
        )

    def _sparse_input(self, i: int) -> tuple[HeldInput, IntArray]:
        """Input of a record with missing samples, and the responses of it that are needed."""
        rows, signal = self.rows[i], self.inputs[i] / self.scales[i]
        moves = np.flatnonzero(np.diff(signal, prepend=0.0))
        if moves.size > MOST_MOVES:
            return SampledInput(signal, self.dt), rows
        sizes = np.diff(signal, prepend=0.0)[moves]
        single = np.ones(rows.size, dtype=np.int64)
        times, when = (self.dt * index.astype(np.float64) for index in (rows, moves))
        return StepSequence(times, single, self.dt, when, sizes), np.arange(rows.size)

    @property
    def complete(self) -> bool:
        """Whether no sample is missing."""
        return self.lengths == self.counts

    @property
    def counts(self) -> list[int]:
        """Number of samples of every record that are fitted."""
        return [rows.size for rows in self.rows]

    @property
    def measured(self) -> tuple[FloatArray, ...]:
        """Outputs that are fitted."""
        return tuple(y[rows] for y, rows in zip(self.outputs, self.rows, strict=True))

    @property
    def spacing(self) -> float:
        """Mean distance of the samples that are fitted, in sample times."""
        return sum(self.lengths) / max(sum(self.counts), 1)

    @property
    def lengths(self) -> list[int]:
        """Samples of every record from the first one fitted on, missing ones included."""
        return [y.size - start for y, start in zip(self.outputs, self.starts, strict=True)]

    @property
    def edges(self) -> IntArray:
        """Bounds of the records in the concatenated data."""
        return np.concatenate([[0], np.cumsum(self.counts)]).astype(np.int64)

    def whitened(self, noise: FloatArray) -> SampledData:
        """Filter inputs and outputs alike, with the polynomial that makes the noise white.

        The plant is linear and remains the same. What the filter does to the first input samples,
        whose past is unknown, has arrived before the samples that are left.
        """
        order = noise.size - 1
        if not order:
            return self
        return replace(
            self,
            inputs=tuple(lfilter(noise, [1.0], u) for u in self.inputs),
            outputs=tuple(lfilter(noise, [1.0], y) for y in self.outputs),
            starts=tuple(start + order for start in self.starts),
        )

    def problem(self, known: KnownFactor) -> Problem:
        """Set up the fit of all records together."""
        clocks = [
            self.dt * (rows - start).astype(np.float64)
            for rows, start in zip(self.rows, self.starts, strict=True)
        ]
        shapes = [_own_shapes(clock, known) for clock in clocks]
        m = int(self.edges[-1])
        if self.complete:
            drive = SeveralInputs(
                tuple(
                    SampledInput(u / scale, self.dt)
                    for u, scale in zip(self.inputs, self.scales, strict=True)
                ),
                self.starts,
            )
        else:
            pairs = [self._sparse_input(i) for i in range(len(self.inputs))]
            parts, rows = zip(*pairs, strict=True)
            drive = SeveralInputs(parts, self.starts, rows)
        joined = np.concatenate(
            [y / scale for y, scale in zip(self.measured, self.scales, strict=True)]
        )
        segments = Segments(self.edges, np.concatenate(clocks), np.concatenate(shapes))
        return Problem(joined, np.ones(m), drive, np.empty((m, 0)), known, segments)


def cut(outputs: Sequence[FloatArray], inputs: Sequence[FloatArray], dt: float) -> SampledData:
    """Shorten long records to a part in which the input moves; the shortest are kept complete."""
    sizes = np.array([y.size for y in outputs])
    seen = np.array([np.count_nonzero(~np.isnan(y)) for y in outputs])
    lengths = np.minimum(seen, MOST_SAMPLES)
    share = MOST_SAMPLES
    while np.minimum(lengths, share).sum() > MOST_IN_ALL:
        share = max(int(0.9 * share), MOST_IN_ALL // len(lengths))
    # Where samples are missing, more of a record has as many of them.
    sparse = sizes / np.maximum(seen, 1)
    moves = np.array([np.count_nonzero(np.diff(u)) for u in inputs])
    sparse = np.where(moves < MOST_MOVES, sparse, np.minimum(sparse, _SPARSEST))
    lengths = np.minimum(sizes, (np.minimum(lengths, share) * sparse).astype(np.int64))
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


def _own_shapes(clock: FloatArray, known: KnownFactor) -> FloatArray:
    """Level, drift, and the free responses of known dynamics, shape (m, q)."""
    length = max(float(clock[-1]), 1e-300)
    shapes = [np.ones_like(clock), clock / length]
    for pole in known.poles[known.poles.imag >= 0]:
        wave = np.exp(pole * clock)
        shapes += [wave.real] if pole.imag == 0 else [wave.real, wave.imag]
    return np.stack(shapes, axis=1)
