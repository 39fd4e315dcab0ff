"""Several records with any input as one problem, with local terms for each record.

The number of fitted samples is limited by computing time, by our own rule.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter

from ...arrays import FloatArray, IntArray
from ...engine.local_terms import Segments
from ...engine.problem import KnownFactor, Problem
from ...engine.responses import HeldInput, SampledInput, SeveralInputs, StepSequence
from ...signals.excitation import lively_start
from .averaged_input import AveragedInput

MOST_SAMPLES = 4000
"""Of longer records a stretch is taken: every sample counts, so that time grows with its length.
Where their response ends in time all samples are fitted afterwards (`condensed`); where the plant
is slow means over blocks of samples are fitted, so many of them."""

SOUGHT, SOUGHT_THEN = 0.25, 0.5
"""Of the longest record, up to which a dead time is sought unless a limit is given: also where what
came before the record is known, or where nothing explains the output or a dead time is at the bound
before."""
BEYOND = 1.5  # of a first-order model's dead time: no model's dead time is later

_SPARSEST = 20
"""Samples, of which one is there, up to which a part is lengthened for what is missing in it. It is
lengthened fully if the input moves seldom: time then grows with the samples that there are."""

_AGO = 1e6
"""Records since the plant moved before a record at its rest: nothing is left, of an integrator
neither."""

_INCOMPLETE = 0.5  # of the blocks, from which on a sample of each is taken

MOST_MOVES = 200
"""Of an input that holds its values: beyond that the recursion over all samples takes less time."""

MOST_IN_ALL = 12000
"""Samples of all records together; beyond that every record is shortened proportionally."""


class Load(NamedTuple):
    """Step of a load: the record, the output from which on it is seen, and its size as an input."""

    record: int
    row: int
    size: float = 0.0


@dataclass(frozen=True, eq=False)
class SampledData:
    """Shortened records with any input, without the samples that depend on unknown past input.

    Attributes
    ----------
    inputs, outputs : tuple of ndarray
        Of every record, from its first sample on; without the mean of the input, or the level at
        which it rests first. The output is NaN where a sample is missing. Of blocks of samples the
        output is the mean.
    starts : tuple of int
        Outputs before these depend on the input before the record.
    scales : tuple of float
        Noise level of every record relative to the mean one. A linear plant is the same for input
        and output divided by it, and the records are then weighted correctly.
    dt : float
        Sample time in s.
    offsets : tuple of int
        First sample of each within its record.
    every, width : int
        Inputs in a block for each output, and the samples of it of which an output is the mean.
    known : KnownFactor
        Dynamics in cascade that are not part of the plant.
    rested : bool
        Every record begins at rest: there is neither a free response nor a drift.
    past : tuple of ndarray
        Of every record, columns (N, order) that are estimated with level and drift: see `whitened`.
    steps, loads : tuple of ndarray
        Of every record, steps of loads that are added to the input, and columns (N, k) by which
        their sizes and times are estimated further.
    """

    inputs: tuple[FloatArray, ...]
    outputs: tuple[FloatArray, ...]
    starts: tuple[int, ...]
    scales: tuple[float, ...]
    dt: float
    offsets: tuple[int, ...]
    every: int
    width: int
    known: KnownFactor
    rested: bool = False
    past: tuple[FloatArray, ...] = ()
    steps: tuple[FloatArray, ...] = ()
    loads: tuple[FloatArray, ...] = ()

    @property
    def without_loads(self) -> SampledData:
        """The records as they are."""
        return replace(self, steps=(), loads=())

    @property
    def step(self) -> float:
        """Time from an output to the next, in s."""
        return self.every * self.dt

    @property
    def held(self) -> tuple[FloatArray, ...]:
        """Input of every record, of blocks their mean."""
        return tuple(_means(u, self.every, self.width) for u in self.inputs)

    @cached_property
    def rows(self) -> tuple[IntArray, ...]:
        """Numbers of the outputs of every record that are fitted, from its first one on."""
        return tuple(
            start + np.flatnonzero(~np.isnan(y[start:]))
            for y, start in zip(self.outputs, self.starts, strict=True)
        )

    def _input(self, i: int) -> tuple[HeldInput, IntArray]:
        """Input of a record, and the rows of its response that are fitted."""
        rows, signal = self.rows[i], self.inputs[i] / self.scales[i]
        if self.steps:
            signal = signal + self.steps[i] / self.scales[i]
        if self.every > 1:
            return AveragedInput(signal, self.dt, self.every, self.width), rows
        moves = np.flatnonzero(np.diff(signal, prepend=0.0))
        if self.complete or moves.size > MOST_MOVES:
            return SampledInput(signal, self.dt), rows
        # Few moves, and samples missing: the response at those that there are.
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
        return self.every * sum(self.lengths) / max(sum(self.counts), 1)

    @property
    def lengths(self) -> list[int]:
        """Outputs of every record from the first one fitted on, missing ones included."""
        return [y.size - start for y, start in zip(self.outputs, self.starts, strict=True)]

    def after(self, dead_time: float) -> SampledData:
        """Leave out what may depend on the input before the records; at most half of each."""
        late = 0 if self.rested else int(np.ceil(BEYOND * dead_time / self.step))
        seen = [np.flatnonzero(~np.isnan(y)) for y in self.outputs]
        return replace(self, starts=tuple(min(late, int(i[i.size // 2])) for i in seen))

    @property
    def longest(self) -> float:
        """Duration of the longest record, in s."""
        return max(y.size for y in self.outputs) * self.step

    @property
    def sought(self) -> float:
        """Largest dead time that is sought unless a limit is given, in s."""
        return (SOUGHT_THEN if self.rested else SOUGHT) * self.longest

    @property
    def edges(self) -> IntArray:
        """Bounds of the records in the concatenated data."""
        return np.concatenate([[0], np.cumsum(self.counts)]).astype(np.int64)

    def whitened(self, noise: FloatArray, residual: tuple[FloatArray, ...] = ()) -> SampledData:
        """Filter inputs and outputs alike, with the polynomial that makes the noise white.

        With a `residual` (N,) of every record its earlier samples become terms that are estimated:
        to first order the fit is then one of model and noise together, as a prediction error
        method is (Ljung, System Identification, 2nd ed. 1999, section 7.2). In a loop both depend
        on each other; otherwise nothing changes.

        The plant is linear and remains the same. What the filter does to the first input samples,
        whose past is unknown, has arrived before the samples that are left.
        """
        order = noise.size - 1
        if not order:
            return self
        return replace(
            self,
            inputs=tuple(_filtered(noise, u, self.every) for u in self.inputs),
            outputs=tuple(lfilter(noise, [1.0], y) for y in self.outputs),
            starts=tuple(start + order for start in self.starts),
            past=tuple(_earlier(left, order) for left in residual),
            steps=tuple(_filtered(noise, step, self.every) for step in self.steps),
            loads=tuple(lfilter(noise, [1.0], load, axis=0) for load in self.loads),
        )

    @cached_property
    def problem(self) -> Problem:
        """The fit of all records together."""
        clocks = [
            self.step * (rows - start).astype(np.float64)
            for rows, start in zip(self.rows, self.starts, strict=True)
        ]
        if self.rested:
            shapes = [np.ones((clock.size, 1)) for clock in clocks]
        else:
            shapes = [_own_shapes(clock, self.known) for clock in clocks]
        for more in filter(None, (self.past, self.loads)):
            own = [columns[rows] for columns, rows in zip(more, self.rows, strict=True)]
            shapes = [np.hstack(both) for both in zip(shapes, own, strict=True)]
        m = int(self.edges[-1])
        inputs = [self._input(i) for i in range(len(self.inputs))]
        drive = SeveralInputs(*zip(*inputs, strict=True))
        joined = np.concatenate(
            [y / scale for y, scale in zip(self.measured, self.scales, strict=True)]
        )
        since = np.concatenate(clocks) + (_AGO * self.longest if self.rested else 0.0)
        segments = Segments(self.edges, since, np.concatenate(shapes))
        return Problem(joined, np.ones(m), drive, np.empty((m, 0)), self.known, segments)


def cut(
    outputs: Sequence[FloatArray],
    inputs: Sequence[FloatArray],
    dt: float,
    every: int,
    known: KnownFactor,
    rested: bool = False,
) -> SampledData:
    """Shorten long records to a part in which the input moves; the shortest are kept complete.

    Of `every` samples one output is left: their mean, or the first one if so many samples are
    missing that most blocks are not complete.
    """
    width = every
    means = [_means(y, every, width) for y in outputs]
    if every > 1 and any(np.isnan(y).mean() > _INCOMPLETE for y in means):
        width = 1
        means = [_means(y, every, width) for y in outputs]
    sizes = np.array([y.size for y in means])
    seen = np.array([np.count_nonzero(~np.isnan(y)) for y in means])
    lengths = np.minimum(seen, MOST_SAMPLES)
    share = MOST_SAMPLES
    while np.minimum(lengths, share).sum() > MOST_IN_ALL:
        share = max(int(0.9 * share), MOST_IN_ALL // len(lengths))
    # Where samples are missing, more of a record has as many of them.
    sparse = sizes / np.maximum(seen, 1)
    moves = np.array([np.count_nonzero(np.diff(u)) for u in inputs])
    sparse = np.where(moves < MOST_MOVES, sparse, np.minimum(sparse, _SPARSEST))
    lengths = np.minimum(sizes, (np.minimum(lengths, share) * sparse).astype(np.int64))
    firsts = [
        lively_start(u[None], every * int(n)) // every if n < y.size else 0
        for u, y, n in zip(inputs, means, lengths, strict=True)
    ]
    parts = [slice(first, first + int(n)) for first, n in zip(firsts, lengths, strict=True)]
    spans = [slice(every * part.start, every * part.stop) for part in parts]
    level = partial(np.take, indices=0) if rested else np.mean
    return SampledData(
        tuple(u[span] - float(level(u[span])) for u, span in zip(inputs, spans, strict=True)),
        tuple(y[part] for y, part in zip(means, parts, strict=True)),
        (0,) * len(lengths),
        (1.0,) * len(lengths),
        dt,
        offsets=tuple(span.start for span in spans),
        every=every,
        width=width,
        known=known,
        rested=rested,
    )


def _means(values: FloatArray, every: int, width: int) -> FloatArray:
    """Mean of the first `width` of `every` samples."""
    count = values.size // every
    blocks = values[: count * every].reshape(count, every)
    return np.asarray(blocks[:, :width].mean(axis=1))


def _filtered(noise: FloatArray, values: FloatArray, every: int) -> FloatArray:
    """Filter with a polynomial in the delay by `every` samples."""
    whole: FloatArray = noise[0] * values
    for lag, weight in enumerate(noise[1:], start=1):
        whole[lag * every :] += weight * values[: -lag * every]
    return whole


def _earlier(residual: FloatArray, order: int) -> FloatArray:
    """Columns (N, order) of a residual (N,), one to `order` samples before."""
    late = np.concatenate([np.zeros(order), residual])
    return np.stack([late[order - k : late.size - k] for k in range(1, order + 1)], axis=1)


def _own_shapes(clock: FloatArray, known: KnownFactor) -> FloatArray:
    """Level, drift, and the free responses of known dynamics, shape (m, q)."""
    length = max(float(clock[-1]), 1e-300)
    shapes = [np.ones_like(clock), clock / length]
    for pole in known.poles[known.poles.imag >= 0]:
        wave = np.exp(pole * clock)
        shapes += [wave.real] if pole.imag == 0 else [wave.real, wave.imag]
    return np.stack(shapes, axis=1)
