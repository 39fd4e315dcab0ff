"""Transfer functions with dead time, least-squares sines, spectral sums."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import signal

from ctrl_realize.numerics.engine.modal import parameters_from_poles
from ctrl_realize.numerics.engine.problem import Structure
from ctrl_realize.numerics.engine.structures import Candidate
from ctrl_realize.numerics.rational.frf_data import FRFData, modal_state_space
from ctrl_realize.numerics.rational.sines import fit_sines
from ctrl_realize.numerics.rational.spectra import independent_segments
from tests.oracles.partial_products import (
    basis_functions,
    factor_parameters,
    full_jacobian,
    project,
)

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


@structures
def test_full_jacobian_is_that_of_the_weighted_model(order, count):
    theta = np.append(theta_of(order), 0.3)
    numerator = np.random.default_rng(count).standard_normal(count)
    weight = np.linspace(1, 2, S.size)

    def model(values):
        basis = basis_functions(S, values[:order], order, count)[0]
        out = weight * np.exp(-S * values[order]) * (basis @ values[order + 1 :])
        return np.concatenate([out.real, out.imag])

    J = full_jacobian(S, weight, theta, numerator, order)
    values = np.concatenate([theta, numerator])
    for i in range(values.size):
        step = np.zeros(values.size)
        step[i] = 1e-5
        slope = (model(values + step) - model(values - step)) / 2e-5
        # Central differences: error 1e-10, rounding 1e-11.
        assert_allclose(J[:, i], slope, atol=1e-8 * np.abs(J).max())


@structures
def test_the_engine_eliminates_the_numerator_as_partial_products_do(order, count):
    rng = np.random.default_rng(order)
    response = rng.standard_normal(S.size) + 1j * rng.standard_normal(S.size)
    weight = rng.uniform(0.5, 2, S.size)
    oracle = project(S, response, weight, np.append(theta_of(order), 0.3), order, count)
    poles = np.array(POLES[order], dtype=complex)
    # relative degree 0, with a direct term, is the largest count
    structure = Structure(order, order + 1 - count)
    fit = Candidate(structure, np.append(0.3, parameters_from_poles(poles)), 0.0)
    data = FRFData(S, response, weight, 1.0)
    state = data.at(fit)
    assert_allclose(state.residual[0], oracle.residual, atol=1e-11)
    slope = -state.jacobian[0, :, 0] @ state.residual[0]
    # the gradient is exact in both, though what they leave out of the Jacobian is not the same
    expected = oracle.jacobian[:, -1] @ oracle.residual
    assert slope == pytest.approx(expected, rel=1e-9, abs=1e-9)
    A, B, C, D = modal_state_space(data, fit)
    inverse = np.linalg.inv(S[:, None, None] * np.eye(order) - A)
    model = (C @ inverse @ B)[:, 0, 0] + D[0, 0]
    left = weight * (response - np.exp(-0.3 * S) * model)
    assert_allclose(left, data.misfit(fit), atol=1e-11)


N, DT = 300, 0.01
T = DT * np.arange(N)


def sine(omega, phasor, offset=0.0, slope=0.0, time=T):
    return (phasor * np.exp(1j * omega * time)).real + offset + slope * time


def test_noisy_estimates_scatter_as_the_bound_and_the_stated_covariance_say():
    rng = np.random.default_rng(2)
    runs, omega, sigma = 1500, 17.0, np.array([0.02, 0.4])
    clean = np.stack([sine(omega, 1.0), sine(omega, 0.5j)])
    noisy = clean + sigma[:, None] * rng.standard_normal((runs, 2, N))
    fit = fit_sines(T, noisy, np.full(runs, omega))
    assert_allclose(np.sqrt(fit.noise_variance.mean(axis=0)), sigma, rtol=0.01)
    # The common frequency must be that of the clean channel: Cramer-Rao bound of both together.
    information = N**3 * DT**2 / 24 * np.sum(np.array([1.0, 0.5]) ** 2 / sigma**2)
    score = (fit.omega - omega) * np.sqrt(information)
    # Standard deviation of a standard deviation over 1500 runs: 1.8 %; three of them.
    assert score.std() == pytest.approx(1.0, abs=0.055)
    assert abs(score.mean()) < 3 / np.sqrt(runs)
    # Phasors at mid-record do not feel the frequency: covariance as for a known frequency.
    turned = fit.phasor[:, 1] * np.exp(1j * fit.omega * T.mean())
    spread = np.sqrt(np.var(turned))
    stated = np.sqrt(np.trace(fit.phasor_covariance[:, 1], axis1=1, axis2=2).mean())
    assert spread == pytest.approx(stated, rel=0.055)


def test_half_overlapped_hann_segments_count_for_19_18_of_their_number():
    # Welch's figure: correlation of neighbours (1/6)^2, so K / (1 + 2/36) for many segments.
    window = signal.get_window("hann", 256)
    assert independent_segments(window, 128, 10_000) / 10_000 == pytest.approx(18 / 19, abs=1e-3)
