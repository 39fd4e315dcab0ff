"""Unit-pulse response from a frequency response."""

import control as ct
import numpy as np
import pytest
from numpy.testing import assert_allclose

import ctrl_realize as cr

DT = 0.01
CORE = ct.ss(ct.tf([1], [0.05, 1]) * ct.tf([1], [0.02, 1]) * ct.tf([1], [0.01, 1]))
PLANT = cr.delayed_ss(CORE, dead_time=0.0735, dt=DT)


def analog(f, tau=0.0735):
    s = 2j * np.pi * f
    return CORE(s) * np.exp(-s * tau)


def test_response_is_that_of_the_plant_behind_a_hold():
    f = np.linspace(0.2, 49, 300)
    g = cr.impulse_from_frf(cr.MeasuredFRF(analog(f), f), DT, 80)
    exact = PLANT.markov(80)
    # The response at Nyquist, 0.3 %, comes back as aliases that the hold does not know.
    assert_allclose(g.markov, exact, atol=6e-3 * exact.max())
    assert g.markov.sum() == pytest.approx(1.0, abs=1e-3)
    assert g.sampling == "step-invariant"
    assert g.flags == ()


def test_samples_of_a_held_input_have_the_hold_in_them():
    f = np.linspace(0.2, 49, 200)
    sampled = cr.MeasuredFRF(PLANT(np.exp(2j * np.pi * f * DT)), f)
    g = cr.impulse_from_frf(sampled, DT, 80, hold="zoh")
    assert_allclose(g.markov, PLANT.markov(80), atol=1e-4 * PLANT.markov(80).max())


def test_errors_are_as_large_as_stated():
    f = np.linspace(0.2, 49, 200)
    exact = PLANT(np.exp(2j * np.pi * f * DT))
    scores = []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        noise = 0.02 * (rng.standard_normal(200) + 1j * rng.standard_normal(200)) / np.sqrt(2)
        frf = cr.MeasuredFRF(exact + noise, f, std=np.full(200, 0.02))
        g = cr.impulse_from_frf(frf, DT, 80, hold="zoh")
        scores.append(np.mean((g.markov[:40] - PLANT.markov(40)) ** 2 / g.std[:40] ** 2))
        assert g.noise_std[0] == pytest.approx(0.02 / np.sqrt(2), rel=0.15)
    # Posterior deviations under a prior that is only roughly the plant's: within a factor.
    assert 0.5 < np.sqrt(np.mean(scores)) < 1.3


def test_band_that_is_too_narrow_is_said():
    def codes(f, length):
        g = cr.impulse_from_frf(cr.MeasuredFRF(analog(f), f), DT, length)
        return [flag.code for flag in g.flags]

    assert codes(np.linspace(0.2, 4, 60), 80) == ["ends_early"]
    assert codes(np.linspace(2, 49, 200), 80) == ["starts_late"]
    assert codes(np.linspace(0.2, 49, 200), 20) == ["unexplained", "cut_off"]
    assert codes(np.linspace(0.2, 49, 200), 12) == ["unexplained"]
