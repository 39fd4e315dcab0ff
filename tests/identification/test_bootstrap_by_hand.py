"""Draws, blocks and bands of a bootstrap, with estimators that are written by hand."""

from __future__ import annotations

import control as ct
import numpy as np

import ctrl_realize as cr
from ctrl_realize.identification.bootstrap import (
    Bootstrap,
)

DT = 0.5


def model(pole=0.5, delay=1, gain=2.0, fit=None):
    """A lag sampled at 0.5 s of that gain behind its delay."""
    core = ct.ss([[pole]], [[1.0]], [[gain * (1 - pole)]], [[0.0]], DT)
    return cr.DelayedStateSpace(core, delay, fit=fit)


# what is read off the draws


def test_phases_fall_with_the_delay_and_are_not_wrapped():
    omega = np.linspace(0.5, 6.0, 40)
    delays = np.array([7, 6, 9])
    result = Bootstrap(
        model(), tuple(model(delay=d) for d in delays), delays * DT, "residuals", 7, 0
    )
    low, high = result.phase_band(omega, level=0.5)
    lag = np.angle(0.5 / (np.exp(1j * omega * DT) - 0.5))
    # of three draws the first and the last; a sample is omega / 2
    np.testing.assert_allclose(high, lag - 6 * omega * DT, atol=1e-9)
    np.testing.assert_allclose(low, lag - 9 * omega * DT, atol=1e-9)


def test_phases_are_taken_within_half_a_turn_of_the_first_model():
    phases = np.array([2.2, -2.2, 3.1, -3.1, 2.0])
    systems = tuple(lambda z, phase=phase: np.exp([1j * phase]) for phase in phases)
    result = Bootstrap(model(), systems, np.ones(5), "residuals", 7, 0)
    # of five in a row 1 / 6 and 5 / 6: 2, 2.2, 3.1, 2 pi - 3.1 and 2 pi - 2.2
    low, high = result.phase_band([1.0], level=2 / 3)
    np.testing.assert_allclose([low[0], high[0]], [2.0, 2 * np.pi - 2.2], rtol=1e-12)


# how the noise is drawn


# one identification after the other
