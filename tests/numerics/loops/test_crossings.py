"""Crossings and closest points of curves; loops from frequency responses alone."""

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
from ctrl_realize.numerics.loops.crossings import (
    follow,
    negative_axis_crossings,
    smallest_distance,
    unit_crossings,
)


def test_a_curve_is_followed_until_it_turns_little_between_points():
    def curve(omega):
        return np.exp(-9j * omega)

    start = np.array([0.0, 0.3, 0.6])
    grid, values = follow(curve, start)
    assert set(start) <= set(grid)
    assert np.all(np.diff(grid) > 0)
    assert np.array_equal(values, curve(grid))
    turn = 9 * np.diff(grid)
    assert turn.max() <= 0.5
    # halved no further than needed: of 2.7 rad an eighth is less than 0.5, and a half less than 1.4
    assert grid.size == 2 * 8 + 1
    assert follow(curve, start, largest_turn=1.4)[0].size == 2 * 2 + 1
    assert np.array_equal(follow(curve, start, largest_turn=2.8)[0], start)


def grid_for(curve, low, high):
    return follow(curve, np.geomspace(low, high, 60))


def test_gain_crossovers_are_where_the_magnitude_is_one():
    def integrator(omega):
        return 2 / (1j * omega)

    assert unit_crossings(integrator, *grid_for(integrator, 0.1, 50)) == pytest.approx([2.0])
    two = np.array([1.0, 3.0])
    assert unit_crossings(integrator, two, integrator(two)) == pytest.approx([2.0])

    def resonant(omega):
        # |1 / (1 - omega^2)| / 2 is one at omega^2 of 1/2 and 3/2
        return 0.5 / (1 - omega**2 + 1e-12j)

    found = unit_crossings(resonant, *grid_for(resonant, 0.1, 50))
    assert found == pytest.approx(np.sqrt([0.5, 1.5]), rel=1e-12)
    low = grid_for(lambda omega: 0.1 * integrator(omega), 1, 50)
    assert unit_crossings(integrator, *low).size == 0


def test_phase_crossovers_are_on_the_negative_axis():
    def lags(omega):
        return 1 / (1 + 1j * omega) ** 3

    found = negative_axis_crossings(lags, *grid_for(lags, 0.01, 100))
    assert found == pytest.approx([np.sqrt(3)], rel=1e-12)

    def delay(omega):
        return np.exp(-1j * omega) / (1 + omega)

    found = negative_axis_crossings(delay, *grid_for(delay, 0.5, 20))
    # at 2 pi and 4 pi it is on the positive one
    assert found == pytest.approx(np.pi * np.array([1, 3, 5]), rel=1e-12)
    # the other way round as well
    found = negative_axis_crossings(
        lambda omega: delay(omega).conj(), *grid_for(lambda omega: delay(omega).conj(), 0.5, 8)
    )
    assert found == pytest.approx([np.pi], rel=1e-12)


def test_the_closest_point_of_a_curve_is_found():
    def curve(omega):
        return (omega - 3) + 0.1j

    distance, at = smallest_distance(curve, np.geomspace(0.1, 50, 40))
    assert distance == pytest.approx(0.1, rel=1e-9)
    # of the half between two points of the grid, eleven times a quarter
    assert at == pytest.approx(3.0, abs=1e-7)
    # the same far from the origin
    distance, at = smallest_distance(lambda omega: curve(omega) + 2j, np.geomspace(0.1, 50, 40))
    assert distance == pytest.approx(2.1, rel=1e-9)
    assert at == pytest.approx(3.0, abs=1e-7)


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
