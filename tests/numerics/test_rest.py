"""The level and the drift of an output before its step."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from ctrl_realize.numerics.signals.baseline import rest_line


def white(n, seed=0):
    return np.random.default_rng(seed).standard_normal(n)


AFTER = np.linspace(5, 9, 40)


@pytest.mark.parametrize("remove", [None, False])
def test_a_steady_output_has_its_mean_as_level(remove):
    before = 3 + 0.1 * white(400)
    assert rest_line(before, AFTER, remove) == (pytest.approx(before.mean()), 0)


@pytest.mark.parametrize("remove", [None, True])
def test_a_drift_is_continued_to_the_step(remove):
    k = np.arange(-400, 0)
    level, slope = rest_line(3 + 0.002 * k + 0.01 * white(400), AFTER, remove)
    # standard errors of a line through 400 samples: sigma sqrt(12 / n^3) and sigma sqrt(4 / n)
    assert slope == pytest.approx(0.002, abs=4 * 0.01 * np.sqrt(12 / 400**3))
    assert level == pytest.approx(3, abs=4 * 0.01 * np.sqrt(4 / 400))


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("pole", [0.0, 0.95])
def test_noise_is_no_drift_white_or_coloured(seed, pole):
    before = lfilter([1], [1, -pole], white(600, seed))
    assert rest_line(before, AFTER, None)[1] == 0


def standard_error(noise):
    """Of the slope of a line through `noise`, correlation counted up to its first zero."""
    n = noise.size
    correlation = np.correlate(noise, noise, "full")[n - 1 :] / (noise @ noise)
    first = np.flatnonzero(correlation <= 0)[0]
    return noise.std() * np.sqrt(12 * max(2 * correlation[:first].sum() - 1, 1) / n**3)


@pytest.mark.parametrize("pole", [-0.5, 0.0, 0.6, 0.9])
@pytest.mark.parametrize("seed", range(4))
def test_five_standard_errors_decide(pole, seed):
    k = np.arange(-300, 0)
    noise = lfilter([1], [1, -pole], white(300, seed))
    noise -= np.polyval(np.polyfit(k, noise, 1), k)  # its own line taken off
    error = standard_error(noise)
    assert rest_line(7 + noise + 4.99 * error * k, AFTER, None)[1] == 0
    assert rest_line(7 + noise + 5.01 * error * k, AFTER, None)[1] == pytest.approx(5.01 * error)
