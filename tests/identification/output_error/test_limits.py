"""An output that clips: the model is that of the plant, and the flag says what was left out."""

import re

import control as ct
import numpy as np
import pytest
from scipy.signal import lfilter

import ctrl_realize as cr
from tests.rigs import codes

DT, GAIN, DEAD_TIME = 0.1, 2.0, 1.2
TIME = DT * np.arange(500)
PLANT = cr.delayed_ss(ct.tf([GAIN], [9, 6, 1]), dead_time=DEAD_TIME, dt=DT)
FEW = [(1, 1), (2, 2), (2, 1)]


def clipped(u, limit, where, seed=0, noise=0.004):
    """Output of the plant for an input, clipped behind or before its noise."""
    clean = np.ravel(PLANT.simulate(u))
    rest = noise * np.random.default_rng(seed).standard_normal(u.size)
    if where == "behind":
        return np.minimum(clean + rest, limit)
    return np.minimum(clean, limit) + rest


def fitted(u, y, **options):
    return cr.fit_output_error(cr.Record(TIME[: u.size], u, y), **options).fit


def holds(fit):
    low, high = fit.gain_interval
    return low <= GAIN <= high and fit.interval[0] <= DEAD_TIME <= fit.interval[1]


@pytest.mark.parametrize(("limit", "sign", "where"), [(1.77, 1, "before"), (1.27, -1, "behind")])
def test_gain_and_dead_time_of_a_step_hold_beyond_a_limit(limit, sign, where):
    u = np.where(TIME < 6, 0.0, 1.0)
    fit = fitted(u, sign * clipped(u, limit, where), structures=FEW)
    low, high = sorted(sign * end for end in fit.gain_interval)
    # as it is recorded the gain is the limit
    assert low <= GAIN <= high
    assert low > 1.05 * limit
    assert fit.interval[0] <= DEAD_TIME <= fit.interval[1]
    assert codes(fit) == {"output_at_limit"}
    told = re.search(r"samples are at (\S+?),? ", str(fit.flags[0]))
    assert float(told[1]) == pytest.approx(sign * limit, abs=0.002)


def test_a_limit_in_noise_that_looks_like_a_load_is_told():
    u = np.where(TIME < 6, 0.0, 1.0)
    fit = fitted(u, clipped(u, 1.8, "before", seed=3, noise=0.03), structures=FEW)
    # it was the limit, 1.805, known to 0.5 %
    assert "output_at_limit" in codes(fit)
    assert "load_disturbance" not in codes(fit)
    assert holds(fit)


def test_an_output_that_reaches_its_limit_by_the_second_of_two_steps():
    u = 0.6 * (TIME >= 6) + 0.4 * (TIME >= 26)
    fit = fitted(u, clipped(u, 1.7, "behind"), structures=FEW)
    assert holds(fit)
    assert codes(fit) == {"output_at_limit"}


@pytest.mark.parametrize("where", ["behind", "before"])
def test_peaks_of_the_response_to_a_binary_input_that_clip(where):
    u = np.repeat(np.random.default_rng(4).choice([-1.0, 1.0], 34), 15)[:500]
    fit = fitted(u, clipped(u, 1.1, where, noise=0.02), structures=[(2, 2)])
    assert holds(fit)
    assert "output_at_limit" in codes(fit)


def test_records_of_which_one_clips_are_fitted_together():
    u = np.where(TIME < 6, 0.0, 1.0)
    outputs = [clipped(u, limit, "behind", seed) for seed, limit in enumerate((1.5, 3.0))]
    records = [cr.Record(TIME, u, y, name=name) for y, name in zip(outputs, "ab", strict=True)]
    fit = cr.fit_output_error(records, structures=[(2, 2)]).fit
    assert fit.gain == pytest.approx(GAIN, rel=0.02)
    told = next(str(flag) for flag in fit.flags if flag.code == "output_at_limit")
    assert told.startswith("record 'a'")


def test_an_output_that_rests_at_its_limit_is_told_and_fitted_as_it_is():
    u = np.where(TIME < 6, 0.0, 1.0)
    rests = np.maximum(clipped(u, 9.0, "behind"), 0.0)
    fit = fitted(u, rests, structures=[(2, 2)])
    told = next(str(flag) for flag in fit.flags if flag.code == "output_at_limit")
    assert "at 0 or" in told
    assert "those of the clipped signal" in told
    assert fit.measured.size == TIME.size


@pytest.mark.parametrize("below", [0.0, 0.2])
def test_a_rest_without_noise_may_have_other_reasons_than_a_limit(below):
    """Padded, or below the range of the sensor: it was a limit for both, and the dead time good."""
    u = np.where(TIME < 6, 0.0, 1.0)
    y = clipped(u, 9.0, "behind") - below
    y = np.where(TIME < 8, 0.0, y) if below == 0 else np.maximum(y, 0.0)
    fit = fitted(u, y, structures=FEW)
    assert "output_at_limit" not in codes(fit)
    assert "stuck_output" in codes(fit)
    assert fit.verdicts[0].level != "good"


def test_a_limit_that_leaves_no_response_is_told():
    u = np.where(TIME < 6, 0.0, 1.0)
    fit = fitted(u, clipped(u, 0.012, "behind"), structures=[(1, 1)])
    told = next(str(flag) for flag in fit.flags if flag.code == "output_at_limit")
    assert "those of the clipped signal" in told


@pytest.mark.parametrize("pole", [0.0, 0.9])
def test_a_response_that_settles_is_not_said_to_clip(pole):
    noise = lfilter([1], [1, -pole], np.random.default_rng(5).standard_normal(500))
    u = np.where(TIME < 6, 0.0, 1.0)
    fit = fitted(u, clipped(u, 9.0, "behind") + 0.02 * noise, structures=FEW)
    assert "output_at_limit" not in codes(fit)
    assert fit.measured.size == TIME.size


def test_a_plateau_that_noise_hides_is_told_and_leaves_the_gain_in_doubt():
    u = np.where(TIME < 6, 0.0, 1.0)
    fit = fitted(u, clipped(u, 1.5, "before", noise=0.04), structures=FEW)
    assert codes(fit) & {"may_be_at_limit", "output_at_limit"}
    assert fit.verdicts[1].level != "good"


@pytest.mark.parametrize(("limit", "seed"), [(1.5, 3), (1.7, 7)])
def test_a_bend_before_a_limit_does_not_hide_it(limit, seed):
    # it was settled, or a load: in the second record the gain was 1.81 to 1.97, and good
    u = np.where(TIME < 6, 0.0, 1.0)
    fit = fitted(u, clipped(u, limit, "before", seed, noise=0.04), structures=FEW)
    assert "output_at_limit" in codes(fit)
    assert "load_disturbance" not in codes(fit)
    low, high = fit.gain_interval
    assert low <= GAIN <= high


def test_the_gain_may_be_larger_where_the_output_may_be_at_a_limit():
    u = np.where(TIME < 6, 0.0, 1.0)
    fit = fitted(u, clipped(u, 1.5, "before", seed=6, noise=0.04), structures=FEW)
    assert "may_be_at_limit" in codes(fit)
    low, high = fit.gain_interval
    assert low <= fit.gain <= 1.5 < GAIN <= high  # it ended at 1.50
    low, high = fit.total_delay_interval
    assert low <= fit.total_delay < DEAD_TIME + 6 <= high


def test_a_response_that_settles_has_no_plateau():
    u = np.where(TIME < 6, 0.0, 1.0)
    for seed in range(3):
        fit = fitted(u, clipped(u, np.inf, "before", seed, noise=0.04), structures=FEW)
        assert not codes(fit) & {"may_be_at_limit", "output_at_limit"}


def test_several_steps_that_a_linear_plant_explains_reach_no_limit():
    # Between two levels the output settles at the same value again and again.
    rng = np.random.default_rng(1)
    u = np.repeat(rng.choice([-1.0, 1.0], 20), 15)
    plant = cr.design.ProcessModel(gain=2.0, lag=12.0, dead_time=4.0).system(1.0)
    y = np.ravel(plant.simulate(u)) + rng.normal(0, 0.03, u.size)
    fit = cr.identify(cr.Record(np.arange(240.0), u[60:], y[60:])).fit
    assert fit.at_noise_level
    assert "may_be_at_limit" not in codes(fit)
    assert fit.gain_interval[0] <= 2.0 <= fit.gain_interval[1]


@pytest.mark.parametrize("seed", [0, 1, 11])
def test_an_output_that_a_controller_holds_is_at_no_limit(seed):
    # A lag of 20 samples behind 12 under a gain of 0.5: it rises as if to twice its level, and is
    # held there.
    size, pole = 800, np.exp(-1 / 20)
    noise = 0.02 * np.random.default_rng(seed).standard_normal(size)
    wanted = np.repeat([0.0, 1.0, -1.0, 1.0], size // 4)
    u, y, state = np.zeros(size), np.zeros(size), 0.0
    for k in range(size):
        y[k] = state + noise[k]
        u[k] = 0.5 * (wanted[k] - y[k])
        state = pole * state + (1 - pole) * u[max(k - 12, 0)]
    fit = cr.fit_output_error(cr.Record(DT * np.arange(size), u, y), structures=FEW).fit
    assert fit.interval[0] <= 12 * DT <= fit.interval[1]
    assert codes(fit) <= {"feedback"}
