"""Feedback and nonlinear plants, seen in what the past of a record does not predict."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from ctrl_realize.numerics.validation.innovations import feedback_chance, nonlinear_chance

N = 600
SURE = 1e-6


def levels(rng):
    return np.repeat(rng.choice([-1.0, 0.0, 1.0], N // 12), 12)


def first_order(drive, delay=5):
    late = np.concatenate([np.zeros(delay), drive[:-delay]])
    return lfilter([0.0, 0.1], [1, -0.9], late)


def loop(rng, gain, integral, disturbance):
    """First-order plant with a delay of five samples under a PI controller."""
    target = np.repeat(rng.choice([-1.0, 0.0, 1.0], N // 60), 60)
    u, y, state, total = np.zeros(N), np.zeros(N), 0.0, 0.0
    for k in range(N):
        y[k] = state + disturbance[k]
        total += integral * (target[k] - y[k])
        u[k] = gain * (target[k] - y[k]) + total
        state = 0.9 * state + 0.1 * (u[k - 5] if k >= 5 else 0.0)
    return u, y


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("pole", [0.0, 0.9])
def test_no_feedback_is_found_in_open_loop(seed, pole):
    rng = np.random.default_rng(seed)
    u = levels(rng)
    noise = 0.05 * lfilter([1.0], [1, -pole], rng.standard_normal(N))
    assert feedback_chance(first_order(u) + noise, u, 20) > 1e-3


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(("gain", "integral"), [(1.0, 0.0), (0.5, 0.03)])
def test_a_controller_is_found_by_the_noise_that_it_passes_on(seed, gain, integral):
    rng = np.random.default_rng(seed)
    noise = 0.05 * lfilter([1.0], [1, -0.9], rng.standard_normal(N))
    u, y = loop(rng, gain, integral, noise)
    assert feedback_chance(y, u, 20) < SURE


def test_set_points_that_move_the_input_more_than_noise_hide_no_feedback():
    rng = np.random.default_rng(0)
    u, y = loop(rng, 2.0, 0.0, 0.02 * rng.standard_normal(N))
    assert feedback_chance(y, u, 20) < SURE


def test_an_input_that_its_own_past_tells_says_nothing_of_feedback():
    rng = np.random.default_rng(0)
    u = np.sin(0.1 * np.arange(N))
    y = first_order(u) + 0.05 * rng.standard_normal(N)
    assert feedback_chance(y, u, 20) == 1.0


def test_units_change_no_chance():
    rng = np.random.default_rng(3)
    u, y = loop(rng, 0.3, 0.01, 0.05 * rng.standard_normal(N))
    one = feedback_chance(y, u, 20)
    assert feedback_chance(1e3 * y + 7, 1e-3 * u - 2, 20) == pytest.approx(one, rel=1e-4)


@pytest.mark.parametrize("seed", range(5))
def test_a_linear_plant_is_not_called_nonlinear(seed):
    rng = np.random.default_rng(seed)
    u = levels(rng)
    y = first_order(u) + 0.02 * rng.standard_normal(N)
    assert nonlinear_chance(y, u, 40)[0] > 1e-3


@pytest.mark.parametrize("bent", [lambda u: u + 0.4 * u**2, lambda u: np.sign(u) * u**2 + 0.3 * u])
def test_a_static_nonlinearity_is_found(bent):
    rng = np.random.default_rng(1)
    u = np.repeat(rng.choice([-1.0, -0.5, 0.0, 0.5, 1.0], N // 12), 12)
    y = first_order(bent(u)) + 0.01 * rng.standard_normal(N)
    chance, part = nonlinear_chance(y, u, 40)
    assert chance < 1e-5
    assert 0.05 < part < 1


def test_records_too_short_for_the_regression_say_nothing():
    rng = np.random.default_rng(1)
    u = rng.standard_normal(80)
    assert feedback_chance(u, u, 20) == 1.0
    assert nonlinear_chance(u, u, 20) == (1.0, 0.0)
