"""Closed loop sample by sample: limits, anti-windup, measurement noise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..._checks import integer, real
from ...delayed import DelayedStateSpace
from ...errors import UnsuitableSystemError
from ...numerics.arrays import FloatArray
from ..siso import delayed_system, same_rate
from .algorithm import PIDAlgorithm

MOST = 1_000_000
"""Largest number of samples: a minute of computing."""
Step = Callable[[float, float], float]


@dataclass(frozen=True, eq=False)
class LoopSimulation:
    """Signals of a closed loop.

    Attributes
    ----------
    time : ndarray, shape (N,)
        In s.
    setpoint, measured, output : ndarray, shape (N,)
        `measured` is the output of the plant without the noise of its sensor; `output` is that of
        the controller, within its limits.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> plant = cr.design.ProcessModel(gain=1.0, lag=10.0, dead_time=2.0).system(0.5)
    >>> algorithm = cr.design.pid(plant).algorithm(output_limits=(0, 1.2))
    >>> loop = cr.design.simulate_loop(plant, algorithm, 200)
    >>> print(loop.output.max(), loop.measured[-1].round(3))
    1.2 1.0
    """

    time: FloatArray
    setpoint: FloatArray
    measured: FloatArray
    output: FloatArray


def simulate_loop(
    system: Any,
    controller: Any,
    count: int,
    *,
    setpoint_step: float = 1.0,
    load_step: float = 0.0,
    noise_std: float = 0.0,
    output_limits: tuple[float, float] | None = None,
    rng: int | np.random.Generator = 0,
) -> LoopSimulation:
    """Simulate a loop with limits and noise, sample by sample.

    All signals are deviations from the operating point.

    Parameters
    ----------
    system : DelayedStateSpace
        Plant with one input and one output, and at least one sample of delay from input to output.
    controller : PIDAlgorithm, PIDController, or a discrete system from error to plant input
        A `PIDController` runs as its `algorithm`, which has anti-windup, with the derivative of
        the error, as its transfer function has it; ``pid.algorithm()`` itself has that of the
        measured value, as exported programs do. Other systems are only limited at their output. The
        bias of an algorithm is the operating point.
    count : int
        Number of samples.
    setpoint_step, load_step : float
        Heights of the steps of set-point and of load at the plant input, at the second sample.
    noise_std : float
        Standard deviation of white noise on the measured value.
    output_limits : tuple of float, optional
        Of the controller, relative to its output at the operating point; a `PIDAlgorithm` keeps
        its own.
    rng : int or numpy Generator
        Of the noise.

    Returns
    -------
    LoopSimulation

    Raises
    ------
    UnsuitableSystemError
        A plant that responds within the same sample; a controller of another sample time.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> plant = cr.design.ProcessModel(gain=1.0, lag=10.0, dead_time=2.0).system(0.5)
    >>> pid = cr.design.pid(plant)
    >>> loop = cr.design.simulate_loop(plant, pid, 200, setpoint_step=0, load_step=1)
    >>> print(loop.measured[-1].round(3), loop.output[-1].round(3))
    0.0 -1.0
    """
    plant = delayed_system(system, "simulate_loop")
    integer(count, "count", 2, MOST)
    height = real(setpoint_step, "setpoint_step", "height of a step")
    disturbance = real(load_step, "load_step", "height of a step")
    noise = real(noise_std, "noise_std", "standard deviation")
    core, delay = plant.delay_free, plant.delay
    if delay == 0 and core.D[0, 0] != 0:
        raise UnsuitableSystemError(
            f"{plant.name!r} responds within the same sample; expected a delay of at least one "
            "sample, or no feedthrough, as every sampled plant with a hold has"
        )
    step = _stepper(controller, plant, output_limits)
    disturbances = noise * np.random.default_rng(rng).standard_normal(count)
    A, B, C, D = core.A, core.B[:, 0], core.C[0], float(core.D[0, 0])
    state = np.zeros(core.nstates)
    applied = np.zeros(count + delay)  # input of the plant's core, `delay` samples later
    measured, output = np.zeros(count), np.zeros(count)
    reference = np.where(np.arange(count) > 0, height, 0.0)
    for k in range(count):
        # without delay D is zero, and the newest input is not needed yet
        measured[k] = C @ state + D * applied[k]
        output[k] = step(float(reference[k]), float(measured[k] + disturbances[k]))
        applied[k + delay] = output[k] + (disturbance if k else 0.0)
        state = A @ state + B * applied[k]
    time: FloatArray = np.arange(count, dtype=np.float64)
    return LoopSimulation(time * float(plant.dt), reference, measured, output)


def _stepper(controller: Any, plant: DelayedStateSpace, limits: tuple[float, float] | None) -> Step:
    """Function of set-point and measured value that returns the controller's output."""
    given = {} if limits is None else {"output_limits": limits}
    if isinstance(controller, PIDAlgorithm):
        if not np.isclose(controller.dt, plant.dt, rtol=1e-6, atol=0.0):
            raise UnsuitableSystemError(
                f"the controller has dt={controller.dt:g} s, the plant {plant.dt:g} s; expected "
                "the same sample time"
            )
        return controller.in_deviations().start().step
    linear = same_rate(controller, float(plant.dt), "simulate_loop")
    if hasattr(controller, "algorithm"):
        algorithm: PIDAlgorithm = controller.algorithm(derivative_weight=1.0, **given)
        return algorithm.start().step
    low, high = limits or (-np.inf, np.inf)
    A, B, C, D = linear.A, linear.B[:, 0], linear.C[0], float(linear.D[0, 0])
    state = np.zeros(linear.nstates)

    def step(setpoint: float, measured: float) -> float:
        nonlocal state
        error = setpoint - measured
        output = float(C @ state) + D * error
        state = A @ state + B * error
        return min(max(output, low), high)

    return step
