"""What a campaign flags, each by itself, on rows that are written by hand."""

from __future__ import annotations

import control as ct
import numpy as np
import pytest
from scipy import stats

import ctrl_realize as cr
from ctrl_realize.identification.campaign_flags import campaign_flags
from ctrl_realize.identification.campaign_row import CampaignRow
from ctrl_realize.identification.packed_model import PackedModel

MODELS = {
    order: PackedModel.of(
        cr.DelayedStateSpace(
            ct.StateSpace(
                0.5 * np.eye(order), np.ones((order, 1)), np.ones((1, order)), [[0.0]], 0.1
            ),
            3,
        )
    )
    for order in (1, 2)
}


def row(name, amplitude=16.0, delay=3.0, order=1, **values):
    return CampaignRow(name, amplitude, delay, model=MODELS[order], **values)


def rows(amplitudes, delays, orders=None, gain=1.0):
    several = zip(amplitudes, delays, orders or [1] * len(delays), strict=True)
    return tuple(row(str(i), a, d, n, gain=gain + i) for i, (a, d, n) in enumerate(several))


def told(good=(), failed=(), method="output_error"):
    found = campaign_flags((*good, *failed), good, failed, method)
    assert len({flag.code for flag in found}) == len(found)
    return {flag.code: flag.message for flag in found}


def test_a_campaign_without_rows_or_with_equal_ones_has_no_trend():
    assert told() == {}
    assert told(rows([4.0] * 6 + [16.0] * 6, [3.0] * 12)) == {}


def test_failed_records_are_counted_and_five_of_them_named():
    failed = tuple(CampaignRow(f"r{i}", error="no") for i in range(6))
    good = rows([1.0], [3.0])
    assert told(good, failed[:5]) == {
        "failed_records": "5 of 6 records failed: r0, r1, r2, r3, r4; the table tells why"
    }
    assert "r3, r4 and 1 more; " in told(good, failed)["failed_records"]


def test_records_whose_results_agree_in_every_digit_are_the_same():
    message = told((row("a"), row("b"), row("c")))["same_records"]
    assert message.startswith("2 of 3 records are others over again: a, b, c have the same")
    assert "last digit; the scatter" in message
    values = {"misfit": 0.1, "gain": 2.0, "interval": (0.2, 0.4)}
    first = row("a", **values)
    near = np.nextafter(0.2, 1.0)
    others = [
        row("b", amplitude=16.1, **values),
        row("b", delay=3.1, **values),
        row("b", **values | {"misfit": 0.11}),
        row("b", **values | {"gain": 2.1}),
        row("b", **values | {"interval": (near, 0.4)}),
        row("b", **values | {"interval": (0.2, 0.5)}),
    ]
    for other in others:
        assert told((first, other)) == {}


def test_of_many_same_records_a_few_are_named():
    four = tuple(row(name) for name in "abcd")
    assert "again: a, b, c, d have" in told(four)["same_records"]
    five = told((*four, row("e")))["same_records"]
    assert "again: a, b, c, d, ... have" in five
    assert "more such" not in five
    pair = (row("x", delay=4.0), row("y", delay=4.0), row("z", delay=5.0))
    both = told((*four, *pair))["same_records"]
    assert both.startswith("4 of 7 records")
    assert "digit (and 1 more such groups)" in both


def test_a_delay_that_follows_the_height_of_the_step_is_flagged():
    heights = [4.0] * 5 + [16.0] * 5
    delays = 3 + 0.01 * np.arange(10)
    message = told(rows(heights, delays))["amplitude_trend"]
    assert "longer for larger steps" in message
    # two heights against ten delays in a row: 25 / sqrt(25 * 33) = 0.870
    chance = stats.spearmanr(heights, delays).pvalue
    assert f"correlation 0.87, chance {chance:.1g})" in message
    assert message.endswith("all amplitudes")
    assert "shorter" in told(rows(heights, delays[::-1]))["amplitude_trend"]
    # a step down is as high as one up
    assert told(rows([-4.0, 4.0] * 5, delays)) == {}
    assert "shorter" in told(rows([-16.0] * 5 + [4.0] * 5, delays))["amplitude_trend"]


def test_a_rank_correlation_of_one_chance_in_a_hundred_is_no_trend():
    heights = np.arange(1.0, 11.0)
    # 1 - 6 * 38 / 990 = 0.770 has 0.92 %, 1 - 6 * 40 / 990 = 0.758 has 1.1 %
    near = [5, 3, 2, 4, 1, 7, 6, 9, 8, 10]
    below = [5, 2, 3, 4, 1, 8, 7, 6, 9, 10]
    assert stats.spearmanr(heights, near).pvalue < 0.01 < stats.spearmanr(heights, below).pvalue
    assert set(told(rows(heights, near))) == {"amplitude_trend"}
    assert told(rows(heights, below)) == {}


def test_eight_records_of_two_heights_are_needed():
    heights = [4.0] * 4 + [16.0] * 4
    delays = [3.0, 3.1, 3.2, 3.3, 6.0, 6.1, 6.2, 6.3]
    assert set(told(rows(heights, delays))) == {"amplitude_trend"}
    assert told(rows(heights[:7], delays[:7])) == {}
    # heights that differ by a part in a million are one, in any unit
    for unit in (1.0, 1e-9):
        near, apart = ([unit] * 4 + [unit * (1 + by)] * 4 for by in (0.9e-6, 1.1e-6))
        assert told(rows(near, delays)) == {}
        assert set(told(rows(apart, delays))) == {"amplitude_trend"}
    assert told(rows([0.0] * 8, delays)) == {}
    # without a height or a delay a row does not count
    assert told(rows([np.nan, *heights[1:]], delays)) == {}
    assert told(rows(heights, [*delays[:7], np.nan])) == {}
    assert set(told(rows([*heights, np.nan], [*delays, 1.0]))) == {"amplitude_trend"}


def test_below_ten_records_the_delays_themselves_have_to_agree():
    heights = np.array([4.0] * 4 + [16.0] * 4)
    # ranks in order, delays that one outlier scatters
    delays = np.array([2.0, 3.1, 3.2, 3.3, 3.4, 3.5, 3.6, 3.7])
    assert stats.spearmanr(heights, delays).pvalue < 0.01 < stats.pearsonr(heights, delays).pvalue
    assert told(rows(heights, delays)) == {}
    nine = rows([*heights, 16.0], [*delays, 3.8])
    assert stats.pearsonr([*heights, 16.0], [*delays, 3.8]).pvalue > 0.01
    assert told(nine) == {}
    ten = rows([*heights, 16.0, 16.0], [-9.0, *delays[1:], 3.8, 3.9])
    assert stats.pearsonr([*heights, 16.0, 16.0], [-9.0, *delays[1:], 3.8, 3.9]).pvalue > 0.01
    assert set(told(ten)) == {"amplitude_trend"}


def test_models_of_another_order_are_not_compared_but_where_the_order_is_fitted():
    heights = [4.0] * 4 + [16.0] * 6
    delays = [3.0, 3.1, 3.2, 3.3, 6.0, 6.1, 6.2, 6.3, 6.4, 6.5]
    orders = [2, 2, 2, 2, 1, 1, 1, 1, 1, 1]
    assert told(rows(heights, delays, orders), method="scan") == {}
    message = told(rows(heights, delays, orders))["amplitude_trend"]
    assert "a lag that only large steps show" in message
    assert "lag that only" not in told(rows(heights, delays))["amplitude_trend"]
    same = told(rows([2.0, *heights], [9.0, *delays], [2] + [1] * 10), method="paper")
    assert "the bias of the scan" in same["amplitude_trend"]
    assert "longer" in same["amplitude_trend"]


def test_a_row_without_a_delay_does_not_make_the_orders_differ():
    heights = [4.0] * 5 + [16.0] * 6
    delays = [*(3 + 0.01 * np.arange(10)), np.nan]
    message = told(rows(heights, delays, [1] * 10 + [2]))["amplitude_trend"]
    assert "orders differ" not in message


@pytest.mark.parametrize("method", ["scan", "paper", "output_error"])
def test_infinite_gains_are_no_difficulty(method):
    several = tuple(row(str(i), 4.0, 3.0 + i, gain=np.inf) for i in range(9))
    assert told(several, method=method) == {}
