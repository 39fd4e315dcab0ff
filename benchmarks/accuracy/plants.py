"""Simulated plants with their exact answers and bounds."""

from __future__ import annotations

import control as ct
import numpy as np

import ctrl_realize as cr
from ctrl_realize.numerics.engine.problem import KnownFactor
from tests import rigs

from .cramer_rao import dead_time_bound

BEFORE, AFTER = 3840, 2600
SENSOR = rigs.lag(30.0)

RIGS: dict[str, ct.TransferFunction] = {
    "R1": rigs.R1,
    "R2": rigs.R2,
    "R3": rigs.R3,
    "R4": rigs.R4,
}
FACTORIAL: dict[str, ct.TransferFunction] = {
    "one lag": rigs.R1,
    "three poles": rigs.R3,
    "underdamped": rigs.pair(4.0, 0.2),
    "five lags": rigs.lag(3) * rigs.lag(4) * rigs.lag(5) * rigs.lag(7) * rigs.lag(9),
}


def record(
    plant: ct.TransferFunction, noise: float, seed: int, coarser: int = 1
) -> tuple[cr.Record, float]:
    """Simulate a step at a random delay, gain and offset; return it and the delay in samples."""
    rng = np.random.default_rng(seed)
    delay = float(rng.uniform(30, 45))
    made = rigs.step_record(
        plant,
        delay=delay / coarser,
        noise=noise,
        seed=seed + 10_000,
        amplitude=float(rng.choice([-3.0, 0.2, 16.0])),
        baseline=float(10 * rng.normal()),
        before=BEFORE // coarser,
        after=AFTER // coarser,
        dt=coarser * rigs.TS,
    )
    return made, delay / coarser


def bound(plant: ct.TransferFunction, noise: float, *, sensor_known: bool = False) -> float:
    """Cramer-Rao bound of the delay in samples."""
    poles = plant.poles().astype(complex)
    known = None
    if sensor_known:
        corner = 2 * np.pi * 30.0
        known = KnownFactor(np.array([-corner + 0j]), np.array([corner]))
    gain = np.array([float(np.prod(-poles).real)])
    error = dead_time_bound(poles, gain, 37 * rigs.TS, rigs.TS, (BEFORE, AFTER), noise, known=known)
    return error / rigs.TS
