"""Gain and dead time of parts of a record against the common model."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from ctrl_realize.numerics.validation.parameter_change import parameter_change

N = 900
THIRDS = 3 * np.arange(N) // N


def response(rng):
    u = np.repeat(rng.choice([-1.0, 0.0, 1.0], N // 15), 15)
    return lfilter([0.0, 0.15], [1, -0.85], u)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("pole", [0.0, 0.9])
def test_parts_of_one_plant_do_not_differ(seed, pole):
    rng = np.random.default_rng(seed)
    noise = 0.03 * lfilter([1.0], [1, -pole], rng.standard_normal(N))
    assert parameter_change(noise, response(rng), THIRDS).chance > 1e-3


def test_a_gain_that_falls_is_measured_part_by_part():
    rng = np.random.default_rng(0)
    model = response(rng)
    truth = np.array([0.2, 0.0, -0.2])
    residual = truth[THIRDS] * model + 0.01 * rng.standard_normal(N)
    found = parameter_change(residual, model, THIRDS)
    assert found.chance < 1e-6
    assert np.all(np.abs(found.gains - truth) < 4 * found.gain_errors + 0.02)


def test_a_delay_that_depends_on_the_direction_is_measured():
    rng = np.random.default_rng(0)
    model = response(rng)
    rising = (np.gradient(model) > 0).astype(int)
    late = np.array([0.5, -0.5])  # samples; small, the regression being one on the derivative
    residual = -late[rising] * np.gradient(model) + 0.002 * rng.standard_normal(N)
    found = parameter_change(residual, model, rising)
    assert found.chance < 1e-6
    assert found.shifts == pytest.approx(late, abs=0.1)


def test_one_group_or_no_motion_is_no_comparison():
    rng = np.random.default_rng(0)
    noise = rng.standard_normal(N)
    assert parameter_change(noise, response(rng), np.zeros(N, dtype=int)) is None
    assert parameter_change(np.zeros(N), response(rng), THIRDS) is None
