"""realize: exact data come back exactly, in python-control's own hands as well."""

import control as ct
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import ctrl_realize as cr
from ctrl_realize.numerics.state_space.responses import markov
from tests.oracles.plants import modal, valve_pulse
from tests.rigs import R3, TS, exact_step


@pytest.fixture(scope="module")
def valve():
    """R3 behind 37 samples, sampled exactly: matrices and 3000 Markov parameters."""
    plant = ct.ss(ct.c2d(ct.ss(R3), TS, "zoh"))
    return plant, valve_pulse("clean", n=3000)


@pytest.mark.parametrize("hankel", ["square", "padded"])
def test_exact_third_order_plant_behind_37_samples_is_found_exactly(valve, hankel):
    plant, pulse = valve
    sys = cr.realize(pulse, 3, delay=37, hankel=hankel, dt=TS)
    assert isinstance(sys, ct.StateSpace)
    assert (sys.nstates, sys.delay, sys.delay_free.nstates) == (40, 37, 3)
    omega = np.linspace(1e-3, np.pi / TS, 4000)
    z = np.exp(1j * omega * TS)
    assert_allclose(sys(z), plant(z) * z**-37, rtol=0, atol=1e-9)
    time = np.arange(3000) * TS
    response = ct.step_response(sys, time).outputs
    assert_allclose(response, exact_step(R3, time - 37 * TS), rtol=0, atol=1e-9)


@given(
    order=st.integers(1, 6),
    seed=st.integers(0, 1000),
    delay=st.integers(0, 20),
    channels=st.sampled_from([(1, 1), (2, 2), (1, 3)]),
)
def test_markov_parameters_of_a_minimal_system_are_returned(order, seed, delay, channels):
    # five samples of 0.97**n would not do for the order-6 plants below
    system = modal(np.random.default_rng(seed), order, *channels)
    pulse = np.concatenate([np.zeros((*channels, delay)), markov(*system, 201)], axis=2)
    sys = cr.realize(pulse[0, 0] if channels == (1, 1) else pulse, order, delay=delay, dt=1.0)
    back = sys.markov(201 + delay).reshape(pulse.shape)
    assert_allclose(back, pulse, rtol=0, atol=1e-12 * np.abs(pulse).max())


def test_direct_term_within_the_noise_is_left_out():
    rng = np.random.default_rng(1)
    pulse, noise = (
        valve_pulse("clean") + 1e-4 * rng.standard_normal(1101),
        1e-4 * rng.standard_normal(500),
    )
    noisy = cr.ImpulseResponse(pulse, TS, noise=noise)

    def direct_term(delay: int, **kwargs) -> float:
        return cr.realize(noisy, 3, delay=delay, **kwargs).delay_free.D[0, 0]

    assert direct_term(37) == 0
    assert direct_term(37, feedthrough=True) == pulse[37]
    assert direct_term(80) == pulse[80]  # 20 times the noise


def test_another_time_unit_scales_the_dead_time_and_nothing_else():
    pulse = valve_pulse("zero-phase", n=500)
    s, ms = cr.realize(pulse, 3, delay=37, dt=TS), cr.realize(pulse, 3, delay=37, dt=1e3 * TS)
    assert ms.delay == s.delay
    assert ms.dead_time == pytest.approx(1e3 * s.dead_time, rel=1e-15)
    assert np.array_equal(ms.delay_free.A, s.delay_free.A)


# the direct term
