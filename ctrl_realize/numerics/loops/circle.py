"""Closed-loop time responses from frequency responses, for any delay.

Inversion of a z-transform by a fast Fourier transform on a circle, whose radius sets the error of
aliasing [1]_. The largest gain outside a circle around -1 is that of [2]_, here at any controller
times.

References
----------
.. [1] J. Abate and W. Whitt, Numerical inversion of probability generating functions, Oper. Res.
   Lett. 12 (1992) 245-251, doi:10.1016/0167-6377(92)90050-D.
.. [2] K. J. Astrom, H. Panagopoulos and T. Hagglund, Design of PI controllers based on non-convex
   optimization, Automatica 34 (1998) 585-601, doi:10.1016/S0005-1098(98)00011-9.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize import fminbound

from ..arrays import ComplexArray, FloatArray, IntArray

DAMPING = 1e6
"""Growth of the circle's radius over the record: wrap-around is divided by this, and rounding
multiplied."""


def damped_circle(count: int) -> ComplexArray:
    """Points of the z-plane for `response_on_circle`, slightly outside the unit circle.

    Returns
    -------
    ndarray, shape (count // 2 + 1,)
    """
    radius = DAMPING ** (1 / count)
    angles = 2j * np.pi * np.arange(count // 2 + 1) / count
    return np.asarray(radius * np.exp(angles), dtype=np.complex128)


def response_on_circle(values: ComplexArray, count: int) -> FloatArray:
    """Inverse z-transform of values on `damped_circle(count)`.

    Accurate to about 1e-6 of the signal's size for every signal that does not grow faster than the
    circle; the error is largest at the end of the record.

    Parameters
    ----------
    values : ndarray, shape (count // 2 + 1,)
    count : int

    Returns
    -------
    ndarray, shape (count,)
    """
    growth = DAMPING ** (np.arange(count) / count)
    return np.asarray(np.fft.irfft(values, count) * growth, dtype=np.float64)


def step_on_circle(values: ComplexArray, z: ComplexArray, count: int) -> FloatArray:
    """Unit-step response (count,) of a system with known values on the circle."""
    return response_on_circle(values * z / (z - 1), count)


def gain_gaps(shape: ComplexArray, distance: float) -> list[tuple[float, float]]:
    """Ranges of k > 0 in which |1 + k L| >= distance holds at all frequencies.

    Stability is the same for all k in such a range, since -1 is never reached.

    Returns
    -------
    list of (low, high)
        Increasing; the last `high` is inf.
    """
    low, high, _ = _circle_entered(shape, distance)
    order = np.argsort(low)
    low = np.append(low[order], np.inf)
    reached = np.maximum.accumulate(np.concatenate([[0.0], high[order]]))
    open_ = low > reached
    return list(zip(reached[open_].tolist(), low[open_].tolist(), strict=True))


def largest_gain(shape: ComplexArray, distance: float) -> tuple[float, int]:
    r"""Largest K such that |1 + k L| >= distance for all 0 <= k <= K and all frequencies.

    At each frequency the condition is a quadratic in k: ``|L|^2 k^2 + 2 Re(L) k + 1 - distance^2``
    has its first positive root where the loop enters the circle around -1. A loop that is stable
    for small gains then stays so up to K.

    Parameters
    ----------
    shape : ndarray, shape (K,)
        L for unit gain.
    distance : float
        0 < distance < 1.

    Returns
    -------
    gain : float
        inf if no gain reaches the circle.
    at : int
        Index of the decisive frequency.
    """
    low, _, where = _circle_entered(shape, distance)
    if not low.size:
        return float("inf"), 0
    first = int(np.argmin(low))
    return float(low[first]), int(where[first])


def _circle_entered(
    shape: ComplexArray, distance: float
) -> tuple[FloatArray, FloatArray, IntArray]:
    """Gains between which the loop is in the circle around -1, and where on the curve it is so."""
    square = np.abs(shape) ** 2
    real = shape.real
    inside = real**2 - square * (1 - distance**2)
    where = np.flatnonzero((inside >= 0) & (real < 0) & (square > 0))
    # The rationalized root: no cancellation if the circle is only touched.
    sums = -real[where] + np.sqrt(inside[where])
    return (1 - distance**2) / sums, sums / square[where], where


def smallest_on_line(
    function: Callable[[float], float], low: float, high: float, points: int = 16
) -> tuple[float, float]:
    """Minimize over a logarithmic range: a scan, then Brent's method around the best point.

    Returns
    -------
    argument, value : float
    """
    grid = np.geomspace(low, high, points)
    values = [function(float(x)) for x in grid]
    best = int(np.argmin(values))
    a, b = np.log(grid[max(best - 1, 0)]), np.log(grid[min(best + 1, points - 1)])
    with np.errstate(invalid="ignore"):  # values may be infinite
        at, value, *_ = fminbound(
            lambda x: function(float(np.exp(x))), a, b, xtol=1e-4, full_output=True, disp=0
        )
    return float(np.exp(at)), float(value)
