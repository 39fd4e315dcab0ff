"""fit_output_error on simulated flows that disperse: inverse Gaussian residence times."""

from __future__ import annotations

import control as ct
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.stats import invgauss

import ctrl_realize as cr
from tests import rigs

TS = rigs.TS
DELAY = 37.0


def flow_record(spread: float, noise: float, *, lag: float = 0.0, seed: int = 1) -> cr.Record:
    """Step through a flow of 80 ms and a lag in s, with a noise in parts of the step.

    `spread` is the standard deviation of the residence times over their mean.
    """
    k = np.arange(-1000, 1600)
    fine = np.arange(0, 1600, 0.05)
    step = invgauss(mu=spread**2, scale=0.08 / spread**2).cdf((fine - DELAY) * TS)
    if lag:
        decay = np.exp(-0.05 * TS / lag)
        step = ct.forced_response(ct.tf([1 - decay, 0], [1, -decay], True), None, step).outputs
    y = np.interp(k, fine, step, left=0.0)
    y += noise * np.random.default_rng(seed).standard_normal(k.size)
    return cr.Record(k * TS, (k >= 0).astype(float), 3 + 2 * y)


def codes(fit) -> set[str]:
    return {flag.code for flag in fit.flags}


@pytest.mark.parametrize(
    ("spread", "noise", "near"),
    [(0.45, 0.001, 1.0), (0.7, 0.001, 0.5), (1.0, 0.001, 0.3), (1.0, 0.005, 1.0)],
)
def test_the_dead_time_before_a_flow_is_found(spread, noise, near):
    fit = cr.fit_output_error(flow_record(spread, noise)).fit
    low, high = fit.delay_interval
    # Lags alone put it 20 (narrow) to 6 samples late (wide), in intervals of 15 samples.
    assert abs(fit.delay - DELAY) < near
    assert low <= DELAY <= high
    assert "dispersed_flow" in codes(fit)
    assert "inverse_response" not in codes(fit)


def test_a_lag_behind_the_flow_is_not_taken_for_it():
    fit = cr.fit_output_error(flow_record(0.7, 0.001, lag=0.02)).fit
    low, high = fit.delay_interval
    assert abs(fit.delay - DELAY) < 2
    assert low <= DELAY <= high


def test_the_model_follows_the_flow_down_to_noise():
    record = flow_record(0.7, 0.001)
    model = cr.fit_output_error(record)
    assert model.fit.residual == pytest.approx(0.002, rel=0.05)
    left = model.fit.measured - model.fit.fitted
    # Five lags behind the dead time: what they miss is less than the noise of one sample.
    smooth = np.convolve(left, np.ones(25) / 25, "valid")
    assert np.abs(smooth).max() < 0.002
    response = model.simulate(record.input) + model.fit.fitted[0]
    assert_allclose(response, model.fit.fitted, rtol=0, atol=1e-6)
    assert model.fit.total_delay == pytest.approx(DELAY * TS + 0.08 - TS / 2, abs=TS)


def test_a_flow_as_narrow_as_sixteen_lags_is_covered_and_told():
    fit = cr.fit_output_error(flow_record(0.25, 0.001)).fit
    low, high = fit.delay_interval
    # No five poles follow it: the model is that of lags, forty samples late.
    assert low <= DELAY <= high
    assert "dispersed_flow" in codes(fit)


@pytest.mark.parametrize("plant", [rigs.R2, rigs.R3, rigs.R4])
def test_lags_are_not_read_as_a_flow(plant):
    for seed in range(2):
        fit = cr.fit_output_error(rigs.step_record(plant, noise=0.005, seed=seed)).fit
        assert "dispersed_flow" not in codes(fit)
