"""What a closed loop does to steps of set-point and load."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..delayed import DelayedStateSpace
from ..numerics.arrays import FloatArray
from ..numerics.closed_loop import damped_circle, step_on_circle
from .loops import open_loop

LONGEST = 2**19
"""Most samples of a response."""
SETTLED = 1e-4
"""Range of the last part of a response, relative, in which it counts as settled."""


@dataclass(frozen=True)
class Performance:
    """Responses of a stable loop to unit steps, in numbers.

    Attributes
    ----------
    setpoint_error, load_error : float
        Integral of the absolute error in s (times the output's unit); inf where an error stays.
    overshoot : float
        Of the set-point response over its final value, as a ratio; 0 without.
    settling_time : float
        In s until the set-point response stays within 2 % of its final value.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> plant = cr.design.ProcessModel(gain=1.0, lag=0.08, dead_time=0.029).system(0.001)
    >>> for rule in ("simc", "amigo"):
    ...     found = cr.design.performance(plant, cr.design.pid(plant, rule), 0.5)
    ...     print(rule, f"overshoot {found.overshoot:.1%}, load error {found.load_error:.4f} s")
    simc overshoot 4.1%, load error 0.0590 s
    amigo overshoot 0.2%, load error 0.1248 s
    """

    setpoint_error: float
    load_error: float
    overshoot: float
    settling_time: float


def step_responses(
    plant: DelayedStateSpace, controller: Any, count: int
) -> tuple[FloatArray, FloatArray]:
    """Output after a unit step of set-point, and of load at the plant input.

    From the frequency response on a circle a little outside the unit one: exact to about 1e-6
    whatever the delay. The loop must be stable.

    Parameters
    ----------
    plant : DelayedStateSpace
    controller : control system of the same sample time
    count : int
        Samples; a power of two is fastest.

    Returns
    -------
    setpoint, load : ndarray, shape (count,)
    """
    z = damped_circle(count)
    loop = open_loop(plant, controller)
    values = np.ones(z.size, dtype=np.complex128)
    for factor in loop.factors:
        values = values * factor.response(z - 1) * z ** (-factor.delay)
    process = np.asarray(plant.horner(z)[0, 0])
    setpoint = step_on_circle(values / (1 + values), z, count)
    load = step_on_circle(process / (1 + values), z, count)
    return setpoint, load


def performance(plant: DelayedStateSpace, controller: Any, total_time: float) -> Performance:
    """Measure how a stable loop answers steps of its set-point and of a load at the plant's input.

    Parameters
    ----------
    plant : DelayedStateSpace
    controller : system or float
        Of the plant's sample time, with negative feedback.
    total_time : float
        Dead time and lags together, in s: the first guess of how long the loop takes. The
        responses are computed for longer until they have settled.

    Returns
    -------
    Performance

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> plant = cr.design.ProcessModel(gain=1.0, lag=0.08, dead_time=0.029).system(0.001)
    >>> found = cr.design.performance(plant, cr.design.pid(plant), 0.5)
    >>> print(f"load error {found.load_error:.4f} s, settled after {found.settling_time:.3f} s")
    load error 0.0590 s, settled after 0.179 s
    """
    dt = float(plant.dt)
    count = 2 ** int(np.ceil(np.log2(max(64.0, min(20 * total_time / dt, LONGEST)))))
    while True:
        # Half of the record is thrown away: the end is where wrapped-around values show.
        setpoint, load = (y[: count // 2] for y in step_responses(plant, controller, count))
        tail = slice(-max(1, count // 40), None)
        left = max(
            np.ptp(setpoint[tail]),
            np.ptp(load[tail]) / max(np.abs(load).max(), 1e-300),
        )
        if left < SETTLED or count >= LONGEST:
            break
        count *= 2
    final = float(setpoint[-1])
    # 1e-5 is what the transform leaves; an error that stays is far larger.
    kept = (abs(1 - final) > 1e-3, abs(load[-1]) > 1e-3 * np.abs(load).max())
    outside = np.flatnonzero(np.abs(setpoint - final) > 0.02 * abs(final))
    return Performance(
        setpoint_error=float("inf") if kept[0] else float(np.abs(1 - setpoint).sum() * dt),
        load_error=float("inf") if kept[1] else float(np.abs(load).sum() * dt),
        overshoot=max(0.0, float(setpoint.max()) / final - 1) if final else float("nan"),
        settling_time=float((outside[-1] + 1) * dt) if outside.size else 0.0,
    )
