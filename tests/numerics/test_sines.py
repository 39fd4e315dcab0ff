"""Least-squares sines."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from ctrl_realize.numerics.rational.sines import dominant_frequency, fit_sines

N, DT = 300, 0.01
T = DT * np.arange(N)


def sine(omega, phasor, offset=0.0, slope=0.0, time=T):
    return (phasor * np.exp(1j * omega * time)).real + offset + slope * time


@given(
    cycles=st.floats(1.2, 60),
    amplitude=st.floats(0.01, 100),
    phase=st.floats(-3.1, 3.1),
    offset=st.floats(-10, 10),
    slope=st.floats(-10, 10),
)
def test_exact_sine_is_recovered_with_its_frequency(cycles, amplitude, phase, offset, slope):
    omega = 2 * np.pi * cycles / (N * DT)
    y = sine(omega, amplitude * np.exp(1j * phase), offset, slope)
    start = np.array([omega + 0.3 * 2 * np.pi / (N * DT)])  # 0.3 of the width of a line
    fit = fit_sines(T, y[None, None], start, drift=True)
    size = amplitude + abs(offset) + abs(slope) * N * DT
    # Rounding of the data, grown by the conditioning of little more than one period (< 1e3).
    assert_allclose(fit.omega * N * DT, [omega * N * DT], atol=1e-10 * size / amplitude)
    assert_allclose(fit.phasor[0, 0], amplitude * np.exp(1j * phase), atol=1e-10 * size)
    assert_allclose([fit.offset[0, 0], fit.slope[0, 0]], [offset, slope], atol=1e-10 * size)


def test_given_frequency_is_plain_linear_least_squares():
    rng = np.random.default_rng(0)
    y = rng.standard_normal((4, 2, N))
    omega = np.array([5.0, 7.0, 11.0, 13.0])
    fit = fit_sines(T, y, omega, free_frequency=False)
    for b in range(4):
        design = np.stack([np.cos(omega[b] * T), -np.sin(omega[b] * T), np.ones(N)], axis=1)
        expected, squares, _, _ = np.linalg.lstsq(design, y[b].T, rcond=None)
        assert_allclose(fit.phasor[b], expected[0] + 1j * expected[1], atol=1e-13)
        assert_allclose(fit.offset[b], expected[2], atol=1e-13)
        assert_allclose(fit.noise_variance[b], squares / (N - 3), rtol=1e-12)
        covariance = np.linalg.inv(design.T @ design)[:2, :2]
        assert_allclose(
            fit.phasor_covariance[b, 1], fit.noise_variance[b, 1] * covariance, rtol=1e-9
        )


def test_a_drift_that_is_fitted_too_widens_the_phasor_as_in_linear_least_squares():
    omega = 2.5  # little more than a period: sine and drift are alike
    y = sine(omega, 1 + 0.5j, 0.3, -0.2) + 0.1 * np.random.default_rng(3).standard_normal(N)
    fit = fit_sines(T, y[None, None], np.array([omega]), free_frequency=False, drift=True)
    design = np.stack([np.cos(omega * T), -np.sin(omega * T), np.ones(N), T], axis=1)
    expected, squares, _, _ = np.linalg.lstsq(design, y, rcond=None)
    assert_allclose(fit.phasor[0, 0], expected[0] + 1j * expected[1], atol=1e-12)
    assert_allclose([fit.offset[0, 0], fit.slope[0, 0]], expected[2:], atol=1e-12)
    covariance = squares / (N - 4) * np.linalg.inv(design.T @ design)[:2, :2]
    assert_allclose(fit.phasor_covariance[0, 0], covariance, rtol=1e-9)


def test_masked_samples_do_not_count():
    y = sine(20.0, 1 + 1j, 0.5)
    spoilt = y.copy()
    spoilt[:90] += 17.0
    mask = (np.arange(N) >= 90) * 1.0
    fit = fit_sines(T, spoilt[None, None], np.array([20.3]), mask=mask[None])
    assert_allclose(fit.phasor[0, 0], 1 + 1j, atol=1e-10)


def test_start_of_the_time_axis_turns_the_phasor_and_nothing_else():
    y = sine(20.0, 1.0) + 0.1 * np.random.default_rng(1).standard_normal(N)
    here = fit_sines(T, y[None, None], np.array([20.0]))
    later = fit_sines(T + 7.0, y[None, None], np.array([20.0]))
    assert_allclose(later.omega, here.omega, rtol=1e-10)
    assert_allclose(later.phasor, here.phasor * np.exp(-7j * here.omega), rtol=1e-8)
    assert_allclose(later.offset, here.offset, rtol=1e-8)


def test_noisy_estimates_scatter_as_the_stated_standard_deviations_say():
    rng = np.random.default_rng(2)
    runs, omega, sigma = 1500, 17.0, np.array([0.02, 0.4])
    clean = np.stack([sine(omega, 1.0), sine(omega, 0.5j)])
    noisy = clean + sigma[:, None] * rng.standard_normal((runs, 2, N))
    fit = fit_sines(T, noisy, np.full(runs, omega))
    score = (fit.omega - omega) / fit.omega_std
    # Standard deviation of a standard deviation over 1500 runs: 1.8 %; three of them.
    assert score.std() == pytest.approx(1.0, abs=0.055)
    assert abs(score.mean()) < 3 / np.sqrt(runs)
    assert_allclose(np.sqrt(fit.noise_variance.mean(axis=0)), sigma, rtol=0.01)
    # The common frequency must be that of the clean channel: Cramer-Rao bound of both together.
    information = N**3 * DT**2 / 24 * np.sum(np.array([1.0, 0.5]) ** 2 / sigma**2)
    assert fit.omega.std() == pytest.approx(1 / np.sqrt(information), rel=0.06)
    # Phasors at mid-record do not feel the frequency: covariance as for a known frequency.
    turned = fit.phasor[:, 1] * np.exp(1j * fit.omega * T.mean())
    spread = np.sqrt(np.var(turned))
    stated = np.sqrt(np.trace(fit.phasor_covariance[:, 1], axis1=1, axis2=2).mean())
    assert spread == pytest.approx(stated, rel=0.055)


@given(cycles=st.floats(2.5, 100), phase=st.floats(-3, 3), offset=st.floats(-5, 5))
def test_strongest_line_is_close_enough_to_start_from(cycles, phase, offset):
    omega = 2 * np.pi * cycles / (N * DT)
    found = dominant_frequency(sine(omega, np.exp(1j * phase), offset)[None], DT)
    # The fit converges from within half a line width; a fifth leaves room.
    assert abs(found[0] - omega) < 0.2 * 2 * np.pi / (N * DT)
