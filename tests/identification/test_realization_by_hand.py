"""What a realization decides and flags, on short responses whose numbers are known."""

from __future__ import annotations

import numpy as np
import pytest

import ctrl_realize as cr
from ctrl_realize.errors import OptionError
from ctrl_realize.identification.realization.realize import uses_feedthrough

DT = 0.1
K = np.arange(40)
LAG = np.r_[np.zeros(4), 0.5**K]  # 1 at sample 4, then half of it and half of that


def test_a_padded_matrix_bounds_the_error():
    two = LAG + np.r_[np.zeros(4), 0.1 * 0.2**K]
    fit = cr.realize(two, 1, delay=3, hankel="padded", dt=DT).fit
    assert (fit.hankel, fit.samples) == ("padded", 40)
    model = cr.realize(two, 1, delay=3, hankel="padded", dt=DT)
    z = np.exp(1j * np.linspace(0.0, np.pi, 50))
    off = np.abs(np.polyval(two[::-1], 1 / z) - model(z)).max()
    assert 0 < off <= fit.error_bound < 0.1
    assert fit.next_singular_value < fit.singular_values[0]
    for hankel in ("round", None):
        with pytest.raises(OptionError, match="hankel="):
            cr.realize(LAG, 1, dt=DT, hankel=hankel)


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
