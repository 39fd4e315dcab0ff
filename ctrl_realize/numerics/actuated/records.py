"""Records for fits of actuators: means over bins, and what the command does between them.

A command that is held between few moves is a list of moves, and the output is averaged over bins
that grow with the distance from them (see `bins`); any other one is used sample by sample. Both
are rules of our own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..arrays import FloatArray, IntArray
from ..signals.bins import response_bins
from ..signals.excitation import lively_start
from ..signals.noise import quantisation_step, rest_noise
from ..signals.onset import first_motion
from ..signals.step_sequence import input_moves

MOST_MOVES = 80
"""Of a command that is a list of moves; beyond that a recursion over the samples is faster."""
MOST_SAMPLES = 4000  # of a record with any other command, to limit the time
_REST = 8  # samples before the first move that tell the noise
_LEAST_NOISE = 1e-4  # of the range, as for step records


@dataclass(frozen=True, eq=False)
class ActuatedRecord:
    """One record.

    Attributes
    ----------
    command : ndarray, shape (N,)
        At every sample, without noise.
    dt : float
        Sample time in s.
    first, width : ndarray of int, shape (M,)
        Bins of samples.
    time, output : ndarray, shape (M,)
        Means over the bins.
    measured : ndarray, shape (N,)
        Output at every sample, NaN where it is missing.
    own : ndarray, shape (N, q)
        Level and other terms of the record that have nothing to do with the command.
    offset : int
        First sample of what is used within the record that was given.
    """

    command: FloatArray
    dt: float
    rows: IntArray
    first: IntArray
    width: IntArray
    measured: FloatArray
    own: FloatArray
    offset: int = 0

    @cached_property
    def time(self) -> FloatArray:
        """Mean times of the samples of every bin (M,), in s."""
        return self.dt * self.averaged(self.rows.astype(np.float64))

    def averaged(self, values: FloatArray) -> FloatArray:
        """Mean over every bin of values at the samples that there are, (R,) or (R, q)."""
        sums = np.add.reduceat(values, self.first, axis=0)
        return np.asarray(sums / self.width.reshape(-1, *[1] * (values.ndim - 1)))

    @cached_property
    def moves(self) -> IntArray:
        """Samples at which the command moves."""
        return np.flatnonzero(np.diff(self.command, prepend=self.command[0]))

    @property
    def listed(self) -> bool:
        """Whether the command is a list of few moves."""
        return self.moves.size <= MOST_MOVES

    @cached_property
    def held(self) -> tuple[FloatArray, IntArray]:
        """Command without repetitions (K,), and the sample of each value.

        A value that is held for two samples or more is there twice, so that a pause is seen.
        """
        kept = np.zeros(self.command.size, dtype=np.bool_)
        starts = np.concatenate([[0], self.moves])
        kept[starts] = True
        kept[np.minimum(starts + 1, self.command.size - 1)] = True
        index = np.flatnonzero(kept)
        return self.command[index], index

    def every_sample(self) -> ActuatedRecord:
        """The same record with every sample as a bin."""
        rows = np.arange(self.command.size)
        return replace(self, rows=rows, first=rows, width=np.ones_like(rows))


def actuated_record(
    output: FloatArray,
    command: FloatArray,
    dt: float,
    *,
    edges: Sequence[tuple[int, int]] = (),
    own: FloatArray | None = None,
) -> ActuatedRecord:
    """Set up a record.

    Parameters
    ----------
    output, command : ndarray, shape (N,)
        The output is NaN where a sample is missing.
    dt : float
        Sample time in s.
    edges : sequence of (index, samples)
        Edges of the command if it is constant between them but for noise.
    own : ndarray, shape (N, q), optional
        Terms of the record itself; default: a level.
    """
    own = np.ones((output.size, 1)) if own is None else own
    if edges:
        index, size = input_moves(command, list(edges), command.size)
        clean = np.zeros(command.size)
        clean[index] = size
        command = command[0] + np.cumsum(clean)
    moves = np.flatnonzero(np.diff(command, prepend=command[0]))
    rows = np.flatnonzero(~np.isnan(output))
    few = 0 < moves.size <= MOST_MOVES
    crossing = _crossing(output[rows], moves, rows) if few else None
    if crossing is not None or (few and command.size > MOST_SAMPLES):
        bins = response_bins(output.size, moves.tolist(), crossing or 0).holding(rows)
        return ActuatedRecord(command, dt, rows, bins.first, bins.width, output, own)
    offset = 0
    if command.size > MOST_SAMPLES:
        offset = lively_start(command[None], MOST_SAMPLES)
        part = slice(offset, offset + MOST_SAMPLES)
        command, output, own = command[part], output[part], own[part]
        rows = np.flatnonzero(~np.isnan(output))
    every = np.arange(rows.size)
    ones = np.ones_like(every)
    return ActuatedRecord(command, dt, rows, every, ones, output, own, offset)


def _crossing(output: FloatArray, moves: IntArray, rows: IntArray) -> int | None:
    """Samples from a move of the command to the first visible motion, None if there is no rest.

    Not from the dead time of a linear model, which may be any: means over bins that are wide where
    the response begins would bias the dead time.
    """
    edge = int(np.searchsorted(rows, moves[0]))
    if edge < _REST:
        return None
    quantum = quantisation_step(output)
    since = rows - int(moves[0])
    sigma, drift = rest_noise(output[:edge], output, quantum, since[:edge])
    sigma = max(sigma, _LEAST_NOISE * float(np.ptp(output)))
    motion = first_motion(output, edge, sigma, quantum, drift, since)
    if motion is None:
        return None
    visible = int(moves[0]) + motion.crossing
    return visible - int(moves[moves <= visible][-1])
