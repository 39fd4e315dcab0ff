"""A model without the dense matrices of its delay chain, for those who keep thousands."""

from __future__ import annotations

from dataclasses import dataclass

import control as ct
import numpy as np

from ...delayed import DelayedStateSpace
from ...numerics.arrays import FloatArray, read_only
from ...results import ModelFit


@dataclass(frozen=True, eq=False, slots=True)
class PackedModel:
    """Core, delays and names of a model, from which it is built again bit by bit.

    A `DelayedStateSpace` holds dense matrices with the square of its delay, as python-control
    needs them: 35 kB at a delay of 40 samples, 8 MB at 1000. Core and delays are some hundred
    bytes.

    Attributes
    ----------
    block : ndarray, shape (order + outputs, order + inputs)
        The core as ``[[A, B], [C, D]]``.
    order : int
    dt : float
        Sample time in s.
    input_delays, output_delays : tuple of int
    name : str
    inputs, outputs : tuple of str
    fit : ModelFit or None
        How the model was found; the very object that the model had.
    """

    block: FloatArray
    order: int
    dt: float
    input_delays: tuple[int, ...]
    output_delays: tuple[int, ...]
    name: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    fit: ModelFit | None

    @classmethod
    def of(cls, system: DelayedStateSpace) -> PackedModel:
        """Pack a model."""
        core = system.delay_free
        return cls(
            block=read_only(np.block([[core.A, core.B], [core.C, core.D]])),
            order=core.nstates,
            dt=core.dt,
            input_delays=system.input_delays,
            output_delays=system.output_delays,
            name=system.name,
            inputs=tuple(system.input_labels),
            outputs=tuple(system.output_labels),
            fit=system.fit,
        )

    def unpack(self) -> DelayedStateSpace:
        """Build the model; equal in every bit to the one that was packed."""
        n = self.order
        A, B = self.block[:n, :n], self.block[:n, n:]
        C, D = self.block[n:, :n], self.block[n:, n:]
        return DelayedStateSpace(
            ct.StateSpace(A, B, C, D, self.dt, remove_useless_states=False),
            self.input_delays,
            output_delay=self.output_delays,
            fit=self.fit,
            name=self.name,
            inputs=self.inputs,
            outputs=self.outputs,
        )
