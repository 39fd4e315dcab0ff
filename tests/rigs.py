"""Plants with an exact answer, for tests: simulated, of course.

R3, R4, R2 and R1 are the lags that the project's accuracy figures refer to: a 2.2 Hz pole with an
8 Hz pair of damping 0.7 (R3), the same with a 30 Hz sensor (R4), 2.2 Hz and 11 Hz (R2), 2 Hz (R1).
"""

import signal
from collections.abc import Iterator
from contextlib import contextmanager

import control as ct
import numpy as np
from scipy.signal import lfilter

import ctrl_realize as cr
from ctrl_realize.results import ModelFit

TS = 7.8125e-4  # the paper's sample time in s


def lag(hz: float) -> ct.TransferFunction:
    w = 2 * np.pi * hz
    return ct.tf([w], [1, w])


def pair(hz: float, zeta: float) -> ct.TransferFunction:
    w = 2 * np.pi * hz
    return ct.tf([w**2], [1, 2 * zeta * w, w**2])


def codes(result: ct.StateSpace | ModelFit) -> set[str]:
    """Codes of the flags of a fit, or of the fit that a model carries."""
    fit = result.fit if isinstance(result, ct.StateSpace) else result
    return {flag.code for flag in fit.flags}


def covers(fit: ModelFit, delay: float) -> bool:
    """Whether the interval of the dead time holds `delay` samples."""
    low, high = fit.delay_interval
    return low <= delay <= high


DT = 0.1  # sample time in s of the two plants that follow
TWO_STATES = cr.DelayedStateSpace(
    ct.ss([[0.8, 0.1], [0.0, 0.6]], [[0.0], [1.0]], [[0.5, 0.1]], [[0.0]], DT), 5
)
TWO_INPUTS = cr.DelayedStateSpace(  # and three outputs
    ct.ss(
        [[0.8, 0.0], [0.0, 0.5]],
        [[1.0, 0.3], [0.2, 1.0]],
        [[0.5, 0.2], [0.1, 0.6], [0.3, 0.3]],
        np.zeros((3, 2)),
        DT,
    ),
    (2, 4),
)

R1 = lag(2.0)
R2 = lag(2.2) * lag(11.0)
R3 = lag(2.2) * pair(8.0, 0.7)
R4 = R3 * lag(30.0)


def exact_step(plant: ct.TransferFunction, time: np.ndarray) -> np.ndarray:
    """Unit step response at any times, by partial fractions (simple poles); 0 before 0."""
    poles = plant.poles()
    den = plant.den[0][0]
    slope = np.polyval(np.polyder(den), poles)
    residues = np.polyval(plant.num[0][0], poles) / (slope * poles)
    gain = plant.num[0][0][-1] / den[-1]
    after = np.clip(time, 0, None)
    values = gain + (residues[:, None] * np.exp(np.outer(poles, after))).sum(axis=0).real
    return np.where(time > 0, values, 0.0)


def drive_with_friction(
    rng: np.random.Generator, dead_time: float, friction: float, slow: float
) -> tuple[np.ndarray, np.ndarray]:
    """Input and speed of a drive with dry friction and a flexible shaft, dead time in samples.

    Slow noise of standard deviation `slow`; the speed is that of a differenced encoder.
    """
    count, edge, within = 1180, 200, 20
    own, other, twist = -1.0, -1.0, 0.0
    stiff, h = 2 * np.pi / 280, 1 / within
    speed = np.empty(count)
    for k in range(count):
        speed[k] = own
        for i in range(within):
            torque = (1 + friction) * (-1.0 if k + i * h < edge + dead_time else 1.0)
            spring = stiff**2 * twist + 0.06 * stiff * (own - other)
            own += h * ((torque - own - friction * np.tanh(50 * own)) / 30 - 0.4 * spring)
            twist += h * (own - other)
            other += h * (spring - 0.0005 * np.tanh(20 * other))
    noise = slow * lfilter([np.sqrt(1 - 0.97**2)], [1, -0.97], rng.standard_normal(count))
    noise += 0.0125 * rng.standard_normal(count)
    u = np.where(np.arange(count) < edge, -1.0, 1.0)
    return u, np.round((speed + noise) / 0.025) * 0.025


def step_record(
    plant: ct.TransferFunction = R3,
    *,
    delay: float = 37.0,
    noise: float = 0.0,
    seed: int = 0,
    amplitude: float = 16.0,
    rest_input: float = 4.0,
    baseline: float = 0.3,
    before: int = 600,
    after: int = 1500,
    dt: float = TS,
) -> cr.Record:
    """Record a step after a rest; `delay` in samples, `noise` as a part of the step."""
    rng = np.random.default_rng(seed)
    k = np.arange(before + after)
    u = rest_input + amplitude * (k >= before)
    y = amplitude * exact_step(plant, (k - before - delay) * dt)
    y = baseline + y + noise * amplitude * rng.standard_normal(k.size)
    return cr.Record(k * dt, u, y, name="simulated")


@contextmanager
def interruptible() -> Iterator[None]:
    """Let what is started here be interrupted: where the tests run detached, it ignores that."""
    listening = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, listening)
