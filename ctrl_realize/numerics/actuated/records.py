"""Records for fits of actuators: commands without noise, outputs, and local terms.

Only a part of a very long record is used, which is our own rule.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import block_diag

from ..arrays import FloatArray, IntArray
from ..engine.problem import KnownFactor, Problem
from ..engine.responses import SampledInput, SeveralInputs
from ..signals.excitation import lively_start
from ..signals.step_sequence import input_moves

FEW_MOVES = 80
"""Up to so many moves a command is a test: the plant is at rest where it begins."""
MOST_SAMPLES = 4000  # of a record with any other command, to limit the time


@dataclass(frozen=True, eq=False)
class ActuatedRecord:
    """One record.

    Attributes
    ----------
    command : ndarray, shape (N,)
        At every sample, without noise.
    dt : float
        Sample time in s.
    measured : ndarray, shape (N,)
        Output, NaN where it is missing.
    regressors : ndarray, shape (N, q)
        Level and other terms of the record that do not depend on the command.
    late : float
        Samples by which the output was measured after the command of the same sample.
    """

    command: FloatArray
    dt: float
    measured: FloatArray
    regressors: FloatArray
    late: float = 0.0

    @cached_property
    def rows(self) -> IntArray:
        """Samples that are not missing."""
        return np.flatnonzero(~np.isnan(self.measured))

    @cached_property
    def moves(self) -> IntArray:
        """Samples at which the command moves."""
        return np.flatnonzero(np.diff(self.command, prepend=self.command[0]))

    @cached_property
    def held(self) -> tuple[FloatArray, IntArray]:
        """Command without repetitions (K,), and which of its values every sample has (N,).

        A value that is held for two samples or more is there twice, so that a pause is seen.
        """
        first = np.zeros(self.command.size, dtype=np.bool_)
        starts = np.concatenate([[0], self.moves])
        first[starts] = True
        first[np.minimum(starts + 1, first.size - 1)] = True
        return self.command[first], np.cumsum(first) - 1

    def thinned(self) -> ActuatedRecord:
        """Means over blocks of samples, counted from the first move, of a long record."""
        block = -(-self.command.size // MOST_SAMPLES)
        if block == 1:
            return self
        first = int(self.moves[0]) % block if self.moves.size else 0
        count = (self.command.size - first) // block
        values = np.column_stack([self.command, self.measured, self.regressors])
        blocks = values[first : first + count * block].reshape(count, block, -1)
        seen = ~np.isnan(blocks[:, :, 1])
        weight = (seen / np.maximum(seen.sum(axis=1, keepdims=True), 1))[:, :, None]
        means = np.where(seen[:, :, None], blocks, 0.0)
        means = (means * weight).sum(axis=1)
        output = np.where(seen.any(axis=1), means[:, 1], np.nan)
        command, late = blocks[:, :, 0].mean(axis=1), (block - 1) / (2 * block)
        return ActuatedRecord(command, block * self.dt, output, means[:, 2:], late)


def actuated_record(
    output: FloatArray,
    command: FloatArray,
    dt: float,
    *,
    edges: Sequence[tuple[int, int]] = (),
    regressors: FloatArray | None = None,
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
    regressors : ndarray, shape (N, q), optional
        Terms of the record that do not depend on the command; default: a level.
    """
    regressors = np.ones((output.size, 1)) if regressors is None else regressors
    if edges:
        index, size = input_moves(command, list(edges), command.size)
        clean = np.zeros(command.size)
        clean[index] = size
        command = command[0] + np.cumsum(clean)
    found = ActuatedRecord(command, dt, output, regressors)
    if found.moves.size <= FEW_MOVES or command.size <= MOST_SAMPLES:
        return found
    first = lively_start(command[None], MOST_SAMPLES)
    part = slice(first, first + MOST_SAMPLES)
    return ActuatedRecord(command[part], dt, output[part], regressors[part])


@dataclass(frozen=True, eq=False)
class Records:
    """Records that are fitted together."""

    parts: tuple[ActuatedRecord, ...]

    @cached_property
    def output(self) -> FloatArray:
        """Outputs (M,) of all records, one after the other."""
        return np.concatenate([part.measured[part.rows] for part in self.parts])

    @cached_property
    def problem(self) -> Problem:
        """The problem of linear models of the same records."""
        inputs = tuple(SampledInput(part.command - part.command[0], part.dt) for part in self.parts)
        rows = tuple(part.rows for part in self.parts)
        drive = SeveralInputs(inputs, rows)
        weight = np.ones(self.output.size)
        regressors = block_diag(*(part.regressors[part.rows] for part in self.parts))
        return Problem(self.output, weight, drive, regressors, KnownFactor())
