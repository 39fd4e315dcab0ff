"""Known dynamics are read right from any system that can be known."""

from __future__ import annotations

import control as ct
import numpy as np
import pytest
from numpy.testing import assert_allclose

from ctrl_realize.errors import UnsuitableSystemError
from ctrl_realize.identification.output_error.known import known_factor
from tests.rigs import lag, pair

S = 1j * np.array([0.1, 1.0, 7.0, 40.0, 300.0])


def response(factor):
    """Frequency response of a factor: numerator over the monic denominator."""
    return np.polyval(factor.numerator, S) / np.polyval(np.atleast_1d(np.poly(factor.poles)), S)


@pytest.mark.parametrize(
    "system",
    [
        lag(30.0),
        pair(8.0, 0.7),
        2.5 * lag(3.0) * pair(8.0, 0.1),
        ct.tf([2.0, 3.0], [1, 4.0]),  # as many zeros as poles
        ct.tf([-2.0, 6.0], [5, 4.0]),  # leading coefficients that are not one
        ct.tf([0, 0, 4.0], [2.0, 1.0, 6.0]),  # leading zeros
        ct.tf([3.0], [2.0]),  # a gain
        ct.ss([[-2.0, 1.0], [0.0, -3.0]], [[0.0], [1.0]], [[4.0, 1.0]], [[0.0]]),
    ],
)
def test_a_factor_has_the_response_of_its_system(system):
    assert_allclose(response(known_factor(system)), system(S), rtol=1e-9)


@pytest.mark.parametrize("times", [2, 3])
def test_coinciding_poles_are_given_apart_by_a_thousandth(times):
    system = lag(30.0) ** times
    poles = known_factor(system).poles
    gaps = np.abs(poles[:, None] - poles)[~np.eye(times, dtype=bool)] / (2 * np.pi * 30)
    assert gaps.min() > 0.4e-3
    assert gaps.max() < 4e-3
    # the frequency response moves by no more than the poles do
    assert_allclose(response(known_factor(system)), system(S), rtol=2e-3 * times)


@pytest.mark.parametrize(
    ("system", "match"),
    [
        (3.0, "float"),
        (lag(3.0).sample(0.1), "dt=0.1"),
        (ct.ss(-np.eye(2), np.eye(2), np.eye(2), np.zeros((2, 2))), "2 inputs, 2 outputs"),
        (ct.tf([1.0, 0, 0], [1, 1.0]), "more zeros than poles"),
        (ct.tf([1.0], [1, -2.0]), r"2\+0j rad/s.*stable"),
        (ct.tf([1.0], [1, 0.0]), "stable"),
        (ct.tf([0.0], [1, 1.0]), "zero"),
    ],
)
def test_what_cannot_be_known_dynamics_is_refused(system, match):
    with pytest.raises(UnsuitableSystemError, match=match):
        known_factor(system)
