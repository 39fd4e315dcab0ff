"""Plants that the design tests share."""

import control as ct
import numpy as np
import pytest

import ctrl_realize as cr

DT = 7.8125e-4
DELAYS = (0, 37, 100, 300, 1000)


def continuous_valve() -> ct.StateSpace:
    """Third order, overdamped: a pole at 2 Hz, a pair at 6 Hz with damping 0.7."""
    slow, fast = 2 * np.pi * 2, 2 * np.pi * 6
    A = np.array([[-slow, 0, 0], [0, 0, fast], [slow, -fast, -1.4 * fast]])
    return ct.ss(A, [[1.0], [0], [0]], [[0, fast, 0]], [[0.0]])


@pytest.fixture(scope="session")
def valve():
    """The valve-like plant with any delay: ``valve(37)``."""
    core = continuous_valve()
    gain = float(core.dcgain())
    core = ct.ss(core.A, core.B, core.C / gain, core.D)
    return lambda delay: cr.delayed_ss(core, delay, dt=DT, name="valve")


@pytest.fixture(scope="session")
def cores():
    """Discrete cores by kind, all with the sample time of the valve."""
    slow = np.exp(-DT / 0.08)
    spin = 0.999 * np.exp(0.03j)
    ring = np.array([[spin.real, spin.imag], [-spin.imag, spin.real]])
    return {
        "stable": ct.ss([[slow, 0.01], [0, 0.98]], [[0.0], [1]], [[0.01, 0]], [[0.0]], DT),
        "integrating": ct.ss([[1.0, 0.01], [0, 0.98]], [[0.0], [1]], [[0.002, 0]], [[0.0]], DT),
        "unstable": ct.ss([[1.0005, 0.01], [0, 0.9]], [[0.0], [1]], [[0.01, 0]], [[0.0]], DT),
        "resonant": ct.ss(ring, [[0.0], [1]], [[0.02, 0.001]], [[0.0]], DT),
        "direct": ct.ss([[slow]], [[1.0]], [[0.01]], [[0.2]], DT),
    }


@pytest.fixture(scope="session")
def pi_controller():
    """PI with forward Euler: ``pi_controller(gain, integral_time)``."""
    return lambda gain, ti: ct.ss([[1.0]], [[1.0]], [[gain * DT / ti]], [[gain]], DT)
