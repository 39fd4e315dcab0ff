"""Is a time axis uniform, and if not, where does it break?

Our own rule: time stamps within 5 % of a sample of the uniform grid were rounded when they were
written; a missed sample is twenty times as far off.
"""

from __future__ import annotations

import numpy as np

from ..arrays import FloatArray

UNIFORM_WITHIN = 0.05
"""Largest distance of a time stamp from the uniform grid, in samples.

Time stamps printed with few digits (0.000073 s steps of 73.24 us) stay well inside it; a
missed sample is twenty times as large.
"""

EXTREME = 1e70
"""Numbers beyond this, and steps below its inverse, are no measurement.

The square of a quotient of two numbers inside is still a double.
"""


def sample_time(time: FloatArray) -> float:
    """Mean step of a time axis, freed of the rounding that a subtraction leaves.

    Examples
    --------
    >>> import numpy as np
    >>> from ctrl_realize.numerics.signals.time_axis import sample_time
    >>> sample_time(0.01 * np.arange(1, 18062))
    0.01
    """
    mean = float((time[-1] - time[0]) / (time.size - 1))
    short = float(f"{mean:.12g}")
    return short if abs(short - mean) <= 1e-13 * mean else mean


def axis_fault(time: FloatArray) -> str | None:
    """Say what is wrong with a time axis, with the first bad row; None when it is uniform.

    Parameters
    ----------
    time : ndarray, shape (N,), N >= 2
        Finite time stamps in s.
    """
    far = int(np.argmax(np.abs(time)))
    if abs(time[far]) > EXTREME:
        return f"time is {time[far]:g} s at row {far}"
    steps = np.diff(time)
    typical = float(np.median(steps))
    if 0 < typical < 1 / EXTREME:
        return f"time runs in steps of {typical:g} s"
    if typical < 0 and np.all(steps < 0):
        return f"time runs backwards: row 1 is at {time[1]:g} s, row 0 at {time[0]:g} s"
    back = np.flatnonzero(steps <= 0)
    if back.size:
        row = int(back[0]) + 1
        kind = "repeats" if time[row] == time[row - 1] else "jumps back"
        return f"time {kind} at row {row}: {time[row]:.9g} s after {time[row - 1]:.9g} s"
    gaps = np.flatnonzero(steps > 1.5 * typical)
    if gaps.size:
        row = int(gaps[0]) + 1
        missing = steps[row - 1] / typical - 1
        return (
            f"time has a gap at row {row}: {steps[row - 1]:.6g} s where {typical:.6g} s is usual "
            f"(about {missing:.0f} sample(s) missing)"
        )
    dt = sample_time(time)
    drift = np.abs(time - (time[0] + dt * np.arange(time.size))) / dt
    bad = np.flatnonzero(drift > UNIFORM_WITHIN)
    if bad.size:
        row = int(bad[0])
        return (
            f"time is not uniform: row {row} is {drift[row]:.2g} samples off the uniform grid "
            f"of {dt:.6g} s (worst: {drift.max():.2f}; allowed: {UNIFORM_WITHIN})"
        )
    return None
