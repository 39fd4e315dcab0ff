"""The tasks that every package gets: step records, simulated with known truth and measured.

Simulated: a third-order lag (2.2 Hz pole, 8 Hz pair with damping 0.7) behind 37 samples of
7.8125e-4 s, a step after 640 samples of rest, white noise on the output. Measured: plants of
others, whose dead time is known as a band; see `measured`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import ctrl_realize as cr
from tests.rigs import R3, TS, step_record

from .answers import Answer

DELAY = 37
ORDER = 3
BAND_HZ = np.geomspace(0.1, 13.0, 60)
NOISES = (1e-4, 1e-3, 5e-3, 1e-2)

# Smallest standard deviation of an unbiased estimate, in samples per 1 % noise: the structure
# of the plant known, its parameters, gain and offset not.
CRAMER_RAO = 0.92


@dataclass(frozen=True, eq=False)
class Task:
    """One record, and what some ways are told of it.

    `u` and `y` are the record with its rest levels taken off, scaled to a step of one and a final
    value of about one; a model of them is `gain` times that of the record. `known` is the delay
    that is told where the delay is told, `rough` are the delays tried where that many can be
    afforded, `max_delay` ends the range elsewhere.
    """

    record: cr.Record
    u: np.ndarray
    y: np.ndarray
    edge: int
    gain: float
    known: int
    rough: tuple[int, ...]
    max_delay: int

    @property
    def dt(self) -> float:
        return self.record.dt


def make_task(noise: float, seed: int) -> Task:
    """Simulate one record."""
    record = step_record(
        R3, delay=DELAY, noise=noise, seed=seed, before=640, after=1400, amplitude=16.0
    )
    rest = record.output[:640].mean()
    u, y = (record.input - 4.0) / 16.0, (record.output - rest) / 16.0
    edge = int(np.argmax(u > 0.5))
    return Task(record, u, y, edge, 1.0, DELAY, tuple(range(25, 51)), 100)


def frequency_error(answer: Answer) -> float:
    """Relative error of the frequency response on BAND_HZ, root mean square."""
    # The sampled plant behind its hold.
    exact = cr.delayed_ss(R3, DELAY, dt=TS)(np.exp(2j * np.pi * BAND_HZ * TS))
    error = np.abs(answer.response(BAND_HZ) - exact) / np.abs(exact)
    return float(np.sqrt(np.mean(error**2)))
