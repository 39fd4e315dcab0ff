"""Shape of half cycles: sine, triangle, or the response of a lag to a relay.

He and others [1]_ compare a sine with a triangle; Rossi and Scali [2]_ a sine with the better of a
triangle and the response of a first-order lag to a relay. All shapes begin and end at zero, and are
fitted on a grid of their parameters; errors are summed over all half cycles. Our own: against the
two shapes of [2]_ stands a sine with a free vertex, because half cycles of an oscillation of
varying amplitude lean to one side, which triangle and relay can do, too.

References
----------
.. [1] Q. P. He, J. Wang, M. Pottmann and S. J. Qin, A curve fitting method for detecting valve
   stiction in oscillating control loops, Ind. Eng. Chem. Res. 46 (2007) 4549-4560,
   doi:10.1021/ie061219a.
.. [2] M. Rossi and C. Scali, A comparison of techniques for automatic detection of stiction:
   simulation and application to industrial data, Journal of Process Control 15 (2005) 505-514.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import FloatArray

FEWEST_SAMPLES = 6
"""Of half a cycle, below which it has no shape."""
POINTS = 41
"""To which a half cycle is interpolated: from 0 at its first zero to 1 at the next."""
_VERTICES = np.linspace(0.06, 0.94, 23)
_LAGS = np.array([0.03, 0.06, 0.12, 0.2, 0.35, 0.6, 1.0, 3.0])
"""Time constants of the relay's lag over the length of half a cycle."""


@dataclass(frozen=True, eq=False)
class HalfCycles:
    """Half cycles and the errors of the shapes.

    ``shapes`` (M, POINTS), turned to the positive side; ``errors`` by shape, the mean square over
    all half cycles divided by that of the signal.
    """

    shapes: FloatArray
    errors: dict[str, float]


def half_cycles(signal: FloatArray, edges: FloatArray, period: float) -> HalfCycles | None:
    """Cut `signal` (N,) at its zeros `edges`, and fit the shapes; None if there are too few.

    None as well if half a cycle has too few samples on average: noise would choose those that have.
    """
    lengths = np.diff(edges)
    good = (lengths > 0.25 * period) & (lengths < period) & (lengths >= FEWEST_SAMPLES)
    if good.sum() < 4 or period < 2 * FEWEST_SAMPLES:
        return None
    place = np.arange(signal.size, dtype=np.float64)
    inside = np.linspace(0.0, 1.0, POINTS)
    shapes = []
    for k in np.flatnonzero(good):
        part = np.interp(edges[k] + inside * lengths[k], place, signal)
        shapes.append(part * (1.0 if part.mean() >= 0 else -1.0))
    table = np.array(shapes)
    total = float((table**2).sum())
    if total == 0:
        return None
    errors = {name: _error(table, basis) / total for name, basis in _BASES.items()}
    return HalfCycles(table, errors)


def _error(table: FloatArray, bases: FloatArray) -> float:
    """Sum of the smallest squared errors of the rows over all bases (M, POINTS, p)."""
    power = (table**2).sum(axis=1)
    best = np.full(power.size, np.inf)
    for basis in bases:
        root, _ = np.linalg.qr(basis)
        best = np.minimum(best, power - ((table @ root) ** 2).sum(axis=1))
    return float(np.maximum(best, 0.0).sum())


def _shapes() -> dict[str, FloatArray]:
    x = np.linspace(0.0, 1.0, POINTS)
    tent = [np.minimum(x / p, (1 - x) / (1 - p)) for p in _VERTICES]
    skew = [np.sin(np.pi / 2 * np.minimum(x / p, (1 - x) / (1 - p))) for p in _VERTICES]
    relay = [_relay(x, p, lag) for p in _VERTICES for lag in _LAGS]
    sine = [np.sin(np.pi * x)]
    shapes = {"sine": sine, "leaning sine": skew, "triangle": tent, "relay": relay}
    return {name: np.array(rows)[:, :, None] for name, rows in shapes.items()}


def _relay(x: FloatArray, turn: float, lag: float) -> FloatArray:
    """Rise of a lag from zero until the relay turns, and its fall to zero at the end."""
    top = 1 - np.exp(-turn / lag)
    rest = np.exp(-(1 - turn) / lag)
    down = top * rest / (1 - rest)
    after = np.maximum(x - turn, 0.0) / lag
    falling = (top + down) * np.exp(-after) - down
    return np.where(x < turn, 1 - np.exp(-x / lag), falling)


_BASES = _shapes()
