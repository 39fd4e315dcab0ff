"""Transfer functions with dead time: basis, derivatives, state space, pole relocation."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from ctrl_realize.numerics.rational.model import (
    basis_functions,
    chain_state_space,
    factor_parameters,
    full_jacobian,
    poles_of,
    project,
)
from ctrl_realize.numerics.rational.starts import relocate_poles, trial_poles

S = 1j * np.geomspace(0.05, 20, 60)
POLES = {
    1: [-3.0],
    2: [-0.2, -9.0],
    3: [-3.0, -0.5 + 2j, -0.5 - 2j],
    4: [-0.1 + 1j, -0.1 - 1j, -0.3 + 5j, -0.3 - 5j],
    5: [-0.1, -4.0, -0.5 + 2j, -0.5 - 2j, -30.0],
}
structures = pytest.mark.parametrize(
    ("order", "count"), [(n, m) for n in POLES for m in range(1, n + 2)]
)


def theta_of(order):
    return factor_parameters(np.array(POLES[order], dtype=complex))


@pytest.mark.parametrize("order", POLES)
def test_poles_go_to_parameters_and_back(order):
    found = poles_of(theta_of(order), order)
    for pole in POLES[order]:
        assert np.abs(found - pole).min() < 1e-12 * abs(pole)


@structures
def test_basis_is_partial_products_over_the_denominator(order, count):
    basis, _ = basis_functions(S, theta_of(order), order, count)
    denominator = np.prod([S - p for p in POLES[order]], axis=0)
    # Each column times the denominator is a polynomial of its own degree.
    for degree in range(count):
        numerator = basis[:, degree] * denominator
        powers = S[:, None] ** np.arange(degree + 1)
        fit, *_ = np.linalg.lstsq(powers, numerator, rcond=None)
        assert_allclose(powers @ fit, numerator, rtol=1e-7)
        assert abs(fit[-1]) > 0


@structures
def test_state_space_chain_has_the_response_of_the_basis(order, count):
    theta = theta_of(order)
    numerator = np.random.default_rng(order * 10 + count).standard_normal(count)
    A, B, C, D = chain_state_space(theta, numerator, order)
    states = np.linalg.solve(S[:, None, None] * np.eye(order) - A, B.astype(complex))
    direct = basis_functions(S, theta, order, count)[0] @ numerator
    assert_allclose((C @ states)[:, 0, 0] + D[0, 0], direct, rtol=1e-11)


@structures
def test_derivatives_are_finite_differences(order, count):
    theta = theta_of(order)
    _, derivatives = basis_functions(S, theta, order, count)
    for i in range(order):
        step = np.zeros(order)
        step[i] = 1e-5
        ahead, behind = (
            basis_functions(S, theta + sign * step, order, count)[0] for sign in (1, -1)
        )
        # Central differences: error 1e-10, rounding 1e-11.
        assert_allclose(derivatives[i], (ahead - behind) / 2e-5, atol=1e-8 * np.abs(ahead).max())


def test_gradient_of_the_projected_misfit_is_exact():
    theta = np.append(theta_of(3) + 0.2, 0.3)
    rng = np.random.default_rng(0)
    response = rng.standard_normal(S.size) + 1j * rng.standard_normal(S.size)
    weight = rng.uniform(0.5, 2, S.size)
    here = project(S, response, weight, theta, 3, 2)
    gradient = 2 * here.jacobian.T @ here.residual
    for i in range(4):
        step = np.zeros(4)
        step[i] = 1e-6
        up, down = (
            np.sum(project(S, response, weight, theta + sign * step, 3, 2).residual ** 2)
            for sign in (1, -1)
        )
        # Kaufman's Jacobian drops a term that does not enter the gradient.
        assert gradient[i] == pytest.approx((up - down) / 2e-6, rel=1e-6, abs=1e-7)


def test_full_jacobian_is_that_of_the_weighted_model():
    theta, numerator = np.append(theta_of(3), 0.3), np.array([1.0, -0.5])
    weight = np.linspace(1, 2, S.size)

    def model(values):
        basis = basis_functions(S, values[:3], 3, 2)[0]
        out = weight * np.exp(-S * values[3]) * (basis @ values[4:])
        return np.concatenate([out.real, out.imag])

    J = full_jacobian(S, weight, theta, numerator, 3)
    values = np.concatenate([theta, numerator])
    for i in range(values.size):
        step = np.zeros(values.size)
        step[i] = 1e-5
        assert_allclose(J[:, i], (model(values + step) - model(values - step)) / 2e-5, atol=1e-8)


@given(
    st.lists(st.floats(0.1, 15), min_size=0, max_size=2),
    st.lists(st.tuples(st.floats(0.2, 10), st.floats(0.03, 0.9)), min_size=0, max_size=2),
)
def test_relocated_poles_reach_those_of_an_exact_response(real, pairs):
    poles = [-complex(w) for w in real]
    for w, zeta in pairs:
        p = w * complex(-zeta, np.sqrt(1 - zeta**2))
        poles += [p, p.conjugate()]
    gaps = [abs(p - q) / max(abs(p), abs(q)) for i, p in enumerate(poles) for q in poles[:i]]
    if not poles or min(gaps, default=1) < 0.15:
        return  # equal poles are no partial fractions, and hardly identifiable
    response = sum(1 / (S - p) for p in poles) + 0.0
    weight = 1 / np.abs(response)
    found = trial_poles(0.05, 20, len(poles), resonant=True)
    for _ in range(12):
        found = relocate_poles(S, response, weight, found)
    # The response is what matters: close poles may be off by more than the response is.
    fractions = np.stack([1 / (S - p) for p in found], axis=1)
    fitted = fractions @ np.linalg.lstsq(fractions, response, rcond=None)[0]
    assert_allclose(fitted, response, rtol=1e-4)


def test_relocated_poles_are_stable_whatever_the_data():
    rng = np.random.default_rng(4)
    for _ in range(20):
        response = rng.standard_normal(S.size) + 1j * rng.standard_normal(S.size)
        poles = trial_poles(0.05, 20, 5, resonant=False)
        for _ in range(4):
            poles = relocate_poles(S, response, np.ones(S.size), poles)
            assert np.all(poles.real < 0)
            assert poles.size == 5
