"""Edges of a measured input, and step responses."""

from __future__ import annotations

from dataclasses import dataclass, field

from ..numerics.arrays import FloatArray, lock_fields
from ..numerics.signals.edges import Edge
from ..results import Drawable
from .record import Record


@dataclass(frozen=True)
class StepEdge(Edge):
    """Position and height of a step in the input.

    ``input[index - 1]`` is at the baseline, ``input[index]`` has moved, and from ``index + samples
    - 1`` on the input is at ``baseline + amplitude``.

    Attributes
    ----------
    index : int
        First sample at which the input has left the baseline.
    time : float
        Time of that sample in s.
    amplitude : float
        New level minus baseline, in the unit of the input.
    baseline : float
        Level before the edge.
    samples : int
        Duration of the edge in samples; 1 is an ideal step.
    start, stop : int
        The input is at the baseline from sample `start` on, and at its new level up to sample
        `stop` (exclusive).
    edges : tuple of StepEdge
        All edges of the record, including this one; empty on its members.

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> t = 0.01 * np.arange(300)
    >>> u = np.where(t < 1.0, 4.0, 12.0)
    >>> edge = cr.detect_step(cr.Record(t, u, np.where(t < 1.2, 0.0, 3.0)))
    >>> edge.index, edge.time, edge.baseline, edge.amplitude, edge.samples
    (100, 1.0, 4.0, 8.0, 1)
    """

    time: float
    edges: tuple[StepEdge, ...] = field(default=(), repr=False)


@dataclass(frozen=True, eq=False)
class StepResponse(Drawable):
    """Response to a unit step, taken from a record.

    ``output[k] = (y[edge.index + k] - baseline - drift * k * dt) / amplitude``; `pre_step` is the
    same before the edge, and contains the measurement noise in the same unit.

    Attributes
    ----------
    time : ndarray, shape (N,)
        Time in s after the step.
    output : ndarray, shape (N,)
        Unit step response S_0, S_1, ... (output unit per input unit).
    input : ndarray, shape (N,)
        Measured input, scaled to a step from 0 to 1.
    pre_step : ndarray, shape (P,)
        Samples before the edge; P = 0 if the record starts at the step.
    dt : float
        Sample time in s.
    amplitude : float
        Height of the input step.
    baseline : float
        Output level before the edge.
    drift : float
        Slope of the output before the edge that was removed, per s; 0 if it was not significant.
    edge : StepEdge
    name : str
    record : Record or None
        Record that it was taken from.

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> t = 0.01 * np.arange(300)
    >>> u = np.where(t < 1.0, 4.0, 12.0)
    >>> step = cr.unit_step(cr.Record(t, u, np.where(t < 1.2, 5.0, 29.0)))
    >>> print(step.amplitude, step.baseline, step.output[[19, 20]])
    8.0 5.0 [0. 3.]
    """

    time: FloatArray
    output: FloatArray
    input: FloatArray
    pre_step: FloatArray
    dt: float
    amplitude: float
    baseline: float
    drift: float
    edge: StepEdge
    name: str = ""
    record: Record | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        lock_fields(self, "time", "output", "input", "pre_step")

    @property
    def n_samples(self) -> int:
        """Samples from the edge on."""
        return int(self.output.size)

    def __repr__(self) -> str:
        name = f" {self.name!r}" if self.name else ""
        return (
            f"<StepResponse{name}: {self.n_samples} samples of {self.dt:g} s after a step of "
            f"{self.amplitude:g}, {self.pre_step.size} before>"
        )
