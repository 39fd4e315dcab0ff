"""Responses of a dispersing flow, and its fit."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import quad
from scipy.stats import invgauss

from ctrl_realize.numerics.separable.dispersion import fit_flows, flow_modes, flow_profile
from ctrl_realize.numerics.separable.profile_ends import profile_limits
from ctrl_realize.numerics.separable.responses import MoveTrain
from ctrl_realize.numerics.separable.structures import Candidate, Scales, search
from ctrl_realize.numerics.separable.varpro import KnownFactor, Problem, Structure


def residence(mean: float, spread: float):
    """Inverse Gaussian distribution of a mean and a coefficient of variation."""
    return invgauss(mu=spread**2, scale=mean / spread**2)


@pytest.mark.parametrize("spread", [0.1, 0.45, 1.0, 3.0])
def test_what_has_passed_is_the_distribution_of_the_residence_times(spread):
    time = 0.08 * np.geomspace(1e-3, 50, 40)
    passed, _ = flow_modes(time, 0.08, spread, np.empty(0, dtype=complex))
    assert_allclose(passed, residence(0.08, spread).cdf(time), rtol=1e-9, atol=1e-14)


@pytest.mark.parametrize("pole", [-3.0, -300.0, -5000.0, -20 + 40j])
@pytest.mark.parametrize("time", [0.02, 0.08, 0.3])
def test_a_mode_behind_a_flow_is_its_convolution_with_the_residence_times(pole, time):
    flow = residence(0.08, 0.45)
    _, modes = flow_modes(np.array([time]), 0.08, 0.45, np.array([pole]))
    recent = [max(time - 8 / abs(pole), 1e-9)]

    def part(take):
        return quad(
            lambda s: take(np.exp(pole * (time - s))) * flow.pdf(s),
            0,
            time,
            points=recent,
            limit=400,
        )[0]

    assert_allclose(
        modes[0, 0], part(np.real) + 1j * part(np.imag), rtol=1e-6, atol=1e-8
    )  # of the quadrature


def flow_problem(
    *, known: KnownFactor | None = None, lag: float = 0.0, noise: float = 1e-3
) -> tuple[Problem, Scales, Candidate]:
    """Two moves through a flow of 80 ms behind 37.3 ms, and what two lags make of the record."""
    dt = 1e-3
    time = dt * np.arange(1200.0)
    flow, size = residence(0.08, 0.6), np.array([1.0, -0.4])
    fine = np.arange(0.0, 1.6, 1e-4)
    step = flow.cdf(fine)
    if lag:
        kernel = np.exp(-fine / lag) * 1e-4 / lag
        step = np.convolve(step, kernel)[: fine.size] - 0.5 * (step * kernel[0])
    y = sum(
        s * np.interp(time - at - 0.0373, fine, step, left=0.0)
        for s, at in zip(size, (0.1, 0.6), strict=True)
    )
    y = 5 + 2 * y + noise * np.random.default_rng(3).standard_normal(y.size)
    train = MoveTrain(time, np.ones(time.size, dtype=np.int64), dt, np.array([0.1, 0.6]), size)
    factor = known or KnownFactor()
    problem = Problem(y, np.ones(y.size), train, np.ones((y.size, 1)), factor)
    scales = Scales(onset=0.05, rise=0.1, length=1.1, dt=dt, latest=0.08)
    lags = Structure(2, 2)
    return problem, scales, search(problem, [lags], scales)[lags]


def test_a_flow_is_found_behind_its_dead_time():
    problem, scales, like = flow_problem()
    flow = min(fit_flows(problem, like, scales, 1e-6, 7.0, np.inf), key=lambda f: f.criterion)
    assert flow.lag == 0.0
    # Means over residence times of 48 ms at a noise of 0.05 %: a tenth of a millisecond.
    assert_allclose([flow.delay, flow.mean, flow.spread], [0.0373, 0.08, 0.6], rtol=0, atol=1.5e-3)
    assert flow.peclet == pytest.approx(2 / 0.36, rel=0.02)
    low, high = profile_limits(*flow_profile(problem, flow, scales, 1e-6))
    assert low < 0.0373 < high
    assert high - low < 2e-3


def test_a_lag_behind_a_flow_is_told_from_it():
    problem, scales, like = flow_problem(lag=0.03)
    flow = min(fit_flows(problem, like, scales, 1e-6, 7.0, np.inf), key=lambda f: f.criterion)
    assert_allclose([flow.delay, flow.mean, flow.lag], [0.0373, 0.08, 0.03], rtol=0, atol=3e-3)
