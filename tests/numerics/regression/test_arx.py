"""Regressions on lagged samples: ARX, their normal equations, kernels."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.signal import lfilter

from ctrl_realize.numerics.regression.arx import (
    arx_equations,
    arx_markov,
    arx_markov_std,
    excited_directions,
    solve_arx,
)
from ctrl_realize.numerics.regression.fir import cautious_std, fit_kernel
from ctrl_realize.numerics.regression.normal_equations import normal_equations


def test_arx_of_the_hairdryer_has_the_published_coefficients(shared_data):
    table = np.loadtxt(shared_data / "hairdryer" / "record.csv", delimiter=",", skiprows=1)[:300]
    u, y = (table[:, [i]].T - table[:, i].mean() for i in (1, 2))
    late = np.pad(u, ((0, 0), (1, 0)))[:, : y.size - 2]  # by three samples, beside y from the third
    fit = solve_arx(arx_equations(late, y[:, 2:], 2, 2, offset=False), 2, 2)
    # five decimals are printed
    assert_allclose(fit.a.ravel(), [-1.27374, 0.39355], rtol=0, atol=6e-6)
    assert_allclose(fit.b.ravel(), [0.06662, 0.04448], rtol=0, atol=6e-6)


def test_std_of_the_pulse_response_is_the_scatter_over_many_records():
    a = np.array([[[-0.8, 0.1], [0.2, -0.5]]])
    b = np.array([[0.9, 0.2], [0.3, 0.7]])
    found, claimed = [], []
    for seed in range(150):
        rng = np.random.default_rng(seed)
        u, e = rng.normal(size=(2, 300)), 0.3 * rng.normal(size=(2, 300))
        e[1] += 0.5 * e[0]
        y = np.zeros((2, 300))
        for k in range(1, 300):
            y[:, k] = -a[0] @ y[:, k - 1] + b @ u[:, k - 1] + e[:, k]
        fit = solve_arx(arx_equations(u, y, 1, 2), 1, 2)
        found.append(arx_markov(fit, 10))
        claimed.append(arx_markov_std(fit, 10))
    ratio = np.std(found, axis=0) / np.mean(claimed, axis=0)
    # a standard deviation of 150 draws is known to 1/sqrt(300) = 6 %; 40 of them, 3.5 sigma
    assert_allclose(ratio, 1.0, rtol=0, atol=0.2)


@pytest.mark.parametrize(
    ("signal", "directions"),
    [
        (np.ones(200), 0),
        (np.sin(0.3 * np.arange(200)), 2),
        (np.sin(0.3 * np.arange(200)) + np.cos(1.1 * np.arange(200)), 4),
        (np.random.default_rng(0).normal(size=200), 12),
    ],
)
def test_a_sine_excites_two_directions_and_a_constant_none(signal, directions):
    assert excited_directions(normal_equations(signal[None], signal[None], 12).gram) == directions


def by_rows(z, y, lags, offset):
    """The regression matrix itself, row by row: the oracle."""
    rows, targets = [], []
    for k in range(lags - 1, z.shape[1]):
        row = np.concatenate([signal[k - lags + 1 : k + 1][::-1] for signal in z])
        if np.isfinite(row).all() and np.isfinite(y[:, k]).all():
            rows.append(row)
            targets.append(y[:, k])
    phi, target = np.array(rows), np.array(targets)
    if offset:
        phi, target = phi - phi.mean(axis=0), target - target.mean(axis=0)
    return phi, target


@pytest.mark.parametrize("missing", [0, 4, 30, 60])  # the last: more rows are lost than kept
@pytest.mark.parametrize("offset", [True, False])
@pytest.mark.parametrize(("signals", "targets", "lags"), [(1, 1, 1), (2, 2, 5), (3, 1, 12)])
def test_sums_by_fft_equal_those_of_the_regression_matrix(
    rng, missing, offset, signals, targets, lags
):
    z, y = rng.normal(size=(signals, 80)), rng.normal(size=(targets, 80))
    if offset:
        z, y = z + 3, y - 100
    y[0, rng.permutation(80)[:missing]] = np.nan
    if missing:
        z[0, 40] = np.nan
    equations = normal_equations(z, y, lags, offset=offset)
    phi, target = by_rows(z, y, lags, offset)
    assert equations.rows == len(phi) > 0
    # sums of 80 products of numbers of size one
    assert_allclose(equations.gram, phi.T @ phi, rtol=0, atol=1e-11)
    assert_allclose(equations.cross, phi.T @ target, rtol=0, atol=1e-11)
    assert_allclose(equations.power, target.T @ target, rtol=0, atol=1e-11)


@pytest.fixture
def rng():
    return np.random.default_rng(5)


def kernel_matrix(kernel, fit, n, channel=0):
    """Prior covariance as the literature writes it, with taps numbered from 1."""
    i = np.arange(1, n + 1)
    lam, c = fit.decay[channel], fit.scale[channel]
    high = np.maximum.outer(i, i)
    if kernel == "TC":
        return c * lam ** high.astype(float)
    # Pillonetto and De Nicolao's stable spline, times the factor 3 that makes K[i, i] = 1
    return c * 3 * (lam ** (np.add.outer(i, i) + high) / 2 - lam ** (3.0 * high) / 6)


@pytest.fixture(scope="module")
def data():
    rng = np.random.default_rng(2)
    u = rng.normal(size=400)
    clean = lfilter([0, 0, 0, 0.3], [1, -0.7], u)
    y = clean + 0.1 * rng.normal(size=400)
    return u, y


@pytest.mark.parametrize("kernel", ["TC", "SS"])
def test_hyper_parameters_are_at_the_top_of_the_marginal_likelihood(data, kernel):
    u, y = data
    n = 30
    fit = fit_kernel(normal_equations(u[None], y[None], n), n, kernel)
    phi = np.lib.stride_tricks.sliding_window_view(u, n)[:, ::-1]
    target = y[n - 1 :] - y[n - 1 :].mean()
    phi = phi - phi.mean(axis=0)

    def evidence(stretch, power):
        moved = type(fit)(**{**vars(fit), "decay": fit.decay**stretch, "scale": fit.scale * power})
        S = phi @ kernel_matrix(kernel, moved, n) @ phi.T + fit.noise_variance * np.eye(len(phi))
        return -0.5 * (np.linalg.slogdet(S)[1] + target @ np.linalg.solve(S, target))

    best = evidence(1.0, 1.0)
    # the search stops within 0.02 of -2 log likelihood
    for stretch, power in ((1.3, 1.0), (0.75, 1.0), (1.0, 2.0), (1.0, 0.5)):
        assert evidence(stretch, power) < best + 0.02


@pytest.mark.parametrize("kernel", ["TC", "SS"])
def test_two_inputs_have_the_posterior_of_both_priors(kernel):
    rng = np.random.default_rng(4)
    n, u = 20, rng.normal(size=(2, 400))
    y = lfilter([0, 0, 0.3], [1, -0.7], u[0]) - 2 * lfilter([0, 0.5], [1, -0.3], u[1])
    y = y + 0.2 * rng.normal(size=400)
    fit = fit_kernel(normal_equations(u, y[None], n), n, kernel)
    rows = [np.lib.stride_tricks.sliding_window_view(each, n)[:, ::-1] for each in u]
    phi, target = np.hstack(rows), y[n - 1 :] - y[n - 1 :].mean()
    phi = phi - phi.mean(axis=0)
    P = np.zeros((2 * n, 2 * n))
    P[:n, :n], P[n:, n:] = (kernel_matrix(kernel, fit, n, channel=i) for i in range(2))
    gain = P @ phi.T @ np.linalg.inv(phi @ P @ phi.T + fit.noise_variance * np.eye(len(phi)))
    spread = np.sqrt(np.diag(P - gain @ phi @ P))
    scale = np.abs(fit.markov).max()
    # the jitter of 1e-11 on the stable spline, seen through a condition number of 1e4
    assert_allclose(fit.markov.ravel(), gain @ target, rtol=0, atol=1e-6 * scale)
    assert_allclose(fit.std.ravel(), spread, rtol=0, atol=1e-5 * scale)
    assert_allclose(fit.effective, np.trace(gain @ phi), rtol=1e-4)


def test_a_cautious_std_holds_both_priors_and_their_distance(data):
    u, y = data
    equations = normal_equations(u[None], y[None], 30)
    smooth, plain = (fit_kernel(equations, 30, kernel) for kernel in ("SS", "TC"))
    assert cautious_std(equations, 30, plain) is plain.std
    both = np.hypot(plain.std, smooth.markov - plain.markov)
    # both searches of TC end within 0.1 of -2 log likelihood, which moves std by some percent
    assert_allclose(cautious_std(equations, 30, smooth), np.maximum(smooth.std, both), rtol=0.1)
    assert np.any(both > 1.5 * smooth.std)
