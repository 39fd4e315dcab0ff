"""The points of a measured frequency response, in rising order."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import control as ct
import numpy as np

from ..errors import UnsuitableSystemError
from ..numerics.arrays import BoolArray, ComplexArray, FloatArray


@dataclass(frozen=True, eq=False)
class MeasuredPoints:
    """Frequencies and what was measured there; all arrays have shape (K,)."""

    frequency_hz: FloatArray
    response: ComplexArray
    coherence: FloatArray | None
    std: FloatArray | None
    repeats: float | None = None
    """From whose scatter `std` was taken; None where it counts as known."""

    @property
    def omega(self) -> FloatArray:
        """The same frequencies in rad/s."""
        return 2 * np.pi * self.frequency_hz

    def only(self, kept: BoolArray) -> MeasuredPoints:
        """Keep the points that are marked."""
        return MeasuredPoints(
            self.frequency_hz[kept],
            self.response[kept],
            None if self.coherence is None else self.coherence[kept],
            None if self.std is None else self.std[kept],
            self.repeats,
        )


def measured_points(frf: Any) -> MeasuredPoints:
    """Take the points of an FRF of one channel, with coherence and std where it has some."""
    if not isinstance(frf, ct.FrequencyResponseData):
        raise UnsuitableSystemError(
            f"frf is a {type(frf).__name__}; needed is a MeasuredFRF or a control FRD"
        )
    check_single_channel(frf, "frf")
    order = np.argsort(frf.omega, kind="stable")
    coherence, std = (
        None if beside is None else np.reshape(beside, -1)[order]
        for beside in (getattr(frf, "coherence", None), getattr(frf, "std", None))
    )
    return MeasuredPoints(
        np.asarray(frf.omega, dtype=np.float64)[order] / (2 * np.pi),
        np.asarray(frf.frdata[0, 0], dtype=np.complex128)[order],
        coherence,
        std,
        getattr(frf, "repeats", None),
    )


def check_single_channel(system: Any, what: str) -> None:
    """Refuse several inputs or outputs."""
    if (system.noutputs, system.ninputs) != (1, 1):
        raise UnsuitableSystemError(
            f"{what} has {system.ninputs} inputs and {system.noutputs} outputs; take one channel "
            f"at a time, as {what}[i, j]"
        )
