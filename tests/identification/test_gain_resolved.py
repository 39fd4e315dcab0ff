"""A gain and a total delay are stated as well as the record tells them, and designs heed it."""

import re
import warnings

import control as ct
import numpy as np
import pytest

import ctrl_realize as cr
from benchmarks.verdicts.cases import case
from ctrl_realize import report
from ctrl_realize.errors import DataError, UnresolvedWarning, UnsuitableSystemError
from tests import measured
from tests.rigs import codes

GAIN, LAG, DELAY, REST = 5.0, 12.0, 4.0, 150.0


def step(seconds, *, lag=LAG, noise=0.05, seed=0, order=1):
    t = np.arange(REST + seconds)
    u = np.where(t < REST, 0.0, 1.0)
    x = np.maximum(t - REST - DELAY, 0) / lag
    y = GAIN * (-np.expm1(-x) if order == 1 else 1 - (1 + x) * np.exp(-x))
    return cr.Record(t, u, y + noise * np.random.default_rng(seed).standard_normal(t.size))


def warned(design, *given):
    """What a design says of a record that does not resolve what it needs."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", UnresolvedWarning)
        design(*given)
    return " | ".join(str(one.message) for one in caught)


def test_a_gain_far_beyond_the_record_is_not_stated_as_known():
    system = cr.identify(step(100, lag=300.0, noise=0.1))
    fit = system.fit
    low, high = fit.gain_interval
    assert low <= GAIN <= high
    assert high - low > 0.5 * GAIN
    assert "firm" not in dict(fit._rows())["total delay"]
    with pytest.warns(UnresolvedWarning, match="gain"):
        cr.design.margins(system, 0.01)


def sagging(seed, *, rise=0.0):
    """A drive of gain 60 that loses 2 to 8 in a second, after `rise` in the fifth of one before."""
    rng = np.random.default_rng(seed)
    t = np.arange(1200.0) * 1e-3
    x = np.maximum(t - 0.202, 0)
    y = -60 * np.expm1(-x / rng.uniform(0.015, 0.04)) - rng.uniform(2, 8) * x
    y += 5 * rise * np.minimum(t - 0.2, 0) + rng.normal(0, 0.6, t.size)
    return cr.Record(t, np.where(t < 0.2, 0.0, 1.0), y)


@pytest.mark.parametrize(("seed", "rise"), [(1, 0.0), (1, 8.0)])
def test_a_model_extrapolates_no_further_than_the_data_ask(seed, rise):
    # The best fits have gains of -2100 to -7, and one of them follows 40 % of the response.
    record = sagging(seed, rise=rise)
    system = cr.identify(record)
    assert "gain_not_resolved" in codes(system)
    assert 0 < system.fit.gain <= 60
    alone = system.simulate(record.input)
    assert np.std(record.output - alone) < 0.1 * np.std(record.output)


def test_a_free_response_does_not_take_the_place_of_the_response():
    # Rounded to 0.32 K, on again while it cools. A chain of equal lags has a gain of 0.24.
    rng = np.random.default_rng(14)
    gap = int(rng.integers(40, 160))
    u = np.repeat([150.0, 0.0, 150.0], [600, gap + 60, 170])
    slow, fast = rng.uniform(80, 130), rng.uniform(12, 22)
    plant = cr.design.ProcessModel(gain=0.3, lag=slow, second_lag=fast, dead_time=4.0)
    y = 300 + plant.system(1.0).simulate(u)[600 + gap :] + rng.normal(0, 0.1, 230)
    record = cr.Record(np.arange(230.0), u[600 + gap :], np.round(y / 0.32) * 0.32)
    fit = cr.identify(record).fit
    assert fit.gain == pytest.approx(0.3, rel=0.05)
    assert fit.delay == pytest.approx(4.0, abs=1.0)


@pytest.fixture(scope="module")
def unknown():
    """A response that dies away again: its gain is nothing."""
    t = np.arange(330.0)
    u = np.where(t < 30, 0.0, 1.0)
    x = np.maximum(t - 34, 0)
    y = np.exp(-x / 40) - np.exp(-x / 8)
    noise = 0.01 * np.random.default_rng(0).standard_normal(t.size)
    return cr.identify(cr.Record(t, u, y + noise))


def test_a_gain_whose_sign_is_not_told_is_called_so(unknown):
    assert "gain_not_resolved" in codes(unknown)
    low, high = unknown.fit.gain_interval
    assert low < 0 < high
    verdict = report.verdict_of(unknown)
    assert verdict.level == "poor"
    assert "not determined" in verdict.headline
    assert "neither the gain nor its sign" in verdict.reasons[0]


@pytest.mark.parametrize(
    "design",
    [
        cr.design.pid,
        cr.design.compare_pid,
        cr.design.ultimate,
        lambda plant: cr.design.smith_predictor(plant, 0.1),
        lambda plant: cr.design.predictor_lqr(plant, 1.0, 1.0),
        lambda plant: cr.design.lqg(plant, 1.0, 1.0, 1.0, 1.0),
    ],
)
def test_no_controller_is_designed_for_a_gain_of_unknown_sign(unknown, design):
    with pytest.raises(UnsuitableSystemError, match="sign of the gain"):
        design(unknown)


def test_structures_that_differ_in_gain_are_warned_of_and_refuse_no_design():
    """Little of two equal lags is seen: the sign of the gain is told, and not much more."""
    record = step(30, order=2, noise=0.02, seed=1)
    system = cr.fit_output_error(record, structures=[(1, 1), (2, 2), (2, 1), (3, 3)])
    told = [str(flag) for flag in system.fit.flags if flag.code == "gain_not_resolved"]
    assert len(told) == 1
    assert system.fit.gain_interval[0] > 0
    assert report.verdict_of(system).level == "caution"
    assert "does not determine the gain:" in warned(cr.design.pid, system, "amigo")


def test_a_predictor_warns_of_a_dead_time_that_may_be_none():
    t = np.arange(200.0)
    u = np.where(t < 50, 0.0, 1.0)
    y = np.where(t < 50, 0.0, -np.expm1(-np.maximum(t - 50, 0) / 10))
    noise = 0.01 * np.random.default_rng(0).standard_normal(t.size)
    system = cr.identify(cr.Record(t, u, y + noise), structures=[(1, 1)])
    assert "no_delay_resolved" in codes(system)
    assert "a dead time to predict over" in warned(cr.design.predictor_lqr, system, 1.0, 1.0)
    cr.design.margins(system, 0.01)  # relies on no dead time


def held_by_a_controller(pole, n=420):
    rng = np.random.default_rng(0)
    target = np.repeat(rng.choice([-1.0, 0.0, 1.0], n // 60), 60)
    u, y, state = np.zeros(n), np.zeros(n), 0.0
    for k in range(n):
        y[k] = state + 0.02 * rng.standard_normal()
        u[k] = 2 * (target[k] - y[k])
        state = pole * state + 0.05 * (u[k - 2] if k >= 2 else 0.0)
    return cr.Record(0.1 * np.arange(n), u, y)


@pytest.mark.parametrize(
    "fit",
    [
        lambda record: cr.fit_output_error(record),
        lambda record: cr.fit_state_space(record, 1),
    ],
)
def test_an_unstable_plant_in_a_loop_is_called_so(fit):
    system = fit(held_by_a_controller(1.03, n=300))
    assert "unstable" in codes(system)
    assert report.verdict_of(system).level == "poor"
    assert "whether the plant is stable" in warned(cr.design.margins, system, 0.01)


def test_a_stable_plant_in_a_loop_has_stable_states():
    """As lags it is called stable in the tests of loops."""
    assert "unstable" not in codes(cr.fit_state_space(held_by_a_controller(0.97, n=240), 1))


def test_no_stable_model_of_an_unstable_plant_is_told_why():
    with pytest.raises(DataError, match="unstable plant"):
        cr.fit_output_error(held_by_a_controller(1.03), structures=[(1, 1)])


def test_a_tank_that_fills_after_a_long_rest_is_not_called_unstable():
    t = 0.01 * np.arange(10_000)
    after = np.clip(t - 30.5, 0, None)
    level = 2 * (after - 0.5 * -np.expm1(-after / 0.5))  # a lag of 0.5 s before an integrator
    noise = 0.02 * np.random.default_rng(1).standard_normal(t.size)
    system = cr.identify(cr.Record(t, np.where(t < 30.0, 0.0, 1.0), level + noise))
    assert "integrating" in codes(system)
    assert "unstable" not in codes(system)
    low, high = system.fit.interval
    assert low <= 0.5 <= high


def test_analyses_warn_and_a_saved_model_still_says_what_is_not_resolved(unknown, tmp_path):
    with pytest.warns(UnresolvedWarning, match="the gain and its sign"):
        cr.design.margins(unknown, 0.01)
    cr.save_model(tmp_path / "model.json", unknown)
    with pytest.raises(UnsuitableSystemError, match="sign of the gain"):
        cr.design.pid(cr.load_model(tmp_path / "model.json"))


def test_the_gas_furnace_has_the_gain_of_box_and_jenkins():
    record = measured.record("gas_furnace/record")
    fit = cr.fit_output_error(record, structures=[(1, 1), (2, 2), (2, 1)]).fit
    low, high = fit.gain_interval
    # (0.53 + 0.37 + 0.51) / (1 - 0.57) = 3.28, negative
    assert low <= -3.28 <= high


def losing_its_gain():
    """The gain falls to a half during the record: no model leaves white noise."""
    rng = np.random.default_rng(0)
    u = np.repeat(rng.choice([-1.0, 1.0], 40), 15)
    y = cr.design.ProcessModel(gain=2.0, lag=30.0, dead_time=8.0).system(1.0).simulate(u)
    y = y * np.linspace(1, 0.5, u.size) + 0.005 * rng.standard_normal(u.size)
    return cr.Record(np.arange(u.size) * 1.0, u, y)


def test_a_gain_that_changes_is_no_integrator():
    system = cr.identify(losing_its_gain())
    assert "time_varying" in codes(system)
    assert system.fit.gain == pytest.approx(1.5, abs=0.15)  # the mean of 2 and 1
    assert system.fit.interval[0] <= 8.0 <= system.fit.interval[1]


def test_the_slope_of_a_structure_that_integrates_is_no_gain_of_others():
    # two steps, of which a third structure makes lags and a slope of 7e-5 per second
    rng, t = np.random.default_rng(22), np.arange(400.0)
    long, short = rng.uniform(8, 20), rng.uniform(3, 7)
    y = np.zeros(t.size)
    for start in (50.0, 200.0):
        x = np.maximum(t - start - 8.3, 0.0)
        lags = long * np.exp(-x / long) - short * np.exp(-x / short)
        y += 1.9 * (1 - lags / (long - short))
    u = (t >= 50) * 1.0 + (t >= 200) * 1.0
    record = cr.Record(t, u, y + 0.019 * rng.standard_normal(t.size))
    fit = cr.identify(record, structures=[(1, 1), (2, 2), (2, 1), (3, 3), (3, 2)]).fit
    assert fit.gain_interval == pytest.approx((1.9, 1.9), rel=0.005)


def test_a_lag_in_place_of_an_integrator_has_the_error_of_a_gain():
    # that of the slope is 1.6e-6, of a gain that is off by 0.012
    plant = cr.bench.heater()
    fit = cr.fit_output_error(plant.step_record(20, rng=0)).fit
    low, high = fit.gain_interval
    assert low <= 0.9 <= high


def test_structures_that_differ_in_gain_are_named_under_a_coloured_residual():
    # with equal weights: a noise model settles it
    system = cr.identify(losing_its_gain(), structures=[(1, 1), (2, 1)], noise="white")
    assert {"coloured_residual", "gain_not_resolved"} <= codes(system)
    told = next(flag.message for flag in system.fit.flags if flag.code == "gain_not_resolved")
    assert "structures that the data cannot rule out have gains of" in told


def test_gains_of_structures_that_the_interval_does_not_hold_are_said_to_be_beyond_it():
    """Beside a gain of `at least 24.7` stood gains of -7.1 to 24.7, without a word."""
    coloured = cr.identify(losing_its_gain(), structures=[(1, 1), (2, 1)], noise="white")
    for fit in (cr.identify(sagging(1)).fit, coloured.fit):
        told = next(str(flag) for flag in fit.flags if flag.code == "gain_not_resolved")
        low, high = map(float, re.search(r"gains of (\S+) to (\S+) ", told).groups())
        # to the three digits that are written
        beyond = low < fit.gain_interval[0] - 1e-3 * abs(low) or high > 1.001 * fit.gain_interval[1]
        assert ("(more than its interval holds)" in told) == beyond


@pytest.mark.parametrize("moves", [[30.0], [30.0, 70.0, 110.0, 190.0]])
def test_a_washout_has_no_total_delay(moves):
    # s / (20 s + 1): the gain is zero, and the delay at zero frequency a ratio with it
    time = 0.5 * np.arange(600)
    rng = np.random.default_rng(1)
    u, y = np.zeros(time.size), 0.01 * rng.standard_normal(time.size)
    for height, at in zip([1.0, -1.0, 1.0, -1.0], moves, strict=False):
        late = time - at - 3.0
        u += height * (time >= at)
        y += height * np.where(late >= 0, np.exp(-np.maximum(late, 0) / 20.0), 0.0)
    fit = cr.identify(cr.Record(time, u, y)).fit
    assert fit.gain_interval[0] < 0 < fit.gain_interval[1]
    assert fit.total_delay_interval[1] == np.inf
    assert "total delay         not determined" in fit.report()


@pytest.mark.parametrize("kind", ["rising at its end", "clipped"])
def test_an_integrator_that_may_be_a_lag_leaves_the_gain_open(kind):
    """It was the slope of an integrator, -0.052 and -0.028 per second, for -2.04 and -1.67."""
    one = case(kind, 115)
    fit = cr.fit_output_error(one.record).fit
    assert fit.integrators == 0
    assert fit.gain_interval[0] <= one.plant.gain <= fit.gain_interval[1]
    assert fit.verdicts[1].level == "no"


def test_a_total_delay_of_either_sign_is_no_number():
    """A lag of 5 s before one of 3000 s, of which the record shows a tenth."""
    t = np.arange(300.0)
    u = np.where(t < 30, 0.0, 1.0)
    plant = ct.tf([1.0], [5, 1]) + ct.tf([5.0], [3000, 1])
    exact = cr.delayed_ss(plant, dead_time=4.0, dt=1.0).simulate(u)
    said = {}
    for seed, noise in ((0, 0.01), (3, 0.01), (0, 0.001)):
        y = exact + noise * np.random.default_rng(seed).standard_normal(t.size)
        fit = cr.identify(cr.Record(t, u, y), structures=[(2, 1)]).fit
        row = next(r for r in fit.report().splitlines() if r.startswith("  total delay"))
        low, high = fit.total_delay_interval
        said[low < 0 < high] = row
        assert ("not determined" in row) == (low < 0 < high or high == np.inf), row
    assert re.search(r"not determined \(-\d+ to \d+ s\)", said[True])
    assert "dead time plus lags" in said[False]
