"""Simulated loops: plants, PI controllers, moves of the set point, noise and imperfections.

The sample time is 1 s, so that times are in samples.
"""

from __future__ import annotations

from dataclasses import dataclass
from zlib import crc32

import numpy as np
from scipy.linalg import expm
from scipy.signal import lfilter

import ctrl_realize as cr

SAMPLES = 900


@dataclass(frozen=True)
class Plant:
    """Lags in series with gain 2, and a dead time, in s."""

    lags: tuple[float, ...]
    dead_time: float

    @property
    def structure(self) -> str:
        """What a user who knows the number of lags states."""
        return f"P{len(self.lags)}D"


PLANTS = {
    "0.1": Plant((25.0, 8.0), 3.4),
    "0.4": Plant((25.0, 8.0), 12.5),
    "0.3": Plant((12.0, 12.0, 6.0), 8.3),
    "1": Plant((20.0,), 20.3),
    "1.5": Plant((12.0, 6.0), 27.6),
    "3": Plant((9.0, 6.0), 45.2),
}
"""By the dead time over the sum of the lags."""
GAIN = 2.0


@dataclass(frozen=True)
class Case:
    """Noise of the sensor, load at the input, and what is wrong with the controller's output."""

    pole: float = 0.0
    noise: float = 0.05
    load: float = 0.0
    limits: tuple[float, float] = (-np.inf, np.inf)
    step: float = 0.0


CASES = {
    "white": Case(),
    "AR(0.9)": Case(0.9, 0.1),
    "AR(0.97)": Case(0.97, 0.15),
    "drifting load": Case(0.0, 0.03, load=0.005),
    "clipped": Case(0.9, 0.1, limits=(-0.05, 0.58)),
    "quantised": Case(0.9, 0.1, step=0.05),
}
MOVES = {
    "one": ((100, 1.0),),
    "three": ((100, 1.0), (350, 0.0), (600, 1.0)),
}


def set_point(moves: str, seed: int) -> np.ndarray:
    """Set point of a record; `nine` moves are random."""
    if moves == "nine":
        levels = np.random.default_rng([seed, 9]).integers(-1, 2, SAMPLES // 100 + 1)
        return np.repeat(levels, 100)[:SAMPLES].astype(float)
    wanted = np.zeros(SAMPLES)
    for start, level in MOVES[moves]:
        wanted[start:] = level
    return wanted


def record(plant: Plant, case: Case, moves: str, seed: int) -> tuple[np.ndarray, cr.Record]:
    """Set point, and record of controller output and process value, of a loop at rest before."""
    # Every record has noise of its own.
    rng = np.random.default_rng([seed, crc32(repr((plant, case, moves)).encode())])
    wanted = set_point(moves, seed)
    white = rng.standard_normal(SAMPLES + 500)
    coloured = lfilter([np.sqrt(1 - case.pole**2)], [1.0, -case.pole], white)[500:]
    noise = case.noise * coloured
    load = case.load * np.cumsum(rng.standard_normal(SAMPLES))
    applied, output = looped(plant, wanted, noise, case, load)
    return wanted, cr.Record(np.arange(SAMPLES) * 1.0, applied, output)


def looped(
    plant: Plant, wanted: np.ndarray, noise: np.ndarray, case: Case, load: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Output of a PI controller, and of the plant in its loop, in which noise is fed back (N,)."""
    proportional, integral_time = tuning(plant)
    whole, samples = int(plant.dead_time), wanted.size
    transition, early, late = chain(plant, plant.dead_time - whole)
    state = np.zeros(len(plant.lags))
    drive = np.zeros(samples + whole + 1)  # from whole + 1 samples before the record on
    applied, output, integral = np.zeros(samples), np.zeros(samples), 0.0
    for k in range(samples):
        output[k] = GAIN * state[-1] + noise[k]
        error = wanted[k] - output[k]
        asked = proportional * error + integral + proportional * error / integral_time
        value = float(np.clip(asked, *case.limits))
        if case.step:
            value = case.step * round(value / case.step)
        if value == asked or abs(asked - value) <= case.step:
            integral += proportional * error / integral_time
        applied[k] = value
        drive[k + whole + 1] = value + load[k]
        state = transition @ state + early * drive[k] + late * drive[k + 1]
    return applied, output


def tuning(plant: Plant) -> tuple[float, float]:
    """Gain and integral time of a PI controller: SIMC of a first lag and half of the second."""
    lags = (*plant.lags, 0.0)
    lag, delay = lags[0] + lags[1] / 2, plant.dead_time + lags[1] / 2 + sum(lags[2:])
    proportional = lag / (GAIN * 2 * delay)
    return min(proportional, 1.0), min(lag, 8 * delay)


def chain(plant: Plant, part: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Lags in series over one sample: transition, and what both values of a held input add.

    The earlier value acts for `part` of the sample, the later one for the rest.
    """
    rates = 1.0 / np.array(plant.lags)
    n = rates.size
    both = np.zeros((n + 1, n + 1))
    both[:n, :n] = np.diag(-rates) + np.diag(rates[1:], -1)
    both[0, n] = rates[0]

    def over(time: float) -> tuple[np.ndarray, np.ndarray]:
        moved = expm(both * time)
        return moved[:n, :n], moved[:n, n]

    whole, _ = over(1.0)
    rest, late = over(1.0 - part)
    return whole, rest @ over(part)[1], late
