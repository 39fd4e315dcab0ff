"""Width of the play (backlash) operator from the levels of a staircase.

The play operator is the one of [1]_, section III.2: the output follows the input at half the width
behind it, and rests while the input crosses the width after a reversal. Only levels are fitted, so
that the dynamics do not matter; the interval is the set of widths that the F-test does not reject
([2]_, section 5.1.3).

References
----------
.. [1] A. Visintin, Differential Models of Hysteresis, Springer 1994.
.. [2] G. A. F. Seber and C. J. Wild, Nonlinear Regression, Wiley 1989.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import fdtri

from ..arrays import FloatArray

_WIDTHS = 160
_STARTS = 9
"""Positions within the play at the first level: it is not known from which side it was reached."""
_FREE = 4  # gain, offset, width, first position


@dataclass(frozen=True)
class PlayFit:
    """Width of the play, its 95 % interval, the gain, and the residual variance over the noise."""

    width: float
    low: float
    high: float
    gain: float
    excess: float


def fit_play(levels: FloatArray, outputs: FloatArray, error: float) -> PlayFit | None:
    """Fit ``output = offset + gain * play(level)``.

    Parameters
    ----------
    levels, outputs : ndarray, shape (K,)
        Input and output at rest, one after the other.
    error : float
        Standard error of an output.

    Returns
    -------
    PlayFit or None
        None with fewer than seven levels, or without a reversal.

    Examples
    --------
    >>> import numpy as np
    >>> from ctrl_realize.numerics.valve_test.play import fit_play
    >>> u = np.array([0.0, 1, 2, 3, 2, 1, 0, -1, -2, -1, 0, 1, 2])
    >>> behind = 0.25 * np.array([0, 1, 1, 1, -1, -1, -1, -1, -1, 1, 1, 1, 1])
    >>> y = u - behind
    >>> round(fit_play(u, y, 0.01).width, 2)
    0.5
    """
    moves = np.sign(np.diff(levels))
    if levels.size <= _FREE + 2 or not (moves[1:] * moves[:-1] < 0).any():
        return None
    widest = float(np.ptp(levels))
    start = np.linspace(-1, 1, _STARTS)
    low, high = 0.0, widest
    # a second, finer grid about the best of the first
    for _ in range(3):
        widths = np.linspace(low, high, _WIDTHS)
        sums, gains = _misfits(levels, outputs, widths, start)
        best = int(np.argmin(sums))
        step = widths[1] - widths[0]
        low, high = max(widths[best] - 3 * step, 0.0), min(widths[best] + 3 * step, widest)
    freedom = levels.size - _FREE
    variance = max(float(sums[best]) / freedom, error**2)
    limit = float(sums[best]) + float(fdtri(1, freedom, 0.95)) * variance
    width = float(widths[best])
    low, high = (_bound(levels, outputs, start, width, end, limit) for end in (0.0, widest))
    excess = float(sums[best]) / freedom / error**2 if error > 0 else float("inf")
    return PlayFit(width, low, high, float(gains[best]), excess)


def _bound(
    levels: FloatArray, outputs: FloatArray, start: FloatArray,
    inside: float, end: float, limit: float,
) -> float:  # fmt: skip
    """Where the sum of squares exceeds the limit, between a width that does not and an end."""
    for _ in range(3):
        widths = np.linspace(inside, end, 60)
        over = np.flatnonzero(_misfits(levels, outputs, widths, start)[0] > limit)
        if not over.size:
            return end
        inside, end = float(widths[max(over[0] - 1, 0)]), float(widths[over[0]])
    return end


def _misfits(
    levels: FloatArray, outputs: FloatArray, widths: FloatArray, start: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Smallest sum of squares of every width over the first positions, and its gain."""
    half = 0.5 * widths[:, None]
    state = levels[0] + half * start
    path = np.empty((levels.size, *state.shape))
    for k, level in enumerate(levels):
        state = np.clip(state, level - half, level + half)
        path[k] = state
    path -= path.mean(axis=0)
    centred = outputs - outputs.mean()
    power = np.einsum("kws,kws->ws", path, path)
    product = np.einsum("kws,k->ws", path, centred)
    moved = power > 1e-12 * np.ptp(levels) ** 2
    gains = np.divide(product, power, out=np.zeros_like(power), where=moved)
    sums = np.maximum(float(centred @ centred) - gains * product, 0.0)
    which = np.arange(widths.size), np.argmin(sums, axis=1)
    return sums[which], gains[which]


def slope_of(x: FloatArray, y: FloatArray) -> float:
    """Slope of the line of least squares; 0 if `x` does not vary."""
    away = x - np.mean(x)
    power = float(away @ away)
    varies = np.ptp(x) > 1e-9 * float(np.max(np.abs(x)))
    return float(away @ (y - np.mean(y))) / power if varies and power > 0 else 0.0
