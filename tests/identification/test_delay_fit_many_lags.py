"""fit_output_error on simulated plants of more lags than its free structures have poles."""

from __future__ import annotations

import control as ct
import numpy as np
import pytest
from scipy.special import gammainc, log_ndtr, ndtr

import ctrl_realize as cr
from tests import rigs

TS = rigs.TS


def chain_record(lags: int, hz: float, noise: float, *, delay: float = 37.0, seed: int = 0):
    """Step record of equal lags in a row: the incomplete gamma function."""
    k = np.arange(-2000, 2600)
    after = np.clip((k - delay) * TS, 0, None)
    y = 16 * gammainc(lags, 2 * np.pi * hz * after)
    y += noise * 16 * np.random.default_rng(seed).standard_normal(k.size)
    return cr.Record(k * TS, 16.0 * (k >= 0), y)


@pytest.mark.parametrize(("lags", "hz"), [(5, 8.0), (6, 10.0), (8, 12.0)])
def test_the_delay_before_many_equal_lags_is_found_and_covered(lags, hz):
    fit = cr.fit_output_error(chain_record(lags, hz, 0.005)).fit
    low, high = fit.delay_interval
    assert fit.structure == (lags, lags)
    # Free structures of up to five poles are 6, 12 and 13 samples late here.
    assert abs(fit.delay - 37) < 1.5
    assert low <= 37 <= high


def test_lags_that_are_not_spread_evenly_are_covered():
    plant = rigs.lag(3) * rigs.lag(4) * rigs.lag(5) * rigs.lag(7) * rigs.lag(9)
    for noise in (0.001, 0.005):
        fit = cr.fit_output_error(rigs.step_record(plant, noise=noise)).fit
        low, high = fit.delay_interval
        assert fit.structure == (5, 5)
        assert low <= 37 <= high
        assert high - low < 20  # without chains: 32 and 45 samples


def diffusion_record(noise: float, *, delay: float = 37.0, seed: int = 0):
    """Step record of 1 / cosh(sqrt(s T)), its slowest mode at 2.2 Hz: a wall that is heated."""
    k = np.arange(-2000, 2600)
    after = np.clip((k - delay) * TS, 0, None)
    m = np.arange(300)[:, None]
    modes = (
        4 / np.pi * (-1.0) ** m / (2 * m + 1) * np.exp(-2 * np.pi * 2.2 * (2 * m + 1) ** 2 * after)
    )
    y = np.where(after > 0, 16 * (1 - modes.sum(axis=0)), 0.0)
    y += noise * 16 * np.random.default_rng(seed).standard_normal(k.size)
    return cr.Record(k * TS, 16.0 * (k >= 0), y)


@pytest.mark.parametrize(("noise", "width"), [(0.001, 15), (0.005, 30)])
def test_the_dead_time_before_diffusion_is_covered(noise, width):
    for seed in range(3):
        low, high = cr.fit_output_error(diffusion_record(noise, seed=seed)).fit.delay_interval
        # Free structures alone put it in 40 ... 49 samples.
        assert low <= 37 <= high
        assert high - low < width  # half as much again as is seen


def test_more_lags_than_were_tried_are_flagged_and_no_delay_is_promised():
    fit = cr.fit_output_error(chain_record(12, 20.0, 0.005)).fit
    assert "many_lags" in {flag.code for flag in fit.flags}
    assert fit.interval[0] == 0.0
    # 37 samples and twelve lags of 10.2, less the half sample of the hold.
    assert fit.total_delay / TS == pytest.approx(37 + 12 / (2 * np.pi * 20 * TS) - 0.5, abs=1.0)


def test_three_lags_need_no_chain():
    fit = cr.fit_output_error(rigs.step_record(noise=0.005)).fit
    assert fit.structure == (3, 3)
    assert "many_lags" not in {flag.code for flag in fit.flags}


def dispersion_record(
    noise: float, *, mean: float, narrow: float = 1.0, delay: float = 37.0, seed: int = 0
):
    """Step record of a flow that disperses: inverse Gaussian residence times, in s.

    Their shape is `narrow` times their mean.
    """
    k = np.arange(-2000, 2600)
    time = np.maximum((k - delay) * TS, 1e-6)
    root = np.sqrt(narrow * mean / time)
    y = ndtr(root * (time / mean - 1))
    y += np.exp(2 * narrow + log_ndtr(-root * (time / mean + 1)))
    y = np.where(k > delay, y, 0.0) + noise * np.random.default_rng(seed).standard_normal(k.size)
    return cr.Record(k * TS, (k >= 0).astype(float), y)


@pytest.mark.parametrize("seed", range(2))
def test_a_beginning_that_a_zero_imitates_is_left_open(seed):
    # Three tenths go ahead, the rest comes twenty samples later.
    k = np.arange(-1000, 1600)
    ahead, behind = (rigs.exact_step(rigs.R2, (k - late) * TS) for late in (37, 57))
    y = 0.3 * ahead + 0.7 * behind + 0.001 * np.random.default_rng(seed).standard_normal(k.size)
    fit = cr.fit_output_error(cr.Record(k * TS, (k >= 0).astype(float), y)).fit
    low, high = fit.delay_interval
    assert fit.order > fit.relative_degree
    assert "onset_open" in {flag.code for flag in fit.flags}
    assert fit.delay > 39
    assert low <= 37 <= high
    # three times as far before the delay as the first motion is behind it, and a sample after that
    assert fit.delay - low == pytest.approx(3 * (fit.onset / TS - fit.delay))
    assert high >= fit.onset / TS + 1 - 1e-9


@pytest.mark.parametrize("seed", range(3))
def test_a_flow_that_disperses_little_looks_like_a_chain_of_lags_and_is_covered(seed):
    fit = cr.fit_output_error(dispersion_record(0.005, mean=0.2, narrow=15.0, seed=seed)).fit
    low, high = fit.delay_interval
    assert fit.order >= 6
    assert fit.delay > 60
    assert low <= 37 <= high


def test_a_plant_with_a_zero_is_covered_and_one_without_is_not_called_open():
    w = 2 * np.pi * 4.0
    zero = cr.fit_output_error(rigs.step_record(rigs.R3 * ct.tf([1 / w, 1], [1]), noise=0.001)).fit
    assert zero.structure == (3, 2)
    assert "onset_open" in {flag.code for flag in zero.flags}
    assert zero.delay_interval[0] <= 37 <= zero.delay_interval[1]
    assert zero.delay_interval[1] - zero.delay_interval[0] < 25  # onset: five samples after it
    plain = cr.fit_output_error(rigs.step_record(noise=0.001)).fit
    assert "onset_open" not in {flag.code for flag in plain.flags}


def test_structures_that_are_given_are_believed():
    fit = cr.fit_output_error(dispersion_record(0.005, mean=0.08), structures=[(3, 2)]).fit
    assert "onset_open" not in {flag.code for flag in fit.flags}
    assert fit.interval[1] - fit.interval[0] < 5 * TS


def test_a_chain_of_seven_lags_in_noise_may_be_a_flow_that_begins_half_of_its_lags_earlier():
    noisy, quiet = (
        cr.fit_output_error(chain_record(7, 20.0, noise)).fit for noise in (0.01, 0.002)
    )
    for fit, told in ((noisy, True), (quiet, False)):
        lead = 0.5 * np.sum(1 / np.abs(fit.poles)) / fit.dt
        assert ("many_lags" in {flag.code for flag in fit.flags}) == told
        assert (fit.interval[0] / fit.dt <= fit.delay - lead + 1e-6) == told
