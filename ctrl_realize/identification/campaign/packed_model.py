"""A model without the dense matrices of its delay line, for storing thousands of them."""

from __future__ import annotations

from dataclasses import dataclass

import control as ct
import numpy as np

from ...delayed import DelayedStateSpace
from ...numerics.arrays import FloatArray, read_only
from ...results import ModelFit


@dataclass(frozen=True, eq=False, slots=True)
class PackedModel:
    """Core, delays and names of a model, from which it is rebuilt bit by bit.

    A `DelayedStateSpace` may hold dense matrices that grow with the square of its delay: 35 kB for
    a delay of 40 samples, 8 MB for 1000. Core and delays take some hundred bytes.

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
        Fit of the model, the same object.
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
        """Rebuild the model, equal in every bit to the original."""
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
