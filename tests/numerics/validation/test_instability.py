"""An unstable plant in a loop is told from stable ones by how its output predicts itself."""

import numpy as np
import pytest
from scipy.signal import lfilter

from ctrl_realize.numerics.validation.instability import unstable_chance

N = 600
SURE = 1e-6


def held(rng, pole, gain=2.0, noise=0.02):
    """First-order plant with a delay of two samples, held by a proportional controller."""
    target = np.repeat(rng.choice([-1.0, 0.0, 1.0], N // 60), 60)
    u, y, state = np.zeros(N), np.zeros(N), 0.0
    for k in range(N):
        y[k] = state + noise * rng.standard_normal()
        u[k] = gain * (target[k] - y[k])
        state = pole * state + 0.05 * (u[k - 2] if k >= 2 else 0.0)
    return u, y


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("pole", [1.02, 1.05])
def test_a_pole_outside_the_unit_circle_is_found_in_a_loop(seed, pole):
    u, y = held(np.random.default_rng(seed), pole)
    assert unstable_chance(y, u, 30) < SURE


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("pole", [0.9, 0.98, 1.0])
def test_no_stable_plant_in_a_loop_and_no_integrator_is_called_unstable(seed, pole):
    u, y = held(np.random.default_rng(seed), pole)
    assert unstable_chance(y, u, 30) > 1e-2


@pytest.mark.parametrize("seed", range(10))
def test_a_random_walk_is_not_called_unstable(seed):
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.choice([-1.0, 1.0], N // 12), 12)
    y = lfilter([0.0, 0.1], [1, -0.9], u) + 0.1 * np.cumsum(rng.standard_normal(N))
    assert unstable_chance(y, u, 30) > 1e-3


def test_the_units_and_levels_of_the_signals_do_not_matter():
    u, y = held(np.random.default_rng(0), 1.02, noise=0.3)
    one = unstable_chance(y, u, 30)
    assert unstable_chance(1e3 * y + 7, 1e-3 * u - 2, 30) == pytest.approx(one, rel=1e-4)


def test_a_second_input_takes_nothing_from_the_test():
    rng = np.random.default_rng(1)
    u, y = held(rng, 1.02)
    assert unstable_chance(y, np.stack([u, rng.standard_normal(N)]), 30) < SURE


def test_without_noise_or_with_few_samples_nothing_is_said():
    u, y = held(np.random.default_rng(0), 1.02, noise=0.0)
    assert unstable_chance(y, u, 30) == 1.0
    assert unstable_chance(y[:80], u[:80], 30) == 1.0
