"""The time from 10 % to 90 % of a step response."""

from __future__ import annotations

import numpy as np
import pytest

from ctrl_realize.numerics.rise import rise_time


def ramp(start, length, size):
    return np.clip((np.arange(size) - start) / length, 0.0, 1.0)


@pytest.mark.parametrize("height", [1.0, -3.0, 1e-200])
def test_a_ramp_rises_for_four_fifths_of_its_length(height):
    # the mean over a window inside the ramp is the ramp: exact, between samples as well
    assert rise_time(height * ramp(10, 100, 1000), 0.5) == pytest.approx(40.0, rel=1e-12)
    assert rise_time(height * ramp(10.3, 33, 400), 1.0) == pytest.approx(26.4, rel=1e-12)
    # of a record that is short, single samples are taken
    assert rise_time(height * ramp(2, 7, 39), 1.0) == pytest.approx(5.6, rel=1e-12)


def test_a_lag_rises_for_the_logarithm_of_nine_times_itself():
    step = -np.expm1(-np.arange(4000) / 200.0)
    # means over 50 samples bend an exponential by (50 / 200)^2 / 24
    assert rise_time(step, 0.1) == pytest.approx(0.1 * 200 * np.log(9), rel=0.005)


def test_noise_neither_starts_nor_ends_the_rise():
    noise = 0.1 * np.random.default_rng(0).standard_normal(2000)
    slow = ramp(200, 1000, 2000) + noise
    # of single samples the first beyond 90 % comes 100 samples early, the last below 10 % late;
    # means over 100 of them err by 0.01, that is by ten samples at either end
    assert rise_time(slow, 1.0) == pytest.approx(800, abs=40)
