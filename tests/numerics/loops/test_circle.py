"""Ranges of a gain for which a loop keeps its distance, from points of its response alone."""

import math

import numpy as np
import pytest

from ctrl_realize.numerics.loops.circle import gain_gaps, largest_gain


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
