from __future__ import annotations

import control as ct
import numpy as np
import pytest
from scipy.signal import lfilter

import ctrl_realize as cr

DT = 0.1
TWO_MODES = ct.tf([25.0], [1, 0.8, 25.0]) + ct.tf([60.0], [1, 0.6, 144.0])
LAG = ct.tf([2.0], [0.8, 1])


def record(plant, delay, seed=0, samples=600, colour=0.0, **kwargs):
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.choice([-1.0, 1.0], samples // 3), 3)
    y = cr.delayed_ss(plant, dead_time=delay * DT, dt=DT).simulate(u)
    noise = lfilter([np.sqrt(1 - colour**2)], [1, -colour], rng.standard_normal(samples))
    return cr.Record(DT * np.arange(samples), u, y + 0.1 * y.std() * noise, **kwargs)


@pytest.fixture(scope="module")
def chosen():
    return cr.identify(record(TWO_MODES, 3.0, name="arm", input_labels=["torque"]))


def codes(system):
    return {flag.code for flag in system.fit.flags}


def test_modes_take_the_place_of_lags_that_leave_structure(chosen):
    fit = chosen.fit
    assert isinstance(fit, cr.identification.StateSpaceFit)
    assert (fit.order, chosen.input_labels) == (4, ["torque"])
    another = record(TWO_MODES, 3.0, seed=1)
    # noise of a tenth of the output leaves 90 %, to 3 standard deviations of 1/sqrt(2 N)
    assert abs(cr.validation.analyse_residuals(chosen, another).fit_percent[0] - 90) < 1.5
    assert (
        cr.validation.analyse_residuals(cr.fit_output_error(another), another).fit_percent[0] < 60
    )
    assert "input_in_residual" not in codes(chosen)


def test_modes_have_a_delay_with_its_interval(chosen):
    fit = chosen.fit
    assert (fit.delay, fit.dead_time) == (chosen.delay, chosen.delay * DT)
    low, high = fit.delay_interval
    assert low <= 3.0 + 1e-9 < high  # the plant's dead time is where the interval begins
    assert high - low < 3
    # static delay of both modes: damping terms over squared frequencies, weighted with the gains
    total = 3 * DT + (0.8 / 25 + 60 / 144 * 0.6 / 144) / (1 + 60 / 144)
    assert abs(fit.total_delay - total) < 0.3 * DT


@pytest.mark.parametrize(("delay", "colour"), [(0.0, 0.0), (25.4, 0.9)])
def test_the_interval_of_modes_holds_a_dead_time(delay, colour):
    found = cr.identify(record(TWO_MODES, delay, seed=2, colour=colour))
    assert isinstance(found.fit, cr.identification.StateSpaceFit)
    low, high = found.fit.delay_interval
    assert low <= delay <= high < low + 8
    assert ("no_delay_resolved" in codes(found)) == (delay == 0)


@pytest.mark.parametrize("colour", [0.0, 0.9])
def test_lags_that_leave_only_noise_stay_as_they_are(colour):
    data = record(LAG, 12.4, seed=3, colour=colour)
    found, plain = cr.identify(data), cr.fit_output_error(data)
    assert isinstance(found.fit, cr.identification.OutputErrorFit)
    assert found.fit.report() == plain.fit.report()
    assert np.array_equal(found.A, plain.A)
    assert np.array_equal(found.B, plain.B)


def test_a_structure_that_was_asked_for_is_only_judged():
    data = record(TWO_MODES, 3.0)
    found = cr.identify(data, structures=[(2, 2)])
    assert isinstance(found.fit, cr.identification.OutputErrorFit)
    (flag,) = (f for f in found.fit.flags if f.code == "input_in_residual")
    assert "fit_state_space" in str(flag)


def test_modes_do_not_pass_a_largest_delay():
    found = cr.identify(record(TWO_MODES, 9.0), max_delay=5)
    assert isinstance(found.fit, cr.identification.OutputErrorFit)
    (flag,) = (f for f in found.fit.flags if f.code == "input_in_residual")
    assert "after max_delay" in str(flag)


def test_lags_that_leave_little_more_widen_the_interval():
    rng = np.random.default_rng(6)
    u = np.repeat(rng.choice([-1.0, 1.0], 200), 3)
    ringing = LAG + 0.2 * ct.tf([144.0], [1, 0.6, 144.0])
    y = cr.delayed_ss(ringing, dead_time=0.55, dt=DT).simulate(u)
    found = cr.identify(cr.Record(DT * np.arange(600), u, y + 0.2 * rng.standard_normal(600)))
    fit = found.fit
    assert isinstance(fit, cr.identification.StateSpaceFit)
    assert fit.lags.residual < 2 * fit.noise_std[0]
    assert fit.interval[0] <= min(fit.dead_time, fit.lags.interval[0])
    assert fit.interval[1] >= max(fit.dead_time, fit.lags.interval[1])


def test_several_records_of_modes_go_together():
    found = cr.identify([record(TWO_MODES, 3.0, seed, samples=300) for seed in (4, 5)])
    assert isinstance(found.fit, cr.identification.StateSpaceFit)
    assert len(found.fit.checks) == 2
    assert found.fit.order == 4
    assert found.fit.delay_interval[0] <= 3 + 1e-9 < found.fit.delay_interval[1]
