"""Transfer functions with dead time, least-squares sines, spectral sums."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy import signal

from ctrl_realize.numerics.rational.model import (
    basis_functions,
    chain_state_space,
    factor_parameters,
    full_jacobian,
    project,
)
from ctrl_realize.numerics.rational.sines import fit_sines
from ctrl_realize.numerics.rational.spectra import (
    independent_segments,
    period_statistics,
    segment_sums,
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


@structures
def test_state_space_chain_has_the_response_of_the_basis(order, count):
    theta = theta_of(order)
    numerator = np.random.default_rng(order * 10 + count).standard_normal(count)
    A, B, C, D = chain_state_space(theta, numerator, order)
    states = np.linalg.solve(S[:, None, None] * np.eye(order) - A, B.astype(complex))
    direct = basis_functions(S, theta, order, count)[0] @ numerator
    assert_allclose((C @ states)[:, 0, 0] + D[0, 0], direct, rtol=1e-11)


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


N, DT = 300, 0.01
T = DT * np.arange(N)


def sine(omega, phasor, offset=0.0, slope=0.0, time=T):
    return (phasor * np.exp(1j * omega * time)).real + offset + slope * time


@given(
    cycles=st.floats(1.2, 60),
    amplitude=st.floats(0.01, 100),
    phase=st.floats(-3.1, 3.1),
    offset=st.floats(-10, 10),
    slope=st.floats(-10, 10),
)
def test_exact_sine_is_recovered_with_its_frequency(cycles, amplitude, phase, offset, slope):
    omega = 2 * np.pi * cycles / (N * DT)
    y = sine(omega, amplitude * np.exp(1j * phase), offset, slope)
    start = np.array([omega + 0.3 * 2 * np.pi / (N * DT)])  # 0.3 of the width of a line
    fit = fit_sines(T, y[None, None], start, drift=True)
    size = amplitude + abs(offset) + abs(slope) * N * DT
    # Rounding of the data, grown by the conditioning of little more than one period (< 1e3).
    assert_allclose(fit.omega * N * DT, [omega * N * DT], atol=1e-10 * size / amplitude)
    assert_allclose(fit.phasor[0, 0], amplitude * np.exp(1j * phase), atol=1e-10 * size)
    assert_allclose([fit.offset[0, 0], fit.slope[0, 0]], [offset, slope], atol=1e-10 * size)


def test_given_frequency_is_plain_linear_least_squares():
    rng = np.random.default_rng(0)
    y = rng.standard_normal((4, 2, N))
    omega = np.array([5.0, 7.0, 11.0, 13.0])
    fit = fit_sines(T, y, omega, free_frequency=False)
    for b in range(4):
        design = np.stack([np.cos(omega[b] * T), -np.sin(omega[b] * T), np.ones(N)], axis=1)
        expected, squares, _, _ = np.linalg.lstsq(design, y[b].T, rcond=None)
        assert_allclose(fit.phasor[b], expected[0] + 1j * expected[1], atol=1e-13)
        assert_allclose(fit.offset[b], expected[2], atol=1e-13)
        assert_allclose(fit.noise_variance[b], squares / (N - 3), rtol=1e-12)
        covariance = np.linalg.inv(design.T @ design)[:2, :2]
        assert_allclose(
            fit.phasor_covariance[b, 1], fit.noise_variance[b, 1] * covariance, rtol=1e-9
        )


def test_noisy_estimates_scatter_as_the_stated_standard_deviations_say():
    rng = np.random.default_rng(2)
    runs, omega, sigma = 1500, 17.0, np.array([0.02, 0.4])
    clean = np.stack([sine(omega, 1.0), sine(omega, 0.5j)])
    noisy = clean + sigma[:, None] * rng.standard_normal((runs, 2, N))
    fit = fit_sines(T, noisy, np.full(runs, omega))
    score = (fit.omega - omega) / fit.omega_std
    # Standard deviation of a standard deviation over 1500 runs: 1.8 %; three of them.
    assert score.std() == pytest.approx(1.0, abs=0.055)
    assert abs(score.mean()) < 3 / np.sqrt(runs)
    assert_allclose(np.sqrt(fit.noise_variance.mean(axis=0)), sigma, rtol=0.01)
    # The common frequency must be that of the clean channel: Cramer-Rao bound of both together.
    information = N**3 * DT**2 / 24 * np.sum(np.array([1.0, 0.5]) ** 2 / sigma**2)
    assert fit.omega.std() == pytest.approx(1 / np.sqrt(information), rel=0.06)
    # Phasors at mid-record do not feel the frequency: covariance as for a known frequency.
    turned = fit.phasor[:, 1] * np.exp(1j * fit.omega * T.mean())
    spread = np.sqrt(np.var(turned))
    stated = np.sqrt(np.trace(fit.phasor_covariance[:, 1], axis1=1, axis2=2).mean())
    assert spread == pytest.approx(stated, rel=0.055)


def test_segment_sums_are_those_of_scipys_csd():
    rng = np.random.default_rng(0)
    u, y = rng.standard_normal((2, 1000))
    window = signal.get_window("hann", 128)
    sums = segment_sums(u[None], y[None], window, 64)
    _, expected = signal.csd(u, y, window=window, noverlap=64, detrend="constant")
    scale = 2 / (window @ window) / sums.count  # one-sided density, fs = 1
    assert_allclose(sums.yu[0, 0, 1:-1] * scale, expected[1:-1], rtol=1e-12)
    assert sums.count == (1000 - 128) // 64 + 1


def test_half_overlapped_hann_segments_count_for_19_18_of_their_number():
    # Welch's figure: correlation of neighbours (1/6)^2, so K / (1 + 2/36) for many segments.
    window = signal.get_window("hann", 256)
    assert independent_segments(window, 128, 10_000) / 10_000 == pytest.approx(18 / 19, abs=1e-3)


def test_period_covariances_are_numpys():
    rng = np.random.default_rng(2)
    u, y = rng.standard_normal((2, 6, 16))
    stats = period_statistics(u, y)
    U, Y = np.fft.rfft(u)[:, 3], np.fft.rfft(y)[:, 3]
    expected = np.cov(Y, U)
    assert_allclose(stats.cov_yu[3], expected[0, 1], rtol=1e-12)
    assert_allclose([stats.var_y[3], stats.var_u[3]], np.diag(expected).real, rtol=1e-12)
