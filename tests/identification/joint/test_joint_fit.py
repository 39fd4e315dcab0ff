"""Time records and a frequency response together: simulated plants with known truth."""

import re
from functools import cache

import control as ct
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import least_squares
from scipy.stats import invgauss

import ctrl_realize as cr
from ctrl_realize.errors import DataError, OptionError, UnsuitableSystemError
from ctrl_realize.identification import fit_joint
from ctrl_realize.report.sketches import frf_sketches

DT = 0.01
TIME = DT * np.arange(500)
EDGE, DEAD_TIME, LAG, GAIN = 100, 0.125, 0.4, 3.0
ONE_LAG = [(1, 1)]
HZ = np.geomspace(0.1, 6.0, 15)
NOISE = 0.03  # of the record
STD = 0.05  # of the points


def held_response(seed):
    """Spectrum of a record of the plant whose input is held for five samples of 0.05 s."""
    dt = 0.05
    plant = cr.delayed_ss(ct.tf([GAIN], [LAG, 1]), dead_time=DEAD_TIME, dt=dt)
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.choice([-1.0, 1.0], 800), 5)
    y = plant.simulate(u) + NOISE * rng.standard_normal(u.size)
    return cr.spectral_frf(cr.Record(dt * np.arange(u.size), u, y), delay=2)


def test_aliases_of_a_held_input_do_not_move_the_dead_time_of_both_together():
    fit = fit_joint(step(), held_response(0)).fit
    assert fit.interval[0] <= DEAD_TIME <= fit.interval[1] < fit.interval[0] + 0.05
    assert fit.dead_time == pytest.approx(DEAD_TIME, abs=0.01)
    assert "inverse_response" not in [flag.code for flag in fit.flags]


def step(seed=0, dead_time=DEAD_TIME, gain=GAIN, noise=NOISE):
    """A step at sample 100, held between samples."""
    since = TIME - TIME[EDGE] - dead_time
    y = np.where(since > 0, -gain * np.expm1(-np.maximum(since, 0) / LAG), 0.0)
    y += noise * np.random.default_rng(seed).standard_normal(TIME.size)
    return cr.Record(TIME, np.where(np.arange(TIME.size) >= EDGE, 1.0, 0.0), y)


def response(seed=0, dead_time=DEAD_TIME, gain=GAIN, more=1.0, std=STD):
    """Points with independent noise of known standard deviation; `more` is a further factor."""
    s = 2j * np.pi * HZ
    noise = np.random.default_rng(1000 + seed).standard_normal((HZ.size, 2)) @ [1, 1j]
    exact = gain * np.exp(-s * dead_time) / (LAG * s + 1) * more
    return cr.MeasuredFRF(exact + std / np.sqrt(2) * noise, HZ, std=np.full(HZ.size, std))


@cache
def agreeing(seed=0):
    return fit_joint(step(seed), response(seed), structures=ONE_LAG).fit


def test_it_is_the_maximum_of_the_likelihood_by_another_optimiser():
    fit, record, frf = agreeing(), step(), response()
    s = 2j * np.pi * HZ
    noise = fit.record_fit.residual * np.sqrt(fit.record_fit.correlation)

    def rows(x):
        dead_time, lag, gain, level = x
        since = np.maximum(TIME - TIME[EDGE] - dead_time, 0)
        left = (record.output - level + gain * np.expm1(-since / lag)) / noise
        off = np.sqrt(2) * (frf.complex - gain * np.exp(-s * dead_time) / (lag * s + 1)) / STD
        return np.concatenate([left, off.real, off.imag])

    best = least_squares(rows, [0.12, 0.5, 2.9, 0.0], x_scale=[0.01, 0.1, 1, 0.1], xtol=1e-12)
    error = np.sqrt(np.diag(np.linalg.inv(best.jac.T @ best.jac)))
    found = [fit.dead_time, -1 / fit.poles[0].real, fit.gain]
    # Means over bins and the wildest residuals differ slightly: a tenth of a standard error.
    assert np.all(np.abs(found - best.x[:3]) < 0.1 * error[:3])
    assert_allclose(fit.std_given_structure, error[0], rtol=0.1)


def test_the_interval_is_narrower_than_either_alone_and_contains_the_truth():
    inside = 0
    for seed in range(6):
        fit = agreeing(seed)
        low, high = fit.interval
        alone = [b - a for a, b in (fit.record_fit.interval, fit.frf_fit.interval)]
        assert high - low < min(alone)
        inside += low <= DEAD_TIME <= high
        assert not fit.agreement.contradicts
        assert fit.interval_kind == "conditional"  # the structure is given
    assert inside >= 5  # 95 % intervals


def test_a_report_says_whether_the_frequency_response_was_fitted():
    together = fit_joint(step(), response(), structures=ONE_LAG)
    alone = cr.identify(step(), structures=ONE_LAG)
    captions = [frf_sketches([one], response())[0].caption for one in (together, alone)]
    assert "fitted together with the records" in captions[0]
    assert "not used for the fit" in captions[1]


def test_another_dead_time_of_the_frequency_response_is_found():
    fit = fit_joint(step(), response(dead_time=DEAD_TIME + 0.02), structures=ONE_LAG).fit
    (shift, chance), (_, by_gain) = fit.agreement.later, fit.agreement.gain_ratio
    assert fit.agreement.contradicts
    assert_allclose(shift, 0.02, atol=0.003)  # three standard errors of the points alone
    assert chance > 0.01 > by_gain
    flag = next(flag for flag in fit.flags if flag.code == "frf_contradicts_records")
    assert "dead time of the frequency response" in flag.message
    assert "longer" in flag.message
    # the interval spans both
    assert fit.interval[0] <= DEAD_TIME
    assert fit.interval[1] >= DEAD_TIME + 0.015
    assert fit.interval_kind == "spanned"


def test_another_gain_of_the_frequency_response_is_found():
    fit = fit_joint(step(), response(gain=1.1 * GAIN), structures=ONE_LAG).fit
    ratio, chance = fit.agreement.gain_ratio
    assert_allclose(ratio, 1.1, atol=0.02)
    assert chance > 0.01
    assert any("A gain of the frequency response" in flag.message for flag in fit.flags)


@pytest.mark.parametrize("wrong", ["sign", "gain", "rad/s", "early"])
def test_no_verdict_is_good_where_records_and_frequency_response_contradict_each_other(wrong):
    # the compromise was called good, with a gain of 2.7 known to 0.3 % beside 3 and -3
    plain, factor = response(), {"sign": -1.0, "gain": 1.1}.get(wrong, 1.0)
    values = factor * plain.complex * np.exp(2j * np.pi * HZ * 0.04 * (wrong == "early"))
    hz = HZ * (2 * np.pi if wrong == "rad/s" else 1.0)
    frf = cr.MeasuredFRF(values, hz, std=plain.std)
    fit = fit_joint(step(), frf, structures=ONE_LAG).fit
    assert fit.flags[0].code == "frf_contradicts_records"
    assert "good" not in {verdict.level for verdict in fit.verdicts}
    low, high = fit.gain_interval
    assert low <= min(GAIN, factor * GAIN)
    assert max(GAIN, factor * GAIN) <= high


def test_a_frequency_response_that_no_model_follows_is_not_said_to_agree():
    # the sign of the phase; its noise is then what its own fit leaves, 50 times what was given
    plain = response()
    frf = cr.MeasuredFRF(np.conj(plain.complex), HZ, std=plain.std)
    fit = fit_joint(step(), frf, structures=ONE_LAG).fit
    assert "hardly counts" in fit.flags[0].message
    assert "good" not in {verdict.level for verdict in fit.verdicts}
    # noise of 1 % on 400 samples, and points that hardly count
    assert fit.gain == pytest.approx(GAIN, rel=0.01)


def test_a_lag_that_only_the_frequency_response_has_is_where_it_is():
    s = 2j * np.pi * HZ
    lagging = response(more=1 / (s / 25 + 1), std=0.1)  # at 4 Hz
    fit = fit_joint(step(noise=0.005), lagging, structures=[(1, 1), (2, 2)]).fit
    assert fit.agreement.contradicts
    # The record is far more accurate, so that the joint model is its own: the lag moves the
    # response out of the circles, of 0.17, where |G| omega / 25 is larger.
    moved = np.abs(GAIN / (LAG * s + 1) * s / 25) > 0.17
    assert np.sum(fit.agreement.outside != moved) <= 3
    flag = next(flag for flag in fit.flags if flag.code == "frf_contradicts_records")
    first, last = HZ[moved][0], HZ[moved][-1]
    low, high = map(float, re.search(r"mainly from (\S+) Hz to (\S+) Hz", flag.message).groups())
    assert first / 1.5 < low < first * 1.5  # a point or so
    assert last / 1.5 < high < last * 1.5


def test_units_of_output_and_time_scale_the_result_and_nothing_else():
    fit, record, frf = agreeing(), step(), response()
    scaled = fit_joint(
        cr.Record(60 * TIME, record.input, 1000 * record.output),
        cr.MeasuredFRF(1000 * frf.complex, HZ / 60, std=1000 * frf.std),
        structures=ONE_LAG,
    ).fit
    # iterations end at slightly different points
    assert_allclose(scaled.dead_time, 60 * fit.dead_time, rtol=1e-5)
    assert_allclose(scaled.gain, 1000 * fit.gain, rtol=1e-5)
    assert_allclose(scaled.agreement.statistic, fit.agreement.statistic, rtol=1e-3, atol=1e-3)


def test_noise_that_was_not_measured_is_that_of_the_fit():
    frf = response()
    without = fit_joint(
        step(), cr.MeasuredFRF(frf.complex, HZ), structures=ONE_LAG, weighting="uniform"
    ).fit
    # the true one, within three standard errors of an estimate from 27 degrees of freedom
    radius = without.agreement.radius / np.sqrt(-np.log(0.05))
    assert_allclose(radius, STD, rtol=3 / np.sqrt(2 * 27))
    assert not without.agreement.contradicts


def test_an_input_that_is_no_step_takes_part():
    rng = np.random.default_rng(3)
    u = np.repeat(rng.choice([-1.0, 1.0], 60), 10)
    core = ct.tf([GAIN], [LAG, 1])
    y = cr.delayed_ss(core, dead_time=DEAD_TIME, dt=DT).simulate(u)
    record = cr.Record(DT * np.arange(u.size), u, y + 0.1 * rng.standard_normal(u.size))
    fit = fit_joint(record, response(), structures=ONE_LAG).fit
    assert fit.time.shape == fit.measured.shape == fit.fitted.shape
    assert not fit.agreement.contradicts
    assert fit.interval[0] <= DEAD_TIME <= fit.interval[1]
    assert_allclose(np.std(fit.measured - fit.fitted), 0.1, rtol=0.1)


def test_the_hold_of_a_sampled_frequency_response_is_no_dead_time():
    held = cr.delayed_ss(ct.tf([GAIN], [LAG, 1]), dead_time=DEAD_TIME, dt=0.1)
    noise = np.random.default_rng(5).standard_normal((HZ.size, 2)) @ [1, 1j]
    low = HZ < 2  # well below the Nyquist frequency of 5 Hz
    exact = np.asarray(held(np.exp(2j * np.pi * HZ * 0.1)))
    frf = cr.MeasuredFRF(
        (exact + 0.02 * noise)[low], HZ[low], std=np.full(low.sum(), 0.03), sample_time=0.1
    )
    right = fit_joint(step(), frf, structures=ONE_LAG).fit
    wrong = fit_joint(step(), frf, structures=ONE_LAG, hold=None).fit
    assert not right.agreement.contradicts
    assert wrong.agreement.contradicts  # half a sample of 0.1 s is 0.05 s


def test_gains_that_differ_between_records_make_the_common_one_uncertain():
    gains = GAIN * np.array([0.8, 0.9, 1.1, 1.2])
    records = [step(seed, gain=gain) for seed, gain in enumerate(gains)]
    several = fit_joint(records, response(gain=1.05 * GAIN), structures=ONE_LAG).fit
    alike = fit_joint(
        [step(seed) for seed in range(4)], response(gain=1.05 * GAIN), structures=ONE_LAG
    ).fit
    assert not several.agreement.contradicts  # the mean of 4 has a standard error of 9 %
    assert alike.agreement.contradicts
    assert several.gain > 1.03 * GAIN  # that of the frequency response
    assert any("gains (9." in reason for reason in several.choices)  # 0.183 / sqrt(4)


def test_a_plant_that_still_moves_before_the_step_is_followed_from_the_first_sample():
    record = step()
    moving = cr.Record(TIME, record.input, record.output + 2.0 * np.exp(-TIME / LAG))
    fit = fit_joint(moving, response(), structures=[(2, 1)]).fit
    assert fit.record_fit.data.relaxing
    # six standard deviations, and what a bin of some samples does not show of the decay
    assert np.abs(fit.measured - fit.fitted).max() < 6 * NOISE + 0.1
    assert fit.interval[0] <= DEAD_TIME <= fit.interval[1]


def test_identify_delegates_and_its_result_has_what_all_fits_have():
    system = cr.identify(step(), frf=response(), order=1)
    fit = system.fit
    assert isinstance(fit, cr.identification.JointFit)
    assert fit.dead_time == agreeing().dead_time
    assert_allclose(system.dcgain(), fit.gain, rtol=1e-6)
    left = np.linalg.norm(fit.measured - fit.fitted)
    spread = np.linalg.norm(fit.measured - fit.measured.mean())
    assert_allclose(fit.estimate.followed.complete, 100 * (1 - left / spread), rtol=1e-9)
    assert_allclose(fit.estimate.followed.simulated, fit.fit_percent, atol=0.01)  # a level alone
    assert "agreement" in fit.report()
    poles = 1 / (LAG * 2j * np.pi * HZ + 1)
    assert_allclose(
        fit.response(2 * np.pi * HZ), GAIN * poles * np.exp(-2j * np.pi * HZ * 0.125), atol=0.1
    )


@pytest.mark.parametrize(
    ("arguments", "error", "match"),
    [
        ({"frf": np.ones(5), "order": 1}, UnsuitableSystemError, "expected a MeasuredFRF"),
        ({"frf": response(), "known": ct.tf([1], [0.1, 1])}, OptionError, "known: not an"),
        ({"frf": response(), "method": "scan"}, OptionError, "frf: not an argument"),
        ({"frf": response(), "order": 1, "structures": ONE_LAG}, OptionError, "got both"),
        ({"frf": cr.MeasuredFRF([1.0, 0.5], [1, 2]), "order": 1}, DataError, "at least 3"),
    ],
)
def test_what_cannot_be_fitted_together_is_refused(arguments, error, match):
    with pytest.raises(error, match=match):
        cr.identify(step(), **arguments)


def measured_plant(folder, name, weighting="auto"):
    records = [cr.read_record(path) for path in sorted((folder / name).glob("[!fp]*.csv"))]
    frf = cr.read_frf(folder / name / "frf.csv")
    return fit_joint(records, frf, weighting=weighting).fit


def test_steps_of_a_measured_heater_agree_with_its_frequency_response(shared_data):
    fit = measured_plant(shared_data, "sbhs_heater")
    assert not fit.agreement.contradicts
    assert 1.0 < fit.dead_time < 4.5  # the band of the README of the data, in s
    before = np.diff(fit.record_fit.interval)
    assert np.diff(fit.interval) < 0.5 * before


def test_the_frequency_response_of_a_measured_arm_contradicts_its_steps(shared_data):
    assert measured_plant(shared_data, "hdd_arm").agreement.contradicts
    # with errors in proportion to the response, which the points do not tell from constant ones
    # of 0.05, at high frequencies
    fit = measured_plant(shared_data, "hdd_arm", weighting="relative")
    assert fit.agreement.contradicts
    hz = fit.frf_fit.frequency_hz
    assert np.mean(fit.agreement.outside[hz > 15]) > 0.3 > np.mean(fit.agreement.outside[hz < 15])


def test_a_gain_that_both_contradict_has_one_interval_in_the_report():
    """It was 0.327 (0.276 to 0.448), and (0.319 to 0.335) in the flag."""
    fit = fit_joint(step()[:2.1], response(gain=1.3 * GAIN), structures=ONE_LAG).fit
    told = next(str(flag) for flag in fit.flags if flag.code == "not_settled")
    assert fit.agreement.contradicts
    rows = [re.split(r" {2,}", line.strip()) for line in fit.report().splitlines()]
    assert f"final gain {dict(row for row in rows if len(row) == 2)['gain']}. " in told


def of_poles(poles, t):
    """Step response of lags with these distinct poles."""
    others = [np.delete(poles, i) for i in range(poles.size)]
    weights = [np.prod(o / (o - p)) for o, p in zip(others, poles, strict=True)]
    return np.where(t > 0, 1 - np.exp(np.outer(t, poles)) @ weights, 0.0)


@pytest.mark.parametrize("seed", [1, 2])
def test_a_flow_that_disperses_is_no_dead_time_of_both_together(seed):
    """Three or four lags took 3 to 4 s of it for dead time, in intervals 0.2 to 1.6 s late."""
    t, f, dead_time = np.arange(-80.0, 400.0), np.geomspace(5e-4, 0.06, 30), 8.0
    rng = np.random.default_rng(seed)
    y = invgauss(mu=0.25, scale=20 / 0.25).cdf(t - dead_time)  # 20 s, and a spread of half of them
    y += 0.01 * rng.standard_normal(t.size)
    s = 2j * np.pi * f
    exact = np.exp(4 * (1 - np.sqrt(1 + 10 * s)) - dead_time * s)
    noise = 0.01 / np.sqrt(2) * (rng.standard_normal((30, 2)) @ [1, 1j])
    frf = cr.MeasuredFRF(exact * (1 + noise), f, std=0.01 * np.abs(exact))
    fit = cr.identify(cr.Record(t, 1.0 * (t >= 0), y), frf=frf).fit
    assert fit.interval[0] <= dead_time <= fit.interval[1]
    assert abs(fit.dead_time - dead_time) < 0.2  # a fiftieth of the spread of 10 s
    assert "dispersed_flow" in {flag.code for flag in fit.flags}
    assert not fit.agreement.contradicts


def test_a_wall_is_no_dead_time_of_both_together():
    """Of infinitely many lags three took 1.8 s for dead time, in an interval 0.2 s late."""
    poles = -((np.pi * (np.arange(1, 41) - 0.5)) ** 2) / 110.0
    t, f, dead_time = np.arange(-80.0, 400.0), np.geomspace(5e-4, 0.06, 30), 8.0
    rng = np.random.default_rng(0)
    y = of_poles(poles, np.clip(t - dead_time, 0, None)) + 0.01 * rng.standard_normal(t.size)
    s = 2j * np.pi * f
    exact = np.exp(-dead_time * s) / np.prod(1 - s[:, None] / poles, axis=1)
    noise = 0.01 / np.sqrt(2) * (rng.standard_normal((30, 2)) @ [1, 1j])
    frf = cr.MeasuredFRF(exact * (1 + noise), f, std=0.01 * np.abs(exact))
    fit = cr.identify(cr.Record(t, 1.0 * (t >= 0), y), frf=frf).fit
    assert fit.interval[0] <= dead_time <= fit.interval[1] < fit.interval[0] + 6
    assert any("diffusion model" in choice for choice in fit.choices)
    assert not fit.agreement.contradicts
