"""Several step records of one plant: mean, scatter, trend, outliers, differences."""

import control as ct
import numpy as np
import pytest
from scipy.special import chdtrc

import ctrl_realize as cr
from ctrl_realize import report
from ctrl_realize.errors import DataError
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
    weight = repeats.errors**-2
    centre = np.sum(weight * repeats.delays) / weight.sum()
    statistic = np.sum(weight * (repeats.delays - centre) ** 2)
    assert repeats.chi_square == pytest.approx(statistic, rel=1e-6)
    assert repeats.p_value == pytest.approx(chdtrc(15, statistic), rel=1e-6)


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
    told = [str(flag) for flag in one.flags if flag.code == "structures_disagree"]
    assert "backlash" in told[0]
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


T = 0.05 * np.arange(400)


def step(height, seed, gain=1.0, lag=1.0, delay=0.5, noise=0.01):
    u = np.where(T < 4, 0.0, height)
    y = gain * height * -np.expm1(-np.maximum(T - 4 - delay, 0) / lag)
    rng = np.random.default_rng(seed)
    return cr.Record(T, u, y + noise * rng.standard_normal(T.size), name=f"step_{height:g}")


def one_lag(records):
    return cr.fit_output_error(records, structures=[(1, 1)]).fit


def told(records):
    return codes(one_lag(records))


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
    assert list(system.fit.repeatability.table().index) == ["step_1", "step_2", "step_4"]
    # and the picture shows every record beside the model
    drawn = cr.plots.fit_plot(system.fit).figure.axes[0].get_lines()
    ends = [float(np.mean(line.get_ydata()[-50:])) for line in drawn]
    for gain in (1.0, 0.5, 0.25, system.fit.gain):
        assert min(abs(end - gain) for end in ends) < 0.02


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
    assert {"gains_differ", "lags_differ"} <= told([first, driven(2, gain=1.2, lag=1.5)])


def test_a_duplicate_is_told_by_what_it_does_to_the_standard_error():
    """A mean of equal records has the noise of one; squared residuals of both count twice."""
    for one, ratio, words in (
        (step(1.0, 1), 1.0, "1 of 2 records are duplicates (no. 2 is no. 1): they make the mean"),
        (driven(1), 2**-0.5, "standard error assumes independent noise and is too small"),
    ):
        single, twice = one_lag([one]), one_lag([one, one])
        found = twice.gain_std_given_structure / single.gain_std_given_structure
        assert found == pytest.approx(ratio, rel=0.02)
        assert words in next(str(flag) for flag in twice.flags if flag.code == "same_records")


def test_the_gains_of_a_canal_differ_with_the_opening_of_its_gate(shared_data):
    folder = shared_data / "wis_canal"
    records = [
        cr.read_record(folder / f"20210202_step_gate1_2_s{opening}.csv")
        for opening in (25, 100, 255)
    ]
    system = cr.identify(records, structures=[(2, 1)])
    assert "gains_differ" in codes(system.fit)
    assert report.verdict_of(system).level == "poor"


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
    of_all = one_lag(records)
    assert due <= flags & codes(of_all)  # a fit of all says so, too
    assert not flags & not_due if due else not flags
    if name == "dead times":  # not taken for gains or lags
        assert not codes(of_all) & {"gains_differ", "lags_differ"}
        np.testing.assert_allclose(np.diff(of_all.repeatability.delays), 0.1, atol=0.02)
    if name == "lags":
        lags = of_all.repeatability.table()["lags"].to_numpy()
        np.testing.assert_allclose(lags / lags[0], [1.0, 1.2, 1.4], rtol=0.03)
    if name == "gains":
        assert "gains_differ" in told([step(1.0 + k, k, 1.0 + 0.05 * k) for k in range(3)])
        assert due <= {f.code for f in cr.identify_campaign(records, method="scan").flags}
        assert campaign_verdict(campaign).level == "poor"
        np.testing.assert_allclose(campaign.table()["gain"], [1.0, 0.5, 0.25], rtol=0.05)


def test_records_that_differ_widen_the_interval_to_their_last_visible_onset_at_most():
    """With other gains and lags, delays of a common model scatter: up to 20 s, though all move."""
    t = np.arange(300.0)
    u = np.where(t < 39.5, 0.0, 1.0)
    records = []
    for gain, lag, seed in ((0.6, 15, 1), (1.4, 60, 2)):
        plant = ct.tf([gain], [lag, 1]) * ct.tf([1], [6, 1])
        y = cr.delayed_ss(plant, dead_time=3.0, dt=1.0).simulate(u)
        y += 0.01 * np.random.default_rng(seed).standard_normal(t.size)
        records.append(cr.Record(t, u, y, name=str(seed)))
    fit = cr.identify(records).fit
    assert "records_differ" in {flag.code for flag in fit.flags}
    # Each moves visibly, by five standard deviations, 6 s after the step.
    assert fit.interval[0] <= 3.0 <= fit.interval[1] <= 12.0


def test_tests_of_several_kinds_add_up_to_one_interval():
    # a mean of both once ended at the second edge of the relay: gain 0.04 for 0.9
    plant = cr.bench.heater(noise=0.05, disturbance=0.0, resolution=None)
    step, relay = plant.step_record(rng=1), cr.bench.relay_test(plant, 10.0, rng=2)
    alone = [cr.identify(test, structures="SOPDT").fit for test in (step, relay)]
    both = cr.identify([step, relay], structures="SOPDT").fit
    # Information matrices of independent records add up (Ljung 1999, section 7.4), and so at least
    # does what is left of them for one parameter; here lags and gain are known better as well.
    least = np.sum([fit.std_given_structure**-2 for fit in alone]) ** -0.5
    assert 0.3 * least < both.std_given_structure < least
    assert both.interval[0] <= 20.0 <= both.interval[1]
    assert both.gain_interval[0] <= 0.9 <= both.gain_interval[1]
    assert both.gain == pytest.approx(0.9, rel=0.01)


@pytest.mark.parametrize(("times", "divisor"), [((1.0, 4.0), 1.0), ((2.0, 3.0), 1.0)])
def test_records_of_two_sample_times_are_fitted_as_the_error_says(times, divisor):
    """Interpolated, as it once said, a step has a value in between: early by a sample.

    On the grid of the shorter sample time, as it said then, samples of the other are moved.
    """

    def taken(every, make, **options):
        t = every * np.arange(int(360 / every))
        move = t[t >= 61.0][0]
        y = 2 * (t >= move + 7.3) * (1 - np.exp(-(t - move - 7.3) / 20))
        y += 0.001 * np.random.default_rng(int(every)).standard_normal(t.size)
        return make(t, (t >= move).astype(float), y, **options)

    advice = rf"Record.from_samples\(time, input, output, dt={divisor:g}\)"
    with pytest.raises(DataError, match=advice):
        cr.identify([taken(every, cr.Record) for every in times])
    again = [taken(every, cr.Record.from_samples, dt=divisor) for every in times]
    fit = cr.identify(again, structures="FOPDT").fit
    assert fit.interval[0] <= 7.3 <= fit.interval[1]
    assert fit.dead_time == pytest.approx(7.3, abs=0.02)
    assert np.ptp(fit.interval) < 0.05
