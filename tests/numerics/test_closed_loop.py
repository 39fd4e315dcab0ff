"""Time responses on a circle, and what gain a loop bears, from frequency responses alone."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ctrl_realize.numerics.closed_loop import (
    damped_circle,
    gain_gaps,
    largest_gain,
    response_on_circle,
    smallest_on_line,
    step_on_circle,
)


@pytest.mark.parametrize("count", [8, 9])
def test_points_lie_on_a_circle_whose_power_is_the_damping(count):
    z = damped_circle(count)
    assert z.size == count // 2 + 1
    assert z**count == pytest.approx(np.full(z.size, 1e6), rel=1e-12)
    # the upper half, from the positive real axis on
    assert np.angle(z) == pytest.approx(2 * np.pi * np.arange(z.size) / count)


@pytest.mark.parametrize("count", [64, 65])
@pytest.mark.parametrize("pole", [0.0, 0.5, -0.9, 1.02])
def test_a_response_known_on_the_circle_is_known_in_time(count, pole):
    z = damped_circle(count)
    expected = 3.0 * pole ** np.arange(count)
    found = response_on_circle(3.0 * z / (z - pole), count)
    # a millionth of what comes after the record: of 3 and its growth, 11 at most
    assert found == pytest.approx(expected, abs=5e-5)
    steps = step_on_circle(3.0 * z / (z - pole), z, count)
    whole = np.cumsum(expected)
    assert steps == pytest.approx(whole, abs=1e-5 * max(np.abs(whole).max(), 10))


def test_a_delay_shifts_the_response():
    z = damped_circle(50)
    found = step_on_circle(2.0 * z**-7, z, 50)
    assert found == pytest.approx(2.0 * (np.arange(50) >= 7), abs=1e-5)


def bears(shape, distance, gain):
    return np.abs(1 + gain * shape).min() >= distance


def test_ranges_of_gain_of_loops_on_the_negative_axis():
    # |1 - k| < 1/2 between 1/2 and 3/2; |1 - k / 4| < 1/2 between 2 and 6
    both = np.array([-0.25, -1.0]) + 0j
    assert gain_gaps(both, 0.5) == [(0.0, 0.5), (1.5, 2.0), (6.0, math.inf)]
    assert largest_gain(both, 0.5) == (0.5, 1)
    # overlapping: |1 - 0.8 k| < 1/2 between 5/8 and 15/8
    low, high = gain_gaps(np.array([-1.0, -0.8]) + 0j, 0.5)
    assert low == (0.0, 0.5)
    assert high == pytest.approx((1.875, math.inf))


def test_a_range_within_another_one_does_not_end_it():
    # -1 is too near from 1/2 to 3/2, the second from 0.66 to 1.20
    inner = -0.9 + 0.4j
    later = -0.4 + 0j  # 5/4 to 15/4
    found = gain_gaps(np.array([-1.0, inner, later]), 0.5)
    assert found == [(0.0, 0.5), (pytest.approx(3.75), math.inf)]


def test_what_never_comes_near_bears_any_gain():
    # to the right, at rest, or past -1 at more than half: |sin| of its angle is 0.89
    aside = np.array([1.0, 0.0, 2j, -1 + 2j, 3 - 4j])
    assert gain_gaps(aside, 0.5) == [(0.0, math.inf)]
    # or so small that its square vanishes
    assert gain_gaps(np.array([-1e-200 + 0j]), 0.5) == [(0.0, math.inf)]
    assert largest_gain(np.array([-1e-200 + 0j]), 0.5) == (math.inf, 0)
    assert largest_gain(aside, 0.5) == (math.inf, 0)


@pytest.mark.parametrize("seed", range(4))
def test_ranges_of_gain_are_those_of_brute_force(seed):
    rng = np.random.default_rng(seed)
    shape = rng.normal(size=6) * rng.uniform(0.05, 1, 6) + 0.5j * rng.normal(size=6)
    distance = rng.uniform(0.3, 0.9)
    gaps = gain_gaps(shape, distance)
    for gain in np.geomspace(1e-2, 1e3, 4000):
        inside = any(low <= gain <= high for low, high in gaps)
        assert inside == bears(shape, distance, gain)
    gain, at = largest_gain(shape, distance)
    assert gain == gaps[0][1]
    if math.isfinite(gain):
        assert abs(1 + gain * shape[at]) == pytest.approx(distance)


@pytest.mark.parametrize("best", [0.02, 0.7, 3.0, 50.0])
def test_the_bottom_of_a_valley_is_found(best):
    asked = []

    def valley(x):
        asked.append(x)
        return 5.0 + np.log(x / best) ** 2

    at, value = smallest_on_line(valley, 1e-2, 1e2)
    # golden sections down to 1e-4 of a logarithm
    assert np.log(at / best) == pytest.approx(0.0, abs=1e-4)
    assert value == valley(at) == min(5.0 + np.log(x / best) ** 2 for x in asked)
    # 16 of a scan 0.614 apart, two sections, and one for each further one of the 1.23 around
    assert len(asked) - 1 == 16 + 2 + math.ceil(np.log(1.228e4) / np.log((1 + np.sqrt(5)) / 2))
    assert min(asked) >= 1e-2 * (1 - 1e-12)
    assert max(asked) <= 1e2 * (1 + 1e-12)


def test_the_lower_of_two_valleys_is_found():
    def valleys(x):
        return min(np.log(x / 0.1) ** 2, np.log(x / 20) ** 2 - 0.1)

    assert smallest_on_line(valleys, 1e-2, 1e2)[0] == pytest.approx(20, rel=1e-4)
    assert smallest_on_line(lambda x: valleys(2 / x), 1e-2, 1e2)[0] == pytest.approx(0.1, rel=1e-4)


def test_at_an_end_of_the_range_the_end_is_found():
    assert smallest_on_line(lambda x: x, 2.0, 50.0)[0] == pytest.approx(2.0, rel=1e-4)
    assert smallest_on_line(lambda x: -x, 2.0, 50.0)[0] == pytest.approx(50.0, rel=1e-4)


def test_a_finer_scan_finds_what_a_coarser_one_steps_over():
    def narrow(x):
        return -1.0 if abs(np.log(x)) < 0.02 else np.log(x + 1)

    assert smallest_on_line(narrow, 0.1, 10.0, points=201)[1] == -1.0
    assert smallest_on_line(narrow, 0.1, 10.0, points=4)[1] > 0
