"""Valve tests on simulated valves whose metrics are known in closed form."""

import pickle
import warnings

import numpy as np
import pytest
from scipy.signal import lfilter

import ctrl_realize as cr
from ctrl_realize import valves
from ctrl_realize.errors import DataError, NoStepError, OptionError

DT, DEAD_TIME, LAG = 0.05, 0.25, 0.3
PERCENT = {"u": "%", "y": "%"}
QUICK = {"fit": False}


def command_of(levels, hold, dt=DT):
    holds = np.broadcast_to(hold, np.shape(levels))
    return np.concatenate(
        [np.full(round(h / dt), float(u)) for u, h in zip(levels, holds, strict=True)]
    )


def stairs(step=0.25, count=8, middle=50.0):
    way = np.repeat([step, -step, step, -step], [count, 2 * count, 2 * count, count])
    return middle + np.r_[0, np.cumsum(way)]


def stem_of(command, *, dt=DT, dead_time=DEAD_TIME, lag=LAG):
    """First-order lag behind a dead time of whole samples, for a command that is held."""
    late = np.r_[np.full(round(dead_time / dt), command[0]), command][: command.size]
    decay = np.exp(-dt / lag)
    return command[0] + lfilter([0, 1 - decay], [1, -decay], late - command[0])


def record_of(command, moved, noise, seed, *, dt=DT, **options):
    measured = stem_of(moved, dt=dt, **options)
    measured = measured + noise * np.random.default_rng(seed).standard_normal(command.size)
    return cr.Record(dt * np.arange(command.size), command, measured, units=PERCENT)


def held(found, truth):
    return found.low - 1e-9 <= truth <= found.high + 1e-9


def test_times_of_a_lag_behind_a_dead_time_are_those_of_the_closed_form():
    command = command_of([50, 52, 50, 60, 50] * 3, 4.0, 0.02)
    dead_time = 0.26
    truth = {
        "dead_time": dead_time, "t63": dead_time + LAG, "t86": dead_time + 2 * LAG,
        "t98": dead_time - LAG * np.log(0.02), "overshoot": 0.0, "gain": 1.0,
    }  # fmt: skip
    hits: dict[str, list[bool]] = {key: [] for key in truth}
    for seed in range(12):
        record = record_of(command, command, 0.04, seed, dt=0.02, dead_time=dead_time)
        report = valves.valve_report(record, **QUICK)
        assert [one.count for one in report.groups] == [3, 3, 3, 3]
        for group in report.groups:
            assert group.estimates["t86"].value == pytest.approx(truth["t86"], rel=0.05)
            for key, value in truth.items():
                if group.estimates[key].is_known:
                    hits[key].append(held(group.estimates[key], value))
    # 48 intervals of 95 %: fewer than 40 hold with a probability below 1e-3
    for key, each in hits.items():
        assert np.mean(each) > 0.83, key
        assert len(each) > 40, key


def test_a_limited_rate_gives_stroke_times_and_is_told_as_such():
    command = command_of([50, 52, 50, 60, 50, 0, 100, 0, 50], [5, 5, 5, 5, 5, 9, 9, 9, 9])
    moved = cr.actuators.SlewRateLimit(20.0, 25.0).simulate(command, DT)
    report = valves.valve_report(record_of(command, moved, 0.02, 1), **QUICK)
    for way, rate in (("opening", 20.0), ("closing", 25.0)):
        slew = report.metric(f"slew_rate_{way}")
        assert slew.interval.value == pytest.approx(rate, rel=0.01)
        assert "the rate is limited" in slew.where
        # at the end of the motion the stem is behind by lag x rate; steps of a held motion are
        # half a sample late, the first of them comes one sample early
        truth = DEAD_TIME + 100 / rate - DT / 2 + LAG * np.log(LAG * rate / 2)
        found = report.metric(f"stroke_time_{way}").interval.value
        assert found == pytest.approx(truth, abs=0.01)
    table = report.table().set_index(["size", "direction"])["t86"].unstack().sort_index()
    assert (table.diff().dropna() > 0).all(axis=None)


@pytest.mark.parametrize(
    ("limit", "judgement"),
    [((20, None), "cannot tell"), ((5, None), "met"), (50, "cannot tell"), (5, "not met")],
)
def test_a_rate_that_a_lag_hides_is_a_lower_bound(limit, judgement):
    """The 7.3 %/s of a lag of 0.5 s made 100 %/s miss a limit of 20, and meet one of 50 %/s."""
    command = command_of([50, 60, 50, 60, 50], 6.0)
    moved = cr.actuators.SlewRateLimit(100.0).simulate(command, DT)
    record = record_of(command, moved, 0.03, 0, lag=0.5)
    report = valves.valve_report(record, limits={"slew_rate_opening": limit}, **QUICK)
    rate = report.metric("slew_rate_opening")
    assert rate.judgement == judgement
    assert held(rate.interval, 100.0)
    assert rate.definition.name in report.missing_tests["full strokes in both directions"]
    assert f"at least {rate.interval.low:.4g} %/s" in report.report()


@pytest.mark.parametrize("width", [0.0, 0.6])
def test_the_interval_of_the_dead_band_holds_a_backlash(width):
    command = command_of(stairs(), 4.0)
    moved = cr.actuators.Backlash(width).simulate(command) if width else command
    hits = []
    for seed in range(12):
        report = valves.valve_report(record_of(command, moved, 0.05, seed), **QUICK)
        band = report.metric("dead_band").interval
        assert band.value == pytest.approx(width, abs=0.02)
        hits.append(held(band, width))
        assert held(report.metric("resolution").interval, 0.0)
        assert held(report.metric("backlash").interval, width)
    # fewer than 9 of 12 intervals of 95 % hold: 2e-3
    assert sum(hits) >= 9


@pytest.mark.parametrize(("S", "J"), [(2.0, 0.6), (1.1, 1.1)])
def test_a_stem_that_sticks_has_the_dead_band_and_the_resolution_of_its_model(S, J):
    command = command_of(stairs(), 4.0)
    moved = cr.actuators.KanoStiction(S=S, J=J).simulate(command)
    report = valves.valve_report(record_of(command, moved, 0.02, 3), **QUICK)
    band, resolution = report.metric("dead_band").interval, report.metric("resolution").interval
    assert held(band, S)
    assert band.high - band.low <= 0.5 + 1e-9
    assert held(resolution, J)
    assert resolution.high - resolution.low <= 0.25 + 1e-9
    assert held(report.metric("backlash").interval, S - J)
    assert any(flag.code == "did_not_move" for flag in report.flags)


@pytest.mark.parametrize(("S", "J"), [(1.2, 0.2), (0.7, 0.2), (0.6, 0.15)])
def test_a_slip_jump_below_a_stair_is_part_of_the_dead_band(S, J):
    """The levels are those of a play of S - J: 0.996 to 1.001 % was said of 1.2 %."""
    command = command_of(stairs(), 4.0)
    moved = cr.actuators.KanoStiction(S=S, J=J).simulate(command)
    record = record_of(command, moved, 0.02, 1)
    report = valves.valve_report(record, limits={"dead_band": S - 0.05}, **QUICK)
    band = report.metric("dead_band")
    assert held(band.interval, S)
    assert band.interval.high - band.interval.low < 0.26
    assert band.judgement == "cannot tell"
    assert held(report.metric("backlash").interval, S - J)


@pytest.mark.parametrize("noise", [0.015, 0.03, 0.05])
def test_steps_that_noise_hides_have_no_dead_time(noise):
    # with 0.03 % it was 0.45 s for steps of 0.25 %, friction with p = 1e-127
    levels = [*stairs(count=4), 52, 50, 52, 50, 60, 50, 60, 50]
    command = command_of(levels, 4.0)
    report = valves.valve_report(record_of(command, command, noise, 2), **QUICK)
    assert held(report.metric("dead_time").interval, DEAD_TIME)
    assert "dead_time_varies" not in {flag.code for flag in report.flags}


@pytest.mark.parametrize("rate", [10.0, np.inf])
def test_a_ramp_tells_the_dead_band_of_a_stem_that_sticks_to_its_reversal(rate):
    """It slides nearer to the command than it waits: S - J was called the dead band, and met."""
    S, J = 3.0, 1.0
    steps = command_of([50, 55, 50, 60, 50], 5.0)
    ramp = np.interp(DT * np.arange(8400), [0, 10, 200, 210, 400, 420], [50, 0, 100, 100, 0, 0])
    command = np.concatenate([steps, ramp])
    slewed = cr.actuators.SlewRateLimit(rate).simulate(command, DT) if rate < 100 else command
    moved = cr.actuators.KanoStiction(S=S, J=J).simulate(slewed)
    record = record_of(command, moved, 0.03, 1)
    band = valves.valve_report(record, limits={"dead_band": 2.5}, **QUICK).metric("dead_band")
    assert held(band.interval, S)
    assert band.interval.low <= S - J + 0.05
    assert band.judgement == "cannot tell"


def test_hysteresis_and_linearity_of_a_slow_ramp_are_those_of_its_curve():
    u = np.interp(np.arange(6000), [0, 200, 2900, 3100, 5800, 6000], [0, 0, 100, 100, 0, 0])
    bend, wide = 3.0, 4.0
    # up: below the line by the bend; the branches are apart by a dead band of 1 and a loop of 4
    way = np.sign(np.gradient(u))
    loop = 0.5 + wide * (u / 100) * (1 - u / 100) / 0.5
    y = u + bend * 4 * (u / 100) * (1 - u / 100) - way * 0.5 * loop
    noisy = y + 0.05 * np.random.default_rng(0).standard_normal(u.size)
    report = valves.valve_report(cr.Record(0.5 * np.arange(u.size), u, noisy, units=PERCENT))
    x = report.curve.command
    curve = x + bend * 4 * (x / 100) * (1 - x / 100)
    line = np.polyval(np.polyfit(x, curve, 1), x)
    linearity = report.metric("linearity").interval
    assert linearity.value == pytest.approx(np.abs(curve - line).max(), rel=0.06)
    apart = 0.5 + wide * 0.5
    band = report.metric("dead_band").interval
    assert report.metric("hysteresis").interval.value == pytest.approx(apart - band.value, abs=0.1)
    assert report.curve.origin == "ramp"


def test_a_ramp_without_steps_tells_the_dead_band_from_zero_on_as_its_lag_is_unknown():
    """Twice the slope times dead time and lag was a dead band of 1.085 to 1.089 % without play."""
    command = np.interp(DT * np.arange(5600), [0, 20, 140, 150, 270], [0, 0, 100, 100, 0])
    record = record_of(command, command, 0.02, 1)
    band = valves.valve_report(record, limits={"dead_band": 0.5}, **QUICK).metric("dead_band")
    lagged = 2 * (DEAD_TIME + LAG) * 100 / 120
    assert band.interval.low == 0
    assert band.interval.high == pytest.approx(lagged, rel=0.06)
    assert band.judgement == "cannot tell"
    assert "lag" in band.where
    steps = command_of([0, 5, 0, 5, 0], 5.0)
    both = record_of(np.r_[steps, command], np.r_[steps, command], 0.02, 1)
    assert valves.valve_report(both, **QUICK).metric("dead_band").interval.high < 0.05


@pytest.mark.parametrize("width", [0.0, 0.8])
def test_a_limited_rate_before_a_lag_leaves_dead_band_and_hysteresis_of_a_ramp(width):
    """The line through the delays of all sizes was 29 ms short: 0.082 to 0.087 % without play."""
    steps = command_of([50, 52, 50, 60, 50, 60, 50, 0], [5] * 7 + [8])
    ramp = np.interp(DT * np.arange(2600), [0, 60, 65, 125], [0, 100, 100, 0])
    command = np.r_[steps, ramp]
    moved = cr.actuators.SlewRateLimit(25.0).simulate(command, DT)
    moved = cr.actuators.Backlash(width).simulate(moved) if width else moved
    report = valves.valve_report(record_of(command, moved, 0.02, 0, lag=0.4), **QUICK)
    assert held(report.metric("dead_band").interval, width)
    assert report.metric("dead_band").interval.high < width + 0.1
    assert held(report.metric("hysteresis").interval, 0.0)


def test_linearity_of_a_ramp_names_its_range_and_has_the_error_of_noise_and_of_its_points():
    """1.4254 with an interval of zero width; over the range of the curve it is 1.554."""
    t = 0.1 * np.arange(12600)
    command = np.interp(t, [0, 20, 620, 630, 1230], [0, 0, 100, 100, 0])
    noise = 0.02 * np.random.default_rng(0).standard_normal(t.size)
    bent = command + 2 * np.sin(2 * np.pi * command / 100) + noise
    report = valves.valve_report(cr.Record(t, command, bent, units=PERCENT), **QUICK)
    x = np.linspace(*report.curve.command[[0, -1]], 2001)
    curve = 2 * np.sin(2 * np.pi * x / 100)
    truth = np.abs(curve - np.polyval(np.polyfit(x, curve, 1), x)).max()
    linearity = report.metric("linearity")
    assert held(linearity.interval, truth)
    assert linearity.interval.high < 1.1 * truth
    assert linearity.where == "6.25 to 93.8 % of the command"
    assert report.curve.std == pytest.approx(0.02 / np.sqrt(150), rel=0.1)


def test_a_worst_case_without_full_strokes_says_so():
    command = command_of([50, 60, 50, 0, 100, 0], 7.0)
    moved = cr.actuators.SlewRateLimit(25.0).simulate(command, DT)
    record = record_of(command, moved, 0.02, 1)
    report = valves.valve_report(record, limits={"t86": 3.0}, **QUICK)
    assert report.groups[-1].estimates["t86"].low > 3.0
    assert "without full strokes" in report.verdict
    assert "without full strokes" in report.metric("t86").definition.sentence


def repeated(shape, hold, noise, seed=0, *, height=10.0, dt=0.02, rounding=0.0):
    """Eight steps up and down, each answered by `shape` of the time since the step."""
    size = round(hold / dt)
    t = dt * np.arange(9 * size)
    measured = np.full(t.size, 50.0)
    for k in range(1, 9):
        since = t - k * size * dt
        measured += (
            height * (-1) ** (k + 1) * np.where(since > 0, shape(np.clip(since, 0, None)), 0)
        )
    measured += noise * np.random.default_rng(seed).standard_normal(t.size)
    if rounding:
        measured = np.round(measured / rounding) * rounding
    command = np.repeat(50 + height * (np.arange(9) % 2), size)
    return cr.Record(t, command, measured, units=PERCENT)


def late_lag(t, late=0.3, lag=0.5):
    return 1 - np.exp(-np.clip(t - late, 0, None) / lag)


@pytest.mark.parametrize("hold", [1.5, 2.0, 2.5, 3.0, 4.0])
def test_a_hold_that_ends_while_the_stem_still_moves_makes_wide_intervals_or_none(hold):
    """Of holds of 2.5 s the gain was 0.927 to 0.972, those of 3 s had T98 1.82 to 2.18 s."""
    report = valves.valve_report(repeated(late_lag, hold, 0.02), **QUICK)
    truth = {"gain": 1.0, "t86": 0.3 + 2 * 0.5, "t98": 0.3 - 0.5 * np.log(0.02)}
    for group in report.groups:
        for key, value in truth.items():
            found = group.estimates[key]
            assert not found.is_known or held(found, value), key
        assert group.estimates["t98"].is_known == (hold > 3)
    assert ("not_settled" in {flag.code for flag in report.flags}) == (hold < 3)


def test_a_stem_that_creeps_for_longer_than_its_hold_has_no_t98():
    """It was 2.8 s (2.3 to 3.3 s) for 6.7 s."""
    creep = lambda t: 0.9 * late_lag(t, lag=0.3) + 0.1 * late_lag(t, lag=4.0)  # noqa: E731
    report = valves.valve_report(repeated(creep, 6.0, 0.02), **QUICK)
    for group in report.groups:
        assert not group.estimates["t98"].is_known
        assert held(group.estimates["gain"], 1.0)


@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_rounding_widens_the_times_of_small_steps(noise):
    """Steps of 5 % rounded to 0.1 %: T98 held its truth in 31 of 50, without noise in 0 of 4."""
    truth = 0.3 - 0.5 * np.log(0.02)
    for seed in range(4 if noise else 1):
        record = repeated(late_lag, 6.0, noise, seed, height=5.0, rounding=0.1)
        for group in valves.valve_report(record, **QUICK).groups:
            assert held(group.estimates["t98"], truth)
            assert held(group.estimates["t86"], 0.3 + 2 * 0.5)


@pytest.mark.parametrize("dt", [0.25, 0.1, 0.02])
@pytest.mark.parametrize("late", [0.0, 0.3, 0.45])
def test_first_motion_lies_between_the_sample_before_and_the_one_that_moved(dt, late):
    """With 0.25 s of sampling it was 0.395 to 0.605 s for 0.3 s; without dead time two samples."""
    record = repeated(lambda t: late_lag(t, late), 6.0, 0.02, height=5.0, dt=dt)
    for group in valves.valve_report(record, **QUICK).groups:
        assert held(group.estimates["dead_time"], late)


@pytest.mark.parametrize(
    ("dt", "lag", "late"), [(0.5, 0.3, 0.45), (1.0, 0.3, 1.2), (1.0, 0.8, 0.45), (0.1, 0.3, 0.45)]
)
def test_samples_far_apart_make_intervals_that_hold_the_truth(dt, lag, late):
    """With 0.5 s of sampling T63 was 0.81 to 0.89 s for 0.75 s, and a limit of 0.80 s not met."""
    record = repeated(lambda t: late_lag(t, late, lag), 20.0, 0.01, dt=dt)
    limits = {"t63": 1.06 * (late + lag), "dead_time": (late, None)}
    report = valves.valve_report(record, limits=limits, **QUICK)
    assert report.level != "poor"
    truth = {"dead_time": late, "t63": late + lag, "t86": late + 2 * lag}
    truth |= {"t98": late - lag * np.log(0.02), "slew_rate": 4 / (lag * np.log(3))}
    for group in report.groups:
        for key, value in truth.items():
            assert held(group.estimates[key], value), key
            one = group.estimates[key]
            assert key == "slew_rate" or one.high - one.low < 2.1 * dt
    (axes,) = np.ravel(cr.plots.valve_plot(report, panel="sizes", metric="slew_rate").axes)
    assert np.isfinite(axes.get_ylim()).all()


def test_close_samples_leave_nothing_open_and_far_ones_hold_at_any_distance():
    """Of T63, T86 and dead time 73, 79 and 85 % held with samples more than a lag apart."""
    rng = np.random.default_rng(0)
    hits: dict[str, list[bool]] = {"t63": [], "t86": [], "dead_time": []}
    for _ in range(60):
        lag, ratio = np.exp(rng.uniform(np.log([0.1, 0.5]), np.log([2.0, 4.0])))
        late, noise, lags = rng.uniform(0, 1.5), rng.uniform(0.01, 0.05), rng.integers(1, 3)
        shape = lambda t: late_lag(t, late, lag) ** lags  # noqa: B023, E731
        hold = max(late + 12 * lag, 40 * ratio * lag)
        record = repeated(shape, hold, noise, rng, dt=ratio * lag)
        for group in valves.valve_report(record, **QUICK).groups:
            for key, left in (("dead_time", 0), ("t63", 1), ("t86", 2)):
                true = late - lag * np.log(1 - (1 - np.exp(-left)) ** (1 / lags))
                hits[key].append(held(group.estimates[key], true))
    # fewer than 52 of 60 intervals of 95 % hold: 5e-3
    for key, each in hits.items():
        assert np.mean(each) > 52 / 60, key
    close = valves.valve_report(repeated(late_lag, 8.0, 0.02, dt=0.01), **QUICK)
    for step in close.steps:
        assert [step.sampling[key] for key in ("t63", "t86", "t98")] == [(0, 0)] * 3


def ringing(t, damping=0.5, omega=4.0):
    ring = np.sqrt(1 - damping**2)
    late = np.clip(t - 0.3, 0, None)
    angle = ring * omega * late
    return 1 - np.exp(-damping * omega * late) * (np.cos(angle) + damping / ring * np.sin(angle))


@pytest.mark.parametrize(("damping", "noise"), [(0.5, 0.02), (0.5, 0.05), (0.3, 0.05), (0.7, 0.05)])
def test_noise_makes_no_overshoot_larger(damping, noise):
    """The largest noisy sample was 16.84 % for 16.30 %, and held in 54 of 100."""
    truth = 100 * np.exp(-np.pi * damping / np.sqrt(1 - damping**2))
    hits = []
    for seed in range(4):
        record = repeated(lambda t: ringing(t, damping), 8.0, noise, seed)
        found = [one.estimates["overshoot"] for one in valves.valve_report(record, **QUICK).groups]
        assert [one.value for one in found] == pytest.approx([truth] * 2, abs=20 * noise)
        hits += [held(one, truth) for one in found]
    # fewer than 6 of 8 intervals of 95 % hold: 6e-3
    assert sum(hits) >= 6


@pytest.mark.parametrize(("dt", "lag", "dead_time"), [(0.1, 2.0, 1.0), (0.01, 0.3, 0.2)])
def test_the_noise_of_many_small_steps_is_no_overshoot(dt, lag, dead_time):
    # in 16 of 20 and 7 of 10 such tests the interval of the worst of 67 steps began above 0
    plan = valves.valve_test_plan(dead_time=dead_time, time_constant=lag, dt=dt)
    stem = stem_of(plan.command, dt=dt, dead_time=dead_time, lag=lag)
    for seed in range(4):
        noisy = stem + 0.03 * np.random.default_rng(seed).standard_normal(stem.size)
        result = plan.evaluate(plan.record(noisy, units={"u": "%", "y": "%"}), fit=False)
        assert result.metric("overshoot").interval.low == 0.0


def test_the_interval_of_a_settling_time_lies_within_the_hold():
    """One error of 27 s beside three of 0.3 s made 2.3 s (-10.9 to 15.5 s)."""
    report = valves.valve_report(repeated(ringing, 8.0, 0.05), **QUICK)
    t = np.arange(0, 8, 1e-3)
    truth = t[np.abs(ringing(t) - 1) > 0.02][-1]
    for group in report.groups:
        found = group.estimates["settling_time"]
        assert 0 <= found.low <= found.high <= 8
        assert held(found, truth)


def test_small_steps_of_a_sticking_valve_are_late_in_table_and_flag_and_the_fit_agrees():
    levels = [50, 52, 50, 52, 50, 60, 50, 60, 50]
    command = command_of(levels, 6.0)
    moved = stem_of(command, dead_time=0.0, lag=0.4)
    moved = cr.actuators.Backlash(1.0).simulate(moved)
    report = valves.valve_report(record_of(command, moved, 0.01, 1), **QUICK)
    late, early = (
        next(one for one in report.groups if round(one.size) == size and one.direction == "closing")
        for size in (2, 10)
    )
    assert late.estimates["dead_time"].low > early.estimates["dead_time"].high
    assert late.estimates["gain"].value < 0.7 < early.estimates["gain"].value
    assert "dead_time_varies" in {flag.code for flag in report.flags}
    steps = command_of([50, 52, 50, 60, 50], 6.0)
    linear = valves.valve_report(record_of(steps, steps, 0.01, 1))
    assert {flag.code for flag in linear.flags} == set()
    for group in linear.groups:
        assert held(group.fitted_dead_time, DEAD_TIME)
    cut = linear.step_records(smallest=5, direction="opening")
    assert [one.name for one in cut] == ["+10 % at 18 s"]
    assert cr.identify(cut[0], structures=[(1, 1)]).fit.dead_time == pytest.approx(
        DEAD_TIME, abs=0.01
    )


def test_a_valve_of_more_lags_than_three_has_a_fitted_dead_time():
    command = command_of([50, 60], 3.0, 0.02)
    stem = command
    for k in range(5):
        stem = stem_of(stem, dt=0.02, dead_time=0.2 if k == 0 else 0.0, lag=0.12)
    noise = 0.003 * np.random.default_rng(1).standard_normal(stem.size)
    record = cr.Record(0.02 * np.arange(stem.size), command, stem + noise, units=PERCENT)
    (group,) = valves.valve_report(record).groups
    # four of the lags hold an input that moves: half a sample more for each
    assert held(group.fitted_dead_time, 0.2 + 4 * 0.01)
    # the first visible motion of five lags is much later
    assert group.fitted_dead_time.value < group.estimates["dead_time"].value


def test_an_anti_surge_valve_gives_strokes_dead_time_and_overshoot_in_one_call():
    dt, dead_time, damping, omega = 0.01, 0.1, 0.6, 12.0
    levels = [50, 52, 50, 60, 50, 0, 100, 0, 100]
    command = command_of(levels, 3.0, dt)
    t = dt * np.arange(300)
    ring = np.sqrt(1 - damping**2)
    step = 1 - np.exp(-damping * omega * t) * (
        np.cos(ring * omega * t) + damping / ring * np.sin(ring * omega * t)
    )
    shape = np.r_[np.zeros(round(dead_time / dt)), step]
    moves = np.diff(command, prepend=command[0])
    stem = command[0] + np.convolve(moves, np.r_[shape, np.ones(command.size)])[: command.size]
    noise = 0.02 * np.random.default_rng(2).standard_normal(command.size)
    record = cr.Record(dt * np.arange(command.size), command, stem + noise, units=PERCENT)
    report = valves.valve_report(
        record,
        limits={"overshoot": 15, "stroke_time_opening": 2.0, "dead_time": {2: 0.2, 10: 0.05}},
    )
    overshoot = 100 * np.exp(-np.pi * damping / ring)
    for group in report.groups:
        assert group.estimates["overshoot"].value == pytest.approx(overshoot, abs=1.5)
        assert group.estimates["dead_time"].value == pytest.approx(dead_time, abs=0.03)
    ninety_eight = dt * np.argmax(step >= 0.98) + dead_time
    assert report.metric("stroke_time_opening").interval.value == pytest.approx(
        ninety_eight, abs=dt
    )
    by_size = [one.judgement for one in report.metrics if one.where.startswith(("2 %", "10 %"))]
    assert by_size.count("met") >= 2
    assert by_size.count("not met") == 2
    assert report.level == "poor"
    assert "dead time" in report.verdict
    assert report.metric("stroke_time_opening").judgement == "met"
    assert any("staircase" in test for test in report.missing_tests)
    again = pickle.loads(pickle.dumps(report))
    assert again.report() == report.report()
    assert not report.steps[0].response.flags.writeable


def test_example_limits_have_a_source_and_judge_a_valve():
    up = np.linspace(0, 100, 1201)
    command = np.r_[command_of(stairs(), 2.0, 0.1), np.r_[up, up[::-1]]]
    for backlash, judgement in ((0.3, "met"), (1.5, "not met")):
        moved = cr.actuators.Backlash(backlash).simulate(command, 0.1)
        record = record_of(command, moved, 0.01, 1, dt=0.1, dead_time=0.3)
        for example in valves.EXAMPLE_LIMITS.values():
            assert example.url.startswith("https://")
            assert "p. " in example.source
            report = valves.valve_report(record, limits=example.limits, **QUICK)
            judged = {one.key: one.judgement for one in report.metrics if one.judgement}
            assert judged.keys() == example.limits.keys()
            assert judged.get("dead_band", judgement) == judgement
            assert judged["linearity"] == "met"


def test_a_plan_is_written_and_its_measured_record_tells_every_metric(tmp_path):
    first = record_of(command_of([50, 55], 5.0), command_of([50, 55], 5.0), 0.02, 1)
    plan = valves.valve_test_plan(first, stroke_time=5.0, repeats=2, ramp_time=100.0, stairs=6)
    written = np.loadtxt(plan.to_csv(tmp_path / "plan.csv"), delimiter=",", skiprows=1)
    np.testing.assert_allclose(written, np.stack([plan.time, plan.command], axis=1), atol=1e-6)
    u, dt = plan.command, plan.dt
    moved = cr.actuators.Backlash(0.6).simulate(cr.actuators.SlewRateLimit(20.0).simulate(u, dt))
    stem = stem_of(moved, dt=dt) + 0.02 * np.random.default_rng(4).standard_normal(u.size)
    record = plan.record(stem, units=PERCENT)
    report = plan.evaluate(record, **QUICK)
    unknown = {one.key for one in report.metrics if not one.interval.is_known}
    assert unknown == {"fitted_dead_time"}
    assert held(report.metric("dead_band").interval, 0.6)
    assert report.metric("linearity").interval.high < 0.1
    kinds = [part.kind for part in report.parts[0]]
    assert kinds.count("stroke") == 2
    assert kinds.count("ramp") == 2
    assert "staircase" in kinds
    part = plan.evaluate(record.between(0, plan.sections[3][2]), **QUICK)
    (flag,) = (flag for flag in part.flags if flag.code == "plan_incomplete")
    assert "strokes, slow ramp" in str(flag)


@pytest.mark.parametrize("seed", range(6))
def test_a_first_step_whose_first_motion_is_hidden_by_noise_gives_a_plan(seed):
    command = command_of([50, 55], [4.0, 6.0])
    plan = valves.valve_test_plan(record_of(command, command, 0.4, seed), stroke_time=5.0)
    # The hold is 2.5 times T98, of which noise of 8 % of the step leaves an upper bound.
    t98 = DEAD_TIME - LAG * np.log(0.02)
    assert t98 < plan.hold / 2.5 < 2 * t98


def test_a_plan_knows_the_command_that_a_record_has_with_noise():
    """With 0.06 % of noise on the command resolution was 0.248 to 0.259 % for 0.6 % in 8 of 19."""
    plan = valves.valve_test_plan(
        dead_time=0.2, time_constant=0.4, stroke_time=2, dt=0.05, sizes=(5,), ramp_time=60
    )
    moved = cr.actuators.KanoStiction(S=1.0, J=0.6).simulate(plan.command)
    clean = record_of(plan.command, moved, 0.02, 0)
    for seed in range(3):
        noise = 0.06 * np.random.default_rng(seed).standard_normal(plan.command.size)
        noisy = cr.Record(plan.time, plan.command + noise, clean.output, units=PERCENT)
        report = plan.evaluate(noisy, **QUICK)
        assert held(report.metric("resolution").interval, 0.6)
        assert any("command is that of the plan" in one for one in report.choices)
        assert report.metric("t86").interval == plan.evaluate(clean, **QUICK).metric("t86").interval
    other = cr.Record(plan.time, np.roll(plan.command, 20), clean.output, units=PERCENT)
    assert not plan.evaluate(other, **QUICK).choices


@pytest.mark.parametrize(("noise", "rounding"), [(0.05, 0.0), (0.0, 0.025)])
def test_parts_are_found_in_a_command_with_noise_or_rounding(noise, rounding):
    plan = valves.valve_test_plan(dead_time=0.2, time_constant=0.3, stroke_time=3, ramp_time=150)
    command = np.round(plan.command / rounding) * rounding if rounding else plan.command
    command = command + noise * np.random.default_rng(1).standard_normal(command.size)
    measured = cr.Record(plan.time, command, command)
    assert [part.kind for part in valves.split_test(measured) if part.kind != "step"] == [
        "baseline", "staircase", "stroke", "stroke", "ramp", "ramp",
    ]  # fmt: skip


def test_a_wrong_range_of_the_command_and_a_reversed_travel_are_flagged_with_what_to_do():
    command = np.r_[command_of([50, 60, 50, 0, 100, 0], 4.0), np.linspace(0, 100, 4000)]
    command = np.r_[command, np.full(200, 100.0), np.linspace(100, 0, 4000), np.zeros(200)]
    record = record_of(command, command, 0.02, 0)
    wrong = valves.valve_report(record, command_range=(4, 20), **QUICK)
    (flag,) = (one for one in wrong.flags if one.code == "range_in_doubt")
    assert "outside command_range 4 to 20" in str(flag)
    falling = cr.Record(record.time, command, 100 - record.output, units=PERCENT)
    (flag,) = valves.valve_report(falling, **QUICK).flags
    assert "travel_range=(100, 0)" in str(flag)
    right = valves.valve_report(falling, travel_range=(100, 0), **QUICK)
    assert right.flags == ()
    assert right.metric("hysteresis").interval.is_known


@pytest.mark.parametrize(
    ("levels", "given", "doubted"),
    [([50, 60, 50], (0, 10), True), ([12, 18, 12], (20, 4), False), ([-2, 103, -2], None, False)],
)
def test_a_command_outside_its_range_is_flagged_whatever_its_steps(levels, given, doubted):
    """Steps of 10 units in a range of 10 were full strokes, without a word."""
    command = command_of(levels, 4.0)
    report = valves.valve_report(
        record_of(command, command, 0.02, 0), command_range=given, travel_range=given, **QUICK
    )
    assert ("range_in_doubt" in {flag.code for flag in report.flags}) == doubted


def test_records_of_operation_end_in_a_verdict_that_names_the_missing_tests():
    measured = cr.datasets.load("sugar_actuator").record[0:400]
    record = cr.Record(measured.time, measured.input, measured.output[0])
    report = valves.valve_report(record, command_range=(0, 100), travel_range=(0, 100))
    assert report.verdict == "Cannot tell: the records contain no valve test."
    assert report.level == "caution"
    assert {"no_valve_test", "operation_fit"} <= {flag.code for flag in report.flags}
    assert len(report.missing_tests) == 5
    # its command is about one sample of 1 s ahead of the stem
    assert report.metric("fitted_dead_time").interval.high < 3.0
    assert "valve_test_plan" in report.report()


def test_a_constant_command_is_called_constant_not_operation():
    command = np.full(400, 50.0)
    report = valves.valve_report(record_of(command, command, 0.02, 0))
    (flag,) = report.flags
    assert flag.code == "no_valve_test"
    assert "the command is constant" in str(flag)
    assert "operation" not in str(flag)


def test_noise_spikes_and_drives_in_milliamperes_leave_the_parts_as_they_are():
    valve = cr.bench.valve()
    records = valve.step_campaign(1, amplitudes=(16.0, 4.0), repeats=3)
    report = valves.valve_report(records, command_range=(4, 20), **QUICK)
    assert [[part.kind for part in own] for own in report.parts] == [["baseline", "stroke"]] * 3 + [
        ["baseline", "step"]
    ] * 3
    assert report.metric("gain").interval.value == pytest.approx(1.0, abs=0.01)
    assert len(report.choices) == 1
    assert "travel range" in report.choices[0]


PLANNED = {"dead_time": 1, "time_constant": 1}


@pytest.mark.parametrize(
    ("error", "match", "call"),
    [
        (DataError, "at least one", lambda r: valves.valve_report([])),
        (DataError, "output has", lambda r: valves.valve_test_plan(**PLANNED).record([1.0, 2])),
        (OptionError, "'t87'", lambda r: valves.valve_report(r, limits={"t87": 1})),
        (OptionError, "largest", lambda r: valves.valve_report(r, limits={"t86": "1"})),
        (OptionError, "in this order", lambda r: valves.valve_report(r, limits={"t86": (3, 1)})),
        (OptionError, "by step", lambda r: valves.valve_report(r, limits={"linearity": {2: 1}})),
        (OptionError, "positive", lambda r: valves.valve_report(r, command_range=(1, 1))),
        (OptionError, "expected one of", lambda r: valves.valve_report(r, **QUICK).metric("x")),
        (OptionError, "dead_time=None", lambda r: valves.valve_test_plan()),
        (OptionError, "the range", lambda r: valves.valve_test_plan(**PLANNED, sizes=(60,))),
        (NoStepError, "no step", lambda r: valves.valve_test_plan(r[0:2])),
    ],
)
def test_unusable_choices_are_refused(error, match, call):
    command = command_of([50, 55], 4.0)
    with pytest.raises(error, match=match):
        call(record_of(command, command, 0.0, 0))


def test_levels_that_were_reached_from_one_side_make_no_linear_valve_bent():
    """Half a dead band of 2 % was taken for 0.77 % of linearity, and a limit was not met."""
    levels = [50, 55, 60, 55, 50, 45, 40, 45, 50, 60, 50, 40, 50, 0, 100, 0, 50]
    command, position, moved = command_of(levels, 10.0), 49.0, []
    for value in command:
        position = min(max(position, value - 1.0), value + 1.0)
        moved.append(position)
    record = record_of(command, np.array(moved), 0.01, 0, dead_time=0.0)
    result = valves.valve_report(record, limits={"linearity": 0.5}, **QUICK)
    assert result.metric("dead_band").interval.value == pytest.approx(2.0, abs=0.02)
    linearity = result.metric("linearity")
    assert not linearity.interval.is_known or linearity.interval.low < 0.05


@pytest.mark.parametrize("seed", range(3))
def test_a_stem_that_creeps_to_the_end_of_its_hold_has_the_error_of_its_level(seed):
    """After 4.2 s it is 0.7 % short of its level: T98 missed by 0.15 s in 8 of 8."""
    dt = 0.02
    command = command_of([50, 50, 90, 50, 90, 50], 4.2, dt)
    position, moved = 50.0, []
    for value in command:
        position += np.clip(value - position, -25 * dt, 25 * dt)
        moved.append(position)
    record = record_of(command, np.array(moved), 0.01, seed, dt=dt, dead_time=0.0, lag=0.5)
    clean = stem_of(np.array(moved), dt=dt, dead_time=0.0, lag=0.5)
    rise = clean[420:630]
    true = np.interp(50 + 0.98 * 40, rise, dt * np.arange(rise.size))
    result = valves.valve_report(record, **QUICK)
    (opening,) = [group for group in result.groups if group.direction == "opening"]
    t98 = opening.estimates["t98"]
    assert t98.low <= true <= t98.high
    overshoot = result.metric("overshoot").interval
    assert overshoot.low == 0.0


def test_a_stem_that_follows_at_once_has_no_times():
    """Its response has no noise at all: a median over no samples was taken, with a warning."""
    t = 0.1 * np.arange(600)
    u = np.where(t < 20, 50.0, 55.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        report = cr.valves.valve_report(cr.Record(t, u, u, units={"u": "%", "y": "%"}))
    assert report.metric("gain").interval.value == pytest.approx(1)
    assert report.metric("fitted_dead_time").interval.high <= 0.1  # a sample


def test_ranges_and_limits_of_other_types_are_refused():
    t = 0.1 * np.arange(600)
    record = cr.Record(t, np.where(t < 20, 50.0, 55.0), 50 + np.sin(t))
    with pytest.raises(OptionError, match="range=5; expected two numbers"):
        cr.valves.valve_report(record, command_range=5)
    with pytest.raises(OptionError, match="limits is a int; expected metrics"):
        cr.valves.valve_report(record, limits=5)
    speed = {"dead_time": 0.3, "time_constant": 0.5}
    one, same = (cr.valves.valve_test_plan(**speed, sizes=sizes) for sizes in (5, (5,)))
    assert np.array_equal(one.command, same.command)
