"""Filters, means over bins, and correlation, against their definitions."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.signal import lfilter, sosfreqz

from ctrl_realize.numerics.signals.bins import Bins, response_bins
from ctrl_realize.numerics.signals.correlation import (
    autoregression,
    correlation,
    cross_bound,
    fit_percent,
    predict_ahead,
    whiteness,
)
from ctrl_realize.numerics.signals.filters import butterworth, butterworth_group_delay, low_pass

DT = 1 / 1280


@pytest.mark.parametrize("order", [1, 2, 3, 5])
def test_the_group_delay_is_the_slope_of_the_phase_at_zero(order):
    frequency = 1e-3
    response = sosfreqz(butterworth(order, 50.0, DT), [frequency], fs=1 / DT)[1]
    expected = -np.angle(response[0]) / (2 * np.pi * frequency * DT)
    # (w / wc)^2 of the slope's own change
    assert butterworth_group_delay(order, 50.0, DT) == pytest.approx(expected, rel=1e-6)


def test_the_causal_filter_looks_only_back_and_starts_at_rest():
    values = 3.0 + (np.arange(2000) >= 500)
    filtered = low_pass(values, 5, 50.0, DT, zero_phase=False)
    assert_allclose(filtered[:500], 3.0, atol=1e-12)
    assert filtered[500] != 3.0
    delay = np.sum(4.0 - filtered[500:])  # area above a unit step: its delay in samples
    assert delay == pytest.approx(butterworth_group_delay(5, 50.0, DT), rel=1e-9)


def test_forward_and_backward_is_symmetric_and_halves_the_power():
    pulse = np.zeros(4001)
    pulse[2000] = 1.0
    response = low_pass(pulse, 5, 50.0, DT, zero_phase=True)
    assert_allclose(response, response[::-1], atol=1e-12)
    k = np.arange(-2000, 2001)
    at_cutoff = np.sum(response * np.cos(2 * np.pi * 50.0 * DT * k))
    # twice through the filter: half the amplitude
    assert [response.sum(), at_cutoff] == pytest.approx([1, 0.5], abs=1e-9)


def test_means_are_those_of_the_samples_of_each_bin():
    bins = Bins(np.array([0, 1, 4]), np.array([1, 3, 2]))
    values = np.array([5.0, 1.0, 2.0, 6.0, 7.0, 9.0, 100.0])  # the last is in no bin
    assert bins.average(values).tolist() == [5.0, 3.0, 8.0]
    both = np.stack([values, -2 * values], axis=1)
    assert bins.average(both).tolist() == [[5.0, -10.0], [3.0, -6.0], [8.0, -16.0]]


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


@pytest.mark.parametrize("edges", [[0], [1], [7, 9], [100, 101, 300]])
def test_every_sample_is_in_one_bin(edges):
    bins = response_bins(500, edges, 30)
    inside = np.concatenate(
        [np.arange(f, f + w) for f, w in zip(bins.first, bins.width, strict=True)]
    )
    assert inside.tolist() == list(range(500))


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


def test_bound_of_cross_correlation_holds_for_coloured_signals():
    rng = np.random.default_rng(0)
    outside = []
    for _ in range(300):
        e, u = lfilter([1], [1, -0.8], rng.normal(size=(2, 500)))
        limit = cross_bound(e, u, 25, 0.95)
        outside.append(np.mean(np.abs(correlation(e, u, 25)) > limit))
    # 5 % of lags; neighbours go together, so 300 records count for about 1000 free lags
    assert abs(np.mean(outside) - 0.05) < 0.025


def test_fit_percent_is_100_for_the_data_and_0_for_their_mean():
    y = np.random.default_rng(0).normal(size=(1, 50)) + 9
    assert fit_percent(y, y)[0] == 100
    assert_allclose(fit_percent(y, np.full((1, 50), y.mean())), 0, atol=1e-12)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_order_and_coefficients_of_an_autoregression_are_found(seed):
    e = lfilter([1], [1, -1.5, 0.8], np.random.default_rng(seed).normal(size=4000))
    c = autoregression(e, 10)
    assert 2 <= c.size <= 3  # BIC takes one more in about 1 % of cases
    assert_allclose(c[:2], [1.5, -0.8], rtol=0, atol=0.05)  # sqrt((1 - .8^2) / 4000) = 0.01
    assert autoregression(np.random.default_rng(seed).normal(size=4000), 10).size <= 1


@pytest.mark.parametrize("steps", [1, 2, 7])
def test_prediction_of_an_ar1_is_its_decay(steps):
    e = np.random.default_rng(0).normal(size=30)
    expected = np.concatenate([np.zeros(steps), 0.6**steps * e[:-steps]])
    assert_allclose(predict_ahead(e, np.array([0.6]), steps), expected, rtol=0, atol=1e-14)
