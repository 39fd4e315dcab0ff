"""The plant of all comparisons: third order, overdamped, like a control valve."""

from __future__ import annotations

import control as ct
import numpy as np
from scipy.optimize import brentq

import ctrl_realize as cr

DT = 7.8125e-4
SLOW, FAST = 2 * np.pi * 2, 2 * np.pi * 6
GAIN, INTEGRAL_TIME = 0.5, 0.2


def valve(delay: int) -> cr.DelayedStateSpace:
    """Pole at 2 Hz, pair at 6 Hz with damping 0.7, `delay` samples of dead time."""
    core = ct.tf([SLOW * FAST**2], np.polymul([1, SLOW], [1, 1.4 * FAST, FAST**2]))
    return cr.delayed_ss(core, delay, dt=DT)


def controller() -> ct.StateSpace:
    """PI by forward differences."""
    return ct.ss([[1.0]], [[1.0]], [[GAIN * DT / INTEGRAL_TIME]], [[GAIN]], DT)


def exact_margins(delay: int) -> tuple[float, float]:
    """Gain and phase margin (degrees) by one root finding each on core(z) z^-d.

    One gain crossover, and the gain falls: the first phase crossover decides.
    """
    core, pi = valve(0), controller()

    def loop(omega: float) -> complex:
        z = np.exp(1j * omega * DT)
        A, B, C = (np.asarray(M) for M in (core.A, core.B, core.C))
        plant = (C @ np.linalg.solve(z * np.eye(A.shape[0]) - A, B))[0, 0]
        return complex(plant * (GAIN + pi.C[0, 0] / (z - 1)) * z**-delay)

    crossover = brentq(lambda w: abs(loop(w)) - 1, 1e-3, 100.0, xtol=1e-13)
    grid = np.linspace(0.1, np.pi / DT, 20_000 + 40 * delay)
    values = np.array([loop(w) for w in grid])
    turns = np.flatnonzero((values.imag[:-1] < 0) & (values.imag[1:] >= 0) & (values.real[1:] < 0))
    first = int(turns[0])
    phase = brentq(lambda w: loop(w).imag, grid[first], grid[first + 1], xtol=1e-13)
    return 1 / abs(loop(phase)), float(np.degrees(np.angle(-loop(crossover))))
