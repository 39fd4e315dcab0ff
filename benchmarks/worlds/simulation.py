"""Simulation on a fine grid: lags, dead times and what else is in a loop, sample by sample.

A record has samples of `DT`; everything is simulated in steps of ``H = DT / FINE``. The input is
held from sample to sample, and lags are exact behind that hold.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

import ctrl_realize as cr

DT = 0.01
FINE = 10
H = DT / FINE
NOISE = 0.005
"""Standard deviation of the noise, as a part of the range of the clean output."""


@dataclass(frozen=True, eq=False)
class Case:
    """Records of a plant, and what is true of it: s, units of output over input, s.

    A quantity that has no true value in a world is NaN and is not judged.
    """

    records: cr.Record | tuple[cr.Record, ...]
    dead_time: float
    gain: float = float("nan")
    total_delay: float = float("nan")


World = Callable[[np.random.Generator], Case]


@dataclass(frozen=True)
class Plant:
    """Dead time in s, lags in s, gain: drawn anew for every record."""

    dead_time: float
    lags: tuple[float, ...]
    gain: float

    @property
    def total_delay(self) -> float:
        return self.dead_time + sum(self.lags)

    def respond(self, fine: np.ndarray) -> np.ndarray:
        """Response to an input on the fine grid that was at its first value for ever."""
        return through(late(self.gain * fine, self.dead_time), *self.lags)

    def case(self, record: cr.Record, **truth: float) -> Case:
        known = {"gain": self.gain, "total_delay": self.total_delay} | truth
        return Case(record, known.pop("dead_time", self.dead_time), **known)


def drawn(
    rng: np.random.Generator,
    lags: tuple[tuple[float, float], ...] = ((0.1, 0.25), (0.3, 0.5)),
    dead_time: tuple[float, float] = (0.12, 0.4),
) -> Plant:
    """Draw a plant; by default two lags behind 12 to 40 samples of dead time."""
    return Plant(
        round(float(rng.uniform(*dead_time)) / H) * H,
        tuple(float(rng.uniform(*ends)) for ends in lags),
        float(rng.choice([0.5, 2.0, 10.0])),
    )


def late(fine: np.ndarray, delay: float) -> np.ndarray:
    """Delay by whole fine steps; before the record was its first value."""
    steps = round(delay / H)
    return np.concatenate([np.full(steps, fine[0]), fine])[: fine.size]


def through(fine: np.ndarray, *lags: float) -> np.ndarray:
    """Pass through first-order lags, at rest at the beginning."""
    for lag in lags:
        pole = float(np.exp(-H / lag))
        start = np.array([fine[0] * pole])
        fine = np.append(fine[0], lfilter([1 - pole], [1, -pole], fine, zi=start)[0][:-1])
    return fine


def held(u: np.ndarray) -> np.ndarray:
    """Hold the samples of an input on the fine grid."""
    return np.repeat(u, FINE)


def sampled(fine: np.ndarray) -> np.ndarray:
    return fine[::FINE]


def step(n: int = 600, at: int = 100, height: float = 1.0) -> np.ndarray:
    return np.where(np.arange(n) < at, 0.0, height)


def levels(
    rng: np.random.Generator, values: tuple[float, ...], n: int = 1000, hold: int = 40
) -> np.ndarray:
    """Random levels, each held for `hold` samples and never twice in a row."""
    chosen = [float(values[0])]
    while len(chosen) * hold < n:
        chosen.append(float(rng.choice([v for v in values if v != chosen[-1]])))
    return np.repeat(chosen, hold)[:n]


def binary(rng: np.random.Generator, n: int = 1000, hold: int = 8) -> np.ndarray:
    """Random binary signal."""
    return np.repeat(rng.choice([-1.0, 1.0], n // hold + 1), hold)[:n]


def noisy(rng: np.random.Generator, y: np.ndarray, part: float = NOISE) -> np.ndarray:
    return y + part * float(np.ptp(y)) * rng.standard_normal(y.size)


def coloured(rng: np.random.Generator, n: int, pole: float = 0.95) -> np.ndarray:
    """AR(1) noise of unit variance."""
    white = rng.standard_normal(n + 300)
    return lfilter([np.sqrt(1 - pole**2)], [1, -pole], white)[300:]


def record(u: np.ndarray, y: np.ndarray) -> cr.Record:
    return cr.Record(DT * np.arange(u.size), u, y, name="simulated")


def stepped(rng: np.random.Generator, plant: Plant, u: np.ndarray) -> np.ndarray:
    """Clean output of a plant at the samples."""
    return sampled(plant.respond(held(u)))
