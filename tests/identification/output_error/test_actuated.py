"""Fits of records through an actuator, against simulated truth."""

from __future__ import annotations

import zlib

import control as ct
import numpy as np
import pytest

import ctrl_realize as cr
from benchmarks.actuators.cases import both_ends
from ctrl_realize.actuators import (
    Backlash,
    Characteristic,
    KanoStiction,
    Saturation,
    SlewRateLimit,
)
from ctrl_realize.numerics.actuators.limits import slew_limited
from tests import rigs

DT, DEAD_TIME = 0.1, 0.73
FINE = 20
"""Steps within a sample for a position that moves within it."""


def through(actuator, command, seed, noise=0.005):
    """Record of an actuator before two lags, with white noise as a part of the range."""
    fine = DT / FINE
    position = actuator.simulate(np.repeat(command, FINE), fine)
    # A position that moves is held at its mean over each step.
    held = 0.5 * (position + np.concatenate([position[:1], position[:-1]]))
    held = np.where(np.abs(np.diff(position, prepend=position[0])) > 3, position, held)
    plant = cr.delayed_ss(2 * ct.tf([1], [0.5, 1.5, 1]), dead_time=DEAD_TIME, dt=fine)
    y = np.ravel(plant.simulate(held - held[0]))[::FINE]
    y += noise * np.ptp(y) * np.random.default_rng(seed).standard_normal(y.size)
    return cr.Record(DT * np.arange(y.size), command, y, units={"u": "%", "y": "mm"})


def staircase(*moves, hold=120):
    return np.repeat(50.0 + np.cumsum([0.0, *moves]), hold)


def test_a_single_large_step_tells_a_slew_rate_and_the_dead_time_behind_it():
    record = through(SlewRateLimit(12.0), staircase(40.0, hold=60), 1)
    linear_system = cr.fit_output_error(record, structures=[(2, 2)])
    system = cr.fit_output_error(record, actuator="auto", structures=[(2, 2)])
    linear, fit = linear_system.fit, system.fit
    assert linear.actuator is None
    rate = fit.actuator["slew_rate"]
    assert rate.low <= 12.0 <= rate.high
    assert rate.high - rate.low < 1.2
    assert rate.unit == "%/s"
    assert fit.interval[0] <= DEAD_TIME <= fit.interval[1]
    assert abs(fit.dead_time - DEAD_TIME) < 0.05
    assert fit.fit_percent > linear.fit_percent
    assert "slew rate" in fit.report()
    other = through(SlewRateLimit(12.0), staircase(-25.0, hold=60), 3)
    follows = cr.compare({"linear": linear_system, "actuator": system}, other).fit_percent
    assert follows["actuator"] > 97 > follows["linear"]


def test_the_levels_of_several_records_are_no_part_of_what_is_followed():
    first, second = (
        through(SlewRateLimit(12.0), staircase(size, hold=60), seed, noise=0.1)
        for size, seed in ((40.0, 1), (-25.0, 2))
    )
    moved = cr.Record(second.time, second.input, second.output + 1000.0)
    here, there = (
        cr.fit_output_error([first, one], actuator="slew_rate", structures=[(2, 2)]).fit
        for one in (second, moved)
    )
    assert here.actuator is not None
    # a level of 1000 takes three of sixteen digits, and a search ends where it has converged
    assert there.fit_percent == pytest.approx(here.fit_percent, abs=1e-5)


def test_at_every_dead_time_other_lags_are_the_best_and_an_interval_follows_them_all_the_way():
    # noise of 2 % hides the pair of R3: from one end of the interval to the other it must change
    # by more than a few steps of a search
    k, delay = np.arange(700.0), 37.3
    demand = rigs.exact_step(rigs.R3, (k - 200 - delay) * rigs.TS)
    noise = 0.02 * np.random.default_rng(2).standard_normal(k.size)
    y = slew_limited(demand, 4.0, 4.0, rigs.TS) + noise
    record = cr.Record(k * rigs.TS, np.where(k < 200, 0.0, 1.0), y)
    fit = cr.fit_output_error(record, actuator="slew_rate", structures=[(3, 3)]).fit
    assert fit.actuator is not None
    low, high = np.array(fit.interval) / rigs.TS
    assert low < delay < high < delay + 20


def test_records_of_several_sizes_share_dead_band_and_linear_part():
    records = [
        through(Backlash(1.3, 0.5), staircase(3, -3, 3, 3, -3), 0),
        through(Backlash(1.3, -0.5), staircase(10, 10, -10, -10), 1),
    ]
    fit = cr.fit_output_error(records, actuator="dead_band", structures=[(2, 2), (3, 3)]).fit
    band = fit.actuator["dead_band"]
    assert band.low <= 1.3 <= band.high
    assert band.high - band.low < 0.1
    assert fit.actuator.starts == pytest.approx((0.5, -0.5), abs=0.1)
    assert fit.interval[0] <= DEAD_TIME <= fit.interval[1]
    assert fit.gain_interval[0] <= 2.0 <= fit.gain_interval[1]


def test_a_slip_of_another_step_is_no_outlier_and_spikes_are():
    large = staircase(15, -15, 15, hold=60) - 50.0
    small = 15.0 + np.repeat(np.cumsum([0.8] * 12 + [-0.8] * 24 + [0.8] * 24), 15)
    record = through(KanoStiction(S=10.1, J=5.7, start=1.0), np.concatenate([large, small]), 7)
    output = record.output.copy()
    output[[40, 333, 600, 802, 1000]] += 3.0
    spiked = cr.Record(record.time, record.input, output)
    fit = cr.fit_output_error(spiked, actuator="stiction", structures=[(2, 2)]).fit
    for name, truth in (("S", 10.1), ("J", 5.7)):
        found = fit.actuator[name]
        assert found.low <= truth <= found.high
        assert abs(found.value / truth - 1) < 0.05
    assert fit.interval[0] <= DEAD_TIME <= fit.interval[1]


def test_a_linear_valve_gets_no_actuator_and_its_interval_covers_those_not_ruled_out():
    record = through(SlewRateLimit(1e6), staircase(4, 4, -4, -4, hold=90), 2)
    linear = cr.fit_output_error(record, structures=[(2, 2)]).fit
    fit = cr.fit_output_error(record, actuator="auto", structures=[(2, 2)]).fit
    assert fit.actuator is None
    assert fit.dead_time == linear.dead_time
    assert fit.interval[0] <= linear.interval[0] <= linear.interval[1] <= fit.interval[1]
    assert any("slew-rate limit" in choice for choice in fit.choices)


LEVELS = staircase(10, 10, 10, 10, -20, -10, -20, -20, 10, hold=50)  # 20 to 90
SMALL = staircase(*[0.5] * 10, *[-0.5] * 14, *[0.5] * 8, hold=25)


def flows(plug):
    """Flows at the levels between 20 and 90, from 0 to 1, and the width of their intervals."""
    low, *inside, high = plug.simulate(np.arange(20.0, 100.0, 10.0))
    parts = (np.array(inside) - low) / (high - low)
    return {f"flow_at_{u}": (part, 0.03) for u, part in zip(range(30, 90, 10), parts, strict=True)}


CURVED = Characteristic("equal-percentage", rangeability=30)
OTHERS = [
    ("slew_rate", SlewRateLimit(12.0, 20.0), staircase(30, -30, 20, -30, hold=70),
     {"slew_rate_opening": (12.0, 1.2), "slew_rate_closing": (20.0, 2.0)}),
    ("saturation", Saturation(27.0, 84.0), LEVELS,
     {"travel_low": (27.0, 0.5), "travel_high": (84.0, 0.5)}),
    ("saturation", Saturation(-100.0, 76.0), LEVELS, {"travel_high": (76.0, 0.5)}),
    ("characteristic", CURVED, LEVELS, flows(CURVED)),
    ("stiction", KanoStiction(1.7, 1.7), SMALL, {"resolution": (1.7, 0.6)}),
]  # fmt: skip


@pytest.mark.parametrize(("asked", "actuator", "command", "truth"), OTHERS)
def test_what_a_valve_does_is_named_and_told_with_intervals(asked, actuator, command, truth):
    record = through(actuator, command, 2)
    fit = cr.fit_output_error(record, actuator=asked, structures=[(2, 2)]).fit
    found = fit.actuator
    assert {one.name for one in found.parameters} == truth.keys()
    for name, (value, width) in truth.items():
        one = found[name]
        assert one.low <= value <= one.high
        assert one.high - one.low < width
        assert one.label in found.in_words()
    assert fit.interval[0] <= DEAD_TIME <= fit.interval[1]
    moved, true = (one.simulate(command, DT) for one in (found.model, actuator))
    moved, true = ((one - one[0]) / np.ptp(one) for one in (moved, true))
    assert np.std(moved - true) < 0.03


def test_no_linear_model_need_follow_what_a_valve_does():
    trial = both_ends(np.random.default_rng([2, zlib.crc32(b"both_ends")]))
    linear = cr.fit_output_error(trial.records, structures=trial.structures).fit
    # from rest its dead time is right; no question has a good answer, and the reason is told
    assert linear.interval[0] <= trial.dead_time <= linear.interval[1]
    assert "good" not in {verdict.level for verdict in linear.verdicts}
    assert "not_linear" in [flag.code for flag in linear.flags]
    fit = cr.fit_output_error(
        trial.records, actuator=trial.actuator, structures=trial.structures
    ).fit
    for name, truth in trial.values.items():
        assert fit.actuator[name].low <= truth <= fit.actuator[name].high
    assert fit.interval[0] <= trial.dead_time <= fit.interval[1]


@pytest.mark.parametrize(
    ("asked", "test"),
    [
        ("dead_band", "staircase up and down"),
        ("saturation", "three levels"),
        ("characteristic", "several positions"),
        ("resolution", "small steps"),
    ],
)
def test_one_step_is_told_not_to_tell_it(asked, test):
    record = through(Backlash(2.0), staircase(10, hold=60), 2)
    with pytest.raises(cr.errors.DataError, match=test):
        cr.fit_output_error(record, actuator=asked, structures=[(2, 2)])


def test_an_end_that_the_records_do_not_tell_is_flagged():
    """A stem moves by every step that is higher than J, which then may be any below."""
    record = through(KanoStiction(1.5, 0.4), staircase(5, 5, -5, -5, 5, 5, hold=50), 3)
    fit = cr.fit_output_error(record, actuator="stiction", structures=[(2, 2)]).fit
    assert fit.actuator["J"].low < 0.1
    flagged = {flag.code: str(flag) for flag in fit.flags}
    assert "small steps" in flagged["actuator_not_resolved"]


def test_an_actuator_is_not_fitted_beside_known_dynamics():
    record = through(Backlash(2.0), staircase(10, hold=40), 2)
    with pytest.raises(cr.errors.OptionError, match="known"):
        cr.fit_output_error(record, known=ct.tf([1], [0.1, 1]), actuator="auto")
    with pytest.raises(cr.errors.OptionError, match="actuator"):
        cr.fit_output_error(record, actuator="sticky")
