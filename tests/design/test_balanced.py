"""Balanced truncation against its bound, its Gramians and closed forms."""

from __future__ import annotations

import control as ct
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import solve_discrete_lyapunov

import ctrl_realize as cr
from ctrl_realize.errors import OptionError, OrderError


def random_core(seed, n, inputs=1, outputs=1):
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((n, n))
    A *= 0.97 / np.abs(np.linalg.eigvals(A)).max()
    matrices = (rng.standard_normal(s) for s in ((n, inputs), (outputs, n), (outputs, inputs)))
    return ct.ss(A, *matrices, 0.1)


@given(seed=st.integers(0, 1000), n=st.integers(1, 8), order=st.integers(0, 8))
def test_error_is_within_the_bound_and_the_delay_is_kept(seed, n, order):
    core, order = random_core(seed, n, 2, 1), min(order, n)
    small = cr.design.reduce(cr.delayed_ss(core, 37), order)
    assert small.delay == 37
    assert small.delay_free.nstates == order
    z = np.exp(1j * np.linspace(0, np.pi, 200))
    error = np.linalg.norm(core(z) - small.delay_free(z), axis=0).max()  # (1, 2, K)
    assert error <= small.fit.error_bound * (1 + 1e-6) + 1e-9


@given(seed=st.integers(0, 1000), n=st.integers(1, 6))
def test_singular_values_are_roots_of_the_product_of_gramians(seed, n):
    core = random_core(seed, n)
    P = solve_discrete_lyapunov(core.A, core.B @ core.B.T)
    Q = solve_discrete_lyapunov(core.A.T, core.C.T @ core.C)
    expected = np.sqrt(np.sort(np.abs(np.linalg.eigvals(P @ Q)))[::-1])
    found = cr.design.hankel_singular_values(cr.delayed_ss(core, 5))
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-7 * expected[0])


def test_reduced_gramians_are_the_kept_singular_values():
    small = cr.design.reduce(cr.delayed_ss(random_core(3, 6), 4), 3).delay_free
    values = cr.design.hankel_singular_values(random_core(3, 6))[:3]
    P = solve_discrete_lyapunov(small.A, small.B @ small.B.T)
    np.testing.assert_allclose(np.diag(P)[0], values[0], rtol=0.2)
    full = cr.design.reduce(random_core(3, 6), 6).delay_free
    P = solve_discrete_lyapunov(full.A, full.B @ full.B.T)
    Q = solve_discrete_lyapunov(full.A.T, full.C.T @ full.C)
    np.testing.assert_allclose(P, Q, atol=1e-8 * P[0, 0])
    np.testing.assert_allclose(P, np.diag(np.diag(P)), atol=1e-8 * P[0, 0])


def test_first_order_has_its_closed_form():
    found = cr.design.hankel_singular_values(ct.ss(0.5, 1.0, 3.0, 0, 0.1))
    np.testing.assert_allclose(found, [3 / (1 - 0.25)], rtol=1e-14)


@given(scale=st.floats(0.1, 10.0))
def test_scaling_the_system_scales_the_values(scale):
    core = random_core(1, 4)
    np.testing.assert_allclose(
        cr.design.hankel_singular_values(scale * core),
        scale * cr.design.hankel_singular_values(core),
        rtol=1e-9,
    )


def test_the_smallest_order_within_a_tolerance_is_taken(valve):
    plant = valve(37)
    for tolerance in (1e-1, 1e-2, 1e-3, 1e-9):
        small = cr.design.reduce(plant, tolerance=tolerance)
        assert small.fit.error_bound <= tolerance
        order = small.delay_free.nstates
        if order:
            assert cr.design.reduce(plant, order - 1).fit.error_bound > tolerance


def test_integrators_and_unstable_poles_are_kept(cores):
    for kind, pole in (("integrating", 1.0), ("unstable", 1.0005)):
        small = cr.design.reduce(cr.delayed_ss(cores[kind], 9), 1)
        np.testing.assert_allclose(small.delay_free.poles(), [pole], rtol=1e-9)
        assert small.fit.kept_unstable == 1
        assert small.delay == 9
        z = np.exp(1j * np.array([0.1, 1.0]))
        error = np.abs(small.delay_free(z) - cores[kind](z)).max()
        assert error <= small.fit.error_bound * (1 + 1e-9)


def test_wrong_orders_are_refused(cores, valve):
    with pytest.raises(OrderError, match=r"1\.\.\.2"):
        cr.design.reduce(cr.delayed_ss(cores["integrating"], 9), 0)
    with pytest.raises(OrderError, match=r"order=4.*0\.\.\.3"):
        cr.design.reduce(valve(1), 4)
    with pytest.raises(OptionError, match="exactly one"):
        cr.design.reduce(valve(1))
    with pytest.raises(OptionError, match="exactly one"):
        cr.design.reduce(valve(1), 2, tolerance=0.1)
