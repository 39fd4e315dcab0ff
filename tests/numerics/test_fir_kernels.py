from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.signal import lfilter

from ctrl_realize.numerics.regression.fir import cautious_std, fit_kernel
from ctrl_realize.numerics.regression.normal_equations import normal_equations


def kernel_matrix(kernel, fit, n, channel=0):
    """Prior covariance as the literature writes it, with taps numbered from 1."""
    i = np.arange(1, n + 1)
    lam, c = fit.decay[channel], fit.scale[channel]
    high, low = np.maximum.outer(i, i), np.minimum.outer(i, i)
    if kernel == "TC":
        return c * lam ** high.astype(float)
    if kernel == "DC":
        return c * lam ** (np.add.outer(i, i) / 2) * fit.correlation[channel] ** (high - low)
    # Pillonetto and De Nicolao's stable spline, times the factor 3 that makes K[i, i] = 1
    return c * 3 * (lam ** (np.add.outer(i, i) + high) / 2 - lam ** (3.0 * high) / 6)


@pytest.fixture(scope="module")
def data():
    rng = np.random.default_rng(2)
    u = rng.normal(size=400)
    clean = lfilter([0, 0, 0, 0.3], [1, -0.7], u)
    y = clean + 0.1 * rng.normal(size=400)
    return u, y


@pytest.mark.parametrize("kernel", ["TC", "DC", "SS"])
def test_estimate_and_std_are_the_posterior_of_the_printed_kernel(data, kernel):
    u, y = data
    n = 30
    fit = fit_kernel(normal_equations(u[None], y[None], n), n, kernel)
    phi = np.lib.stride_tricks.sliding_window_view(u, n)[:, ::-1]
    phi, target = phi - phi.mean(axis=0), y[n - 1 :] - y[n - 1 :].mean()
    P = kernel_matrix(kernel, fit, n)
    gain = P @ phi.T @ np.linalg.inv(phi @ P @ phi.T + fit.noise_variance * np.eye(len(phi)))
    covariance = P - gain @ phi @ P
    scale = np.abs(fit.markov).max()
    # the jitter of 1e-11 on the stable spline, seen through a condition number of 1e4
    assert_allclose(fit.markov[0], gain @ target, rtol=0, atol=1e-6 * scale)
    assert_allclose(fit.std[0], np.sqrt(np.diag(covariance)), rtol=0, atol=1e-5 * scale)


@pytest.mark.parametrize("kernel", ["TC", "DC", "SS"])
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


@pytest.mark.parametrize("kernel", ["TC", "DC", "SS"])
def test_the_correlation_of_neighbours_is_that_of_the_printed_kernel(data, kernel):
    u, y = data
    fit = fit_kernel(normal_equations(u[None], y[None], 30), 30, kernel)
    P = kernel_matrix(kernel, fit, 30)
    correlation = P[0, 1] / np.sqrt(P[0, 0] * P[1, 1])
    # printed with the scale of tap 1, ours is that of the stationary part: the same to rounding
    assert_allclose(fit.correlation[0], correlation, rtol=1e-9)


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
    # the jitter of 1e-11 on the stable spline, as above
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
