"""Dead times in samples, whole and not, and what becomes of a direct term."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from ctrl_realize.numerics.state_space.sampling import (
    sample_with_dead_time,
    split_dead_time,
    zero_order_hold,
)

LAG = (np.array([[-2.0]]), np.array([[2.0]]), np.array([[1.0]]))


@pytest.mark.parametrize(
    ("samples", "whole", "rest"),
    [
        (0.0, 0, 0.0),
        (3.0, 3, 0.0),
        (3.25, 3, 0.25),
        (1 + 0.5e-9, 1, 0.0),  # nearer than a thousand millionth: rounding
        (1 + 1.5e-9, 1, 1.5e-9),
        (1 - 0.5e-9, 1, 0.0),
        (1 - 1.5e-9, 0, 1 - 1.5e-9),
        (1000 + 0.5e-6, 1000, 0.0),  # rounding grows with the number
        (1000 + 1.5e-6, 1000, 1.5e-6),
    ],
)
def test_a_dead_time_is_whole_samples_and_a_rest(samples, whole, rest):
    found = split_dead_time(samples, 1.0)
    assert found[0] == whole
    assert_allclose(found[1], rest, rtol=0, atol=1e-12)


def test_rounding_of_decimal_times_makes_no_rest():
    for dt in (0.1, 0.01, 7.8125e-4, 0.3):
        assert [split_dead_time(k * dt, dt) for k in range(300)] == [(k, 0.0) for k in range(300)]


def test_a_whole_dead_time_leaves_model_and_direct_term_alone():
    A, B, C, D, delay = sample_with_dead_time(*LAG, np.array([[0.7]]), 0.1, 0.3)
    assert delay == 3
    assert_allclose([A[0, 0], B[0, 0]], [np.exp(-0.2), 1 - np.exp(-0.2)])
    assert_allclose([C[0, 0], D[0, 0]], [1.0, 0.7], rtol=0)


def test_a_direct_term_behind_a_fraction_is_no_model():
    with pytest.raises(AssertionError, match="direct term"):
        sample_with_dead_time(*LAG, np.array([[0.7]]), 0.1, 0.33)


@pytest.mark.parametrize("fraction", [1e-6, 0.2, 0.5, 0.999])
def test_a_fractional_dead_time_samples_the_delayed_exponential(fraction):
    dt, count = 0.1, 40
    A, B, C, D, delay = sample_with_dead_time(*LAG, np.zeros((1, 1)), dt, (2 + fraction) * dt)
    assert delay == 3
    markov = [D[0, 0]] + [(C @ np.linalg.matrix_power(A, k) @ B)[0, 0] for k in range(count - 1)]
    step = np.concatenate([np.zeros(delay), np.cumsum(markov)])
    time = dt * np.arange(step.size) - (2 + fraction) * dt
    assert_allclose(step, np.where(time > 0, 1 - np.exp(-2 * time), 0), rtol=0, atol=1e-13)


def test_the_hold_integrates_several_inputs_apart():
    A, B = np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0, 1.0], [2.0, 0.0]])
    Phi, Gamma = zero_order_hold(A, B, 0.5)
    # a double integrator: polynomials in the sample time
    assert_allclose(Phi, [[1, 0.5], [0, 1]])
    assert_allclose(Gamma, [[2 * 0.125, 0.5], [1.0, 0.0]])
