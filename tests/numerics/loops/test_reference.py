"""The PI that a model asks for, and the largest sensitivity of its loop on other models."""

import control as ct
import numpy as np
import pytest
from numpy.testing import assert_allclose

from ctrl_realize.numerics.engine.plausible_models import PlausibleModel
from ctrl_realize.numerics.loops.reference import (
    controller_response,
    grid,
    largest_sensitivity,
    model_response,
    robust_pi,
    simc_pi,
)

DT = 0.05
OMEGA = np.geomspace(1e-3, np.pi / DT, 4000)


def model(dead_time, poles, *numerator):
    return PlausibleModel(dead_time, np.array(poles, dtype=complex), np.array(numerator))


def test_a_response_is_that_of_the_transfer_function():
    found = model_response(model(0.4, [-1.0, -2 + 1j, -2 - 1j], 3.0, 0.7), OMEGA)
    s = 1j * OMEGA
    assert_allclose(found, np.exp(-0.4 * s) * (3 + 0.7 * s) / ((s + 1) * (s**2 + 4 * s + 5)))


def test_simc_of_a_first_order_model_is_that_of_the_paper():
    # kp = T / (2 k theta), ti = min(T, 8 theta), with the hold's half sample in theta
    theta = 0.4 + DT / 2
    assert_allclose(simc_pi(model(0.4, [-0.5], 1.5), DT), (2.0 / (2 * 3.0 * theta), 2.0))
    assert_allclose(simc_pi(model(0.4, [-0.05], 1.5), DT)[1], 8 * theta)
    # an integrator of slope 1.5
    assert_allclose(simc_pi(model(0.4, [0.0], 1.5), DT), (1 / (2 * 1.5 * theta), 8 * theta))


def test_the_largest_sensitivity_is_that_of_python_control():
    plant = ct.tf([2.0], [3.0, 4.0, 1.0])
    for gain in (0.3, 1.0, 4.0):
        loop = gain * plant * ct.tf([3.0, 1.0], [3.0, 0.0])
        found = largest_sensitivity(loop(1j * np.geomspace(1e-3, 1e3, 20000)))
        assert found == pytest.approx(1 / ct.stability_margins(loop)[2], rel=1e-5)


@pytest.mark.parametrize(("gain", "stable"), [(0.98, True), (1.02, False)])
def test_a_loop_is_unstable_beyond_its_gain_margin(gain, stable):
    # K exp(-s L) / s is stable for K L < pi / 2
    loop = gain * np.pi / 2 * np.exp(-1j * OMEGA) / (1j * OMEGA)
    assert np.isfinite(largest_sensitivity(loop)) == stable


@pytest.mark.parametrize("damping", [0.1, 0.3, 0.8])
def test_the_loop_with_a_plant_that_swings_is_robust(damping):
    pair = np.roots([1.0, 2 * damping, 1.0])
    plant = model(0.3, pair, 1.0)
    omega = grid(plant, DT)
    loop = controller_response(*robust_pi(plant, DT), omega, DT) * model_response(plant, omega)
    assert largest_sensitivity(loop) <= 1.7
