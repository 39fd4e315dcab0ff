"""The linear part of the simulated set-up, without integration error."""

from __future__ import annotations

from functools import reduce

import control as ct
import numpy as np
from scipy.linalg import expm, solve
from scipy.signal import buttap

from ..numerics.arrays import FloatArray
from ..numerics.state_space.responses import simulate
from ..numerics.state_space.sampling import sample_with_dead_time

Core = tuple[FloatArray, FloatArray, FloatArray, FloatArray]
"""A, B, C, D of a continuous single-input single-output system."""


def lag(cutoff_hz: float) -> Core:
    """Return a first-order low-pass of unit gain."""
    pole = 2 * np.pi * cutoff_hz
    return np.array([[-pole]]), np.array([[pole]]), np.array([[1.0]]), np.zeros((1, 1))


def second_order_lag(frequency_hz: float, damping: float) -> Core:
    """Return a second-order low-pass of unit gain."""
    w = 2 * np.pi * frequency_hz
    A = np.array([[0.0, w], [-w, -2 * damping * w]])
    return A, np.array([[0.0], [w]]), np.array([[1.0, 0.0]]), np.zeros((1, 1))


def butterworth(order: int, cutoff_hz: float) -> list[Core]:
    """Return an analog Butterworth low-pass as a cascade of sections."""
    poles = buttap(order)[1]
    sections = [
        second_order_lag(cutoff_hz, -float(p.real)) for p in poles if p.imag > 1e-9 * abs(p)
    ]
    return sections + [lag(cutoff_hz)] * (order % 2)


def integrator(rate: float) -> Core:
    """Return an integrator of `rate` per second."""
    return np.zeros((1, 1)), np.ones((1, 1)), np.array([[rate]]), np.zeros((1, 1))


def chain(parts: list[Core], gain: float = 1.0) -> Core:
    """Connect strictly proper systems in series, the first one at the input."""
    systems = [ct.ss(*part) for part in parts]
    A, B, C, D = ct.ssdata(reduce(lambda before, behind: behind * before, systems))
    return A, B, gain * C, D


def dc_gain(core: Core) -> float:
    """Return the gain at frequency zero."""
    return float(ct.ss(*core).dcgain())


def response_to_held_input(core: Core, held: FloatArray, dt: float, dead_time: float) -> FloatArray:
    """Simulate an input that is held over each sample, exactly.

    Parameters
    ----------
    core : (A, B, C, D)
    held : ndarray, shape (N,)
        Input; before the record it is constant at its first value.
    dt, dead_time : float
        In s; the dead time need not be a multiple of `dt`.

    Returns
    -------
    ndarray, shape (N,)
        Output at the samples, before the input of the same sample acts.
    """
    before = dc_gain(core) * float(held[0])
    return np.asarray(response_to_changes(core, held, dt, dead_time) + before)


def response_to_changes(core: Core, held: FloatArray, dt: float, dead_time: float) -> FloatArray:
    """Simulate the deviation from the output before the record, in which the input was `held[0]`.

    As `response_to_held_input`, and for integrating plants, too.
    """
    Ad, Bd, Cd, Dd, delay = sample_with_dead_time(*core, dt, dead_time)
    moved = np.zeros((1, held.size))
    shift = min(delay, held.size)
    moved[0, shift:] = held[: held.size - shift] - held[0]
    return np.asarray(simulate(Ad, Bd, Cd, Dd, moved)[0])


def response_to_started_sine(
    core: Core, omega: float, time: FloatArray, dead_time: float
) -> FloatArray:
    """Compute the response to ``sin(omega t)``, switched on at t = 0, exactly.

    Parameters
    ----------
    core : (A, B, C, D)
        D must be 0.
    omega : float
        In rad/s.
    time : ndarray, shape (N,)
        Uniform, in s.
    dead_time : float
        In s.

    Returns
    -------
    ndarray, shape (N,)
    """
    A, B, C, _ = core
    n = A.shape[0]
    # Steady state X exp(j omega t), and a free response that starts at -imag(X).
    steady = solve(1j * omega * np.eye(n) - A, B.astype(complex))[:, 0]
    local = time - dead_time
    first = int(np.searchsorted(local, 0.0))
    y = np.zeros(time.size)
    if first == time.size:
        return y
    acting = local[first:]
    free = expm(A * acting[0]) @ -steady.imag[:, None]
    power = expm(A * (time[1] - time[0]))
    # Columns x, Mx, M^2 x, ... by doubling: without eigenvectors, for equal poles, too.
    while free.shape[1] < acting.size:
        free = np.hstack([free, power @ free])
        power = power @ power
    y[first:] = ((C @ steady)[0] * np.exp(1j * omega * acting)).imag
    y[first:] += (C @ free[:, : acting.size])[0]
    return y
