"""An output error of a given order from many random starts: what patience finds by hand."""

from __future__ import annotations

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import lfilter

from .answers import Answer
from .tasks import Task

STARTS = 50
_EVALUATIONS = 60  # of each start


def _exponents(shape: np.ndarray, pairs: int) -> np.ndarray:
    """Poles of logarithms: first pairs (frequency, damping ratio), then real ones."""
    of_pairs = np.exp(shape[: 2 * pairs]).reshape(-1, 2)
    found = []
    for frequency, damping in of_pairs:
        turn = np.sqrt(complex(damping**2 - 1))
        found += [frequency * (-damping + turn), frequency * (-damping - turn)]
    return np.array([*found, *-np.exp(shape[2 * pairs :])], dtype=complex)


def _responses(u: np.ndarray, delay: float, poles: np.ndarray) -> np.ndarray:
    """Responses to a held input that poles span, from rest, (N, n): any zeros but no jump."""
    whole = int(np.ceil(delay - 1e-9))
    moves = np.concatenate([np.zeros(whole), np.diff(u, prepend=0.0)])[: u.size]
    # exp(p t) of every change that has arrived, and where all of them are over.
    parts = [
        np.exp(pole * (whole - delay)) * lfilter([1.0], [1.0, -np.exp(pole)], moves)
        for pole in poles
    ]
    return np.column_stack(parts) - np.cumsum(moves)[:, None]


def from_many_starts(task: Task, order: int) -> Answer:
    """Fit dead time and poles by least squares; the rest is linear."""
    rng = np.random.default_rng(0)
    length = float(task.y.size - task.edge)

    def solved(theta: np.ndarray, pairs: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        poles = _exponents(theta[1:], pairs)
        basis = _responses(task.u, theta[0], poles)
        parts = np.column_stack([basis.real, basis.imag, np.ones(task.y.size)])
        weights = np.linalg.lstsq(parts, task.y, rcond=1e-10)[0]
        return poles, weights, task.y - parts @ weights

    best: tuple[float, np.ndarray, int] | None = None
    for turn in range(STARTS):
        pairs = int(rng.integers(0, order // 2 + 1)) if turn % 2 else 0
        rate = 10 ** rng.uniform(-0.5, 1.5) / length
        spread = 10 ** rng.uniform(-1, 1, order)
        shape = np.log(rate * spread)
        shape[1 : 2 * pairs : 2] = np.log(10 ** rng.uniform(-1.5, 0, pairs))
        start = np.array([rng.uniform(0, task.max_delay), *shape])
        low = np.array([0.0, *np.full(order, -20.0)])
        high = np.array([float(task.max_delay), *np.full(order, 5.0)])
        found = least_squares(
            lambda theta, pairs=pairs: solved(theta, pairs)[2],
            np.clip(start, low + 1e-9, high - 1e-9), bounds=(low, high),
            x_scale=np.array([1.0, *np.full(order, 0.1)]), max_nfev=_EVALUATIONS,
        )  # fmt: skip
        if best is None or found.cost < best[0]:
            best = float(found.cost), found.x, pairs
    assert best is not None
    _, theta, pairs = best
    poles, weights, _ = solved(theta, pairs)
    residues = weights[:order] - 1j * weights[order : 2 * order]
    rates = poles / task.dt

    def simulate(u: np.ndarray) -> np.ndarray:
        return np.real(_responses(u, theta[0], poles) @ residues)

    def response(s: np.ndarray) -> np.ndarray:
        core = (residues * rates / (s[:, None] - rates)).sum(axis=1)
        return core * np.exp(-s * theta[0] * task.dt)

    return Answer(float(theta[0]), lambda hz: response(2j * np.pi * hz), simulate)
