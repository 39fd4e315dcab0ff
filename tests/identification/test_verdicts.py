"""Verdicts on dead time, gain and tuning: right where the truth is known, and said everywhere."""

import control as ct
import numpy as np
import pytest

import ctrl_realize as cr
from benchmarks.verdicts.cases import case
from tests import rigs


def levels(fit):
    return {verdict.question: verdict.level for verdict in fit.verdicts}


@pytest.fixture(scope="module")
def well():
    record = rigs.step_record(rigs.R1, before=300, after=900, dt=0.02, delay=20, noise=0.01, seed=1)
    return cr.fit_output_error(record)


def test_a_record_that_tells_all_is_good_in_all(well):
    assert set(levels(well.fit).values()) == {"good"}


def test_the_numbers_of_verdicts_are_those_of_the_fit(well):
    dead_time, gain, tuning = well.fit.verdicts
    low, high = well.fit.interval
    assert dead_time.number == pytest.approx(high - low)
    low, high = np.array(well.fit.gain_interval) / well.fit.gain
    assert gain.number == pytest.approx(max(1 - low, high - 1))
    assert 1 < tuning.number <= 2


def test_the_card_says_the_verdicts(well):
    for verdict in well.fit.verdicts:
        assert f"{verdict.level}: {verdict.sentence}" in well.fit.report()


def test_a_record_that_ends_in_the_rise_does_not_tell_the_gain():
    # 40 % of the response of a lag of 0.8 s
    rng = np.random.default_rng(4)
    t = 0.02 * np.arange(345)
    y = np.where(t < 6.4, 0.0, -np.expm1(-(t - 6.4) / 0.8)) + 0.02 * rng.standard_normal(t.size)
    fit = cr.fit_output_error(cr.Record(t, (t >= 6.0) * 1.0, y)).fit
    assert levels(fit)["gain"] != "good"


def test_an_open_gain_leaves_a_dead_time_good_that_is_narrow():
    # the record ends 1.4 lags after the dead time, whose own evidence is the start of the response
    t = np.arange(123.0)
    plant = cr.delayed_ss(ct.tf([2], np.polymul([20, 1], [8, 1])), dead_time=35.3, dt=1.0)
    u = 1.0 * (t >= 60)
    y = plant.simulate(u) + 0.02 * np.random.default_rng(1).standard_normal(t.size)
    fit = cr.fit_output_error(cr.Record(t, u, y)).fit
    assert "gain_not_resolved" in {flag.code for flag in fit.flags}
    assert (levels(fit)["dead time"], levels(fit)["gain"]) == ("good", "no")
    assert fit.interval[0] <= 35.3 <= fit.interval[1]


def test_what_two_lags_leave_open_is_no_matter_for_a_controller():
    # the dead time may be lag: each is open, and every split has a robust loop
    record = rigs.step_record(rigs.R2, before=300, after=900, dt=0.02, delay=5, noise=0.03, seed=2)
    fit = cr.fit_output_error(record).fit
    assert levels(fit)["dead time"] == "with care"
    assert levels(fit)["tuning"] == "good"


def test_models_that_fit_a_record_with_a_load_as_well_have_gains_near_that_of_the_plant():
    # a structure of which the data leave the slowest pole open fits as well: with a pole far slower
    # than the record its gain would be any number of either sign
    one = case("load", 222)
    fit = cr.fit_output_error(one.record).fit
    # a late path that takes 78 % of the response back is another plant for a controller
    assert levels(fit)["tuning"] == "no"
    gains = np.array([np.real(ct.dcgain(sys)) for sys in fit.plausible_models.systems])
    # their standard deviation is 1.5 %; about a pole at its bound two were 2364 and 2634. Every
    # second one has the load as a late path of the plant
    assert gains[1::2] == pytest.approx(one.plant.gain, rel=0.1)
    late = gains[::2] - fit.estimate.load.own_gain
    assert late == pytest.approx(one.plant.gain, rel=0.1)


def test_flags_that_do_not_go_with_wrong_answers_are_notes():
    rng = np.random.default_rng(4)
    t = 0.02 * np.arange(900)
    y = np.where(t < 6.4, 0.0, -np.expm1(-(t - 6.4) / 0.8)) + 0.004 * rng.standard_normal(t.size)
    y[[120, 500, 730]] += 0.4
    fit = cr.fit_output_error(cr.Record(t, (t >= 6.0) * 1.0, y)).fit
    assert "outliers" in {flag.code for flag in fit.flags}
    assert "  - note: " in fit.report()
    assert "  ! " not in fit.report()


def test_models_that_fit_as_well_decide_on_tuning():
    # the PI is robust on the model itself, and not on one of the models in twenty
    fit = cr.fit_output_error(case("rising at its end", 122).record).fit
    tuning = fit.verdicts[2]
    assert tuning.level != "good"
    assert tuning.number > 2
    assert "Ms 1." in tuning.sentence


def test_a_sine_in_the_noise_is_no_pair_that_a_controller_has_to_fear():
    # a pair that follows it left an Ms of 3 and more open
    plant = cr.design.ProcessModel(2, 20, 6).system(1)
    system = cr.identify(one_step(plant, 20, 5))
    assert levels(system.fit)["tuning"] == "good"
    assert cr.design.margins(plant, cr.design.pid(system)).ms < 2


def test_a_sine_in_the_noise_is_no_pair_of_the_plant():
    # at 1.1 rad/s, with a damping of 0.018
    plant = cr.design.ProcessModel(10, 60, 3.3).system(2)
    assert cr.identify(one_step(plant, 60, 7)).fit.structure == (1, 1)


def one_step(plant, lag, seed):
    """Record of six lags after the step, with noise of 1.25 % of the response."""
    u = 4.0 * (np.arange(40 + int(6 * lag / plant.dt)) >= 40)
    noise = 0.05 * float(plant.dcgain()) * np.random.default_rng(seed).standard_normal(u.size)
    return cr.Record(plant.dt * np.arange(u.size), u, plant.simulate(u) + noise)


def test_the_band_of_an_integrating_plant_has_axes_of_its_record():
    rng = np.random.default_rng(2)
    t = 0.1 * np.arange(600)
    y = 0.3 * np.clip(t - 21.0, 0, None) + 0.02 * rng.standard_normal(t.size)
    fit = cr.fit_output_error(cr.Record(t, (t >= 20.0) * 1.0, y)).fit
    axes = fit.plausible_models.plot().figure.axes
    assert axes[0].get_xlim()[1] < 1e3
    assert axes[1].get_xlim()[0] > 1e-4


def test_an_unstable_plant_is_not_judged_by_a_controller_that_does_nothing():
    # 2 exp(-6.3 s) / (1 - 100 s) is fitted with four poles far slower than the record: the loop of
    # SIMC's PI crosses over below the frequencies that are looked at, where its Ms is 1
    rng = np.random.default_rng(11)
    t = np.arange(200.0)
    y = 2 - 2 * np.exp(np.maximum(t - 16.3, 0) / 100) + 0.02 * rng.standard_normal(t.size)
    fit = cr.fit_output_error(cr.Record(t, (t >= 10) * 1.0, y)).fit
    assert levels(fit)["tuning"] == levels(fit)["gain"] == "no"
