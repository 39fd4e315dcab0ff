"""Differences that are significant, and too small to matter: flags are silent, numbers are not."""

import re

import numpy as np
import pytest

import ctrl_realize as cr

LAG, DEAD_TIME, GAIN = 30.0, 20.0, 2.0  # s, sampled every second


def codes(fit):
    return {flag.code for flag in fit.flags}


def response(t, moves, heights):
    after = np.clip(t[:, None] - np.asarray(moves) - DEAD_TIME, 0, None)
    return GAIN * -np.expm1(-after / LAG) @ np.asarray(heights)


def late_in_parts(late, gains, seed=3):
    """A record whose plant is later, and has another gain, in each third."""
    rng = np.random.default_rng(seed)
    t = np.arange(900.0)
    moves = np.arange(10.0, 850.0, 70.0)
    heights = rng.choice([-1.0, 1.0], moves.size) * rng.uniform(0.7, 1.3, moves.size)
    third = np.minimum(3 * moves // t.size, 2).astype(int)
    u = (t[:, None] >= moves) @ heights
    y = response(t, moves + np.array(late)[third], heights * np.array(gains)[third])
    return cr.Record(t, u, y + 0.005 * rng.standard_normal(t.size))


@pytest.mark.parametrize(
    ("late", "gains", "told"),
    [
        ((0.0, 0.6, 1.2), (1.0, 1.01, 0.99), False),
        ((0.0, 3.0, 6.0), (1.0, 1.0, 1.0), True),
        ((0.0, 0.0, 0.0), (1.0, 1.1, 1.25), True),
    ],
)
def test_a_plant_is_called_time_varying_where_it_matters(late, gains, told):
    fit = cr.identify(late_in_parts(late, gains), structures="FOPDT").fit
    assert ("time_varying" in codes(fit)) == told
    note = [choice for choice in fit.choices if choice.startswith("small but significant")]
    assert len(note) == (not told)
    if note:
        # the response to the last move of a third goes on in the next one
        assert 0.4 <= float(re.search(r"delay \+-(\S+) samples", note[0])[1]) <= 0.6


def steps(late, gains):
    """Records of a step each, with a noise of 0.1 %."""
    t = np.arange(400.0)
    out = []
    for seed, (shift, gain) in enumerate(zip(late, gains, strict=True)):
        noise = 0.002 * np.random.default_rng(seed).standard_normal(t.size)
        y = gain * response(t, [60.0 + shift], [1.0]) + noise
        out.append(cr.Record(t, (t >= 60.0).astype(float), y, name=f"r{seed}"))
    return out


@pytest.mark.parametrize(
    ("late", "gains", "told"),
    [
        ((0.0, 0.4, 0.8), (1.0, 1.0, 1.0), set()),
        ((0.0, 2.0, 4.0), (1.0, 1.0, 1.0), {"records_differ"}),
        ((0.0, 0.0, 0.0), (1.0, 1.02, 1.0), set()),
        ((0.0, 0.0, 0.0), (1.0, 1.08, 1.0), {"gains_differ"}),
    ],
)
def test_records_are_called_different_where_it_matters(late, gains, told):
    records = steps(late, gains)
    possible = {"records_differ", "gains_differ", "lags_differ"}
    together = cr.identify(records, structures="FOPDT").fit
    assert codes(together) & possible == told
    campaign = cr.identify_campaign(records, structures="FOPDT")
    assert {flag.code for flag in campaign.flags} & possible - {"lags_differ"} == told
    # what is not told is in the numbers: the interval, and the test of the records
    repeats = together.repeatability
    assert min(repeats.p_value, repeats.gain_test[1]) < 1e-3
    assert together.interval[0] <= DEAD_TIME + np.mean(late) <= together.interval[1]
    assert together.gain_interval[0] <= GAIN * max(gains) * 1.001
