"""Phase of responses with dead time, on grids too coarse for direct unwrapping.

Our own: a dead time changes the phase by ``-omega tau``, so the remaining phase is smoothest for
the true dead time.
"""

from __future__ import annotations

import numpy as np

from ..arrays import ComplexArray, FloatArray


def unwrap_with_dead_time(omega: FloatArray, values: ComplexArray, dead_time: float) -> FloatArray:
    """Unwrap the phase after removing a dead time, and add the dead time again.

    The phase of the delay may change by any number of turns between neighbouring points; only the
    rest has to change by less than half a turn.

    Parameters
    ----------
    omega : ndarray, shape (K,)
        Rising, rad/s.
    values : ndarray, shape (K,)
    dead_time : float
        In s.

    Returns
    -------
    ndarray, shape (K,)
        Phase in rad; the delay-free part starts in -pi...pi.
    """
    rest = np.unwrap(np.angle(values * np.exp(1j * omega * dead_time)))
    return np.asarray(rest - omega * dead_time, dtype=np.float64)


def dead_time_from_phase(omega: FloatArray, values: ComplexArray) -> float:
    """Find the dead time for which the remaining phase is smoothest.

    The sum of the absolute remaining phase steps is minimised over delays up to one turn between
    the closest points; on a uniform grid larger delays are indistinguishable.

    Parameters
    ----------
    omega : ndarray, shape (K,)
        Rising, rad/s.
    values : ndarray, shape (K,)

    Returns
    -------
    float
        Dead time in s, >= 0.
    """
    gaps = np.diff(omega)
    if gaps.size < 2:
        return 0.0
    steps = np.angle(values[1:] / values[:-1])
    longest = 2 * np.pi / gaps.min() if gaps.max() > 1.01 * gaps.min() else np.pi / gaps.min()
    # The widest gap determines the step of the delay, the total band its range.
    count = int(np.clip(8 * longest * gaps.max() / (2 * np.pi), 64, 20_000))
    tried = np.linspace(0, min(longest, count * np.pi / (4 * gaps.max())), count)
    left = phase_roughness(steps, gaps, tried)
    best = float(tried[np.argmin(left)])
    width = tried[1] - tried[0]
    for _ in range(30):
        near = np.linspace(max(0.0, best - width), best + width, 9)
        best = float(near[np.argmin(phase_roughness(steps, gaps, near))])
        width /= 3
    # The phase of a lag also decreases; if no delay is nearly as smooth, none is used.
    turned = best * gaps.max()
    return best if turned > 0.5 else 0.0


def phase_roughness(steps: FloatArray, gaps: FloatArray, delays: FloatArray) -> FloatArray:
    """Sum the absolute phase steps that remain after removal of each delay.

    Parameters
    ----------
    steps, gaps : ndarray, shape (K - 1,)
        Phase from point to point, any number of turns off, and distance in rad/s.
    delays : ndarray, shape (D,)

    Returns
    -------
    ndarray, shape (D,)
    """
    left = np.empty(delays.size)
    for start in range(0, delays.size, 512):
        part = delays[start : start + 512, None]
        turned = steps + part * gaps
        left[start : start + 512] = np.abs(turned - 2 * np.pi * np.round(turned / (2 * np.pi))).sum(
            axis=1
        )
    return left
