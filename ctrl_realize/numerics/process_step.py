"""Step responses of first- and second-order models with dead time, in closed form."""

from __future__ import annotations

import numpy as np

from .arrays import FloatArray


def process_step(
    time: FloatArray, lag: float, second_lag: float, dead_time: float, *, integrating: bool
) -> FloatArray:
    """Unit-gain step response of exp(-theta s) / ((T1 s + 1)(T2 s + 1)), or of that over s.

    Parameters
    ----------
    time : ndarray, shape (N,)
        In s.
    lag, second_lag, dead_time : float
        T1 >= T2 >= 0 and theta, in s.
    integrating : bool

    Returns
    -------
    ndarray, shape (N,)
    """
    t = np.maximum(time - dead_time, 0.0)
    big, small = max(lag, second_lag), min(lag, second_lag)
    if big == 0:
        return t if integrating else np.where(time >= dead_time, 1.0, 0.0)
    slow = np.exp(-t / big)
    if small < 1e-9 * big:
        rest = slow
        area = big * (1 - slow)
    elif big - small < 1e-6 * big:
        mean = (big + small) / 2
        slow = np.exp(-t / mean)
        rest = (1 + t / mean) * slow
        area = 2 * mean * (1 - slow) - t * slow
    else:
        fast = np.exp(-t / small)
        rest = (big * slow - small * fast) / (big - small)
        area = (big**2 * (1 - slow) - small**2 * (1 - fast)) / (big - small)
    return np.asarray(t - area if integrating else 1 - rest, dtype=np.float64)
