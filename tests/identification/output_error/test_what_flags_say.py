"""Flags of a step record: one where several say the same, with sizes and times that are true."""

import re

import numpy as np
import pytest

import ctrl_realize as cr
from ctrl_realize import report
from ctrl_realize.numerics.signals.noise import largest_excess

T = np.arange(-100.0, 600.0, 2.0)
TWO = [(1, 1), (2, 2)]


def response(time, dead_time, lags):
    """Step response of lags, no two alike, by partial fractions."""
    after, y = np.clip(time - dead_time, 0, None), np.ones(time.size)
    for lag in lags:
        others = [lag / (lag - other) for other in lags if other != lag]
        y -= np.prod(others) * np.exp(-after / lag)
    return y


def model(y, seed, time=T, noise=0.002, **options):
    y = y + noise * np.random.default_rng(seed).standard_normal(time.size)
    return cr.fit_output_error(cr.Record(time, 1.0 * (time >= 0), y), **options)


def fitted(*args, **options):
    return model(*args, **options).fit


def said(fit, code):
    """Message of the one flag of a code."""
    (message,) = (flag.message for flag in fit.flags if flag.code == code)
    return message


def codes(fit):
    return [flag.code for flag in fit.flags]


@pytest.mark.parametrize(("first", "last", "height"), [(250, 330, 0.05), (200, 320, -0.06)])
def test_what_a_model_misses_is_told_with_its_size_and_its_time(first, last, height):
    unknown = height * np.sin(np.pi * np.clip((T - first) / (last - first), 0, 1))
    system = model(response(T, 20, (40, 15)) + unknown, 0, structures=TWO, loss="least_squares")
    assert codes(system.fit)[0] == "structured_misfit"
    told = re.search(r"misses (\S+) % .* between (\S+) and (\S+) s", system.fit.flags[0].message)
    share, begins, ends = map(float, told.groups())
    assert first <= begins < first + 0.2 * (last - first)
    assert last - 0.2 * (last - first) < ends <= last
    # a half sine has a root mean square of 1 / sqrt(2), and the model follows some of it
    assert 0.7 * abs(height) / np.sqrt(2) < share / 100 < abs(height)
    assert report.verdict_of(system).reasons[0].startswith("The model misses")


def test_the_interval_of_most_excess_is_the_best_of_all_intervals():
    values = np.random.default_rng(3).standard_normal(60) * np.repeat([1, 2, 1], 20)
    above = values**2 - np.mean(values**2)
    sums = {(i, k): above[i:k].sum() for i in range(60) for k in range(i + 1, 61)}
    assert largest_excess(values) == max(sums, key=sums.get)


@pytest.mark.parametrize("lags", [(60.0,), (60.0, 15.0)])
@pytest.mark.parametrize("constants", [1.2, 2.0])
def test_a_record_that_ends_early_says_at_which_part_of_the_response(lags, constants):
    end = 20 + sum(lags[1:]) + 60 * constants
    time = np.arange(-50.0, end, 1.0)
    fit = fitted(2 * response(time, 20, lags), 3, time, 0.002, structures=[(len(lags), len(lags))])
    share = float(re.search(r"ends at (\S+) %", said(fit, "not_settled"))[1])
    assert share == pytest.approx(100 * response(np.array([end]), 20, lags)[0], abs=1.5)
    more = float(re.search(r"Record (\S+) s more", said(fit, "not_settled"))[1])
    # to three constants behind the dead time, where it counts as settled
    assert more == pytest.approx(20 + 180 - end, abs=8)


@pytest.mark.parametrize("constants", [0.6, 1.5])
def test_one_flag_tells_what_an_early_end_leaves_open(constants):
    time = np.arange(-50.0, 20 + 60 * constants, 1.0)
    fit = fitted(response(time, 20, (60.0, 9.0)), 1, time, 0.01, structures=TWO)
    assert len({"integrating", "not_settled", "gain_not_resolved"} & set(codes(fit))) >= 1
    assert not {"not_settled", "gain_not_resolved"} <= set(codes(fit))


def test_where_dead_time_and_lags_are_not_told_apart_their_sum_is():
    lags, dead_time = (40.0, 12.0, 5.0, 4.0), 6.0
    fit = fitted(response(T, dead_time, lags), 0, noise=0.004)
    split = [
        flag for flag in fit.flags if flag.code in ("no_delay_resolved", "structures_disagree")
    ]
    assert len(split) == 1
    told = re.search(r"sum is \S+ s \((\S+) to (\S+) s\)", split[0].message)
    low, high = map(float, told.groups())
    assert low <= dead_time + sum(lags) <= high
    assert high - low < 0.1 * low


def test_how_far_an_output_moved_before_the_step_is_told():
    # the end of an earlier step of the same height, 50 s before the record
    before = response(T + 150, 20, (40, 15)) - 1
    fit = fitted(response(T, 20, (40, 15)) + before, 0, structures=TWO)
    assert "earlier_input" not in codes(fit)
    share = float(re.search(r"moved by (\S+) %", said(fit, "not_at_rest"))[1])
    assert share == pytest.approx(100 * np.ptp(before[:50]), rel=0.15)


def test_rounding_and_drift_are_told_in_parts_of_the_response():
    y = response(T, 20, (40, 15))
    coarse = fitted(np.round(y / 0.05) * 0.05, 0, noise=0.0, structures=TWO)
    assert "5 % of the response" in said(coarse, "coarse_quantisation")
    drifting = fitted(y + 0.2 * T / np.ptp(T), 0, structures=TWO)
    share = float(re.search(r", (\S+) % of", said(drifting, "drift"))[1])
    assert share == pytest.approx(20, rel=0.1)


def test_an_integrator_is_no_plant_whose_gain_and_tuning_are_certain():
    # it may be a slow lag, whose gain and lag the record does not show
    time = np.arange(-50.0, 250.0)
    after = np.clip(time - 20, 0, None)
    fit = fitted(0.02 * after, 0, time, structures=TWO)
    assert "integrating" in codes(fit)
    levels = {verdict.question: verdict.level for verdict in fit.verdicts}
    assert "good" not in (levels["gain"], levels["tuning"])
