"""SRIVC with dead time: refined instrumental variables for continuous-time models.

A textbook prototype of our own, since no package in Python has one: H. Garnier and P. Young, The
advantages of directly identifying continuous-time transfer function models in practical
applications, International Journal of Control 87 (2014) 1319-1338, section 3, for the iteration;
the dead time is sought around it, as in F. Chen, H. Garnier and M. Gilson, Robust identification
of continuous-time models with arbitrary time-delay from irregularly sampled data, Journal of
Process Control 25 (2015) 19-27.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.signal import cont2discrete, lfilter

from .answers import Answer
from .tasks import ORDER, Task

_TURNS = 30
_SETTLED = 1e-4  # relative change of the parameters that ends the iteration
_STARTS = np.array([0.3, 1.0, 3.0])  # of the first prefilter, times the rate of the response
_DELAYS = 16  # of the grid on which the dead time is sought first


@dataclass(frozen=True)
class Model:
    """b(s) / a(s) in units of one sample, behind a dead time of `delay` samples."""

    a: np.ndarray  # monic, (n + 1,)
    b: np.ndarray  # (m,), m - 1 zeros; m <= n
    delay: float

    def simulate(self, u: np.ndarray) -> np.ndarray:
        return _derivatives(self.a, _delayed(u, self.delay))[:, : self.b.size] @ self.b[::-1]


def _delayed(u: np.ndarray, delay: float) -> tuple[np.ndarray, float]:
    """Shift by whole samples; the fraction of a sample is left to the hold."""
    whole = int(np.floor(delay))
    return np.concatenate([np.zeros(whole), u])[: u.size], delay - whole


def _states(Ad: np.ndarray, driven: np.ndarray) -> np.ndarray:
    """x[k + 1] = Ad x[k] + driven[k] from rest, by the modes of Ad, (N, n)."""
    poles, vectors = np.linalg.eig(Ad)
    parts = np.linalg.solve(vectors, driven.T.astype(complex))
    modes = [
        lfilter([0.0, 1.0], [1.0, -pole], part) for pole, part in zip(poles, parts, strict=True)
    ]
    return np.real(vectors @ np.array(modes)).T


def _chain(a: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """State space of 1 / a(s); the states are the derivatives 0 to n - 1."""
    n = a.size - 1
    A = np.vstack([np.eye(n)[1:], -a[:0:-1]])
    return A, np.eye(n)[:, -1:], np.eye(n), np.zeros((n, 1))


def _derivatives(a: np.ndarray, held: tuple[np.ndarray, float]) -> np.ndarray:
    """Derivatives 0 to n - 1 of a held input behind 1 / a(s), (N, n)."""
    u, part = held
    Ad, B = cont2discrete(_chain(a), 1.0, "zoh")[:2]
    late = cont2discrete(_chain(a), 1.0 - part, "zoh")[1]
    # Until the fraction is over the value before acts.
    before = np.concatenate([[0.0], u[:-1]])
    return _states(Ad, np.column_stack([u, before]) @ np.hstack([late, B - late]).T)


def _filtered(a: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Derivatives 0 to n of samples behind 1 / a(s), linear between the samples, (N, n + 1)."""
    Ad, B, _, D = cont2discrete(_chain(a), 1.0, "foh")[:4]
    low = _states(Ad, y[:, None] @ B.T) + y[:, None] @ D.T
    return np.column_stack([low, y - low @ a[:0:-1]])


def _stable(a: np.ndarray) -> np.ndarray:
    """Mirror unstable roots, as the prefilter has to be stable."""
    roots = np.roots(a)
    return np.real(np.poly(-np.abs(roots.real) - 1e-9 + 1j * roots.imag))


def sought(
    u: np.ndarray, y: np.ndarray, sizes: tuple[int, int], longest: float, cutoff: float
) -> Model:
    """Seek the dead time on a grid, then between its best point's neighbours.

    `sizes` are n poles and m coefficients of b, `cutoff` of the first prefilter is in rad/sample.
    """

    def at(delay: float) -> tuple[float, Model]:
        starts = cutoff * _STARTS
        return min((_at(delay, u, y, sizes, start) for start in starts), key=lambda each: each[0])

    grid = np.linspace(0.0, longest, _DELAYS)
    found = [at(delay) for delay in grid]
    k = int(np.argmin([cost for cost, _ in found]))
    around = (float(grid[max(k - 1, 0)]), float(grid[min(k + 1, _DELAYS - 1)]))
    between = minimize_scalar(
        lambda delay: at(delay)[0], bounds=around, method="bounded",
        options={"xatol": 0.02, "maxiter": 25},
    )  # fmt: skip
    return min(found[k], at(float(between.x)), key=lambda each: each[0])[1]


def _at(
    delay: float, u: np.ndarray, y: np.ndarray, sizes: tuple[int, int], cutoff: float
) -> tuple[float, Model]:
    """Iterate at a given dead time: sum of squares, and the model."""
    n, m = sizes
    a = np.poly(-cutoff * np.geomspace(0.7, 1.4, n))
    held, best = _delayed(u, delay), (np.inf, Model(a, np.zeros(m), delay))
    settled = np.zeros(n + m)
    instrument = None
    for _ in range(_TURNS):
        outputs, inputs = _filtered(a, y), _derivatives(a, held)[:, :m]
        regressors = np.hstack([-outputs[:, :-1], inputs])
        by = regressors
        if instrument is not None:
            by = np.hstack([-_filtered(a, instrument)[:, :-1], inputs])
        theta = np.linalg.lstsq(by.T @ regressors, by.T @ outputs[:, -1], rcond=1e-14)[0]
        a = _stable(np.r_[1.0, theta[n - 1 :: -1]])
        model = Model(a, theta[: n - 1 : -1], delay)
        instrument = model.simulate(u)
        cost = float(np.sum((y - instrument) ** 2))
        if cost < best[0]:
            best = cost, model
        if np.linalg.norm(theta - settled) < _SETTLED * np.linalg.norm(theta):
            break
        settled = theta
    return best


def from_srivc(task: Task) -> Answer:
    """Model of order 3, with as many zeros as a strictly proper model may have."""
    # The area above a step response is its dead time and lags.
    area = float(np.sum((task.u - task.y)[task.edge :]))
    rate = 2.0 / np.clip(area, 2.0, task.y.size / 4)
    model = sought(task.u, task.y, (ORDER, ORDER), task.max_delay, rate)

    def response(hz: np.ndarray) -> np.ndarray:
        s = 2j * np.pi * hz * task.dt
        return np.polyval(model.b, s) / np.polyval(model.a, s) * np.exp(-s * model.delay)

    return Answer(model.delay, response, model.simulate)
