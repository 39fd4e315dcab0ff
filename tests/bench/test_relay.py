"""Relay tests against the limit cycles of theory, and what a fit of their records tells."""

import control as ct
import numpy as np
import pytest
from scipy.signal import cont2discrete

import ctrl_realize as cr
from benchmarks.relay import __main__ as relay
from benchmarks.worlds.loops import relay_cycle
from ctrl_realize import bench, design
from ctrl_realize.errors import OptionError

CLEAN = {"noise": 0, "disturbance": 0, "resolution": None}


def cycles_of(record):
    """Half of the swing, and the period, of the last full cycle."""
    u, y = np.ravel(record.input), np.ravel(record.output)
    up = np.flatnonzero(np.diff(u) > 0)
    last = y[up[-2] : up[-1]]
    return np.ptp(last) / 2, (up[-1] - up[-2]) * record.dt


@pytest.mark.parametrize("sign", [1, -1])
def test_an_integrator_with_dead_time_swings_as_theory_says(sign):
    # slope k d for a dead time L after the output has come back: amplitude k d L, period 4 L
    rate, size, wait = 0.01, 4.0, 12.0
    plant = bench.tank(
        rate=sign * rate, sensor_lag=1e-3, dead_time=wait, dt=0.05, pre_step_time=5.0, **CLEAN
    )
    record = bench.relay_test(plant, size)
    amplitude, period = cycles_of(record)
    assert amplitude == pytest.approx(rate * size * wait, rel=0.01)  # of a sample, 0.4 %
    assert period == pytest.approx(4 * wait, rel=0.01)
    # the describing function is 4 / pi / (pi / 2) = 81 % of the ultimate gain pi / (2 k L)
    gain = 4 * size / (np.pi * amplitude)
    assert gain / abs(design.ultimate(plant.truth.sampled).gain) == pytest.approx(
        8 / np.pi**2, rel=0.02
    )


def test_one_lag_swings_between_its_values_a_dead_time_after_the_switches():
    # from the reversal at +-eps the output still approaches K d for a dead time
    gain, lag, wait, size, width = 2.0, 20.0, 5.0, 3.0, 0.5
    plant = bench.heater(
        gain=gain, lag_time=lag, sensor_lag=1e-3, dead_time=wait, dt=0.02, pre_step_time=2, **CLEAN
    )
    amplitude, period = cycles_of(bench.relay_test(plant, size, hysteresis=width))
    end = gain * size
    peak = end - (end - width) * np.exp(-wait / lag)
    assert amplitude == pytest.approx(peak, rel=5e-3)
    half = wait + lag * np.log((end + peak) / (end - width))
    assert period == pytest.approx(2 * half, rel=5e-3)


def test_a_bias_is_seen_in_the_time_up_and_down_and_the_record_starts_at_rest():
    plant = bench.heater(**CLEAN)
    record = bench.relay_test(plant, 10.0, bias=4.0, cycles=3)
    u = np.ravel(record.input)
    rest = round(plant.pre_step_time / plant.dt)
    assert set(u[:rest]) == {20.0}
    assert set(u[rest:]) == {14.0, 34.0}
    assert np.mean(u[rest:] == 34.0) < 0.4
    assert np.sum(np.diff(u[rest:]) != 0) == 2 * 3
    noisy = bench.relay_test(bench.heater(), rng=3)
    again = bench.relay_test(bench.heater(), rng=3)
    np.testing.assert_array_equal(noisy.output, again.output)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"amplitude": 30.0}, "switch between -10 and 50"),
        ({"hysteresis": 100.0}, "has switched 0 times"),
        ({"amplitude": 5.0, "bias": 6.0}, "less bias"),
    ],
)
def test_relays_that_cannot_work_are_refused(given, words):
    with pytest.raises(OptionError, match=words):
        bench.relay_test(bench.heater(), rng=1, **given)


def test_a_relay_record_gives_the_ultimate_point_closer_than_the_describing_function():
    plant = bench.heater(noise=0.02, disturbance=0.0, resolution=None)
    record = bench.relay_test(plant, 10.0, rng=1, bias=2.0)
    found = design.ultimate(cr.identify(record, structures="SOPDT"))
    truth = design.ultimate(plant.truth.sampled)
    assert found.gain == pytest.approx(truth.gain, rel=0.01)
    assert found.period == pytest.approx(truth.period, rel=0.005)
    assert found.gain_interval[0] <= truth.gain <= found.gain_interval[1]
    amplitude, _ = cycles_of(record)
    described = 4 * 10.0 / (np.pi * np.sqrt(amplitude**2 - 0.06**2))
    assert abs(described / truth.gain - 1) > 0.05


def test_the_interval_of_an_integrating_plant_is_narrow():
    # poles that may be zero once gave models of any slope: 0.03 to 170
    plant = bench.tank(dt=2.0)
    found = design.ultimate(cr.identify(bench.relay_test(plant, rng=1, cycles=3)))
    truth = design.ultimate(plant.truth.sampled).gain
    low, high = found.gain_interval
    assert 0.9 * truth < low <= truth <= high < 1.1 * truth


def test_a_lag_of_hundreds_of_records_is_an_integrator():
    # it was told as a lag of 200 records, with a gain of thousands that was known to a thousandth
    plant = relay.plant("integrating", 0.02, 0.0, 1.0)
    fit = cr.identify(bench.relay_test(plant, relay.AMPLITUDE, 0, hysteresis=0.06, cycles=6)).fit
    assert fit.integrators == 1
    assert [p.name for p in fit.parameters if p.name.startswith("lag")] == ["lag_2"]
    low, high = fit.gain_interval
    assert 0.09 < low <= 0.1 <= high < 0.11


def test_a_dead_time_beside_an_integrator_has_both_of_its_ends():
    # a direction in which nothing changes shortened the steps in all others: 5.886 to 5.976 for 6
    plant = relay.plant("integrating", 0.14, 0.0, 1.0)
    record = bench.relay_test(plant, relay.AMPLITUDE, 3, hysteresis=0.42, bias=3.0, cycles=6)
    fit = cr.identify(record).fit
    low, high = fit.interval
    assert low <= plant.truth.dead_time <= high
    # Cramer-Rao bound of rate, lag, dead time and level in that noise: 0.034 s
    assert high - low > 2 * 1.96 * 0.034


def test_in_a_drift_a_relay_is_fitted_as_a_controller():
    # as an open loop a state-space model of the drift was chosen, and the gain 55 % off
    plant = relay.plant("a quarter of a lag", 0.09, 1.38, 1000.0)
    rng = np.random.default_rng([0, 9])
    sys = cr.identify(bench.relay_test(plant, relay.AMPLITUDE, rng, hysteresis=0.28, cycles=6))
    assert any("as that of a controller does" in choice for choice in sys.fit.choices)
    low, high = sys.fit.interval
    assert low <= plant.truth.dead_time <= high
    assert design.ultimate(sys, reverse=False).gain == pytest.approx(
        design.ultimate(plant.truth.sampled).gain, rel=0.02
    )


def test_models_that_fit_a_symmetric_relay_as_well_have_robust_loops():
    # one lag looks like an integrator: models of two were drawn within its bounds, unstable ones
    fit = cr.identify(relay_cycle(np.random.default_rng(1)).records).fit
    assert fit.verdicts[-1].question == "tuning"
    assert fit.verdicts[-1].number < 2


def test_a_drift_that_a_relay_answers_is_no_part_of_the_plant():
    """Slow states explained it no better than a drift, and gave a period of 2500 s for 28 s."""
    dt, rng = 0.9, np.random.default_rng(0)
    lags = [1.46], np.polymul(np.polymul([7.6, 1], [5.1, 1]), [2.9, 1])
    plant = cr.delayed_ss(ct.tf(*lags), dead_time=3 * dt, dt=dt)
    num, den, _ = cont2discrete(lags, dt)
    u, clean, y, level = *np.zeros((3, 400)), 1.0
    for k in range(400):
        if k >= 40:
            clean[k] = num[0, 1:] @ u[k - 6 : k - 3][::-1] - den[1:] @ clean[k - 3 : k][::-1]
        y[k] = clean[k] + 0.0027 * k + 0.04 * rng.standard_normal()
        level = -1.0 if y[k] > 0.1 else 1.0 if y[k] < -0.1 else level
        u[k] = 10 * level if k >= 40 else 0.0
    found = cr.identify(cr.Record(dt * np.arange(400), u, y))
    assert found.fit.interval[0] <= 3 * dt <= found.fit.interval[1]
    told, true = design.ultimate(found), design.ultimate(plant)
    assert told.gain == pytest.approx(true.gain, rel=0.05)
    assert told.period == pytest.approx(true.period, rel=0.02)
