"""Responses of state-space models against python-control and plain recursions."""

from __future__ import annotations

import control as ct
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from ctrl_realize.numerics.state_space.responses import responses, sampling


def system(seed: int, n: int = 4, m: int = 2, p: int = 3, radius: float = 0.95):
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((n, n))
    A *= radius / np.abs(np.linalg.eigvals(A)).max()
    return (
        A,
        rng.standard_normal((n, m)),
        rng.standard_normal((p, n)),
        rng.standard_normal((p, m)),
    )


def recursion(A, B, C, D, u, x):
    out = np.empty((C.shape[0], u.shape[1]))
    for k in range(u.shape[1]):
        out[:, k] = C @ x + D @ u[:, k]
        x = A @ x + B @ u[:, k]
    return out


@given(seed=st.integers(0, 10**6), n=st.integers(1, 12), m=st.integers(1, 3), p=st.integers(1, 3))
def test_frequency_response_equals_the_solve(seed, n, m, p):
    A, B, C, D = system(seed, n, m, p)
    z = np.exp(1j * np.linspace(0.01, np.pi, 9))
    direct = np.stack([C @ np.linalg.solve(x * np.eye(n) - A, B) + D for x in z], axis=-1)
    fast = responses.frequency_response(responses.schur_form(A), B, C, D, z)
    # Poles inside 0.95: the resolvent is at most about 1/0.05^2 for near-defective A.
    assert_allclose(fast, direct, rtol=0, atol=1e-10 * np.abs(direct).max())


def test_units_of_the_states_do_not_change_the_response():
    A, B, C, D = system(3)
    units = 2.0 ** np.linspace(-40, 40, A.shape[0]).round()  # exact in binary
    z = np.exp(1j * np.linspace(0.01, np.pi, 9))
    plain = responses.frequency_response(responses.schur_form(A), B, C, D, z)
    scaled = responses.frequency_response(
        responses.schur_form(units[:, None] * A / units), units[:, None] * B, C / units, D, z
    )
    # balanced with another start the rounding is another
    assert_allclose(scaled, plain, rtol=0, atol=1e-11 * np.abs(plain).max())


@pytest.mark.parametrize("count", [1, 2, 3, 64, 65, 66, 129, 500])
def test_markov_parameters_are_powers_of_a(count):
    A, B, C, D = system(0)
    expected = [D] + [C @ np.linalg.matrix_power(A, k) @ B for k in range(count - 1)]
    assert_allclose(
        responses.markov(A, B, C, D, count), np.stack(expected, axis=-1), rtol=0, atol=1e-12
    )


@given(seed=st.integers(0, 10**6), samples=st.integers(1, 200))
def test_simulation_equals_the_recursion(seed, samples):
    A, B, C, D = system(seed)
    rng = np.random.default_rng(seed)
    u, x = rng.standard_normal((2, samples)), rng.standard_normal(4)
    expected = recursion(A, B, C, D, u, x)
    fast = responses.simulate(A, B, C, D, u, x)
    assert_allclose(fast, expected, rtol=0, atol=1e-11 * max(1.0, np.abs(expected).max()))


def test_a_long_step_keeps_its_digits():
    # One pole at 1 - 1e-6: a running sum of a million Markov parameters would lose digits.
    A, B, C, D = (np.array([[v]]) for v in (1 - 1e-6, 1e-6, 1.0, 0.0))
    step = responses.step_response(A, B, C, D, 1_000_000)[0, 0]
    k = np.arange(1_000_000)
    # A has 1e-16 / 1e-6 of rounding in its distance from 1.
    assert_allclose(step, -np.expm1(k * np.log1p(-1e-6)), rtol=0, atol=1e-9)


@given(dt=st.floats(1e-3, 1.0), fraction=st.floats(0.0, 5.0))
def test_sampling_is_that_of_the_continuous_step(dt, fraction):
    plant = ct.ss(ct.tf([3.0], [0.5, 1.0]))
    *model, delay = sampling.sample_with_dead_time(
        plant.A, plant.B, plant.C, plant.D, dt, fraction * dt
    )
    k = np.arange(40)
    exact = np.clip(3 * -np.expm1(-np.clip(k - fraction, 0, None) * dt / 0.5), 0, None)
    step = np.zeros(40)
    step[delay:] = responses.step_response(*model, 40)[0, 0, : 40 - delay]
    assert_allclose(step, exact, rtol=0, atol=1e-8)
    assert delay in (int(np.floor(fraction)), int(np.floor(fraction)) + 1)


def test_integrators_are_sampled_exactly():
    A, B, C, D = np.zeros((1, 1)), np.ones((1, 1)), np.ones((1, 1)), np.zeros((1, 1))
    *model, delay = sampling.sample_with_dead_time(A, B, C, D, 0.5, 0.75)
    step = responses.step_response(*model, 6)[0, 0]
    assert delay == 2
    assert_allclose(step, 0.5 * np.arange(6) + 0.25, atol=1e-15)
