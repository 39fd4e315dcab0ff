"""What a campaign flags, each by itself, on rows that are written by hand."""

from __future__ import annotations

import control as ct
import numpy as np
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
