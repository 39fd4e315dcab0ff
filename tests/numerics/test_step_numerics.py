"""What samples at rest tell, when an output first moves, how far a profile reaches."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.signal import lfilter

from ctrl_realize.numerics.output_error.step_data import fixed_regressors, step_data
from ctrl_realize.numerics.separable.profile_ends import profile_limits
from ctrl_realize.numerics.signals.noise import hum_frequencies, rest_noise, winsorised_sigma
from ctrl_realize.numerics.signals.onset import first_motion
from tests import rigs


def white(n, seed=0):
    return np.random.default_rng(seed).standard_normal(n)


@pytest.mark.parametrize("pole", [0.0, 0.9, 0.97])
def test_slow_noise_is_no_drift(pole):
    rng = np.random.default_rng(5)
    found = []
    for _ in range(40):
        slow = lfilter([1.0], [1.0, -pole], rng.standard_normal(1200))[200:]
        found.append(rest_noise(slow[:500], slow, 0.0)[1])
    # five standard errors: none of 40, where white ones make 10 and 24 of 40 a drift
    assert not np.any(found)
    assert rest_noise(slow[:500] + 0.5 * np.arange(500), slow, 0.0)[1] == pytest.approx(
        0.5, abs=0.05
    )


def test_a_slope_before_the_step_has_three_explanations_and_a_brief_one_may_be_nothing():
    k = np.arange(1000)

    def ways(edge):
        output = 0.05 * k + 0.01 * white(1000) + 200.0 * (k >= edge + 20)
        return step_data(output, 1.0 * (k >= edge), 1.0, [(edge, 1)]).explanations()

    level, slope = fixed_regressors(ways(100)[0]).T
    assert_allclose(level, 1.0)
    assert_allclose(np.diff(slope), slope[1] - slope[0])
    ending = np.diff(fixed_regressors(ways(100)[1])[:, 1])
    assert_allclose(ending[:299], ending[0])
    assert_allclose(ending[300:], 0.0)
    moving = ways(100)[2]
    assert moving.relaxing
    assert fixed_regressors(moving).shape == (1000, 1)
    assert len(ways(100)) == 3
    # 47 samples are less than a twentieth of the 953 that follow
    assert [bool(way.drift) for way in ways(47)] == [True, True, False, False]
    assert len(ways(48)) == 3
    assert len(step_data(white(1000), 1.0 * (k >= 100), 1.0, [(100, 1)]).explanations()) == 1


def test_noise_is_found_beside_outliers_drift_and_quantisation():
    clean = white(2000)
    assert winsorised_sigma(clean, 0.0) == pytest.approx(1.0, rel=0.05)
    spoiled = clean.copy()
    spoiled[::50] += 30
    assert winsorised_sigma(spoiled, 0.0) == pytest.approx(1.0, rel=0.12)
    drifting = clean + 0.01 * np.arange(2000)
    sigma, drift = rest_noise(drifting, drifting, 0.0)
    assert sigma == pytest.approx(1.0, rel=0.05)
    assert drift == pytest.approx(0.01, rel=0.05)
    # a signal that rests on one level: the rounding itself, q / sqrt(12)
    assert rest_noise(np.zeros(100), np.zeros(300), 0.5)[0] == pytest.approx(0.5 / np.sqrt(12))


def test_without_rest_the_third_differences_tell_the_noise():
    response = 50 * (1 - np.exp(-np.arange(800) / 60)) + white(800)
    assert rest_noise(response[:0], response, 0.0)[0] == pytest.approx(1.0, rel=0.1)


def test_hum_is_found_to_a_small_part_of_a_period_over_the_record():
    index = np.arange(3840)
    frequency = 50 / 1280 * 1.0007
    found = hum_frequencies(2 * np.sin(2 * np.pi * frequency * index + 1) + white(3840))
    assert len(found) == 1
    # Cramer-Rao bound of the frequency: sqrt(24) / (2 pi A n^1.5) for unit noise, A = 2
    assert abs(found[0] - frequency) < 4 * np.sqrt(24) / (2 * np.pi * 2 * 3840**1.5)
    for seed in range(20):
        assert hum_frequencies(white(1000, seed)) == []


def test_first_motion_is_not_a_spike_and_not_a_glitch():
    time = rigs.TS * np.arange(-400, 1200)
    output = rigs.exact_step(rigs.R1, time - 60 * rigs.TS) + 0.002 * white(1600)
    output[420:424] += 0.2  # 20 samples after the step, 4 samples long
    found = first_motion(output, 400, 0.002, 0.0, 0.0)
    assert 60 <= found.crossing <= 64
    assert abs(found.onset - 60) < 1.5
    assert found.sign == 1


def test_profile_limits_are_where_a_parabola_crosses():
    delay = np.linspace(-4, 8, 13)
    low, high = profile_limits(delay, ((delay - 2) / 1.5) ** 2)
    # the root of the excess is linear, so that interpolation is exact
    assert_allclose([low, high], [2 - 1.5 * np.sqrt(3.84), 2 + 1.5 * np.sqrt(3.84)])
    assert profile_limits(delay, np.zeros(13)) == (-4, 8)
