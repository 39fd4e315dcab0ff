"""Spectral sums, hold and phase."""

from __future__ import annotations

import control as ct
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import signal

from ctrl_realize.numerics.rational.spectra import (
    hold_response,
    independent_segments,
    period_statistics,
    segment_sums,
    unwrapped_phase,
)


def test_hold_lags_by_half_a_sample_1_83_degrees_at_13_hz():
    hold = hold_response(2 * np.pi * np.array([2.0, 13.0]), 7.8125e-4)
    assert_allclose(-np.degrees(np.angle(hold)), [0.28125, 1.828125], rtol=1e-12)


def test_hold_is_what_sampling_an_integrator_adds():
    # Sampled integrator dt/(z-1) against 1/s: ratio exactly hold x (aliases of 1/s, summed).
    dt, omega = 0.1, np.array([0.5, 3.0])
    sampled = ct.sample_system(ct.tf([1], [1, 0]), dt, "zoh")
    ratio = sampled(np.exp(1j * omega * dt)) * 1j * omega
    # Aliases turn sinc into x cot(x) with the same half-sample phase.
    half = omega * dt / 2
    assert_allclose(np.angle(ratio), np.angle(hold_response(omega, dt)), atol=1e-12)
    assert_allclose(np.abs(ratio), half / np.sin(half), rtol=1e-12)


def test_phase_is_right_on_a_grid_far_too_coarse_for_plain_unwrapping():
    omega = 2 * np.pi * np.geomspace(0.1, 50, 12)
    delay = 300 * 7.8125e-4
    response = np.exp(-1j * omega * delay) / (1 + 1j * omega / 14)
    expected = -omega * delay - np.arctan(omega / 14)
    assert_allclose(unwrapped_phase(response, omega, delay), expected, atol=1e-9)
    assert np.abs(np.unwrap(np.angle(response)) - expected).max() > 6  # plain unwrapping is lost


def test_segment_sums_are_those_of_scipys_csd():
    rng = np.random.default_rng(0)
    u, y = rng.standard_normal((2, 1000))
    window = signal.get_window("hann", 128)
    sums = segment_sums(u[None], y[None], window, 64)
    _, expected = signal.csd(u, y, window=window, noverlap=64, detrend="constant")
    scale = 2 / (window @ window) / sums.count  # one-sided density, fs = 1
    assert_allclose(sums.yu[0, 0, 1:-1] * scale, expected[1:-1], rtol=1e-12)
    assert sums.count == (1000 - 128) // 64 + 1


def test_half_overlapped_hann_segments_count_for_19_18_of_their_number():
    # Welch's figure: correlation of neighbours (1/6)^2, so K / (1 + 2/36) for many segments.
    window = signal.get_window("hann", 256)
    assert independent_segments(window, 128, 10_000) / 10_000 == pytest.approx(18 / 19, abs=1e-3)


def test_periods_of_a_pure_tone_have_no_scatter_and_no_leakage():
    t = np.arange(4 * 50)
    u = np.cos(2 * np.pi * 7 * t / 50).reshape(4, 50)
    stats = period_statistics(u, 3 * u)
    assert_allclose(stats.mean_u[7], 25.0, rtol=1e-12)
    assert_allclose(np.delete(stats.mean_u, 7), 0, atol=1e-12)
    assert_allclose(stats.var_y, 0, atol=1e-20)


def test_period_covariances_are_numpys():
    rng = np.random.default_rng(2)
    u, y = rng.standard_normal((2, 6, 16))
    stats = period_statistics(u, y)
    U, Y = np.fft.rfft(u)[:, 3], np.fft.rfft(y)[:, 3]
    expected = np.cov(Y, U)
    assert_allclose(stats.cov_yu[3], expected[0, 1], rtol=1e-12)
    assert_allclose([stats.var_y[3], stats.var_u[3]], np.diag(expected).real, rtol=1e-12)
