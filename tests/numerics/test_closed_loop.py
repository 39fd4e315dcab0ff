"""Time responses on a circle, and what gain a loop bears, from frequency responses alone."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ctrl_realize.numerics.loops.circle import (
    damped_circle,
    gain_gaps,
    largest_gain,
    response_on_circle,
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
