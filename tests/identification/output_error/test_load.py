"""A load that moves the output during a step test is told and taken out of the gain (simulated)."""

import numpy as np
import pytest
from scipy.signal import lfilter

import ctrl_realize as cr
from benchmarks.verdicts import cases as verdict_cases
from ctrl_realize.errors import UnsuitableSystemError
from ctrl_realize.numerics.signals.load_step import LoadStep

GAIN, LAGS, DEAD_TIME, DT, SAMPLES, STEP = 1.1, (70.0, 20.0), 24.0, 2.0, 600, 200.0
TIME = DT * np.arange(SAMPLES)
RISE = 118.0
"""Time to 63 % of the response, dead time included."""


def lagged(signal, *constants):
    for constant in constants:
        pole = np.exp(-DT / constant)
        signal = np.append(0.0, lfilter([1 - pole], [1, -pole], signal)[:-1])
    return signal


def record(seed, moved=None, size=0.0, lags=(120.0,), pole=0.0):
    """A step of 6 % at 200 s; a load of `size` times the response at `moved` s, through `lags`."""
    noise = np.random.default_rng(seed).standard_normal(SAMPLES + 100)
    noise = lfilter([np.sqrt(1 - pole**2)], [1, -pole], noise)[100:]
    response = 6 * GAIN * lagged(np.where(TIME - DEAD_TIME < STEP, 0.0, 1.0), *LAGS)
    load = 0.0
    if moved is not None:
        load = 6 * GAIN * size * lagged(np.where(moved > TIME, 0.0, 1.0), *lags)
    u = np.where(TIME < STEP, 40.0, 46.0)
    return cr.Record(TIME, u, 60 + response + load + 0.05 * noise)


def told(fit):
    return [flag for flag in fit.flags if flag.code == "load_disturbance"]


@pytest.mark.parametrize(("size", "lags"), [(0.1, (120.0,)), (-0.8, LAGS)])
def test_a_late_load_is_told_and_taken_out_of_the_gain(size, lags):
    moved = STEP + 3.5 * RISE
    fit = cr.identify(record(11, moved, size, lags)).fit
    assert len(told(fit)) == 1
    load = fit.estimate.load
    assert abs(load.time - moved) < 0.05 * TIME[-1]
    # what it has added to the last output
    added = 6 * GAIN * size * lagged(np.where(moved > TIME, 0.0, 1.0), *lags)[-1]
    assert load.size == pytest.approx(added, rel=0.05)
    low, high = fit.gain_interval
    assert low <= GAIN <= high
    assert fit.gain == pytest.approx(GAIN, rel=0.01)
    assert fit.interval[0] <= DEAD_TIME <= fit.interval[1]


def test_a_late_part_of_the_response_to_one_step_may_be_the_plant_s_own():
    # half of the gain comes by a second path, which is 6 lags longer
    paths = [np.where(TIME - late < STEP, 0.0, 1.0) for late in (DEAD_TIME, DEAD_TIME + 420)]
    noise = 0.05 * np.random.default_rng(3).standard_normal(SAMPLES)
    output = 60 + 3 * GAIN * lagged(sum(paths), *LAGS) + noise
    fit = cr.identify(cr.Record(TIME, np.where(TIME < STEP, 40.0, 46.0), output)).fit
    _, gain, tuning = fit.verdicts
    assert gain.level == "no"
    assert tuning.level == "no"  # Ms of the PI is 14 on this plant
    low, high = fit.gain_interval
    assert low <= GAIN / 2 <= GAIN <= high
    (flag,) = told(fit)
    assert "one step cannot tell" in str(flag)


def test_a_load_that_does_not_follow_another_step_is_no_part_of_the_plant():
    steps = np.where(TIME < STEP, 0.0, 1.0) - np.where(STEP + 500 > TIME, 0.0, 2.0)
    delayed = np.interp(TIME - DEAD_TIME, TIME, steps)
    load = 0.4 * lagged(np.where(STEP + 350 > TIME, 0.0, 1.0), *LAGS)
    noise = 0.05 * np.random.default_rng(4).standard_normal(SAMPLES)
    output = 6 * GAIN * (lagged(delayed, *LAGS) + load) + noise
    fit = cr.identify(cr.Record(TIME, 40 + 6 * steps, output)).fit
    (flag,) = told(fit)
    assert "cut the record" in str(flag)
    low, high = fit.gain_interval
    assert low <= GAIN <= high < 1.05 * GAIN


def test_a_step_of_a_coarse_converter_is_no_load():
    # 1.8 degC, rounded to 0.1: a load of 0.088 took the gain away
    fit = cr.fit_output_error(cr.bench.heater().step_record(2, rng=3)).fit
    assert "load_disturbance" not in [flag.code for flag in fit.flags]
    assert np.isfinite(fit.gain_interval).all()


def test_a_load_whose_response_has_only_begun_at_the_end_is_told():
    # the time to 63 % of its response is longer than what is left: it was a gain of 746000
    fit = cr.identify(record(11, TIME[-1] - 0.5 * RISE, 0.8, LAGS)).fit
    assert len(told(fit)) == 1
    assert fit.gain_interval[0] <= GAIN <= fit.gain_interval[1]
    assert fit.gain == pytest.approx(GAIN, rel=0.01)


@pytest.mark.parametrize(("seed", "size"), [(11, 0.8), (13, -0.8)])
def test_a_load_before_the_response_has_settled_is_told_from_the_plant(seed, size):
    # the model of all samples takes it up: about that alone gains of 1.55 and 0.88 were found
    fit = cr.identify(record(seed, STEP + 1.6 * RISE, size, LAGS)).fit
    assert len(told(fit)) == 1
    assert fit.gain_interval[0] <= GAIN <= fit.gain_interval[1]
    assert fit.gain == pytest.approx(GAIN, rel=0.03)


def test_a_load_soon_after_the_step_leaves_the_gain_open():
    system = cr.identify(record(11, STEP + 1.2 * RISE, 0.3))
    assert len(told(system.fit)) == 1
    assert system.fit.gain_interval == (-np.inf, np.inf)
    with pytest.raises(UnsuitableSystemError, match="sign of the gain"):
        cr.design.pid(system)


def test_a_load_that_many_poles_take_up_is_told_all_the_same_by_those_that_do_not():
    # simulated: the best model of the record without the load has a pole more than the plant
    case = verdict_cases.case("load", 224)
    fit = cr.identify(case.record).fit
    assert told(fit)
    low, high = fit.gain_interval
    assert low <= case.plant.gain <= high
    # without the load -4.35 for -3.45
    assert fit.gain == pytest.approx(case.plant.gain, rel=0.02)


@pytest.mark.parametrize(("seed", "pole"), [(1, 0.0), (3, 0.9)])
def test_noise_alone_is_no_load(seed, pole):
    assert not told(cr.identify(record(seed, pole=pole)).fit)


def test_a_structure_with_too_few_lags_is_no_load():
    assert not told(cr.fit_output_error(record(1), structures="P1D").fit)
    fit = cr.fit_output_error(record(1, STEP + 3.5 * RISE, 0.3), structures="P2D").fit
    assert len(told(fit)) == 1
    assert fit.gain == pytest.approx(GAIN, rel=0.01)


def test_the_flag_names_the_time_on_the_clock_of_the_record():
    moved = record(5, 600.0, 0.3)
    later = cr.Record(1000 + TIME, moved.input, moved.output)
    fit = cr.identify(later, structures="P2D").fit
    (flag,) = told(fit)
    assert abs(fit.estimate.load.time - 600.0) < 0.02 * TIME[-1]
    assert f"from {1000 + fit.estimate.load.time:.4g} s on" in str(flag)


def test_columns_of_a_load_are_the_derivatives_of_its_response():
    poles = np.array([-1.0 + 2.0j, -1.0 - 2.0j])
    residues = np.array([0.5 - 0.3j, 0.5 + 0.3j])
    load, clock, step = LoadStep(3.0, 2.0, poles, residues), np.linspace(0, 20, 400), 1e-6
    response, slope, stretch = load.columns(clock).T

    def moved(time, lag):
        return LoadStep(time, lag, poles, residues).columns(clock)[:, 0]

    later = (moved(3.0 + step, 2.0) - moved(3.0 - step, 2.0)) / (2 * step)
    longer = (moved(3.0, 2.0 + step) - moved(3.0, 2.0 - step)) / (2 * step)
    np.testing.assert_allclose(-slope / 2.0, later, atol=1e-7)
    np.testing.assert_allclose(-stretch / 2.0, longer, atol=1e-7)
    assert not response[clock <= 3.0].any()
