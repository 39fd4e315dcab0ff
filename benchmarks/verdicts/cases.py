"""Records of simulated plants of many kinds, with their true frequency responses."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import lfilter

import ctrl_realize as cr
from benchmarks.closed_loop import cases as loops

KINDS = (
    "one lag", "two lags", "three lags", "four lags", "five lags", "zero on the left",
    "zero on the right", "pair", "slow noise", "load", "clipped", "rising at its end", "loud noise",
    "running loop",
)  # fmt: skip
Rng = np.random.Generator


@dataclass(frozen=True)
class Plant:
    """Gain exp(-L s) prod(z s + 1) / prod(T s + 1), a pair of poles besides; times in s."""

    gain: float
    dead_time: float
    lags: tuple[complex, ...]
    leads: tuple[float, ...] = ()

    def response(self, omega: np.ndarray) -> np.ndarray:
        """Frequency response at omega in rad/s."""
        s = 1j * omega
        value = self.gain * np.exp(-self.dead_time * s)
        for lead in self.leads:
            value = value * (lead * s + 1)
        for lag in self.lags:
            value = value / (lag * s + 1)
        return np.asarray(value)

    def step(self, time: np.ndarray) -> np.ndarray:
        """Response to a unit step at time 0, by partial fractions."""
        poles = -1 / np.array(self.lags, dtype=np.complex128)
        since = np.clip(time - self.dead_time, 0.0, None)
        value = np.ones(time.size, dtype=np.complex128)
        for i, p in enumerate(poles):
            others = np.delete(poles, i)
            residue = np.prod([1 + lead * p for lead in self.leads])
            residue *= np.prod(-poles) / (p * np.prod(p - others))
            value += residue * np.exp(p * since)
        return np.asarray(np.where(time >= self.dead_time, self.gain * value.real, 0.0))

    @property
    def settled(self) -> float:
        """Time by which 98 % of the response is over, about."""
        return self.dead_time + 4 * max(abs(lag) for lag in self.lags) + sum(map(abs, self.lags))


@dataclass(frozen=True)
class Case:
    """A record of a kind, and its plant."""

    kind: str
    seed: int
    plant: Plant
    record: cr.Record


def _lags(rng: Rng, count: int) -> tuple[complex, ...]:
    """A longest one of 20 s, and others of 15 to 85 % of it, no two alike."""
    while True:
        rest = 20 * rng.uniform(0.15, 0.85, count - 1)
        lags = np.concatenate([[20.0], rest])
        if count == 1 or np.min(np.diff(np.sort(lags))) > 0.3:
            return tuple(complex(lag) for lag in lags)


def _plant(kind: str, rng: Rng) -> Plant:
    count = {"one lag": 1, "three lags": 3, "four lags": 4, "five lags": 5}.get(kind, 2)
    if kind in KINDS[8:]:
        count = int(rng.integers(1, 4))
    plant = Plant(float(rng.choice([-1, 1]) * rng.uniform(0.5, 4)), 0.0, _lags(rng, count))
    plant = replace(plant, dead_time=float(20 * np.exp(rng.uniform(np.log(0.1), np.log(2.0)))))
    if kind == "zero on the left":
        return replace(plant, leads=(float(rng.uniform(3, 15)),))
    if kind == "zero on the right":
        return replace(plant, leads=(-float(rng.uniform(3, 15)),))
    if kind == "pair":
        damping, omega = float(rng.uniform(0.15, 0.8)), 1 / float(rng.uniform(4, 12))
        pair = 1 / (omega * complex(damping, float(np.sqrt(1 - damping**2))))
        return replace(plant, lags=(pair, pair.conjugate()))
    return plant


def case(kind: str, seed: int) -> Case:
    """Make one record of a kind: dt 1 s, noise of 0.2 to 4 % of the response, loud 10 to 50 %."""
    rng = np.random.default_rng([KINDS.index(kind), seed])
    if kind == "running loop":
        return _loop(seed, rng)
    plant = _plant(kind, rng)
    before = int(rng.integers(40, 120))
    after = int(plant.settled * rng.uniform(1.1, 2.5))
    if kind == "rising at its end":
        after = int(plant.dead_time + plant.lags[0].real * rng.uniform(1.0, 2.2))
    size = float(rng.uniform(0.5, 3))
    time = np.arange(before + after, dtype=np.float64)
    u = np.where(time < before, 1.0, 1.0 + size)
    y = size * plant.step(time - before)
    height = float(np.abs(y).max())
    if kind == "load":
        y += _load(plant, rng, time, before, height)
    if kind == "clipped":
        limit = float(rng.uniform(0.6, 0.97)) * height
        y = np.clip(y, -limit, limit)
    least, most = (0.1, 0.5) if kind == "loud noise" else (0.002, 0.04)
    level = height * float(np.exp(rng.uniform(np.log(least), np.log(most))))
    noise = rng.standard_normal(time.size + 200)
    if kind == "slow noise" or (kind == "load" and rng.random() < 0.3):
        noise = lfilter([np.sqrt(1 - 0.9**2)], [1, -0.9], noise)
    return Case(kind, seed, plant, cr.Record(time, u, 5 + y + level * noise[200:]))


def _loop(seed: int, rng: Rng) -> Case:
    """A loop of `benchmarks.closed_loop` whose set point, recorded, moves once or three times."""
    plant = loops.PLANTS[str(rng.choice(list(loops.PLANTS)))]
    noise = loops.CASES[str(rng.choice(["white", "AR(0.9)", "AR(0.97)"]))]
    moves = str(rng.choice(list(loops.MOVES)))
    wanted, made = loops.record(plant, noise, moves, int(rng.integers(2**31)))
    record = cr.Record(made.time, made.input, made.output, reference=wanted)
    lags = tuple(map(complex, plant.lags))
    return Case("running loop", seed, Plant(loops.GAIN, plant.dead_time, lags), record)


def _load(plant: Plant, rng: Rng, time: np.ndarray, before: int, height: float) -> np.ndarray:
    """A step of a load of 10 to 80 % of the response, through the lags of the plant."""
    first = before + plant.dead_time + 1.5 * plant.lags[0].real
    when = rng.uniform(first, max(time[-1] - 10, first + 1))
    through = replace(plant, dead_time=0.0, leads=(), gain=1.0)
    return np.asarray(
        rng.choice([-1, 1]) * rng.uniform(0.1, 0.8) * height * through.step(time - when)
    )
