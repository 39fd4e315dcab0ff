"""Six plants, their records, what is estimated from them, and the bounds; all simulated."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import NamedTuple
from zlib import crc32

import numpy as np

import ctrl_realize as cr
from ctrl_realize.identification.bound import Bound
from ctrl_realize.numerics.engine.plausible_models import PlausibleModel
from ctrl_realize.numerics.families.physical import process_parameters

from ..closed_loop.bound import least_errors
from ..peers.srivc import sought

SAMPLES, REST = 800, 40
MOVES = 25  # samples between moves of a set point
_STEP = 1e-3  # of a parameter, for a slope by differences

Values = Mapping[str, float]
Told = tuple[float, float, float, float]
"""Value, standard error and the ends of the 95 % interval; NaN where they are not told."""


class Plant(NamedTuple):
    """True parameters, the structure as a user states it, and a PI controller.

    Noise is a part of the standard deviation of the response to the random binary signal, which
    keeps its value for `clock` samples.
    """

    values: Values
    structure: str | tuple[tuple[int, int], ...]
    controller: tuple[float, float]
    integrators: int = 0
    noise: float = 0.1
    clock: int = 4
    dt: float = 1.0


PLANTS = {
    "one lag": Plant({"gain": 2.0, "dead_time": 8.3, "lag_1": 20.0}, "P1D", (1.0, 20.0)),
    "two lags": Plant(
        {"gain": 2.0, "dead_time": 9.4, "lag_1": 20.0, "lag_2": 6.0}, "P2D", (0.7, 20.0)
    ),
    "pair": Plant(
        {"gain": 1.5, "dead_time": 7.6, "pair_time_1": 6.0, "pair_damping_1": 0.4},
        "P2DU",
        (0.15, 6.0),
    ),
    "zero on the right": Plant(
        {"gain": 1.5, "dead_time": 5.7, "lag_1": 15.0, "lag_2": 5.0, "lead_1": -6.0},
        "P2DZ",
        (0.4, 15.0),
    ),
    "integrator and lag": Plant(
        {"gain": 0.1, "dead_time": 6.5, "lag_1": 8.0}, "P1DI", (0.25, 80.0), integrators=1
    ),
    "Rao and Garnier": Plant(
        {
            "gain": 1.0, "dead_time": 0.523, "pair_time_1": 0.5, "pair_damping_1": 0.25,
            "pair_time_2": 0.05, "pair_damping_2": 0.1, "lead_1": -4.0,
        },
        ((4, 3),),
        (0.03, 0.2),
        noise=0.02,
        dt=0.05,
    ),
}  # fmt: skip
"""The last one is that of G. P. Rao and H. Garnier, Numerical illustrations of the relevance of
direct continuous-time model identification, Proc. 15th IFAC World Congress 2002, with a dead time
of ours; so are the others."""
KINDS = ("step", "binary", "loop")
WAYS = ("structure", "structure, no set point", "nothing given", "SRIVC")


class Made(NamedTuple):
    """Record, with its set point if it is of a loop, and the standard deviation of its noise."""

    record: cr.Record
    sigma: float


def model(values: Values, integrators: int = 0) -> PlausibleModel:
    """Model with these parameters, named as in `fit.parameter_table`."""
    poles = [-1 / values[name] + 0j for name in values if name.startswith("lag_")]
    for name in values:
        if name.startswith("pair_time_"):
            damping = values[name.replace("time", "damping")]
            root = (-damping + 1j * np.sqrt(1 - damping**2)) / values[name]
            poles += [root, root.conjugate()]
    gain = values["gain"] * float(np.prod(-np.array(poles)).real)
    leads = [values[name] for name in values if name.startswith("lead_")]
    every = np.array([*poles, *[0j] * integrators])
    return PlausibleModel(values["dead_time"], every, gain * np.array([1.0, *leads]))


def response(plant: Plant, values: Values, drive: np.ndarray) -> np.ndarray:
    """Output (N,) for a held input (N,), from rest."""
    exact = Bound(model(values, plant.integrators), plant.dt)
    return exact.response(np.append(0.0, drive))[1:]  # it counts from the first value


def bounds(plant: Plant, kind: str, drive: np.ndarray, sigma: float) -> dict[str, float]:
    """Cramer-Rao bound of every parameter in white noise, for the input as it was.

    In a loop that is the information of direct identification: given the input, the likelihood of
    the measured values is that of the plant alone (Ljung, System Identification, 2nd ed., Prentice
    Hall 1999, section 13.4). The level is unknown as well, and with a random binary input a drift:
    `identify` estimates them.
    """
    slopes = [np.ones(drive.size), np.linspace(0, 1, drive.size)][: 2 if kind == "binary" else 1]
    own = len(slopes)
    for name, value in plant.values.items():
        move = _STEP * abs(value)
        low, high = (
            response(plant, {**plant.values, name: value + sign * move}, drive) for sign in (-1, 1)
        )
        slopes.append((high - low) / (2 * move))
    found = least_errors(np.stack(slopes), sigma)[own:]
    return dict(zip(plant.values, found.tolist(), strict=True))


def binary(clock: int, rng: np.random.Generator) -> np.ndarray:
    """Rest at 0, then a random binary signal of -1 and 1 that may change every `clock` samples."""
    made = np.repeat(np.sign(rng.standard_normal(SAMPLES // clock + 1)), clock)
    return np.concatenate([np.zeros(REST), made])[:SAMPLES]


@cache
def noise_of(name: str) -> float:
    """Standard deviation of the noise of a plant."""
    plant = PLANTS[name]
    clean = response(plant, plant.values, binary(plant.clock, np.random.default_rng(0)))
    return plant.noise * float(np.std(clean))


def made(name: str, kind: str, seed: int) -> Made:
    """Simulate a record: one step, a random binary input, or a loop whose set point moves."""
    plant, sigma = PLANTS[name], noise_of(name)
    rng = np.random.default_rng([seed, crc32(f"{name}, {kind}".encode())])
    noise = sigma * rng.standard_normal(SAMPLES)
    time = plant.dt * np.arange(SAMPLES)
    if kind == "loop":
        wanted = binary(MOVES, rng)
        drive, output = looped(plant, wanted, noise)
        return Made(cr.Record(time, drive, output, reference=wanted), sigma)
    step = (np.arange(SAMPLES) >= SAMPLES // 8).astype(float)
    drive = step if kind == "step" else binary(plant.clock, rng)
    return Made(cr.Record(time, drive, response(plant, plant.values, drive) + noise), sigma)


def looped(plant: Plant, wanted: np.ndarray, noise: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Output of the PI controller, and of the plant in its loop, from rest."""
    size = wanted.size
    pulse = response(plant, plant.values, np.eye(1, size)[0])
    gain, integral_time = plant.controller
    drive, output, integral = np.zeros(size), np.zeros(size), 0.0
    for k in range(size):
        output[k] = pulse[k:0:-1] @ drive[:k] + noise[k]
        error = wanted[k] - output[k]
        integral += plant.dt / integral_time * error
        drive[k] = gain * (error + integral)
    return drive, output


def ways(name: str, kind: str) -> tuple[str, ...]:
    """Ways of a record: only a loop has a set point, and SRIVC is for stable plants."""
    plant = PLANTS[name]
    left = {WAYS[1]} if kind != "loop" else set()
    if kind == "step" or plant.integrators:
        left.add("SRIVC")
    return tuple(way for way in WAYS if way not in left)


def estimated(name: str, way: str, record: cr.Record) -> tuple[dict[str, Told], list[str]]:
    """Parameters that mean what they do in the plant, as they are told, and the flags.

    Where another structure was chosen, these are the dead time, and the gain of a stable plant.
    """
    plant = PLANTS[name]
    if way == "SRIVC":
        return of_srivc(plant, record), []
    bare = cr.Record(record.time, record.input, record.output)
    given = {} if way == "nothing given" else {"structures": plant.structure}
    fit = cr.identify(bare if way == WAYS[1] else record, **given).fit
    flags = [flag.code for flag in fit.flags]
    nan = float("nan")
    told: dict[str, Told] = {"dead_time": (fit.dead_time, nan, *fit.interval)}
    if isinstance(fit, cr.identification.OutputErrorFit):
        rows = {one.name: (one.value, one.std, one.low, one.high) for one in fit.parameters}
        true = rows.keys() == plant.values.keys() and fit.integrators == plant.integrators
        stable = not (fit.integrators or plant.integrators)
        told |= {key: row for key, row in rows.items() if true or (stable and key == "gain")}
        told["dead_time"] = rows["dead_time"]
    return told, flags


def of_srivc(plant: Plant, record: cr.Record) -> dict[str, Told]:
    """Parameters by SRIVC, which is told the structure and about how fast the plant is."""
    order = sum(name.startswith(("lag_", "pair_")) for name in plant.values)
    coefficients = 1 + sum(name.startswith("lead_") for name in plant.values)
    times = [
        value for name, value in plant.values.items() if name.startswith(("lag_", "pair_time"))
    ]
    u, y = record.input.ravel(), record.output.ravel()
    longest = 2 * plant.values["dead_time"] / plant.dt
    found = sought(u, y, (order, coefficients), longest, plant.dt / max(times))
    poles, numerator = np.roots(found.a) / plant.dt, found.b[::-1] / found.a[-1]
    numerator = numerator * np.prod(-poles).real * plant.dt ** np.arange(coefficients)
    nan = float("nan")
    length = SAMPLES * plant.dt
    every = process_parameters(poles, numerator, found.delay * plant.dt, length)
    rows = {one.name: (one.value, nan, nan, nan) for one in every}
    stable_gain = ("gain", "dead_time")
    return {
        key: row
        for key, row in rows.items()
        if rows.keys() == plant.values.keys() or key in stable_gain
    }
