"""Poles as real and quadratic factors: there and back, derivatives, coinciding poles."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from ctrl_realize.numerics.separable.poles import parameters_from_poles, poles_from_parameters

GAP = 0.01  # relative distance that coinciding poles of one pair are given


def ordered(poles):
    return np.array(sorted(poles, key=lambda p: (round(abs(p), 9), p.imag)))


SETS = [
    [-3.0],
    [-1.0, -4.0],
    [-2.0, -1.0, -5.0],
    [-9.0, -1.0, -5.0, -2.0],
    [-3 + 4j, -3 - 4j],
    [-3 + 4j, -3 - 4j, -2.0],
    [-1.0, -6 + 1j, -6 - 1j, -2.0, -0.1 + 30j, -0.1 - 30j],
]


@pytest.mark.parametrize("poles", SETS)
@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
def test_poles_come_back_in_any_unit_of_time(poles, unit):
    poles = unit * np.array(poles, dtype=complex)
    theta = parameters_from_poles(poles)
    assert theta.shape == (poles.size,)
    back = poles_from_parameters(theta[np.newaxis])[0][0]
    assert_allclose(ordered(back / unit), ordered(poles / unit), rtol=1e-9)


def test_parameters_are_logarithms_of_frequency_and_damping():
    assert_allclose(parameters_from_poles(np.array([-3 + 4j, -3 - 4j])), np.log([5, 0.6]))
    # two real poles: their geometric mean, and a damping above one
    assert_allclose(parameters_from_poles(np.array([-4.0 + 0j, -1.0])), np.log([2, 1.25]))
    # an odd one stands first; it is the slowest of the real ones
    three = parameters_from_poles(np.array([-4.0 + 0j, -0.5, -1.0]))
    assert_allclose(three, np.log([0.5, 2, 1.25]))


@given(
    zeta=st.one_of(st.floats(0.01, 0.98), st.floats(1.02, 50)),
    omega=st.floats(1e-3, 1e3),
    rate=st.floats(1e-3, 1e3),
)
def test_derivatives_are_those_of_differences(zeta, omega, rate):
    theta = np.log([rate, omega, zeta])
    poles, derivative = poles_from_parameters(theta[np.newaxis])
    h = 1e-6
    for q in range(3):
        step = h * (np.arange(3) == q)
        up = poles_from_parameters((theta + step)[np.newaxis])[0]
        down = poles_from_parameters((theta - step)[np.newaxis])[0]
        size = np.abs(poles).max()
        if np.abs(poles[0, 0] - poles[0, 1:]).min() < 0.02 * rate:
            continue  # moved apart, which the derivative does not follow
        # curvature of the root near a damping of one: h / (zeta - 1)
        assert_allclose(derivative[0, :, q], ((up - down) / (2 * h))[0], atol=1e-4 * size)


@pytest.mark.parametrize("zeta", [1.0, 1 - 1e-9, 1 + 1e-9, 1 - 1e-5, 1 + 1e-5])
def test_a_double_pole_is_given_apart(zeta):
    poles = poles_from_parameters(np.log([[7.0, zeta]]))[0][0]
    apart = (poles[0] - poles[1]) / 7
    # 1 / (zeta + root) for zeta - root: their product is not quite one, by root^2
    assert_allclose(abs(apart), GAP, rtol=GAP / 2)
    # below a damping of one they stay a pair
    assert bool(abs(apart.imag) > 0) == (zeta < 1)
    assert_allclose(poles.mean(), -7, rtol=1e-4)


@pytest.mark.parametrize("zeta", [1e-3, 0.3, 30.0, 1e6])
def test_nothing_cancels_far_from_a_double_pole(zeta):
    poles = poles_from_parameters(np.log([[7.0, zeta]]))[0][0]
    assert_allclose(np.prod(poles), 49, rtol=1e-12)


def real_poles(*rates):
    return poles_from_parameters(parameters_from_poles(-np.array(rates) + 0j)[np.newaxis])[0][
        0
    ].real


def test_equal_poles_of_different_factors_are_moved_to_faster_ones():
    found = np.sort(-real_poles(3.0, 3.0, 9.0))
    assert_allclose(found, [3.0, 3.0 * (1 + GAP), 9.0], rtol=1e-9)
    many = np.sort(-real_poles(3.0, 3.0, 3.0, 3.0, 3.0))
    assert np.min(np.diff(many)) > 0.4 * GAP * 3
    assert many[0] > 3 * (1 - GAP)
    assert many[-1] < 3 * (1 + 6 * GAP)
