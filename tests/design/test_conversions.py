"""Conversions against closed forms and arbitrary precision."""

import math
from contextlib import nullcontext

import control as ct
import mpmath as mp
import numpy as np
import pytest

import ctrl_realize as cr

DT = 7.8125e-4


@pytest.mark.parametrize("delay", [0, 37, 100, 300, 1000])
def test_transfer_function_has_the_response_of_the_system(valve, delay):
    plant = valve(delay)
    tf = cr.design.to_tf(plant)
    z = np.exp(1j * np.array([0.001, 0.05, 0.5, 3.0]))
    # The core's own polynomial: a triple pole cluster near z = 1 costs 3 to 4 digits.
    np.testing.assert_allclose(tf(z), plant(z), rtol=1e-8)
    assert tf.den[0][0].size == 4 + delay
    np.testing.assert_array_equal(tf.den[0][0][4:], 0)
    assert tf.name == "valve"


@pytest.mark.parametrize(("dt", "lost"), [(0.002, True), (0.5, False)])
def test_coefficients_that_cancel_are_told(dt, lost):
    # (s + 1)^6: at 2 ms a gain of 0.191, of 1, without a word; at 0.5 s seven digits are left
    plant = cr.delayed_ss(ct.tf([1], np.poly([-1] * 6)), dead_time=50 * dt, dt=dt)
    context = pytest.warns(cr.errors.DataWarning, match="cancel") if lost else nullcontext()
    with context:
        tf = cr.design.to_tf(plant)
    assert lost or tf.dcgain() == pytest.approx(1, rel=1e-6)
    assert plant.dcgain() == pytest.approx(1, rel=1e-9)


@pytest.mark.parametrize("dead_time", [0.0, 0.0289, 0.0289 + DT / 3, 37 * DT, 0.4 * DT])
def test_continuous_and_back_is_the_identity(valve, dead_time):
    continuous = cr.design.to_continuous(valve(0)).core
    plant = cr.design.to_discrete(continuous, dead_time, DT)
    core, found = cr.design.to_continuous(plant)
    # A relative degree of 2 leaves (f dt)^2 of a fraction to see: a few digits less.
    assert found == pytest.approx(dead_time, abs=2e-6)
    np.testing.assert_allclose(np.sort(core.poles()), np.sort(continuous.poles()), rtol=1e-9)
    again = cr.design.to_discrete(cr.design.to_continuous(plant))
    np.testing.assert_allclose(again.step(500), plant.step(500), atol=1e-11)


@pytest.mark.parametrize("fraction", [0.0134, 0.0099, 0.5, 0.782])
@pytest.mark.parametrize("den", [[0.233, 1.052, 1.0], [1.094, 1.0, 0.0], [9.46, 14.96, 8.05, 1, 0]])
def test_a_fraction_at_which_the_feedthrough_touches_its_value_is_found(fraction, den):
    """There is no change of sign: the fraction was left in a core whose response jumps."""
    plant = cr.delayed_ss(ct.tf([2.0], den), dead_time=(11 + fraction) * 0.05, dt=0.05)
    core, dead_time = cr.design.to_continuous(plant)
    # an integrator behind three lags leaves (f dt)^4 of a fraction to see
    assert dead_time == pytest.approx((11 + fraction) * 0.05, abs=1e-4)
    assert abs(core.D.item()) == 0


@pytest.mark.parametrize("order", [1, 2, 3, 5, 10, 15, 20])
def test_pade_is_the_ratio_of_exact_polynomials(order):
    """Q(-s)/Q(s) with integer coefficients, in 60 digits."""
    tau, delay = 0.3, cr.design.pade_ss(0.3, order)
    omega = np.array([0.1, 5.0, 40.0, 300.0])
    with mp.workdps(60):

        def Q(s):
            return mp.fsum(
                mp.mpf(math.factorial(2 * order - k))
                / (math.factorial(k) * math.factorial(order - k))
                * s**k
                for k in range(order + 1)
            )

        exact = [complex(Q(-1j * mp.mpf(w) * tau) / Q(1j * mp.mpf(w) * tau)) for w in omega]
    np.testing.assert_allclose(delay(1j * omega), exact, atol=1e-13)
    assert np.all(delay.poles().real < 0)


@pytest.mark.parametrize(
    "F",
    [
        np.diag([-1.0, -1.0, -1.0]) + np.diag([5.0, 5.0], 1),  # one Jordan block
        np.diag([-1.0, -1.0 - 1e-9, -1.0 + 1e-9]) + np.diag([1.0, 1.0], 1),  # nearly one
        np.array([[-0.1, 3.1, 1.0], [-3.1, -0.1, 2.0], [0.0, 0.0, -5.0]]),  # by the Nyquist pole
        np.diag([-1e-6, -1.0, -20.0]) + np.diag([10.0, 100.0], 1),
    ],
    ids=["defective", "nearly defective", "near Nyquist", "far apart"],
)
def test_a_core_and_back_is_the_core(F):
    core = ct.ss(F, [[0.0], [0.0], [1.0]], [[1.0, 0.0, 0.0]], 0)
    back = cr.design.to_continuous(cr.design.to_discrete(core, 3.0, 1.0)).core
    # exp keeps 1e-16 of its norm; the logarithm loses what the slowest mode has less than that
    np.testing.assert_allclose(back.A, F, rtol=0, atol=1e-7 * np.abs(F).max())


# a feedthrough that starts as the cube of the fraction tells it to the cube root of rounding
@pytest.mark.parametrize(("samples", "near"), [(4.0, 1e-12), (4.3, 5e-5)])
@pytest.mark.parametrize("dt", [1e-6, 1.0, 1e4])
def test_a_plain_core_of_any_speed_and_back_has_its_response(dt, samples, near):
    # python-control's companion form of lags of microseconds has entries from 1 to 1e15
    den = np.polymul(np.polymul([0.6 * dt, 1], [0.9 * dt, 1]), [1.8 * dt, 1])
    sampled = cr.design.to_discrete(ct.ss(ct.tf([3.0], den)), samples * dt, dt)
    found = cr.design.to_continuous(sampled)
    s = 1j * np.geomspace(0.01, 2, 9) / dt
    expected = 3.0 / np.polyval(den, s) * np.exp(-samples * dt * s)
    response = found.core(s) * np.exp(-found.dead_time * s)
    np.testing.assert_allclose(response, expected, rtol=near)
