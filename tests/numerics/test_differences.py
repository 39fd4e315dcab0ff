"""Differences of a sampled step: exact sums, exact polynomials."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from ctrl_realize.numerics.differences import backward_difference, central_difference


def test_backward_difference_begins_at_the_value_before():
    assert_array_equal(backward_difference(np.array([1.0, 3.0, 6.0])), [1, 2, 3])
    assert_array_equal(backward_difference(np.array([1.0, 3.0, 6.0]), 0.5), [0.5, 2, 3])


@pytest.mark.parametrize("power", range(5))
def test_central_difference_is_exact_up_to_power_four(power):
    t = np.arange(-4.0, 8.0)
    slope = power * t ** max(power - 1, 0)
    # inside: five points, exact for power four
    assert_allclose(central_difference(t**power)[2:-2], slope[2:-2], atol=1e-11)
    # the two at each end: stencils of order two, exact for parabolas
    if power <= 2:
        assert_allclose(central_difference(t**power), slope, atol=1e-12)


def test_the_second_sample_from_each_end_uses_its_two_neighbours():
    # |x|^3-like data, for which the five-point stencil would differ
    step = np.array([0.0, 1.0, 8.0, 27.0, 64.0, 125.0, 216.0])
    slope = central_difference(step)
    assert_allclose(slope[[1, -2]], [4.0, (216 - 64) / 2])
    # one-sided: (-3 s0 + 4 s1 - s2) / 2
    assert_allclose(slope[[0, -1]], [(4 * 1 - 8) / 2, (3 * 216 - 4 * 125 + 64) / 2])
