"""Filters, means over bins, and correlation, against their definitions."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.signal import lfilter

from ctrl_realize.numerics.signals.bins import response_bins
from ctrl_realize.numerics.signals.correlation import (
    autoregression,
    correlation,
    cross_bound,
    whiteness,
)


def test_bins_are_4_percent_of_the_distance_from_the_first_motion_wide():
    bins = response_bins(2000, [100], 20)
    away = np.abs(bins.first[12:] - 120)
    width = bins.width[12:]
    # single samples as far as two are more than 4 %, that is within 50 samples
    assert np.all(width[away < 50] == 1)
    assert np.all(width[:-1] <= np.maximum(0.04 * away[:-1], 1))
    # widths go up by 19 %, or from 1 to 2, 2 to 3, 3 to 4 and 4 to 5
    wide = away[:-1] >= 75
    assert np.all(width[:-1][wide] > 0.04 * away[:-1][wide] / 1.34)
    # few of them are different, and none is beyond 4 % of the 1880 samples that are left
    assert width[:-1].max() <= 75
    assert len(set(width.tolist())) <= 20
    assert bins.width.sum() == 2000


def test_correlation_by_fft_is_the_sum_over_pairs():
    rng = np.random.default_rng(0)
    x, y = rng.normal(size=(2, 57)) + 5
    a, b = x - x.mean(), y - y.mean()
    norm = np.linalg.norm(a) * np.linalg.norm(b)
    expected = [a[i:] @ b[: 57 - i] / norm for i in range(11)]
    assert_allclose(correlation(x, y, 10), expected, rtol=0, atol=1e-14)


def test_white_noise_fails_the_test_as_often_as_asked_for():
    draws = np.random.default_rng(0).normal(size=(600, 400))
    chance = np.array([whiteness(correlation(e, e, 20)[1:], 400) for e in draws])
    # 600 draws: 5 -+ 0.9 %, and 50 -+ 2 %
    assert abs(np.mean(chance < 0.05) - 0.05) < 0.03
    assert abs(np.mean(chance < 0.5) - 0.5) < 0.07
    coloured = lfilter([1], [1, -0.3], draws[0])
    assert whiteness(correlation(coloured, coloured, 20)[1:], 400) < 1e-3


def test_a_quarter_as_many_lags_as_samples_have_their_share_of_false_alarms():
    draws = np.random.default_rng(3).standard_normal((2000, 100))
    chance = np.array([whiteness(correlation(e, e, 25)[1:], 100) for e in draws])
    # 1 and 5 % of 2000 are 20 +- 4.4 and 100 +- 9.7; with 25 degrees of freedom 58 and 160
    assert 10 <= np.sum(chance < 0.01) <= 38
    assert np.sum(chance < 0.05) == pytest.approx(100, abs=30)


def test_bound_of_cross_correlation_holds_for_coloured_signals():
    rng = np.random.default_rng(0)
    outside = []
    for _ in range(300):
        e, u = lfilter([1], [1, -0.8], rng.normal(size=(2, 500)))
        limit = cross_bound(e, u, 25, 0.95)
        outside.append(np.mean(np.abs(correlation(e, u, 25)) > limit))
    # 5 % of lags; neighbours go together, so 300 records count for about 1000 free lags
    assert abs(np.mean(outside) - 0.05) < 0.025


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_order_and_coefficients_of_an_autoregression_are_found(seed):
    e = lfilter([1], [1, -1.5, 0.8], np.random.default_rng(seed).normal(size=4000))
    c = autoregression(e, 10)
    assert 2 <= c.size <= 3  # BIC takes one more in about 1 % of cases
    assert_allclose(c[:2], [1.5, -0.8], rtol=0, atol=0.05)  # sqrt((1 - .8^2) / 4000) = 0.01
    assert autoregression(np.random.default_rng(seed).normal(size=4000), 10).size <= 1
