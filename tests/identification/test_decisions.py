"""What an estimate decides by itself, each decision on simulated data whose truth is known."""

import control as ct
import numpy as np
import pytest
from scipy.signal import lfilter

import ctrl_realize as cr
from ctrl_realize.errors import DataError, NoStepError
from tests import rigs
from tests.rigs import codes

DT = 0.1
LAG = ct.tf([3.0], [1.0, 1.0])
ONE = {"structures": [(1, 1)]}


def lag_record(seed=0, *, n=120, edge=40, delay=7.3, noise=0.02, height=1.0, name=""):
    """A step at 4 s into a lag of 1 s with a gain of 3; the delay in samples."""
    time = DT * np.arange(n)
    y = height * rigs.exact_step(LAG, time - DT * (edge + delay))
    y += noise * np.random.default_rng(seed).standard_normal(n)
    return cr.Record(time, height * (np.arange(n) >= edge), y, name=name)


def driven(u, seed=0, *, delay=5, core=LAG, noise=0.02, extra=0.0, name="", **options):
    """Any input into a plant behind whole samples of delay."""
    plant = cr.delayed_ss(core, delay=delay, dt=DT)
    y = plant.simulate(u) + extra
    y = y + noise * np.random.default_rng(seed).standard_normal(u.size)
    return cr.Record(DT * np.arange(u.size), u, y, name=name, **options)


def random_levels(seed, n=600, held=5):
    return np.repeat(np.random.default_rng(seed).standard_normal(-(-n // held)), held)[:n]


# --- one step record: deviation, interval, structure


def test_intervals_and_deviations_are_those_of_twenty_records():
    twenty = [cr.fit_output_error(lag_record(seed), **ONE).fit for seed in range(20)]
    # twenty values tell a deviation to 16 %; a third is two of them
    claims = {"dead_time": "std_given_structure", "gain": "gain_std_given_structure"}
    for name, std in claims.items():
        scatter = np.std([getattr(fit, name) for fit in twenty], ddof=1)
        claimed = np.mean([getattr(fit, std) for fit in twenty])
        assert claimed == pytest.approx(scatter, rel=0.33)
    # fewer than 16 of twenty intervals of 95 % hold with a chance of 3 in 1000
    truths = {"": 0.73, "gain_": 3.0, "total_delay_": 1.73}
    for name, truth in truths.items():
        ends = [getattr(fit, f"{name}interval") for fit in twenty]
        assert sum(low <= truth <= high for low, high in ends) >= 16
    widths = [np.diff(fit.interval)[0] / fit.std_given_structure for fit in twenty]
    assert np.mean(widths) == pytest.approx(2 * 1.96, rel=0.05)


def test_zeros_and_lags_that_are_not_there_are_not_chosen():
    chosen = []
    for seed in range(2):
        record = rigs.step_record(
            rigs.R2, noise=0.005, seed=seed, before=100, after=150, dt=6e-3, delay=8
        )
        fit = cr.fit_output_error(record).fit
        chosen.append((fit.order, fit.relative_degree))
    assert chosen == 2 * [(2, 2)]


def test_a_short_record_does_not_lose_its_interval_to_models_that_know_no_delay():
    widths = []
    for seed in range(2):
        record = rigs.step_record(
            rigs.R1, noise=0.02, seed=seed, before=30, after=40, dt=1e-2, delay=8
        )
        low, high = np.array(cr.fit_output_error(record).fit.interval) / 1e-2
        assert low <= 8 <= high
        widths.append(high - low)
    assert np.mean(widths) < 3


def test_where_no_model_leaves_noise_the_delay_is_the_median_of_five_views():
    record = rigs.step_record(rigs.R2, noise=2e-3, seed=2, before=600, after=1500)
    slew = np.ravel(record.output).copy()
    for k in range(1, slew.size):  # a valve that moves by so much in a sample and no more
        slew[k] = slew[k - 1] + np.clip(record.output[k] - slew[k - 1], -0.05, 0.05)
    slew += 0.03 * np.random.default_rng(0).standard_normal(slew.size)
    fit = cr.fit_output_error(cr.Record(record.time, record.input, slew)).fit
    assert "structured_misfit" in codes(fit)
    views = list(fit.delay_estimates.values())
    assert len(views) == 6
    assert fit.dead_time == pytest.approx(np.median(views[:5]), rel=1e-9)
    # the earliest is left out of the interval, which one wrong view would open to nothing, and the
    # interval reaches as far as the model takes to move by what it misses, to the sample
    low, high = sorted(views)[1], max(views)
    assert fit.interval[0] <= low + 1e-9 < high - 1e-9 <= fit.interval[1]
    ends = np.array(fit.interval)
    assert ends[1] - fit.dead_time == pytest.approx(fit.dead_time - ends[0], rel=0.03)
    missed = np.std((fit.measured - fit.fitted)[600:])
    moved = np.abs(fit.fitted[600:] - fit.fitted[599])
    assert abs(np.argmax(moved > missed) - ends[1] / fit.dt) <= 1.5
    believed = cr.fit_output_error(
        cr.Record(record.time, record.input, slew), structures=[(2, 2)]
    ).fit
    assert not believed.delay_estimates


def test_slow_noise_at_rest_is_no_drift():
    for seed in range(2):
        rng = np.random.default_rng(seed)
        slow = lfilter([0.05], [1.0, -0.8], rng.standard_normal(1000))[200:]
        clean = lag_record(noise=0.0, n=800, edge=300)
        fit = cr.fit_output_error(
            cr.Record(clean.time, clean.input, clean.output + slow), **ONE
        ).fit
        assert "drift" not in codes(fit)
        assert np.diff(fit.interval)[0] < 0.15
        assert fit.dead_time == pytest.approx(0.73, abs=4 * fit.std_given_structure)


# --- what is a step experiment


@pytest.mark.parametrize(("edges", "stepped"), [(1, True), (12, True), (13, False)])
def test_an_input_of_more_than_twelve_edges_is_any_input(edges, stepped):
    u = np.repeat(np.arange(edges + 1) % 2, 40).astype(float)
    fit = cr.fit_output_error(driven(u), **ONE).fit
    assert np.isfinite(fit.onset) == stepped
    assert fit.delay == pytest.approx(5, abs=0.3)


# --- several records


def test_a_record_in_noise_does_not_choose_the_class_of_the_model():
    core = ct.tf([2.0], np.polymul([1.2, 1.0], [0.3, 1.0]))
    plant = cr.delayed_ss(core, dead_time=0.43, dt=DT)
    records = []
    for levels, seed, noise in ((0, 1, 0.0005), (5, 2, 2.0)):  # 2.0: louder than the response
        u = np.repeat(np.random.default_rng(levels).choice([-1.0, 1.0], 40), 10)
        y = plant.simulate(u - u[0]) + noise * np.random.default_rng(seed).standard_normal(u.size)
        records.append(cr.Record(DT * np.arange(u.size), u, y))
    fit = cr.identify(records).fit
    assert fit.interval[0] <= 0.43 <= fit.interval[1]
    assert fit.interval[1] - fit.interval[0] < 0.1  # 0.02 of the clear record alone


def test_a_record_that_comes_late_is_named_and_does_not_move_the_mean():
    records = [lag_record(k, name=f"r{k}") for k in range(4)]
    alone = cr.fit_output_error(records, **ONE).fit
    late = lag_record(9, delay=8.4, name="late")
    together = cr.fit_output_error([*records, late], **ONE).fit
    assert together.repeatability.outlying == ("late",)
    assert together.dead_time == pytest.approx(alone.dead_time, abs=alone.std_given_structure)


@pytest.fixture(scope="module")
def alike():
    return cr.fit_output_error([lag_record(k) for k in range(6)], **ONE).fit


@pytest.mark.parametrize(("half", "told"), [(0.5, False), (1.0, True)])
def test_delays_that_differ_from_record_to_record_widen_the_interval(alike, half, told):
    jitter = half * np.linspace(-1, 1, 6)  # samples; up to 0.5 the samples alone explain
    apart = cr.fit_output_error(
        [lag_record(k, delay=7.3 + d) for k, d in enumerate(jitter)], **ONE
    ).fit
    assert ("records_differ" in codes(apart) - codes(alike)) == told
    assert apart.std_given_structure > 1.5 * alike.std_given_structure
    # the standard error of a mean of delays that scatter
    assert apart.std_given_structure == pytest.approx(
        np.hypot(alike.std_given_structure, DT * jitter.std(ddof=1) / 6**0.5), rel=0.3
    )


def test_a_noisy_record_of_any_input_weighs_little_beside_a_quiet_one():
    quiet = driven(random_levels(1), 1, noise=0.02)
    noisy = driven(random_levels(2), 2, noise=1.0)
    alone = cr.fit_output_error(quiet, **ONE).fit
    both = cr.fit_output_error([quiet, noisy], **ONE).fit
    assert both.std_given_structure < 1.2 * alone.std_given_structure
    assert both.delay == pytest.approx(5, abs=5 * both.std_given_structure / DT)


def test_a_record_of_any_input_with_another_delay_is_left_out():
    records = [driven(random_levels(k, 300), k, name=f"r{k}") for k in range(3)]
    fit = cr.fit_output_error(
        [*records, driven(random_levels(7, 300), 7, delay=9, name="late")], **ONE
    ).fit
    assert fit.repeatability.outlying == ("late",)
    assert fit.delay == pytest.approx(5, abs=0.1)


# --- the impulse response from any input


def test_the_estimate_that_predicts_better_is_taken():
    u = random_levels(4, 1200, 2)
    rings = cr.delayed_ss(ct.tf([25.0], [1.0, 0.05, 25.0]), delay=3, dt=DT)
    settles = cr.delayed_ss(LAG, delay=3, dt=DT)
    for plant, okid in ((rings, True), (settles, False)):
        y = plant.simulate(u)
        y = y + 0.02 * y.std() * np.random.default_rng(1).standard_normal(u.size)
        record = cr.Record(DT * np.arange(u.size), u, y)
        found = cr.impulse_from_io(record)
        assert found.method.startswith("OKID") == okid
        truth = plant.markov(found.n_samples)
        assert np.abs(found.markov - truth).max() < 0.1 * np.abs(truth).max()
        holes = np.where(np.arange(u.size) % 301 == 300, np.nan, y)
        gaps = cr.Record(record.time, u, holes, missing="keep")
        # what is simulated needs every sample: no choice without one
        assert not cr.impulse_from_io(gaps).method.startswith("OKID")


def test_the_window_grows_until_the_response_has_died_away():
    u = random_levels(5, 1500, 3)
    slow = driven(u, core=ct.tf([1.0], [6.0, 1.0]), delay=3)
    quick = driven(u, core=ct.tf([1.0], [0.5, 1.0]), delay=3)
    assert cr.impulse_from_io(quick, method="regularized").n_samples == 100
    grown = cr.impulse_from_io(slow, method="regularized")
    assert grown.n_samples > 100
    assert "not_died_away" not in codes(grown)
    assert "not_died_away" in codes(cr.impulse_from_io(slow, 60, method="regularized"))


# --- channels


def test_an_output_of_noise_is_named_and_the_other_one_is_fitted():
    rng = np.random.default_rng(0)
    u = random_levels(7, 300, 2)
    good = cr.delayed_ss(LAG, delay=3, dt=DT).simulate(u) + 0.02 * rng.standard_normal(u.size)
    record = cr.Record(DT * np.arange(u.size), u, np.stack([good, rng.standard_normal(u.size)]))
    fit = cr.fit_state_space(record, 1, delays=[[3], [3]], feedthrough=False).fit
    silent = [flag.message for flag in fit.flags if flag.code == "no_response"]
    assert len(silent) == 1
    assert silent[0].startswith("output 1")


# --- the order of a scan


def test_without_known_noise_the_least_order_of_nearly_the_least_misfit_is_suggested():
    markov = cr.delayed_ss(rigs.R2, delay=12, dt=4 * rigs.TS).markov(400)
    noisy = markov + 1e-4 * np.abs(markov).max() * np.random.default_rng(0).standard_normal(400)
    scan = cr.scan_orders(cr.ImpulseResponse(noisy, 4 * rigs.TS), 4, max_delay=30)
    assert scan.order == 2
    least = scan.iae.min(axis=1)
    assert least[1] <= 1.1 * least.min()
    assert least[0] > 1.1 * least.min()


def test_an_input_that_does_not_hold_its_level_is_any_input():
    rng = np.random.default_rng(0)
    # an edge of 4, and half a unit of noise at every sample: an eighth; or a whole one: a quarter
    for size, stepped in ((0.2, True), (1.0, False)):
        u = np.repeat([0.0, 4.0], 150) + size * rng.standard_normal(300)
        fit = cr.fit_output_error(driven(u, noise=0.05), **ONE).fit
        assert np.isfinite(fit.onset) == stepped
        assert fit.delay == pytest.approx(5, abs=0.5)


def test_wild_samples_move_least_squares_more_than_the_usual_loss():
    errors = {"huber": [], "least_squares": []}
    for seed in range(2):
        rng = np.random.default_rng(seed)
        record = lag_record(seed)
        wild = np.where(rng.random(120) < 0.05, 1.5 * rng.standard_normal(120), 0.0)
        spoilt = cr.Record(record.time, record.input, record.output + wild)
        for loss, found in errors.items():
            found.append(cr.fit_output_error(spoilt, loss=loss, **ONE).fit.dead_time - 0.73)
    rms = {loss: np.sqrt(np.mean(np.square(found))) for loss, found in errors.items()}
    assert rms["huber"] < 0.08
    assert rms["least_squares"] > 1.3 * rms["huber"]


def test_steps_that_follow_before_the_first_one_is_seen_are_any_input():
    for second, stepped in ((100, True), (48, False)):
        u = 1.0 * (np.arange(200) >= 40) + 1.0 * (np.arange(200) >= second)
        fit = cr.fit_output_error(driven(u), **ONE).fit
        assert np.isfinite(fit.onset) == stepped
        assert fit.delay == pytest.approx(5, abs=0.3)
    with pytest.raises(NoStepError, match="nothing was recorded after it"):
        cr.fit_output_error(driven(1.0 * (np.arange(60) >= 59)))
    with pytest.raises(DataError, match="does not leave its baseline"):
        cr.fit_output_error(driven(1.0 * (np.arange(60) >= 56)))
