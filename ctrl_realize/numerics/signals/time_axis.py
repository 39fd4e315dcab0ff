"""Test whether a time axis is uniform, and find its first fault.

Our own rule: time stamps within 5 % of a sample of the uniform grid were rounded when they were
written; a missed sample is twenty times as far away.
"""

from __future__ import annotations

from typing import Literal, NamedTuple, TypeAlias

import numpy as np

from ..arrays import FloatArray
from ..constants import LARGEST, SMALLEST

UNIFORM_WITHIN = 0.05
"""Largest distance of a time stamp from the uniform grid, in samples.

Time stamps printed with few digits (0.000073 s steps of 73.24 us) are well inside it; a missed
sample is twenty times as large.
"""


def sample_time(time: FloatArray) -> float:
    """Mean step of a time axis, without the rounding error of the subtraction.

    Examples
    --------
    >>> import numpy as np
    >>> from ctrl_realize.numerics.signals.time_axis import sample_time
    >>> sample_time(0.01 * np.arange(1, 18062))
    0.01
    """
    return without_rounding(float((time[-1] - time[0]) / (time.size - 1)))


def without_rounding(step: float) -> float:
    """Return a step with twelve digits if it differs from them by rounding only."""
    short = float(f"{step:.12g}")
    return short if abs(short - step) <= 1e-13 * step else step


AxisFaultKind: TypeAlias = Literal[
    "extreme", "tiny_steps", "backwards", "repeated", "jumps_back", "gap", "not_uniform"
]


class AxisFault(NamedTuple):
    """First fault of a time axis.

    Attributes
    ----------
    kind : str
        Key of the fault.
    row : int
        Its row.
    value : float
        Time stamp of that row in s; for "tiny_steps" and "gap" the step in s, for "not_uniform"
        the distance from the uniform grid in samples.
    usual : float
        The value it is compared with, in s: the stamp before, or the usual step.
    worst : float
        Largest distance from the uniform grid, in samples.
    """

    kind: AxisFaultKind
    row: int
    value: float
    usual: float = 0.0
    worst: float = 0.0


def axis_fault(time: FloatArray) -> AxisFault | None:
    """Find the first fault of a time axis; None if it is uniform.

    Parameters
    ----------
    time : ndarray, shape (N,), N >= 2
        Finite time stamps in s.
    """
    far = int(np.argmax(np.abs(time)))
    if abs(time[far]) > LARGEST:
        return AxisFault("extreme", far, time[far])
    steps = np.diff(time)
    typical = float(np.median(steps))
    if 0 < typical < SMALLEST:
        return AxisFault("tiny_steps", 0, typical)
    if typical < 0 and np.all(steps < 0):
        return AxisFault("backwards", 1, time[1], time[0])
    back = np.flatnonzero(steps <= 0)
    if back.size:
        row = int(back[0]) + 1
        kind: AxisFaultKind = "repeated" if time[row] == time[row - 1] else "jumps_back"
        return AxisFault(kind, row, time[row], time[row - 1])
    gaps = np.flatnonzero(steps > 1.5 * typical)
    if gaps.size:
        row = int(gaps[0]) + 1
        return AxisFault("gap", row, steps[row - 1], typical)
    dt = sample_time(time)
    drift = np.abs(time - (time[0] + dt * np.arange(time.size))) / dt
    bad = np.flatnonzero(drift > UNIFORM_WITHIN)
    if bad.size:
        row = int(bad[0])
        return AxisFault("not_uniform", row, drift[row], dt, drift.max())
    return None
