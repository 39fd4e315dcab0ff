"""fit_output_error: right on simulated plants, honest where the model is wrong."""

import control as ct
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.signal import lfilter

import ctrl_realize as cr
from ctrl_realize import report
from ctrl_realize.identification.output_error.arguments import known_factor
from tests import rigs
from tests.rigs import codes, covers, lag

TS = rigs.TS
THREE = {"structures": [(3, 3)]}


def changed(record: cr.Record, output) -> cr.Record:
    return cr.Record(record.time, record.input, output)


def test_the_delay_of_a_simulated_valve_is_found_to_a_fraction_of_a_sample(quiet_valve):
    fit = quiet_valve.fit
    assert fit.structure == (3, 3)
    assert abs(fit.delay - 36.4) < 4 * 0.092  # four times the Cramer-Rao bound at 0.1 %
    assert fit.std_given_structure / TS == pytest.approx(0.092, rel=0.15)
    assert covers(fit, 36.4)
    assert fit.at_noise_level
    assert not fit.delay_estimates
    # Delay and lags together: 165.2 samples for 37, less 0.6; known to 0.02.
    assert abs(fit.total_delay / TS - 164.6) < 0.1
    assert fit.onset > fit.dead_time


def test_an_unknown_sensor_widens_the_interval_and_a_known_one_narrows_it():
    sensor = rigs.lag(30.0)
    record = rigs.step_record(rigs.R4, noise=0.005, before=600, after=1500)
    blind = cr.fit_output_error(record).fit
    assert covers(blind, 37)  # the order chosen is 3, which alone would be off by 5.4
    told = cr.fit_output_error(record, known=sensor, **THREE).fit
    assert abs(told.delay - 37) < 3 * told.std_given_structure / TS
    assert told.std_given_structure < 1.2 * 0.48 * TS  # the Cramer-Rao bound is 0.48 samples
    assert_allclose(np.sort(told.poles.real), np.sort(rigs.R3.poles().real), rtol=0.1)


def test_known_dynamics_stay_out_of_the_model_unless_asked_for():
    sensor = rigs.lag(30.0)
    record = rigs.step_record(rigs.R4, noise=0.001, before=400, after=1200)
    without = cr.fit_output_error(record, known=sensor, structures=[(3, 3)])
    within = cr.fit_output_error(record, known=sensor, structures=[(3, 3)], include_known=True)
    assert (without.delay_free.nstates, within.delay_free.nstates) == (3, 4)
    s = 2j * np.pi * 5.0
    ratio = within(np.exp(s * TS)) / without(np.exp(s * TS))
    assert_allclose(ratio, sensor(s), atol=2e-3)  # the hold acts once, not twice: (5/1280)^2
    with pytest.raises(cr.errors.OptionError, match="include_known=True without known"):
        cr.fit_output_error(record, include_known=True)


def test_hum_and_drift_before_the_step_are_fitted_along():
    record = rigs.step_record(noise=0.001)
    hum = 0.005 * 16 * np.sin(2 * np.pi * 50 * record.time + 1)
    fit = cr.fit_output_error(changed(record, record.output + hum), **THREE).fit
    assert abs(fit.delay - 37) < 0.5
    assert "hum" in codes(fit)
    slope = changed(record, record.output + 0.02 * 16 * record.time)
    drifting = cr.fit_output_error(slope, **THREE).fit
    assert abs(drifting.delay - 37) < 0.5
    assert "drift" in codes(drifting)


def after_an_earlier_step(rest: float, before: float) -> cr.Record:
    """Two lags of 5 and 1 s behind 0.6 s, cut `rest` s before a step, `before` s after another."""
    plant = cr.delayed_ss(ct.tf([1.5], [5, 6, 1]), dead_time=0.6, dt=0.05)
    t = 0.05 * np.arange(-200, 1200)
    u = np.select([t < -before, t < 0], [0.0, 1.0], 3.0)
    y = plant.simulate(u - u[0]) + 0.01 * np.random.default_rng(0).standard_normal(t.size)
    return cr.Record(t, u, y).between(-rest, 60)


def test_a_drift_is_told_from_a_plant_that_moves():
    settled = after_an_earlier_step(2.0, before=60)
    drifting = changed(settled, settled.output + 0.02 * settled.time)
    fit = cr.fit_output_error(drifting, structures=[(1, 1), (2, 2), (2, 1), (3, 3)]).fit
    assert "drift" in codes(fit)
    assert fit.interval[0] <= 0.6 <= fit.interval[1] < 1.0
    assert fit.total_delay == pytest.approx(6.6, rel=0.02)


def test_eight_bit_quantisation_is_seen_and_the_interval_covers():
    clean = rigs.step_record(noise=0.0, before=600, after=1500)
    step = 16 * 1.2 / 128
    fit = cr.fit_output_error(changed(clean, np.round(clean.output / step) * step)).fit
    assert "coarse_quantisation" in codes(fit)
    assert covers(fit, 37)


def test_the_standard_error_knows_that_neighbours_are_rounded_alike():
    rng = np.random.default_rng(0)
    k = np.arange(1600)
    scores = []
    for delay in rng.uniform(30, 45, 10):
        y = rigs.exact_step(rigs.R1, (k - 600 - delay) * TS) + 0.001 * rng.standard_normal(1600)
        step = 1.25 / 256
        y = step * np.round(y / step + rng.uniform())  # eight bits, five times the noise
        fit = cr.fit_output_error(cr.Record(k * TS, 1.0 * (k >= 600), y), structures=[(1, 1)]).fit
        scores.append((fit.delay - delay) / (fit.std_given_structure / TS))
    # chi-square of ten: 18.3 is exceeded once in 20
    assert np.sum(np.square(scores)) < 18.3


def test_a_lag_of_a_tenth_of_a_sample_leaves_its_sample_open_and_one_of_two_samples_does_not():
    k = np.arange(-100, 400)
    noise = 0.001 * np.random.default_rng(0).standard_normal(k.size)
    intervals = []
    for slow in (0.1, 2.0):
        y = -np.expm1(-np.maximum(k - 25.4, 0) / slow) + noise
        record = cr.Record(0.01 * k, (k >= 0).astype(float), y)
        fit = cr.fit_output_error(record, structures=[(1, 1), (2, 2)]).fit
        assert covers(fit, 25.4)
        intervals.append(fit.delay_interval)
    assert intervals[0][1] == pytest.approx(26.0, abs=0.01)
    assert intervals[1][1] < 25.5


def test_an_inverse_response_is_found_with_its_zero():
    w = 2 * np.pi * 5.0
    fit = cr.fit_output_error(rigs.step_record(rigs.R3 * ct.tf([-1, w], [w]), noise=0.001)).fit
    assert fit.structure == (3, 2)
    assert abs(fit.delay - 37) < 1
    assert "inverse_response" in codes(fit)
    assert fit.zeros[0].real == pytest.approx(w, rel=0.1)


def test_a_pair_of_zeros_on_the_right_does_not_begin_the_wrong_way():
    # s^2 leads the numerator, so that the response begins upwards, as it ends.
    plant = rigs.R3 * ct.tf([1, -10, 400], [400])
    fit = cr.fit_output_error(rigs.step_record(plant, noise=0.001), structures=[(3, 1)]).fit
    assert np.all(fit.zeros.real > 0)
    assert covers(fit, 37)
    assert "inverse_response" not in codes(fit)


def test_an_integrating_plant_gets_an_exact_integrator():
    # 1/s times R2: the ramp lags by the lags of R2, 1/w1 + 1/w2.
    record = rigs.step_record(rigs.R2, noise=0.0, before=1000, after=1500)
    ramp = np.cumsum(record.output - record.output[0]) * TS
    ramp = ramp + 0.002 * np.random.default_rng(0).standard_normal(ramp.size)
    system = cr.fit_output_error(changed(record, ramp), structures=[(2, 2), (3, 3), (3, 2)])
    fit = system.fit
    assert "integrating" in codes(fit)
    assert np.any(fit.poles == 0)
    assert fit.gain == pytest.approx(1.0, rel=0.01)
    lags = (1 / 2.2 + 1 / 11.0) / (2 * np.pi * TS)
    # the sum above integrates half a sample ahead
    assert fit.total_delay / TS == pytest.approx(37 + lags - 0.5, abs=1.0)
    assert covers(fit, 37)


@pytest.mark.parametrize("before", [1, 12])
def test_few_or_no_samples_before_the_step_suffice(before):
    fit = cr.fit_output_error(rigs.step_record(noise=0.002, before=before), **THREE).fit
    assert abs(fit.delay - 37) < 4 * 0.19
    assert ("no_rest" in codes(fit)) == (before < 8)


def test_coloured_noise_leaves_a_delay_and_structures_disagree_only_where_it_matters(quiet_valve):
    k = np.arange(1600)
    white = np.random.default_rng(0).standard_normal(1800)
    noise = lfilter([np.sqrt(1 - 0.81)], [1.0, -0.9], white)
    y = rigs.exact_step(rigs.R3, (k - 637) * TS) + 0.005 * noise[200:]
    fit = cr.fit_output_error(cr.Record(k * TS, 1.0 * (k >= 600), y)).fit
    assert covers(fit, 37)
    # 84 independent samples; where a parameter is charged no more than their log: 48
    assert (fit.interval[1] - fit.interval[0]) / TS < 40
    assert "no_delay_resolved" not in codes(fit)
    loud = cr.fit_output_error(rigs.step_record(noise=0.03, seed=1)).fit
    white = [quiet_valve.fit, loud]
    assert ["structures_disagree" in codes(fit) for fit in white] == [False, True]


def test_a_code_for_missing_samples_is_told_by_its_value():
    record = rigs.step_record(rigs.R1, noise=0.005, before=300, after=600)
    y = record.output.copy()
    y[[350, 800]] = -9999.0
    fit = cr.fit_output_error(cr.Record(record.time, record.input, y), structures=[(1, 1)]).fit
    message = next(str(flag) for flag in fit.flags if flag.code == "outliers")
    assert message.startswith("2 sample(s), the first at 273 ms, are -9999")
    # One wild sample of each kind is no code.
    y[800] = 8888.0
    fit = cr.fit_output_error(cr.Record(record.time, record.input, y), structures=[(1, 1)]).fit
    assert not any("missing value" in str(flag) for flag in fit.flags)


DELAY, SLOW, FAST = 45.0, 180.0, 40.0
T = np.arange(900.0)
U = np.where(T < 100, 0.0, 1.0)


def two_lags(seed=0, noise=0.003):
    x = np.maximum(T - 100 - DELAY, 0)
    y = 1 - (SLOW * np.exp(-x / SLOW) - FAST * np.exp(-x / FAST)) / (SLOW - FAST)
    return cr.Record(T, U, 0.8 * y + noise * np.random.default_rng(seed).standard_normal(T.size))


def test_a_first_order_model_of_two_lags_has_an_apparent_dead_time():
    forced = cr.identify(two_lags(), order=1)
    fit = forced.fit
    assert fit.interval[0] > DELAY + 5  # tight, and wrong
    assert "apparent_dead_time" in codes(forced)
    assert (fit.better.order, fit.better.relative_degree) == (2, 2)
    low, high = fit.better.interval
    assert low <= DELAY <= high
    assert fit.better.dead_time == pytest.approx(DELAY, abs=3)
    text = fit.report()
    assert text.startswith("Output-error fit: apparent dead time")
    assert "if the structure is right" in text
    assert "order 2, relative degree 2 gives" in text
    verdict = report.verdict_of(forced)
    assert verdict.level != "good"
    assert verdict.headline.startswith("Apparent dead time")


S = 1j * np.array([0.1, 1.0, 7.0, 40.0, 300.0])


def response(factor):
    """Frequency response of a factor: numerator over the monic denominator."""
    return np.polyval(factor.numerator, S) / np.polyval(np.atleast_1d(np.poly(factor.poles)), S)


def test_coinciding_poles_are_given_apart_by_a_thousandth():
    times = 3
    system = lag(30.0) ** times
    poles = known_factor(system).poles
    gaps = np.abs(poles[:, None] - poles)[~np.eye(times, dtype=bool)] / (2 * np.pi * 30)
    assert gaps.min() > 0.4e-3
    assert gaps.max() < 4e-3
    # the frequency response moves by no more than the poles do
    assert_allclose(response(known_factor(system)), system(S), rtol=2e-3 * times)


def test_records_of_other_inputs_are_looked_at_too():
    rng = np.random.default_rng(5)
    u = np.repeat(rng.choice([-1.0, 1.0], 150), 4)
    core = cr.design.ProcessModel(1.0, 12.0, 3.0, second_lag=6.0).system(1.0).delay_free
    y = cr.delayed_ss(core, 3).simulate(u) + 0.01 * rng.standard_normal(u.size)
    record = cr.Record(np.arange(u.size) * 1.0, u, y)
    fit = cr.fit_output_error(record, structures=[(1, 1)]).fit
    assert fit.dead_time > 4
    assert fit.better is not None
    assert fit.better.dead_time == pytest.approx(3.0, abs=0.5)
    assert cr.fit_output_error(record, structures=[(2, 2)]).fit.better is None


# how much of a record a fit follows, and why not more


def followed(fit):
    return dict(line.split(maxsplit=1) for line in map(str.strip, fit.report().splitlines()[1:]))[
        "fit"
    ]


TWO = {"structures": [(2, 2)]}


@pytest.mark.parametrize("noise", [0.002, 0.02])
def test_the_fit_of_a_right_model_is_what_noise_leaves(noise):
    record = rigs.step_record(rigs.R2, noise=noise, before=400, after=900)
    fit = cr.fit_output_error(record, **TWO).fit
    left = 16 * noise / np.std(record.output)
    # the noise of one record, known to 1 / sqrt(2 N)
    assert fit.fit_percent == pytest.approx(100 * (1 - left), abs=100 * left * 0.06)
    assert followed(fit) == f"{fit.fit_percent:.1f} % of the response"
    assert not any("closely" in choice for choice in fit.choices)


def test_a_drift_is_in_the_fit_and_not_in_the_model_alone():
    record = rigs.step_record(rigs.R2, noise=0.001, before=900, after=900)
    drift = 3e-3 * np.arange(record.n_samples)
    fit = cr.fit_output_error(
        cr.Record(record.time, record.input, record.output + drift), **TWO
    ).fit
    assert "drift" in {flag.code for flag in fit.flags}
    clean = record.output
    alone = 100 * (1 - np.std(drift) / np.std(clean + drift))
    assert fit.fit_percent > 99
    assert f"{alone:.1f} % simulated from rest, without the drift" in followed(fit)


def test_where_no_structure_is_right_five_poles_are_the_model_if_three_miss_twice_as_much():
    # Seven poles; at most five are tried.
    plant = rigs.R2 + 0.1 * rigs.lag(6.0) * rigs.pair(20.0, 0.05) - 0.1 * rigs.pair(9.0, 0.03)
    fit = cr.fit_output_error(rigs.step_record(plant, noise=1e-3, before=300, after=900)).fit
    assert not fit.at_noise_level
    assert fit.order == 5
    # up to three poles follow 97.8 % of it
    assert fit.fit_percent > 98.5


def test_known_dynamics_with_a_dead_time_are_refused_by_that():
    for known in (cr.delay(2.0), ct.ss(-1, 1, 1, 0) * cr.delay(2.0)):
        with pytest.raises(cr.errors.UnsuitableSystemError, match=r"known is .*without dead"):
            cr.fit_output_error(cr.Record(np.arange(9.0), np.ones(9), np.ones(9)), known=known)
