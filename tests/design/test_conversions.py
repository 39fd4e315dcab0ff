"""Conversions against closed forms and arbitrary precision."""

from __future__ import annotations

import math
import pickle

import control as ct
import mpmath as mp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import ctrl_realize as cr
from ctrl_realize.errors import DelayRangeError, OptionError, UnsuitableSystemError

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


def test_transfer_function_keeps_the_relative_degree(valve):
    tf = cr.design.to_tf(valve(100))
    assert tf.den[0][0].size - tf.num[0][0].size == 101
    direct = cr.design.to_tf(cr.delayed_ss(ct.ss([[0.5]], [[1.0]], [[1.0]], [[2.0]], 0.1), 2))
    np.testing.assert_allclose(direct.num[0][0], [2.0, 0.0])
    np.testing.assert_allclose(direct.den[0][0], [1.0, -0.5, 0, 0])


def test_every_channel_gets_its_own_delay():
    core = ct.ss(np.diag([0.5, 0.8]), np.eye(2), [[1.0, 2.0], [0.0, 1.0]], 0, 0.1)
    plant = cr.delayed_ss(core, [1, 3], output_delay=[0, 2])
    tf = cr.design.to_tf(plant)
    z = np.exp(0.7j)
    np.testing.assert_allclose(tf(z), plant(z), rtol=1e-12, atol=1e-12)


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


@given(
    pole=st.floats(-5.0, -0.01), gain=st.floats(-3, 3).filter(lambda x: abs(x) > 0.01),
    fraction=st.floats(0.02, 0.98), samples=st.integers(0, 50),
)  # fmt: skip
def test_a_fraction_of_a_sample_is_found_again(pole, gain, fraction, samples):
    plant = cr.delayed_ss(ct.ss(pole, 1, gain, 0), dead_time=0.1 * (samples + fraction), dt=0.1)
    core, dead_time = cr.design.to_continuous(plant)
    assert dead_time == pytest.approx(0.1 * (samples + fraction), rel=1e-9)
    assert core.poles()[0] == pytest.approx(pole, rel=1e-9)


def test_integrators_have_a_continuous_counterpart():
    core = ct.ss(ct.tf([2.0], [0.1, 1, 0, 0]))
    plant = cr.design.to_discrete(core, 0.3, 0.01)
    found, dead_time = cr.design.to_continuous(plant)
    assert dead_time == pytest.approx(0.3)
    omega = 1j * np.array([0.3, 3.0])
    np.testing.assert_allclose(found(omega), core(omega), rtol=1e-6)  # a double pole at z = 1


def test_several_channels_are_converted():
    core = ct.ss(np.diag([-1.0, -2.0]), np.eye(2), [[1.0, 0.3]], 0)
    found, dead_time = cr.design.to_continuous(cr.delayed_ss(core, dead_time=0.5, dt=0.1))
    np.testing.assert_allclose(found(2j), core(2j), rtol=1e-12)
    assert dead_time == pytest.approx(0.5)


def test_continuous_model_pickles_unpacks_and_prints(valve):
    model = cr.design.to_continuous(valve(37))
    again = pickle.loads(pickle.dumps(model))
    np.testing.assert_array_equal(again.core.A, model.core.A)
    assert again.dead_time == model.dead_time == pytest.approx(37 * DT)
    assert "dead time" in model.report()
    assert "\n" not in repr(model)


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


def test_pade_of_order_20_is_well_conditioned():
    delay = cr.design.pade_ss(0.0289, 20)
    A, B = np.asarray(delay.A), np.asarray(delay.B)
    # Lossless: the identity is its Gramian.
    np.testing.assert_allclose(A + A.T, -B @ B.T, atol=1e-9 * np.abs(A).max())
    assert np.linalg.cond(A) < 1000


@pytest.mark.parametrize(
    ("order", "hertz", "error"), [(3, 13, 4e-3), (5, 13, 1e-5), (10, 50, 1e-5)]
)
def test_pade_errors_are_those_promised(order, hertz, error):
    omega = 2 * np.pi * np.linspace(0.1, hertz, 50)
    exact = np.exp(-1j * omega * 0.0289)
    assert np.abs(cr.design.pade_ss(0.0289, order)(1j * omega) - exact).max() < error


def test_continuous_model_with_pade_is_close_to_the_sampled_plant(valve):
    model = cr.design.to_continuous(valve(37))
    omega = 2 * np.pi * 2.0
    held = (1 - np.exp(-1j * omega * DT)) / (1j * omega * DT)
    expected = valve(37)(np.exp(1j * omega * DT))
    # The hold's sinc is the only difference that is left: folded bands are below 1e-3.
    assert model.pade(8)(1j * omega) * held == pytest.approx(expected, rel=1e-3)


@given(order=st.integers(1, 6), delay=st.floats(0.5, 40.0))
def test_thiran_is_all_pass_and_has_its_delay_at_low_frequency(order, delay):
    found = cr.design.thiran(0.01 * delay, 0.01, order)
    z = np.exp(1j * np.array([1e-4, 0.5, 2.0, 3.0]))
    np.testing.assert_allclose(np.abs(found(z)), 1.0, rtol=1e-10)
    assert -np.angle(found(z[0])) / 1e-4 == pytest.approx(delay, rel=1e-6)
    assert np.all(np.abs(found.poles()) < 1)


def test_thiran_of_whole_samples_is_the_delay_itself():
    found = cr.design.thiran(0.37, 0.01)
    assert found.delay == 37
    assert found.delay_free.nstates == 0


def test_impossible_conversions_are_refused(valve):
    negative = ct.ss([[-0.5]], [[1.0]], [[1.0]], 0, 0.1)
    with pytest.raises(UnsuitableSystemError, match=r"z = -0\.5"):
        cr.design.to_continuous(cr.delayed_ss(negative, 3))
    with pytest.raises(UnsuitableSystemError, match="z = 0"):
        cr.design.to_continuous(cr.delayed_ss(ct.ss([[0.0]], [[1.0]], [[1.0]], 0, 0.1), 3))
    with pytest.raises(UnsuitableSystemError, match="discrete system"):
        cr.design.to_continuous(ct.ss(-1, 1, 1, 0))
    two = cr.delayed_ss(ct.ss(np.diag([0.5, 0.5]), np.eye(2), [[1.0, 1.0]], 0, 0.1), [1, 2])
    with pytest.raises(UnsuitableSystemError, match="different delays"):
        cr.design.to_continuous(two)
    with pytest.raises(UnsuitableSystemError, match="discrete already"):
        cr.design.to_discrete(valve(3), 0.0, DT)
    with pytest.raises(UnsuitableSystemError, match="more zeros than poles"):
        cr.design.to_discrete(ct.tf([1, 1, 1], [1, 1]), 0.0, DT)
    with pytest.raises(OptionError, match="dt=None"):
        cr.design.to_discrete(ct.tf([1], [1, 1]), 0.1)
    with pytest.raises(OptionError, match="order=21"):
        cr.design.pade_ss(0.1, 21)
    with pytest.raises(OptionError, match="dead_time=0"):
        cr.design.pade_ss(0.0)
    with pytest.raises(DelayRangeError, match="half a sample"):
        cr.design.thiran(0.003, 0.01)
    with pytest.raises(DelayRangeError, match=">= 0"):
        cr.design.thiran(-0.003, 0.01)


def test_systems_are_not_changed(valve):
    plant = valve(5)
    before = [np.array(M) for M in (plant.A, plant.B, plant.C, plant.D)]
    cr.design.to_tf(plant)
    cr.design.to_continuous(plant)
    for a, b in zip(before, (plant.A, plant.B, plant.C, plant.D), strict=True):
        np.testing.assert_array_equal(a, b)


def test_a_sample_time_is_not_taken_for_the_dead_time_of_a_model(valve):
    model = cr.design.to_continuous(valve(37))
    with pytest.raises(OptionError, match="dead time of its own"):
        cr.design.to_discrete(model, DT / 2)
    finer = cr.design.to_discrete(model, dt=DT / 2)
    assert finer.dead_time == pytest.approx(model.dead_time, abs=DT / 2)
    replaced = cr.design.to_discrete(model, 10 * DT, DT)
    assert replaced.dead_time == pytest.approx(10 * DT)


def test_a_conversion_draws_nothing_from_numpys_global_generator():
    core = ct.ss(
        np.diag([0.9, 0.8, 0.7, 0.6, 0.5]) + np.diag([0.3] * 4, 1), np.eye(5), np.eye(5), 0, 1
    )
    before = np.random.get_state()  # noqa: NPY002 - it is what must not be touched
    cr.design.to_continuous(cr.delayed_ss(core, 2))
    after = np.random.get_state()  # noqa: NPY002
    np.testing.assert_array_equal(before[1], after[1])
    assert before[2:] == after[2:]


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
