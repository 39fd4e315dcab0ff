"""When an output first moves: on exact ramps to the sample, in noise within the noise."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ctrl_realize.numerics.signals.onset import first_motion
from tests import rigs

EDGE = 300
K = np.arange(1000)


def ramp(delay, length=100, edge=EDGE):
    """Rest, then a straight line from `delay` samples after the edge, then one."""
    return np.clip((K - edge - delay) / length, 0, 1)


@given(
    delay=st.integers(0, 30),
    length=st.integers(20, 150),
    gain=st.floats(1e-3, 1e3),
    up=st.booleans(),
    offset=st.floats(-100, 100),
    drift=st.floats(-1e-3, 1e-3),
)
def test_a_clean_straight_rise_begins_where_it_begins(delay, length, gain, up, offset, drift):
    height = gain if up else -gain
    output = height * ramp(delay, length) + offset + gain * drift * (K - EDGE)
    # drift is continued for as long as it was seen, here 300 samples
    output -= gain * drift * np.maximum(K - 2 * EDGE, 0)
    # rounding of offset and drift is the only noise
    found = first_motion(output, EDGE, 1e-12 * (gain + abs(offset)), 0.0, gain * drift)
    assert found.crossing in (delay + 1, delay + 2)
    assert found.onset == pytest.approx(delay, abs=1e-3)
    assert found.sign == (1 if up else -1)
    assert found.rest == pytest.approx(offset, abs=1e-9 * (gain + abs(offset)))
    assert found.span == pytest.approx(gain, rel=1e-6)


@pytest.mark.parametrize("quantum", [0.05, 0.1])
def test_a_coarse_output_moves_by_more_than_its_rounding(quantum):
    output = quantum * np.round(ramp(25, 200) / quantum)
    found = first_motion(output, EDGE, 0.0, quantum, 0.0)
    # 1.5 steps of rounding: the second step is the motion, at 1.5 steps of the straight line
    assert found.crossing == pytest.approx(25 + 1.5 * quantum * 200, abs=1.01)
    # a line through two of the steps is right to one of them
    assert found.onset == pytest.approx(25, abs=quantum * 200)
    flicker = quantum * (np.arange(1000) % 2)
    assert first_motion(flicker, EDGE, 0.0, quantum, 0.0) is None


def test_the_threshold_is_five_sigma():
    for sigma in (0.01, 0.03):
        found = first_motion(ramp(40, 400), EDGE, sigma, 0.0, 0.0)
        # the line reaches five sigma after 5 sigma 400 samples
        assert found.crossing == pytest.approx(40 + 5 * sigma * 400, abs=1.01)
        # before that it was inside one sigma of a mean over 3 % of the time since the step
        inside = sigma / np.sqrt(round(0.03 * found.crossing))
        assert found.onset == pytest.approx(40 + inside * 400, abs=1.01)


@pytest.mark.parametrize("seed", range(5))
def test_small_steps_are_seen_in_means_of_eight_and_of_sixtyfour(seed):
    noise = np.random.default_rng(seed).standard_normal(4000)
    k = np.arange(4000)
    for height, blur in ((3.0, 8), (1.2, 64)):
        output = height * (k >= 1200) + noise
        found = first_motion(output, 1000, 1.0, 0.0, 0.0)
        assert found.sign == 1
        # a mean reaches half its length ahead
        assert abs(found.onset - 200) <= blur
        assert found.span == pytest.approx(height, abs=1.0)
    assert first_motion(noise, 1000, 1.0, 0.0, 0.0) is None


def test_a_plant_of_third_order_is_seen_to_move_after_its_delay():
    time = rigs.TS * np.arange(-400, 1200)
    output = rigs.exact_step(rigs.R3, time - 60 * rigs.TS)
    found = first_motion(output, 400, 1e-6, 0.0, 0.0)
    # it begins like t^3: 0.5 % is reached after 29 samples
    assert 60 < found.onset < 60 + 29
    assert found.crossing == np.flatnonzero(output[400:] > 0.005 * found.span)[0]
