"""Phase of responses with a dead time, on grids too coarse to unwrap.

Our own: a dead time turns the phase by ``-omega tau``, so that of all dead times the true one
leaves the least to unwrap.
"""

from __future__ import annotations

import numpy as np

from ..arrays import ComplexArray, FloatArray


def unwrap_with_dead_time(omega: FloatArray, values: ComplexArray, dead_time: float) -> FloatArray:
    """Unwrap the phase after taking a dead time out, and put it back.

    Neighbouring points may then differ by any number of turns of the delay; only the rest has to
    change by less than half a turn.

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
    """Find the dead time that leaves the smoothest phase behind.

    The sum of the absolute phase steps that remain is searched over delays up to one turn between
    the closest points; on an evenly spaced grid that is all that can be told.

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
    # The widest gap sets how finely the delay must be tried; the total band how far it matters.
    count = int(np.clip(8 * longest * gaps.max() / (2 * np.pi), 64, 20_000))
    tried = np.linspace(0, min(longest, count * np.pi / (4 * gaps.max())), count)
    left = phase_roughness(steps, gaps, tried)
    best = float(tried[np.argmin(left)])
    width = tried[1] - tried[0]
    for _ in range(30):
        near = np.linspace(max(0.0, best - width), best + width, 9)
        best = float(near[np.argmin(phase_roughness(steps, gaps, near))])
        width /= 3
    # A plain lag also slopes; where no delay at all is nearly as smooth, there is none to take.
    turned = best * gaps.max()
    return best if turned > 0.5 else 0.0


def phase_roughness(steps: FloatArray, gaps: FloatArray, delays: FloatArray) -> FloatArray:
    """Sum the absolute phase steps that are left when each delay is taken out.

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
