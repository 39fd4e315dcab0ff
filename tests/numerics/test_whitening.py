"""Noise that is coloured, made white in means over bins."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import toeplitz
from scipy.signal import lfilter

from ctrl_realize.numerics.signals.bins import response_bins
from ctrl_realize.numerics.signals.noise_model import noise_covariance, whitener

RADIUS, ANGLE = 0.95, 2 * np.pi / 20
RINGING = np.array([1.0, -2 * RADIUS * np.cos(ANGLE), RADIUS**2])


def ringing(size, seed=0):
    white = np.random.default_rng(seed).standard_normal(size + 500)
    return lfilter([1.0], RINGING, white)[500:]


def exact_covariance(lags):
    """Autocovariance of the ringing noise over its variance, by Yule and Walker."""
    rho = [1.0, -RINGING[1] / (1 + RINGING[2])]
    while len(rho) < lags:
        rho.append(-RINGING[1] * rho[-1] - RINGING[2] * rho[-2])
    return np.array(rho[:lags])


def test_the_covariance_of_ringing_noise_is_found():
    found = noise_covariance(ringing(40_000), 40_000)
    # 1/sqrt(40 000) times the square root of what a sample counts for, with room: 0.02
    assert found[:100] == pytest.approx(exact_covariance(100), abs=0.02)
    # it goes on until it has died away, and no longer
    assert abs(found[-1]) < 1e-4
    assert found.size < 1000


def test_means_over_bins_become_white_exactly():
    covariance = exact_covariance(500)
    bins = response_bins(1600, [600], 640)
    means = np.zeros((bins.first.size, 1600))
    for row, first, width in zip(means, bins.first, bins.width, strict=True):
        row[first : first + width] = 1 / width
    whole = np.zeros(1600)
    whole[:500] = covariance
    among = means @ toeplitz(whole) @ means.T
    white = whitener(bins, covariance)
    # the ridge is 1e-9 of the variance of a sample, the smallest eigenvalue of `among` 2e-4
    assert white @ among @ white.T == pytest.approx(np.eye(len(among)), abs=1e-4)
    assert np.all(np.triu(white, 1) == 0)


def test_a_million_samples_need_no_covariance_of_a_million():
    bins = response_bins(1_000_000, [1000], 1100)
    covariance = exact_covariance(500)
    white = whitener(bins, covariance)
    # A wide bin is as good as alone: its mean has the variance of the noise at frequency 0.
    growth = 2 * covariance.sum() - 1
    width = float(bins.width[-1])
    assert width > 10_000
    assert white[-1, -1] ** -2 == pytest.approx(growth / width, rel=0.01)
