"""Several step records of one plant: mean, scatter, trend, outliers, differences."""

import control as ct
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.special import chdtrc

import ctrl_realize as cr
from ctrl_realize import report
from ctrl_realize.identification.output_error.averaging import (
    MeanStep,
    aligned_steps,
    mean_step,
    repeatability,
)
from ctrl_realize.report.verdict import campaign_verdict
from tests import rigs
from tests.rigs import codes

TS = rigs.TS


def record(seed, *, delay=37.0, amplitude=16.0, name="", plant=rigs.R3):
    made = rigs.step_record(
        plant, delay=delay, noise=0.005, seed=seed, amplitude=amplitude, before=400, after=1300
    )
    return cr.Record(made.time, made.input, made.output, name=name or f"no. {seed}")


def test_the_mean_of_sixteen_records_is_four_times_as_exact():
    sixteen = cr.fit_output_error([record(seed) for seed in range(16)], structures=[(3, 3)]).fit
    assert sixteen.std_given_structure / TS == pytest.approx(0.46 / 4, rel=0.25)
    assert abs(sixteen.delay - 37) < 4 * 0.46 / 4
    assert sixteen.at_noise_level
    assert sixteen.gain == pytest.approx(1.0, abs=0.002)
    # and records that differ by noise alone are not called different
    repeats = sixteen.repeatability
    assert repeats.p_value > 0.01
    assert not repeats.outlying
    # standard error of a shift with known shape: 0.15 samples per 1 % noise
    assert np.median(repeats.errors) / TS == pytest.approx(0.15 * 0.5, rel=0.3)
    assert not codes(sixteen) & {"records_differ", "amplitude_trend", "outlying_records"}


def test_a_delay_that_grows_with_the_amplitude_is_an_alarm():
    records = [
        record(10 * k + a, delay=36 + a / 8, amplitude=float(a))
        for k in range(4)
        for a in (4, 8, 16)
    ]
    fit = cr.fit_output_error(records, structures=[(3, 3)]).fit
    assert "amplitude_trend" in codes(fit)
    assert fit.repeatability.trend / TS == pytest.approx(1 / 8, rel=0.3)


def through_play(height, seed):
    """Two lags of 8 s behind 10 s of dead time, and play of a fifth of the smallest step."""
    t = np.arange(400.0)
    x = np.clip(t - 110, 0, None) / 8
    y = np.clip(height * (1 - (1 + x) * np.exp(-x)) - 0.1, 0, None)
    noise = 0.002 * np.random.default_rng(seed).standard_normal(t.size)
    return cr.Record(t, height * (t >= 100), y + noise)


def test_play_that_one_height_takes_for_dead_time_is_told_by_several():
    one = cr.fit_output_error(through_play(1.0, 0)).fit
    assert one.interval[0] > 10
    told = [str(flag) for flag in one.flags if flag.code == "onset_open"]
    assert "Backlash" in told[0]
    heights = (1.0, 1.5, 2.0, 3.0)
    records = [through_play(h, k) for k, h in enumerate(heights)]
    several = cr.fit_output_error(records, structures=[(2, 2), (3, 3)]).fit
    assert "amplitude_trend" in codes(several)
    assert several.repeatability.trend < 0


def moving(seed: int, *, drifts: bool) -> cr.Record:
    """Two lags behind 0.6 s: a drift of its own, or an earlier step 5 to 9 s before."""
    rng = np.random.default_rng(seed)
    t = 0.05 * np.arange(-400, 1000)
    before = 0.0 if drifts else rng.uniform(-1, 1)
    u = np.select([t < -rng.uniform(5, 9), t < 0], [0.0, before], 2.0 + before)
    plant = cr.delayed_ss(ct.tf([1.5], [5, 6, 1]), dead_time=0.6, dt=0.05)
    y = plant.simulate(u) + 0.01 * rng.standard_normal(t.size)
    drift = rng.uniform(-0.03, 0.03) * t if drifts else 0.0
    return cr.Record(t, u, y + drift, name=f"no. {seed}").between(-4, 50)


@pytest.mark.parametrize("drifts", [True, False])
def test_records_that_were_not_at_rest_are_fitted_together(drifts):
    records = [moving(seed, drifts=drifts) for seed in range(6)]
    fit = cr.fit_output_error(records, structures=[(1, 1), (2, 2), (2, 1), (3, 3)]).fit
    assert ("drift" if drifts else "not_at_rest") in codes(fit)
    assert "records_differ" not in codes(fit)
    assert fit.interval[0] <= 0.6 <= fit.interval[1] < 1.0
    assert fit.total_delay == pytest.approx(6.6, rel=0.01)


LEVEL = np.ones((1600, 1))


def simulated(delays, amplitudes, *, noise=0.0, gains=None, names=None):
    gains = gains or [1.0] * len(delays)
    made = []
    for i, (delay, height, gain) in enumerate(zip(delays, amplitudes, gains, strict=True)):
        record = rigs.step_record(
            rigs.R3, delay=delay, amplitude=height, noise=noise, seed=i, before=300, after=1300
        )
        name = names[i] if names else ""
        made.append(cr.Record(record.time, record.input, gain * record.output, name=name))
    return aligned_steps(tuple(made))


def model_of(mean: MeanStep, delay: float):
    time = TS * (np.arange(mean.output.size) - mean.edge)
    return rigs.exact_step(rigs.R3, time - delay * TS)


def test_shifts_gains_and_names_of_exact_records_are_found():
    delays, gains = [36.0, 37.0, 38.5], [0.9, 1.0, 1.3]
    made = simulated(delays, [16.0, 8.0, -4.0], gains=gains, names=["a", "", "c"])
    mean = mean_step(made)
    found = repeatability(made, mean, model_of(mean, 37.0), 37 * TS, LEVEL)
    # linear interpolation of the model: (w Ts)^2 / 8 of the curvature, w = 50 rad/s
    assert_allclose(found.delays / TS, delays, atol=0.01)
    assert_allclose(found.gains, gains, rtol=1e-3)
    assert found.names == ("a", "record 1", "c")
    assert_allclose(found.amplitudes, [16, 8, -4])
    assert found.outlying == ()


def test_errors_and_chi_square_are_those_of_the_noise():
    noise, count = 0.01, 30
    made = simulated([37.0] * count, [16.0] * count, noise=noise)
    mean = mean_step(made)
    found = repeatability(made, mean, model_of(mean, 37.0), 37 * TS, LEVEL)
    # the scatter of 30 tells sigma to 13 %
    assert np.std(found.delays, ddof=1) == pytest.approx(np.mean(found.errors), rel=0.4)
    slope = np.gradient(model_of(mean, 37.0)) / TS
    line = np.linspace(0, 1, slope.size)
    columns = np.stack([-slope, model_of(mean, 37.0), np.ones(slope.size), line], axis=1)
    expected = noise * np.sqrt(np.linalg.inv(columns.T @ columns)[0, 0])
    assert_allclose(found.errors, expected, rtol=0.1)
    assert abs(found.delays.mean() / TS - 37) < 4 * expected / TS / np.sqrt(count)
    kept = np.array(mean.used)
    weight = found.errors[kept] ** -2
    centre = np.sum(weight * found.delays[kept]) / weight.sum()
    statistic = np.sum(weight * (found.delays[kept] - centre) ** 2)
    assert found.chi_square == pytest.approx(statistic, rel=1e-6)
    assert found.p_value == pytest.approx(chdtrc(kept.size - 1, statistic), rel=1e-6)
    assert found.p_value > 0.001


T = 0.05 * np.arange(400)


def step(height, seed, gain=1.0, lag=1.0, delay=0.5, noise=0.01):
    u = np.where(T < 4, 0.0, height)
    y = gain * height * -np.expm1(-np.maximum(T - 4 - delay, 0) / lag)
    rng = np.random.default_rng(seed)
    return cr.Record(T, u, y + noise * rng.standard_normal(T.size), name=f"step_{height:g}")


def told(records):
    return {flag.code for flag in cr.fit_output_error(records, structures=[(1, 1)]).fit.flags}


def test_steps_of_different_gain_are_no_plant_without_objection():
    records = [step(1.0, 0, 1.0), step(2.0, 1, 0.5), step(4.0, 2, 0.25)]
    system = cr.identify(records)
    found = {flag.code: str(flag) for flag in system.fit.flags}
    assert {"gains_differ", "no_common_gain"} <= set(found)
    verdict = report.verdict_of(system)
    assert verdict.level == "poor"
    assert verdict.reasons[0].startswith("No single gain fits all records")
    # their gains over each other, whatever the common one is
    gains = system.fit.repeatability.gains * system.fit.gain
    np.testing.assert_allclose(gains, [1.0, 0.5, 0.25], rtol=0.02)
    assert (system.fit.repeatability.fit_percent < 90).all()


def driven(seed, gain=1.0, lag=1.0, delay=0.5, noise=0.02):
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.choice([-1.0, 1.0], 80), 5)
    plant = cr.delayed_ss(
        cr.design.ProcessModel(gain=gain, lag=lag, dead_time=delay).system(0.05).delay_free,
        round(delay / 0.05),
    )
    y = plant.simulate(u) + noise * rng.standard_normal(u.size)
    return cr.Record(T, u, y, name=f"driven_{seed}")


def test_records_of_other_inputs_are_compared_too():
    first = driven(1)
    assert not told([first, driven(2)]) & {"gains_differ", "lags_differ", "no_common_gain"}
    assert "gains_differ" in told([first, driven(2, gain=1.2)])
    assert "lags_differ" in told([first, driven(2, lag=1.5)])


def test_the_gains_of_a_canal_differ_with_the_opening_of_its_gate(shared_data):
    folder = shared_data / "wis_canal"
    records = [
        cr.read_record(folder / f"20210202_step_gate1_2_s{opening}.csv")
        for opening in (25, 100, 255)
    ]
    system = cr.identify(records, structures=[(2, 1), (3, 1)])
    assert "gains_differ" in codes(system.fit)
    assert report.verdict_of(system).level == "poor"


def test_table_and_picture_show_every_record_beside_the_model():
    records = [step(1.0, 0, 1.0, lag=0.8), step(2.0, 1, 0.5), step(4.0, 2, 0.25, lag=1.3)]
    fit = cr.fit_output_error(records, structures=[(1, 1)]).fit
    table = fit.repeatability.table()
    assert list(table.index) == ["step_1", "step_2", "step_4"]
    # over each other: 0.8 to 1 to 1.3; the common model fits the mean
    ratio = (table["lags"] / table["lags"]["step_2"]).to_numpy()
    np.testing.assert_allclose(ratio, [0.8, 1.0, 1.3], rtol=0.03)
    assert (table["fit_percent"] < 100).all()
    drawn = cr.plots.fit_plot(fit).figure.axes[0].get_lines()
    ends = [float(np.mean(line.get_ydata()[-50:])) for line in drawn]
    for gain in (1.0, 0.5, 0.25, fit.gain):
        assert min(abs(end - gain) for end in ends) < 0.02


CAMPAIGNS = {
    "one plant": ([step(h, 50 + h) for h in (1, 2, 4)], set(), set()),
    "gains": (
        [step(2.0**k, k, 0.5**k) for k in range(3)],
        {"gains_differ", "no_common_gain"},
        {"lags_differ"},
    ),
    "dead times": (
        [step(2.0, k, delay=0.5 + 0.1 * k) for k in range(3)],
        {"records_differ"},
        {"gains_differ"},
    ),
    "lags": ([step(2.0, k, lag=1.0 + 0.2 * k) for k in range(3)], {"lags_differ"}, set()),
}


@pytest.mark.parametrize("name", CAMPAIGNS)
def test_a_campaign_tells_what_differs_from_record_to_record(name):
    records, due, not_due = CAMPAIGNS[name]
    campaign = cr.identify_campaign(records, structures=[(1, 1)])
    flags = {flag.code for flag in campaign.flags}
    assert due <= flags & told(records)  # a fit of all says so, too
    assert not flags & not_due if due else not flags
    if name == "dead times":  # not taken for gains or lags
        small = [step(1.0 + k, k, delay=0.5 + 0.05 * k) for k in range(3)]
        found = told(small)
        assert "records_differ" in found
        assert not found & {"gains_differ", "lags_differ"}
    if name == "gains":
        assert "gains_differ" in told([step(1.0 + k, k, 1.0 + 0.05 * k) for k in range(3)])
        assert due <= {f.code for f in cr.identify_campaign(records, method="scan").flags}
        assert campaign_verdict(campaign).level == "poor"
        np.testing.assert_allclose(campaign.table()["gain"], [1.0, 0.5, 0.25], rtol=0.05)
