"""Chains of nearly equal lags, and dispersing flows."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import quad
from scipy.special import gammainc
from scipy.stats import invgauss

from ctrl_realize.numerics.engine.descend import fit_batch
from ctrl_realize.numerics.engine.modal import parameters_from_poles
from ctrl_realize.numerics.engine.problem import KnownFactor, Structure
from ctrl_realize.numerics.engine.structures import Candidate, parameter_bounds
from ctrl_realize.numerics.engine.window_fit import window_of_rows, with_known_noise
from ctrl_realize.numerics.families.equal_lags import fit_diffusion
from ctrl_realize.numerics.families.flow import flow_modes
from ctrl_realize.numerics.output_error.step_data import step_data, step_scales, window

SIGMA = 1e-3


@pytest.fixture(scope="module")
def problem():
    """Six equal lags of 12 samples behind a dead time of 20, and a third-order fit of them."""
    k = np.arange(-300, 600, dtype=float)
    y = gammainc(6, np.clip(k - 20, 0, None) / 12)
    y += SIGMA * np.random.default_rng(3).standard_normal(k.size)
    data = step_data(y, (k >= 0).astype(float), 1.0, [(300, 1)])
    scales = step_scales(data, k.size, None)
    problem = window(data, k.size, KnownFactor()).problem
    structure = Structure(3, 3)
    start = np.append(40.0, parameters_from_poles(-np.array([0.04, 0.05, 0.06], complex)))
    bounds = parameter_bounds(Structure(3, 3), scales)
    parameters, cost = fit_batch(problem, structure, start[None], bounds)
    return problem, Candidate(structure, parameters[0], float(cost[0])), scales


@pytest.mark.parametrize("shift", [0.0, 0.5])
def test_the_modes_of_diffusion_are_found_and_the_hidden_ones_counted(shift):
    """Forty modes with rates (k - c)^2 behind a dead time of 20."""
    k = np.arange(-300, 900, dtype=float)
    after = np.clip(k - 20, 0, None)
    numbers = (np.arange(1, 41) - shift) / (1 - shift)
    rates = 0.01 * numbers**2
    others = [np.delete(rates, i) for i in range(rates.size)]
    weights = np.array([np.prod(o / (o - r)) for o, r in zip(others, rates, strict=True)])
    y = np.where(after > 0, 1 - weights @ np.exp(-np.outer(rates, after)), 0.0)
    y += 1e-4 * np.random.default_rng(2).standard_normal(k.size)
    data = step_data(y, (k >= 0).astype(float), 1.0, [(300, 1)])
    scales = step_scales(data, k.size, None)
    problem = window(data, k.size, KnownFactor()).problem
    start = np.append(25.0, parameters_from_poles(-np.array([0.01, 0.06], complex)))
    bounds = parameter_bounds(Structure(2, 2), scales)
    parameters, cost = fit_batch(problem, Structure(2, 2), start[None], bounds)
    like = Candidate(Structure(2, 2), parameters[0], float(cost[0]))
    fits = with_known_noise(window_of_rows(problem), {like.structure: like}, scales, 1e-4)
    (chain,) = fit_diffusion(fits)
    beyond = float(np.sum(1 / rates[8:]))
    # Modes beyond the eighth are a dead time but for their spread; 0.05 samples are seen.
    assert abs(chain.candidate.dead_time - beyond - 20) < 0.2
    # What comes after the forty modes of this plant: 1 / (k - c)^2 sums to 1 / (40.5 - c).
    endless = beyond + (1 - shift) ** 2 / (40.5 - shift) / 0.01
    assert chain.truncated == pytest.approx(endless, rel=0.05)


def residence(mean: float, spread: float):
    """Inverse Gaussian distribution of a mean and a coefficient of variation."""
    return invgauss(mu=spread**2, scale=mean / spread**2)


@pytest.mark.parametrize("spread", [0.1, 0.45, 3.0])
@pytest.mark.parametrize("pole", [0.0, -3.0, -300.0, -5000.0, -20 + 40j])
def test_a_mode_behind_a_flow_is_its_convolution_with_the_residence_times(pole, spread):
    flow, times = residence(0.08, spread), np.array([0.02, 0.08, 0.3])
    modes = flow_modes(times, 0.08, spread, np.array([pole])).values[:, 0]
    if not pole:  # what has passed
        assert_allclose(modes, flow.cdf(times), rtol=1e-9, atol=1e-14)
        return
    for time, mode in zip(times, modes, strict=True):

        def part(take, time=time):
            recent = [max(time - 8 / abs(pole), 1e-9)]
            wave = quad(
                lambda s: take(np.exp(pole * (time - s))) * flow.pdf(s),
                0, time, points=recent, limit=400,
            )  # fmt: skip
            return wave[0]

        expected = part(np.real) + 1j * part(np.imag)
        assert_allclose(mode, expected, rtol=1e-6, atol=1e-8)  # of the quadrature


@pytest.mark.parametrize("pole", [0.0, -3.0, -300.0, -20 + 40j])
@pytest.mark.parametrize("spread", [0.2, 0.9])
def test_derivatives_of_a_mode_behind_a_flow_are_limits_of_differences(pole, spread):
    time, step = np.geomspace(0.004, 0.8, 20), 1e-5

    def moved(by_time=0.0, by_mean=0.0, by_spread=0.0, by_pole=0.0):
        settings = 0.08 * np.exp(by_mean), spread * np.exp(by_spread), np.array([pole + by_pole])
        return flow_modes(time + by_time, *settings).values

    found = flow_modes(time, 0.08, spread, np.array([pole]))
    for name, size in (("time", 1e-6), ("mean", step), ("spread", step), ("pole", 1e-3)):
        slope = (moved(**{f"by_{name}": size}) - moved(**{f"by_{name}": -size})) / (2 * size)
        close = 1e-6 * np.abs(slope).max()  # third derivatives and rounding of the differences
        assert_allclose(getattr(found, f"by_{name}"), slope, rtol=0, atol=close)
