"""Planned tests: closed forms of the bound, laws of the plans, predicted and achieved."""

from functools import cache

import numpy as np
import pytest
from scipy.linalg import toeplitz

import ctrl_realize as cr
from benchmarks.experiment.cases import CASES, Case, dead_time, planned, simulated
from ctrl_realize.errors import DataError, OptionError, UnsuitableSystemError
from ctrl_realize.experiment.signals import KINDS, shapes
from ctrl_realize.identification.bound import Bound, Experiment
from ctrl_realize.identification.noise import NoiseModel
from ctrl_realize.numerics.engine.plausible_models import PlausibleModel

GAIN, LAG, DEAD_TIME, SIGMA = 2.0, 10.0, 3.0, 0.01
WHITE = NoiseModel(np.empty(0), SIGMA, 0.1)
FIRST_ORDER = PlausibleModel(DEAD_TIME, np.array([-1 / LAG + 0j]), np.array([GAIN / LAG]))
LEVEL = cr.design.ProcessModel(gain=0.2, lag=0.0, dead_time=3.0, integrating=True)
FLOW = cr.design.ProcessModel(gain=1.2, lag=3.0, dead_time=2.0)
ASKED = {"time": 60.0, "amplitude": 5.0, "rate": 5.0, "noise": 0.1}


ONE_STEP = Case("first order", 0.0, best=False, way="given")
PLAN = planned(ONE_STEP)


@cache
def of_one_step():
    """Plan from one record of a step."""
    return cr.experiment.plan(simulated(ONE_STEP, PLAN, 0), structures=[(1, 1)])


def error(signal, dt, wanted="dead_time", noise=WHITE, model=FIRST_ORDER):
    bound = Bound(model, dt)
    return bound.errors([Experiment(signal, noise)], bound.gradient([wanted]))[0]


def one_step(rest, count, height=1.0):
    return np.concatenate([np.zeros(rest), np.full(count, height)])


def test_dead_time_of_a_first_order_step_response_sampled_densely():
    # With x = t / T, the slopes by dead time, by the lag and by the gain are K/T exp(-x), K/T x
    # exp(-x) and 1 - exp(-x); the level is known from a long rest. Projections by integrals over
    # 0...X, in units of the samples T / dt.
    reach = 12.0
    x = np.linspace(0, reach, 400_001)
    late, lag, gain = np.exp(-x), x * np.exp(-x), -np.expm1(-x)
    rows = np.stack([late, lag, gain])
    gram = np.trapezoid(rows[:, None] * rows[None], x, axis=2)
    alone = gram[0, 0] - gram[0, 1:] @ np.linalg.solve(gram[1:, 1:], gram[1:, 0])
    dt = 0.005
    expected = SIGMA * LAG / GAIN / np.sqrt(alone * LAG / dt)
    signal = one_step(100_000, round((reach * LAG + DEAD_TIME) / dt))
    assert error(signal, dt) == pytest.approx(expected, rel=0.01)


def test_gain_in_coloured_noise_has_the_error_of_a_mean():
    # A settled response between two long rests: the difference of two means, of which that of AR(1)
    # noise has the variance sigma_w^2 / (n (1 - a)^2).
    pole, rest, count = 0.8, 20_000, 20_000
    noise = NoiseModel(np.array([pole]), SIGMA, 1.0)
    found = error(one_step(rest, count), 1.0, "gain", noise)
    expected = SIGMA / (1 - pole) * np.sqrt(1 / rest + 1 / count)
    assert found == pytest.approx(expected, rel=0.01)
    assert noise.sigma == pytest.approx(SIGMA / np.sqrt(1 - pole**2))


def test_twice_the_amplitude_halves_the_error():
    single, double = (error(one_step(100, 900, height), 0.1) for height in (1.0, 2.0))
    assert single / double == pytest.approx(2.0)


@pytest.mark.parametrize("count", [4, 9])
def test_error_falls_with_the_root_of_repeated_settled_steps(count):
    hold = 1200
    many = np.concatenate([np.zeros(hold), *([k % 2] * hold for k in range(1, count + 1))])
    # The first step is seen after rest, as all others after a settled response.
    ratio = error(one_step(hold, hold), 0.1) / error(many.astype(float), 0.1)
    assert ratio == pytest.approx(np.sqrt(count), rel=0.03)


def test_information_of_tests_adds_up():
    bound = Bound(FIRST_ORDER, 0.1)
    test, gradient = (
        Experiment(one_step(300, 900), WHITE),
        bound.gradient(["dead_time", "gain", "Ms"]),
    )
    once, thrice = (bound.errors([test] * count, gradient) for count in (1, 3))
    np.testing.assert_allclose(once / thrice, np.sqrt(3), rtol=1e-6)


def test_phase_of_a_dead_time_alone_and_ms_are_their_derivatives():
    gradient = Bound(FIRST_ORDER, 0.1).gradient(["dead_time", "gain", "phase", "Ms"])
    # By dead time, logarithm of the pole, numerator: K = b / p.
    np.testing.assert_allclose(gradient[0], [1, 0, 0], atol=1e-9)
    np.testing.assert_allclose(gradient[1], [0, -GAIN, LAG], rtol=1e-6)
    assert gradient[2, 0] < 0 == pytest.approx(gradient[2, 2], abs=1e-6)
    assert gradient[3, 0] > 0  # more dead time, more sensitivity


@pytest.mark.parametrize("returns", [False, True])
def test_signals_keep_their_limits_and_come_back(returns):
    found = list(shapes(701, 30.0, returns=returns))
    assert {kind for kind, _, _ in found} - {"one step", "up and down"} == set(KINDS)
    for kind, number, signal in found:
        assert signal.size == 701
        assert np.abs(signal).max() <= 1 + 1e-12
        if returns:
            assert signal.sum() == pytest.approx(0, abs=1e-9), (kind, number)


def test_crest_factor_of_the_multisine_is_that_of_good_phases():
    signal = KINDS["multisine"][0](1024, 32)
    assert np.abs(signal).max() / np.sqrt(np.mean(signal**2)) < 1.55  # Schroeder's: 1.7
    power = np.abs(np.fft.rfft(signal)) ** 2
    assert np.ptp(power[1:33]) < 1e-9 * power.max() > power[33:].max() * 1e9


def test_plan_is_better_than_one_step_as_the_issue_of_signals_says():
    plan = cr.experiment.plan(FLOW, **{**ASKED, "time": 120.0})
    errors = plan.table["better than one step"]
    # Four settled steps have twice the root of one; a random binary signal has many more changes.
    four = error_of_steps(plan, 4)
    assert 1.8 < plan.step.std / four < 2.1
    assert errors["random binary"] > 3.8


def error_of_steps(plan, count):
    rest = int(np.flatnonzero(plan.command)[0])
    hold = (plan.time.size - rest) // count
    up = (np.arange(plan.time.size - rest) // hold + 1) % 2
    bound = Bound(plan.model, plan.dt)
    test = Experiment(np.concatenate([np.zeros(rest), 5.0 * up]), plan.noise)
    return bound.errors([test], bound.gradient(["dead_time"]))[0]


@pytest.mark.parametrize("want", ["dead_time", "gain", "phase", "Ms"])
def test_plan_ranks_all_candidates(want, tmp_path):
    plan = cr.experiment.plan(FLOW, want=want, level=40.0, **ASKED)
    scores = [one.score for one in plan.candidates]
    assert scores[1:] == sorted(scores[1:])
    assert scores[0] <= 1.05 * min(scores)
    assert {*plan.table.index} == {
        "one step", "steps", "3-2-1-1", "random binary", "multisine", "chirp", "relay"
    }  # fmt: skip
    assert plan.command.min() >= 40
    assert plan.command.max() <= 45
    assert plan.command[0] == 40
    np.testing.assert_array_equal(plan.command, 40 + plan.chosen.input)
    written = np.loadtxt(plan.to_csv(tmp_path / "plan.csv"), delimiter=",", skiprows=1)
    np.testing.assert_allclose(written, np.stack([plan.time, plan.command], axis=1))
    np.testing.assert_array_equal(np.ravel(plan.record(plan.time).input), plan.command)
    assert "standard error" in plan.report()
    # the exported code returns to the level at rest, and a log may run on
    longer = plan.dt * np.arange(plan.time.size + 5)
    np.testing.assert_array_equal(
        np.ravel(plan.record(longer, time=longer).input), [*plan.command, *[40.0] * 5]
    )


def test_longer_tests_tell_more_and_limits_of_the_output_cost():
    plan = cr.experiment.plan(FLOW, **ASKED)
    assert np.all(np.diff(plan.curve.best) < 0)
    assert plan.curve.first is None
    assert plan.curve.best[2] == pytest.approx(plan.std, rel=0.06)
    free = max(one.excursion for one in plan.candidates)
    limited = cr.experiment.plan(FLOW, output_limit=free / 4, **ASKED)
    assert max(one.excursion for one in limited.candidates) <= free / 4 * (1 + 1e-9)
    assert limited.step.std == pytest.approx(4 * plan.step.std * plan.step.excursion / free)


def test_integrating_plant_comes_back():
    plan = cr.experiment.plan(LEVEL, time=60, amplitude=1, rate=2, noise=0.02)
    bound = Bound(plan.model, plan.dt)
    for one in plan.candidates:
        if one.kind != "relay":
            assert one.input.sum() == pytest.approx(0, abs=1e-9)
            held = np.concatenate([one.input, np.zeros(20)])
            assert bound.response(held)[-1] == pytest.approx(0, abs=1e-3 * one.excursion)
    assert plan.step.kind == "up and down"


def test_plan_from_a_record_has_rivals_noise_and_todays_error():
    record = simulated(ONE_STEP, PLAN, 0)
    system = cr.identify(record, structures=[(1, 1)])
    plan, again, fit = of_one_step(), cr.experiment.plan(system), system.fit
    np.testing.assert_array_equal(plan.command, again.command)
    length, error = plan.curve.first
    assert length == pytest.approx(120.0)
    assert error == pytest.approx(fit.std_given_structure, rel=0.1)
    assert plan.noise.sigma == pytest.approx(0.02, rel=0.1)
    one = plan.chosen
    assert one.others[0] <= one.std <= one.others[1]
    assert one.others[0] < one.others[1]
    assert one.together < min(one.std, error)


def test_the_output_keeps_its_limit_on_every_plausible_model():
    rng = np.random.default_rng(3)
    command = ((np.arange(240) >= 20) * 1.0) - (np.arange(240) >= 140)
    plant = cr.design.ProcessModel(gain=2.0, lag=10.0, second_lag=3.0, dead_time=3.03)
    output = plant.system(0.5).simulate(command) + 0.25 * rng.standard_normal(240)
    system = cr.identify(cr.Record(0.5 * np.arange(240), command, output), structures=[(2, 2)])
    plan = cr.experiment.plan(system, output_limit=0.5)
    moved = [
        np.abs(Bound(model, 0.5).response(plan.chosen.input)).max()
        for model in system.fit.plausible_models.models
    ]
    assert len(moved) > 30
    assert max(moved) == pytest.approx(plan.chosen.excursion)
    assert max(moved) <= 0.5 * (1 + 1e-9)


def test_two_step_records_have_the_noise_and_the_information_of_both():
    first, second = (simulated(ONE_STEP, PLAN, seed) for seed in (0, 1))
    alone, both = of_one_step(), cr.experiment.plan([first, second], structures=[(1, 1)])
    assert both.noise.sigma == pytest.approx(0.02, rel=0.15)
    assert both.curve.first[0] == pytest.approx(240.0)
    assert both.curve.first[1] == pytest.approx(alone.curve.first[1] / np.sqrt(2), rel=0.2)


def of_three_records(edges, factors=(1.0, 1.0, 1.0), starts=(0.0, 0.0, 0.0), **options):
    """Plan from three records of a first-order plant, each with its gain and its free response."""
    time = 0.5 * np.arange(200)
    command = np.searchsorted(edges, time, side="right") % 2.0
    plant = cr.design.ProcessModel(gain=2.0, lag=10.0, dead_time=3.03).system(0.5)
    rng = np.random.default_rng(4)
    records = [
        cr.Record(
            time,
            command,
            plant.simulate(gain * command)
            + start * np.exp(-time / 10)
            + 0.03 * rng.standard_normal(time.size),
        )
        for gain, start in zip(factors, starts, strict=True)
    ]
    return cr.experiment.plan(records, time=40.0, structures=[(1, 1)], **options)


@pytest.mark.parametrize("edges", [[60], [20, 50, 75]])
def test_several_records_have_their_noise_with_own_gains_and_free_responses(edges):
    plain = of_three_records(edges)
    moving = of_three_records(edges, starts=(1.0, -1.0, 0.5))
    own = of_three_records(edges, factors=(0.5, 1.0, 2.0), gains="own")
    for plan in (plain, moving, own):
        sigmas = [one.noise.sigma for one in plan.tests]
        assert sigmas == pytest.approx([0.03] * 3, rel=0.2)
        assert np.abs(plan.chosen.input).max() == 1  # as in the records
    # Information grows with the square of the gain: 0.25 + 1 + 4 in place of 3.
    today = plain.curve.first[1]
    assert moving.curve.first[1] == pytest.approx(today, rel=0.1)
    assert own.curve.first[1] == pytest.approx(today * np.sqrt(3 / 5.25), rel=0.1)


def test_rounding_of_a_record_is_noise_of_its_test_too():
    # Both levels are levels of the sensor, whose step is 3.3 and 40 standard deviations.
    step, sigma, time = 0.1, 0.03, 0.5 * np.arange(300)
    plant = cr.design.ProcessModel(gain=2.0, lag=10.0, dead_time=3.03).system(0.5)
    command = (time >= 60) * 1.0
    output = plant.simulate(command) + sigma * np.random.default_rng(6).standard_normal(300)
    still = plant.simulate(command) + (output - plant.simulate(command)) / 12
    plain, coarse, coarsest = (
        cr.experiment.plan(cr.Record(time, command, values), time=40.0, structures=[(1, 1)])
        for values in (output, step * np.round(output / step), step * np.round(still / step))
    )
    expected = np.hypot(sigma, step / np.sqrt(12)) / sigma
    for found in (coarse.noise.sigma / plain.noise.sigma, coarse.std / plain.std):
        assert found == pytest.approx(expected, rel=0.35)
    assert step / np.sqrt(12) <= coarsest.noise.sigma < 2 * step / np.sqrt(12)


@pytest.mark.parametrize(
    ("lag", "seed", "simplest"), [(1e4, 0, "one step"), (1e6, 2, "up and down")]
)
def test_errors_of_static_gains_and_of_slopes_are_not_mixed(lag, seed, simplest):
    # The record does not tell an integrator from a lag of a hundred times its length.
    time = 0.5 * np.arange(240)
    output = 0.02 * lag * -np.expm1(-np.maximum(time - 23.03, 0) / lag)
    output += 0.03 * np.random.default_rng(seed).standard_normal(240)
    system = cr.identify(cr.Record(time, (time >= 20) * 1.0, output), structures=[(1, 1)])
    plan = cr.experiment.plan(system, want="gain", time=40.0, amplitude=(-1, 1))
    assert plan.step.kind == simplest  # as the model integrates or not
    low, high = plan.chosen.others
    assert high < 1e3 * low


def test_noise_of_a_long_record_is_not_that_of_the_means_that_are_fitted():
    count, rng = 6000, np.random.default_rng(5)
    command = np.repeat(rng.standard_normal(10), 600) * (np.arange(count) >= 100)
    plant = cr.design.ProcessModel(gain=2.0, lag=400.0, dead_time=60.2).system(0.5)
    output = plant.simulate(command) + 0.03 * rng.standard_normal(count)
    record = cr.Record(0.5 * np.arange(count), command, output)
    plan = cr.experiment.plan(record, time=1000.0, rate=0.2, structures=[(1, 1)])
    assert plan.noise.sigma == pytest.approx(0.03, rel=0.05)


def test_achieved_beside_predicted():
    case = Case("first order", 0.0, best=True, way="given")
    plan = planned(case)
    found = cr.experiment.achieved(plan, simulated(case, plan, 1), structures=[(1, 1)])
    assert found.ratio == pytest.approx(1.0, abs=0.15)
    assert found.std == pytest.approx(found.fit.std_given_structure, rel=0.35)
    assert found.std_of_all > 0
    assert "predicted standard error" in found.report()
    louder = plan.record(
        np.ravel(simulated(case, plan, 1).output)
        + 0.04 * np.random.default_rng(7).standard_normal(plan.time.size)
    )
    more = cr.experiment.achieved(plan, louder, structures=[(1, 1)])
    assert more.by_noise == pytest.approx(np.sqrt(5), rel=0.15)


def test_what_was_fitted_as_a_loop_has_its_own_error():
    # the pattern of a relay looks like the answer of one: 2.2 times the error, called 1.0 times
    plant = cr.design.ProcessModel(gain=1.2, lag=10.0, second_lag=4.0, dead_time=3.0)
    plan = cr.experiment.plan(plant, time=120, amplitude=5, rate=2, noise=0.05).using("relay")
    output = plant.system(plan.dt).simulate(plan.command - plan.level)
    output += 0.05 * np.random.default_rng(200).standard_normal(output.size)
    found = cr.experiment.achieved(plan, plan.record(output), structures="SOPDT")
    assert found.std >= found.fit.std_given_structure


def test_missing_samples_tell_nothing():
    # Of white noise every fourth sample has a quarter of the information of all.
    command = np.tile(np.repeat([0.0, 1.0], 60), 4)
    plant = cr.design.ProcessModel(gain=2.0, lag=10.0, dead_time=3.03)
    output = plant.system(0.5).simulate(command)
    output += 0.03 * np.random.default_rng(1).standard_normal(480)
    few = np.where(np.arange(480) % 4 == 0, output, np.nan)
    plan = cr.experiment.plan(plant, time=240.0, amplitude=1.0, rate=2.0, noise=0.03)
    whole, quarter = (
        cr.Record(0.5 * np.arange(480), command, values, missing="keep") for values in (output, few)
    )
    found = [cr.experiment.achieved(plan, one, structures=[(1, 1)]) for one in (whole, quarter)]
    assert found[1].std / found[0].std == pytest.approx(2.0, rel=0.15)
    assert found[1].std == pytest.approx(found[1].fit.std_given_structure, rel=0.25)
    assert found[1].by_noise == pytest.approx(1.0, rel=0.2)
    again = cr.experiment.plan(quarter, structures=[(1, 1)])
    assert again.curve.first[1] == pytest.approx(found[1].std)


def test_samples_that_are_seen_are_those_of_a_record_at_their_rate():
    # An input that moves with every other sample, which alone are seen, in coloured noise.
    signal, noise = one_step(300, 900), NoiseModel(np.array([0.7]), SIGMA, 0.1)
    fine = Experiment(np.repeat(signal, 2), noise, np.arange(2400) % 2 == 0, 0.05)
    bound = Bound(FIRST_ORDER, 0.1)
    gradient = bound.gradient(["dead_time", "gain", "Ms"])
    expected = bound.errors([Experiment(signal, noise)], gradient)
    np.testing.assert_allclose(bound.errors([fine], gradient), expected, rtol=1e-6)


def test_irregular_stamps_have_the_error_of_their_fit():
    rng = np.random.default_rng(2)
    time = 0.5 * np.arange(240) + 0.05 * rng.integers(-2, 3, 240)
    time[0] = 0.0
    moves = 30.0 * np.arange(4)
    passed = np.maximum(time[:, None] - moves[1:] - 3.03, 0)
    output = 2.0 * -np.expm1(-passed / 10) @ (-1.0) ** np.arange(3)
    output += 0.03 * rng.standard_normal(240)
    record = cr.Record.from_samples(time, np.arange(4) % 2, output, input_time=moves)
    assert record.sample_time == pytest.approx(10 * record.dt)
    system = cr.identify(record, structures=[(1, 1)])
    errors = {"dead_time": system.fit.std_given_structure}
    errors["gain"] = system.fit.gain_std_given_structure
    for want, expected in errors.items():
        plan = cr.experiment.plan(system, want=want)
        assert plan.dt == pytest.approx(record.sample_time)
        assert plan.curve.first == pytest.approx((120.0, expected), rel=0.25)


def test_a_record_at_another_rate_keeps_its_information():
    record = simulated(ONE_STEP, PLAN, 0)
    plan, twice = (
        of_one_step(),
        cr.experiment.plan(record, rate=4.0, time=40.0, structures=[(1, 1)]),
    )
    assert twice.curve.first == pytest.approx(plan.curve.first)
    assert twice.chosen.together < twice.std


def test_estimates_of_the_benchmark_are_those_of_identify():
    case = Case("first order", 0.0, best=True, way="given")
    record = simulated(case, planned(case), 3)
    expected = cr.identify(record, structures=[(1, 1)]).fit.dead_time
    assert dead_time(case, record) == pytest.approx(expected, rel=1e-9)
    assert max(CASES.values()) == 200


def test_rounding_is_noise_of_a_twelfth_of_its_square():
    asked = {**ASKED, "noise": None}
    rounded = cr.experiment.plan(FLOW, resolution=0.1 * np.sqrt(12), **asked)
    plain = cr.experiment.plan(FLOW, **ASKED)
    assert rounded.std == pytest.approx(plain.std)


@pytest.mark.parametrize("pole", [0.9, -0.5])
def test_rounding_of_coloured_noise_is_white(pole):
    asked = {**ASKED, "noise": 0.02, "noise_pole": pole}
    plan = cr.experiment.plan(FLOW, resolution=0.1, **asked)
    assert plan.noise.sigma == pytest.approx(np.hypot(0.02, 0.1 / np.sqrt(12)), rel=0.01)
    # Generalised least squares with the covariance of the sum.
    covariance = toeplitz(0.02**2 * pole ** np.arange(300.0)) + 0.1**2 / 12 * np.eye(300)
    for one in plan.candidates:
        slopes = np.concatenate(Bound(plan.model, plan.dt).slopes(one.input), axis=1)
        information = slopes.T @ np.linalg.solve(covariance, slopes)
        # The first samples, which have no past, tell nothing by themselves.
        first = plan.noise.coefficients.size
        early = slopes[:first]
        information -= early.T @ np.linalg.solve(covariance[:first, :first], early)
        expected = np.sqrt(np.linalg.inv(information)[0, 0])
        assert one.std == pytest.approx(expected, rel=0.05), one.kind


def test_code_of_a_plan_gives_its_input(tmp_path):
    plan = cr.experiment.plan(FLOW, level=40.0, **ASKED).using("random binary")
    made: dict = {}
    exec(cr.export.to_python(plan, tmp_path / "plan.py").read_text(), made)
    block = made["test_input"]()
    assert block.step(run=False) == 40
    assert [block.step(run=True) for _ in plan.time] == list(plan.command)
    assert block.step(run=True) == 40
    text = cr.export.to_structured_text(plan, tmp_path / "plan.st").read_text()
    assert text.count("IF at >= ") == np.count_nonzero(np.diff(plan.command)) + 1


def test_what_is_refused():
    refused = [
        {"want": "poles"}, {"amplitude": None}, {"rate": None}, {"noise": None}, {"time": 2.0},
        {"time": 1e6}, {"amplitude": 0.0}, {"amplitude": (3, -1)}, {"noise_pole": 1.0},
        {"output_limit": 0.0},
    ]  # fmt: skip
    for change in refused:
        with pytest.raises(OptionError, match=r"expected|choose"):
            cr.experiment.plan(FLOW, **{**ASKED, **change})
    late = cr.design.ProcessModel(gain=1.2, lag=3.0, dead_time=50.0)  # after 20 % of rest
    with pytest.raises(
        OptionError, match="are 300 samples; expected 314 to 20000, for a rest, the"
    ):
        cr.experiment.plan(late, **ASKED)
    # 50 s and their rest, a fifth of the test, are 62.5 s, and two samples more
    with pytest.raises(OptionError, match=r"a lower rate: .* take 62500002, of 20000 at most"):
        cr.experiment.plan(late, **{**ASKED, "rate": 1e6})
    longer = cr.experiment.plan(late, **{**ASKED, "time": 314 / 5})
    assert longer.curve.time.min() == pytest.approx(314 / 5)
    assert longer.step.excursion > 0
    with pytest.raises(DataError, match="expected a Record"):
        cr.experiment.plan("heater.csv", **ASKED)
    twice = PlausibleModel(1.0, np.zeros(2, dtype=complex), np.ones(1))
    with pytest.raises(UnsuitableSystemError, match="integrator"):
        cr.experiment.plan(twice, **ASKED)
    with pytest.raises(UnsuitableSystemError, match="expected records"):
        cr.experiment.plan(FLOW.system(0.2), **ASKED)
    with pytest.raises(OptionError, match="choose one of"):
        cr.experiment.plan(FLOW, **ASKED).using("knock")
    for one_sided in ((0, 5), (-5, 0)):  # the input of an integrating plant has to come back
        with pytest.raises(OptionError, match="integrates"):
            cr.experiment.plan(LEVEL, **{**ASKED, "amplitude": one_sided})
    with pytest.raises(UnsuitableSystemError, match="got output_limits beside a model"):
        cr.experiment.plan(FLOW, **ASKED, output_limits=0.1)


def test_what_an_input_did_before_is_as_unknown_to_a_plan_as_to_a_fit():
    # simulated: a lag behind 3.03 s; Cramer-Rao bound from differences of the exact response
    slow = cr.design.ProcessModel(gain=2.0, lag=10.0, dead_time=3.03)
    plan = cr.experiment.plan(slow, time=120, amplitude=1.0, rate=2, noise=0.02)
    time = plan.time - plan.time[0]

    def response(point, u):
        gain, lag, dead = point
        moves = np.flatnonzero(np.diff(u)) + 1
        since = np.maximum(time[:, None] - time[moves] - dead, 0.0)
        return gain * -np.expm1(-since / lag) @ (u[moves] - u[moves - 1])

    point = np.array([2.0, 10.0, 3.03])
    known = {}
    for one in plan.candidates:
        columns = [
            (response(point + move, one.input) - response(point - move, one.input)) / 2e-5
            for move in 1e-5 * np.eye(3)
        ]
        of_steps = one.kind in {"one step", "steps"}
        past = [] if of_steps else [time, np.exp(-time / 10.0)]
        slopes = np.stack([*columns, time**0, *past], axis=1)
        known[one.kind] = 0.02 * np.sqrt(np.linalg.inv(slopes.T @ slopes)[2, 2])
        assert one.std == pytest.approx(known[one.kind], rel=1e-3), one.kind
    assert len(known) > 3


def test_noise_whose_variance_is_no_number_is_refused():
    with pytest.raises(cr.errors.OptionError, match=r"noise=1e\+300.*that is a number"):
        cr.experiment.plan(LEVEL, time=60, amplitude=1, rate=2, noise=1e300)
