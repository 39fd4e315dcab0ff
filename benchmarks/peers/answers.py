"""What a package found, whatever it calls a model: a frequency response and a simulation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter, oaconvolve


@dataclass(frozen=True)
class Answer:
    """A delay in samples (None where the way estimates none) and a model of the scaled record.

    `reasons` are what the way says about the fit of its own result.
    """

    delay: float | None
    response: Callable[[np.ndarray], np.ndarray]
    """Frequencies in Hz to complex gains."""
    simulate: Callable[[np.ndarray], np.ndarray]
    """Input, from rest, to output."""
    reasons: tuple[str, ...] = ()


def of_polynomials(delay: float | None, b: np.ndarray, f: np.ndarray, dt: float) -> Answer:
    """Make an answer of b(q^-1) / f(q^-1)."""

    def response(hz: np.ndarray) -> np.ndarray:
        x = np.exp(-2j * np.pi * hz * dt)
        return np.polyval(b[::-1], x) / np.polyval(f[::-1], x)

    return Answer(delay, response, lambda u: lfilter(b, f, u))


def of_matrices(
    A: np.ndarray, B: np.ndarray, C: np.ndarray, D: np.ndarray, dt: float, shift: int = 0
) -> Answer:
    """Make an answer of a state-space model, behind a delay that it was told."""
    n = A.shape[0]

    def response(hz: np.ndarray) -> np.ndarray:
        z = np.exp(2j * np.pi * hz * dt)
        core = [(C @ np.linalg.solve(x * np.eye(n) - A, B) + D)[0, 0] for x in z]
        return np.array(core) * z**-shift

    def simulate(u: np.ndarray) -> np.ndarray:
        x, y = np.zeros((n, 1)), np.empty(u.size)
        for k, now in enumerate(u):
            y[k] = (C @ x + D * now).item()
            x = A @ x + B * now
        return np.r_[np.zeros(shift), y][: u.size]

    return Answer(None, response, simulate)


def of_step(
    delay: float,
    step: Callable[[np.ndarray], np.ndarray],
    response: Callable[[np.ndarray], np.ndarray],
    dt: float,
) -> Answer:
    """Make an answer of a step response in seconds."""

    def simulate(u: np.ndarray) -> np.ndarray:
        # The input is held between samples, so it is a sum of steps.
        return oaconvolve(np.diff(u, prepend=0.0), step(dt * np.arange(u.size)))[: u.size]

    return Answer(delay, lambda hz: response(2j * np.pi * hz), simulate)
