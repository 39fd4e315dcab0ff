"""Closed-loop responses to steps of set-point and load."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import control as ct
import numpy as np

from ..._checks import check_type
from ..._wording import in_time
from ...delayed import DelayedStateSpace, DelaySystem
from ...delayed.operands import Linear, Numbers
from ...errors import ModelWarning, UnsuitableSystemError, warn_caller
from ...numerics.arrays import FloatArray
from ...numerics.blas_threads import single_threaded
from ...numerics.internal_delays.equation import MOST_EQUAL, response_times
from ...numerics.loops.circle import damped_circle, step_on_circle
from ..models.conversions import to_discrete
from ..resolved import warn_unresolved
from ..siso import delayed_system, is_continuous, with_dead_time
from .loop import open_loop
from .margins import margins

LONGEST = 2**19
"""Largest number of samples of a response."""
SETTLED = 1e-4
"""Relative range of the last part of a response that counts as settled."""
DOUBLINGS = 8
"""How often the duration of the responses of a continuous loop is doubled."""
SHORT = 1000
"""Turn of a continuous loop by 1 rad over a dead time that a hold of its length stands for."""
ROUNDING = 1e-8
"""Relative overshoot within the error of a simulated response."""
SETTLING_BAND = 0.02
"""Distance from the final value, relative to it, within which a response counts as settled."""


@dataclass(frozen=True, repr=False)
class Performance:
    """Characteristics of the closed-loop responses to unit steps.

    Attributes
    ----------
    setpoint_error, load_error : float
        Integral of the absolute error in s (times the output's unit); inf for a steady-state error.
    overshoot : float
        Of the set-point response, relative to its final value; 0 if there is none.
    settling_time : float
        In s until the set-point response stays within 2 % of its final value.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> plant = cr.design.ProcessModel(gain=1.0, lag=0.08, dead_time=0.029).system(0.001)
    >>> for rule in ("simc", "amigo"):
    ...     found = cr.design.performance(plant, cr.design.pid(plant, rule))
    ...     print(rule, f"overshoot {found.overshoot:.1%}, load error {found.load_error:.4f} s")
    simc overshoot 4.1%, load error 0.0590 s
    amigo overshoot 0.2%, load error 0.1248 s
    """

    setpoint_error: float
    load_error: float
    overshoot: float
    settling_time: float

    def __repr__(self) -> str:
        both = ("set-point error", self.setpoint_error), ("load error", self.load_error)
        errors = (
            f"{name} {'stays' if error == float('inf') else in_time(error)}" for name, error in both
        )
        over = "unknown" if np.isnan(self.overshoot) else f"{100 * self.overshoot:.3g} %"
        ends = "does not settle"
        if np.isfinite(self.settling_time):
            ends = f"settled after {in_time(self.settling_time)}"
        return f"<Performance: {', '.join(errors)}, overshoot {over}, {ends}>"


def step_responses(
    plant: DelayedStateSpace, controller: Any, count: int, *, of_controller: bool = False
) -> tuple[FloatArray, FloatArray]:
    """Output after a unit step of set-point, and of load at the plant input.

    From the frequency response on a circle slightly larger than the unit circle: exact to about
    1e-6 at any delay. The loop must be stable.

    Parameters
    ----------
    plant : DelayedStateSpace
    controller : control system of the same sample time
    count : int
        Number of samples; a power of two is fastest.
    of_controller : bool, optional
        The output of the controller, not that of the plant.

    Returns
    -------
    setpoint, load : ndarray, shape (count,)
    """
    z = damped_circle(count)
    values = np.ones(z.size, dtype=np.complex128)
    for factor in open_loop(plant, controller).factors:
        values = values * factor.response(z - 1) * z ** (-factor.delay)
    process = np.asarray(plant.horner(z)[0, 0])
    closed = values / (1 + values)
    pair = (closed / process, -closed) if of_controller else (closed, process / (1 + values))
    return step_on_circle(pair[0], z, count), step_on_circle(pair[1], z, count)


@single_threaded
def performance(plant: DelayedStateSpace | DelaySystem, controller: Any) -> Performance:
    """Compute the closed-loop responses to steps of set-point and load at the plant input.

    Parameters
    ----------
    plant : DelayedStateSpace or DelaySystem
        Discrete; or continuous: its delay differential equation is solved or, of a dead time of
        less than a thousandth of the time in which the loop turns by 1 rad, the loop is sampled in
        such steps. Any other system of python-control.
    controller : system or float
        Of the plant's sample time, with negative feedback.

    Returns
    -------
    Performance

    Raises
    ------
    UnsuitableSystemError
        The loop is not stable.

    Warns
    -----
    ModelWarning
        The responses do not settle within 260 000 samples; the results are those up to there.

    Notes
    -----
    The integrated error of a load step is ``ti / kp`` for an ideal PI or PID controller [1]_.

    References
    ----------
    .. [1] K. J. Astrom and T. Hagglund, Advanced PID Control, ISA 2006, chapter 4 (Controller
       design).

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> plant = cr.design.ProcessModel(gain=1.0, lag=0.08, dead_time=0.029).system(0.001)
    >>> cr.design.performance(plant, cr.design.pid(plant))
    <Performance: set-point error 64 ms, load error 59 ms, overshoot 4.05 %, settled after 179 ms>
    >>> cr.design.performance(plant, 0.5).setpoint_error
    inf
    """
    made = with_dead_time if is_continuous(plant) else delayed_system
    plant = made(plant, "the performance of a loop")
    expected = "a linear system or a number"
    check_type(controller, (*Linear, *Numbers), "controller", expected, UnsuitableSystemError)
    warn_unresolved(plant)
    slow, turn = loop_times(plant, controller)
    if not plant.dt:
        within = isinstance(controller, DelaySystem)
        if within or not 0 < plant.delay_apart()[1] < turn / SHORT:
            return continuous_performance(plant, controller, slow, turn)
        plant = to_discrete(plant, dt=turn / SHORT)
        if isinstance(controller, ct.LTI):
            controller = to_discrete(controller, dt=turn / SHORT)
    setpoint, load, settled = settled_responses(plant, controller, slow)
    if not settled:
        warn_caller(
            f"the loop has not settled after {setpoint.size} samples of {plant.dt:g} s; its errors "
            "are those up to then. Use a longer sample time to cover the whole response",
            ModelWarning,
        )
    return sampled_performance(setpoint, load, float(plant.dt))


def continuous_performance(
    plant: DelaySystem, controller: Any, total_time: float, turn: float
) -> Performance:
    """Characteristics of the responses of a continuous loop, which turns by 1 rad in `turn` s."""
    loop = (plant * controller).feedback(1)
    to_load = plant.feedback(controller)
    end = 4 * total_time
    for _ in range(DOUBLINGS):
        times = response_times(end, turn, MOST_EQUAL)
        setpoint = np.asarray(loop.step_response(times, tolerance=SETTLED / 100).outputs)
        load = np.asarray(to_load.step_response(times, tolerance=SETTLED / 100).outputs)
        if _still(setpoint, load, int(np.sum(times >= 0.95 * end))):
            break
        end *= 2
    else:
        warn_caller(
            f"the loop has not settled after {end / 2:g} s; its errors are those up to this time",
            ModelWarning,
        )
    # with the weights of the trapezoidal rule
    return measured(setpoint, load, times, np.convolve(np.diff(times), [0.5, 0.5]))


def plant_time(plant: DelayedStateSpace | DelaySystem) -> float:
    """Guess the settling time of a plant: dead time and twice its slowest lag, in s."""
    if isinstance(plant, DelaySystem):
        features, dead_time = plant.features()
        rates = -features.real[features.real < -1e-9 * np.abs(features).max(initial=1.0)]
        slow = dead_time + 2 / float(rates.min(initial=np.inf)) + 4 * float(plant.dt)
        return slow or 1.0  # a gain has no time of its own
    poles = np.abs(plant.delay_free.poles())
    slow = poles[poles < 1 - 1e-9]
    slowest = -1 / np.log(slow.max()) if slow.size and slow.max() > 0 else 1.0
    return float(plant.dt * (plant.delay + 2 * slowest + 4))


def loop_times(plant: DelayedStateSpace, controller: Any, name: str = "") -> tuple[float, float]:
    """Guess the settling time of a loop in s, and tell in which it turns by 1 rad at crossover.

    The former is that of its plant, or of its slowest crossover; the latter of the fastest.

    Raises
    ------
    UnsuitableSystemError
        The loop is not stable; `name` is for the message.
    """
    found = margins(plant, controller)
    if not found.stable:
        raise UnsuitableSystemError(
            f"the loop{f' with {name!r}' if name else ''} is not stable: it has "
            f"{found.unstable_poles} unstable poles, so its step response does not settle; see "
            "design.margins"
        )
    turns, slow = 1 / found.gain_crossovers, plant_time(plant)
    return float(turns.max(initial=slow)), float(turns.min(initial=slow))


def settled_responses(
    plant: DelayedStateSpace, controller: Any, total_time: float
) -> tuple[FloatArray, FloatArray, bool]:
    """Closed-loop responses to steps of set-point and load, and whether they have settled.

    `total_time` in s is the initial guess of the settling time.
    """
    dt = float(plant.dt)
    count = 2 ** int(np.ceil(np.log2(max(64.0, min(20 * total_time / dt, LONGEST)))))
    while True:
        # Half of the record is discarded: circular wrap-around shows at the end.
        setpoint, load = (y[: count // 2] for y in step_responses(plant, controller, count))
        settled = _still(setpoint, load, max(1, count // 40))
        if settled or count >= LONGEST:
            return setpoint, load, settled
        count *= 2


def _still(setpoint: FloatArray, load: FloatArray, last: int) -> bool:
    """Whether both responses have settled over their last samples."""
    moving = np.ptp(setpoint[-last:]), np.ptp(load[-last:]) / max(np.abs(load).max(), 1e-300)
    return bool(max(moving) < SETTLED)


def measured(
    setpoint: FloatArray, load: FloatArray, times: FloatArray, weights: FloatArray | float
) -> Performance:
    """Compute the characteristics of settled responses; `weights` in s are those of integrals."""
    final = float(setpoint[-1])
    # The transform has an error of 1e-5; a steady-state error is far larger.
    kept = (abs(1 - final) > 1e-3, abs(load[-1]) > 1e-3 * np.abs(load).max())
    over = float((setpoint / final).max()) - 1 if final else float("nan")
    return Performance(
        setpoint_error=float("inf") if kept[0] else float(np.sum(np.abs(1 - setpoint) * weights)),
        load_error=float("inf") if kept[1] else float(np.sum(np.abs(load) * weights)),
        overshoot=0.0 if over <= ROUNDING else over,
        settling_time=float(times[settling(setpoint, final)]),
    )


def sampled_performance(setpoint: FloatArray, load: FloatArray, dt: float) -> Performance:
    """The same of responses with a sample time in s."""
    return measured(setpoint, load, np.arange(setpoint.size, dtype=np.float64) * dt, dt)


def lasting(setpoint: FloatArray, load: FloatArray) -> int:
    """Samples until both responses stay within 2 % of their ends (for the load: of its peak)."""
    return max(settling(setpoint, setpoint[-1]), settling(load, np.abs(load).max()))


def settling(response: FloatArray, size: float) -> int:
    """First sample from which on a response stays within 2 % of a size about its final value."""
    outside = np.flatnonzero(np.abs(response - response[-1]) > SETTLING_BAND * abs(size))
    return int(outside[-1]) + 1 if outside.size else 0
