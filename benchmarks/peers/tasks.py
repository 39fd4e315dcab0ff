"""The task that every package gets: one step record of a plant whose truth is known.

Simulated: a third-order lag (2.2 Hz pole, 8 Hz pair with damping 0.7) behind 37 samples of
7.8125e-4 s, a step after 640 samples of rest, white noise on the output.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import ctrl_realize as cr
from tests.rigs import R3, TS, step_record

DELAY = 37
ORDER = 3
MAX_DELAY = 100
BAND_HZ = np.geomspace(0.1, 13.0, 60)
NOISES = (1e-4, 1e-3, 5e-3, 1e-2)

# Smallest standard deviation of an unbiased estimate, in samples per 1 % noise: the structure
# of the plant known, its parameters, gain and offset not.
CRAMER_RAO = 0.92


@dataclass(frozen=True)
class Task:
    """One record; `u` and `y` have their rest levels taken off and start at the step's rest."""

    record: cr.Record
    u: np.ndarray
    y: np.ndarray

    @property
    def dt(self) -> float:
        return TS


@dataclass(frozen=True)
class Answer:
    """What a package found: a delay (None where it estimates none) and a frequency response."""

    delay: float | None
    response: np.ndarray


def make_task(noise: float, seed: int) -> Task:
    record = step_record(
        R3, delay=DELAY, noise=noise, seed=seed, before=640, after=1400, amplitude=16.0
    )
    rest = record.output[:640].mean()
    return Task(record, (record.input - 4.0) / 16.0, (record.output - rest) / 16.0)


def truth() -> np.ndarray:
    """Response of the sampled plant behind its hold, on BAND_HZ."""
    return cr.delayed_ss(R3, DELAY, dt=TS)(np.exp(2j * np.pi * BAND_HZ * TS))


def frequency_error(answer: Answer) -> float:
    exact = truth()
    error = np.abs(answer.response - exact) / np.abs(exact)
    return float(np.sqrt(np.mean(error**2)))


def of_polynomials(b: np.ndarray, f: np.ndarray) -> np.ndarray:
    """Response of b(q^-1) / f(q^-1) on BAND_HZ."""
    x = np.exp(-2j * np.pi * BAND_HZ * TS)
    return np.polyval(b[::-1], x) / np.polyval(f[::-1], x)


def of_matrices(A: np.ndarray, B: np.ndarray, C: np.ndarray, D: np.ndarray) -> np.ndarray:
    """Response of a state-space model on BAND_HZ."""
    z = np.exp(2j * np.pi * BAND_HZ * TS)
    n = A.shape[0]
    return np.array([(C @ np.linalg.solve(x * np.eye(n) - A, B) + D)[0, 0] for x in z])
