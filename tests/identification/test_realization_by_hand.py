"""What a realization decides and flags, on short responses whose numbers are known."""

from __future__ import annotations

import numpy as np
import pytest

import ctrl_realize as cr
from ctrl_realize.errors import OptionError
from ctrl_realize.identification.realization import (
    uses_feedthrough,
)

DT = 0.1
K = np.arange(40)
LAG = np.r_[np.zeros(4), 0.5**K]  # 1 at sample 4, then half of it and half of that


def test_samples_beyond_those_asked_for_are_not_seen():
    wild = LAG.copy()
    wild[14] = 9.0
    seen = cr.realize(wild, 1, delay=4, samples=9, dt=DT).fit  # 5 to 13
    assert seen.samples == 9
    assert seen.iae < 1e-13
    assert cr.realize(wild, 1, delay=4, samples=10, dt=DT).fit.iae > 1
    # what comes before the delay is not modelled
    early = LAG.copy()
    early[1] = -2.0
    assert cr.realize(early, 1, delay=4, dt=DT).fit.iae == pytest.approx(2.0, rel=1e-12)


def test_a_padded_matrix_bounds_the_error():
    two = LAG + np.r_[np.zeros(4), 0.1 * 0.2**K]
    fit = cr.realize(two, 1, delay=3, hankel="padded", dt=DT).fit
    assert (fit.hankel, fit.samples) == ("padded", 40)
    model = cr.realize(two, 1, delay=3, hankel="padded", dt=DT)
    z = np.exp(1j * np.linspace(0.0, np.pi, 50))
    off = np.abs(np.polyval(two[::-1], 1 / z) - model(z)).max()
    assert 0 < off <= fit.error_bound < 0.1
    assert fit.following < fit.singular_values[0]
    for hankel in ("round", None):
        with pytest.raises(OptionError, match="hankel="):
            cr.realize(LAG, 1, dt=DT, hankel=hankel)


def test_channels_keep_their_places():
    gains = np.array([[1.0, 2.0], [3.0, -1.0], [0.5, 0.25]])
    pulses = gains[:, :, None] * LAG
    for direct in (None, False):
        system = cr.realize(pulses, 2, delay=4, feedthrough=direct, dt=DT)
        assert system.delay_free.D.shape == (3, 2)
        expected = pulses.copy()
        if direct is False:
            expected[:, :, 4] = 0
        np.testing.assert_allclose(system.markov(44), expected, atol=1e-13)


# the direct term


def impulse(noise, first=1.0):
    return cr.ImpulseResponse(np.r_[0.5, first, np.zeros(20)], DT, noise=noise)


def test_three_standard_deviations_are_needed_to_believe_it():
    two = np.array([1.0, -1.0])  # a standard deviation of the square root of 2
    for sign in (1, -1):
        assert uses_feedthrough(impulse(two, sign * 4.2426), 1, None) is False
        assert uses_feedthrough(impulse(two, sign * 4.2427), 1, None) is True
    assert uses_feedthrough(impulse(two, 9.0), 0, None) is False  # at its own sample


# what is left
