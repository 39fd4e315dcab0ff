from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.signal import lfilter

from ctrl_realize.numerics.fir_kernels import fit_kernel
from ctrl_realize.numerics.lagged import normal_equations


def kernel_matrix(kernel, fit, n):
    """Prior covariance as the literature writes it, with taps numbered from 1."""
    i = np.arange(1, n + 1)
    lam, c = fit.decay[0], fit.scale[0]
    high, low = np.maximum.outer(i, i), np.minimum.outer(i, i)
    if kernel == "TC":
        return c * lam ** high.astype(float)
    if kernel == "DC":
        return c * lam ** (np.add.outer(i, i) / 2) * fit.correlation[0] ** (high - low)
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


def test_noise_variance_is_found(data):
    u, y = data
    fit = fit_kernel(normal_equations(u[None], y[None], 30), 30, "TC")
    assert_allclose(np.sqrt(fit.noise_variance), 0.1, rtol=0.1)  # 370 samples: 4 % per sigma


def test_a_longer_window_is_searched_in_two_steps_and_ends_at_the_same_answer(data):
    u, y = data
    short = fit_kernel(normal_equations(u[None], y[None], 95), 95, "TC")
    long = fit_kernel(normal_equations(u[None], y[None], 120), 120, "TC")
    # the data of 25 more lags are dropped, so the answers differ by part of their std
    assert np.all(np.abs(long.markov[0, :95] - short.markov[0]) < 2 * short.std[0] + 1e-4)


@pytest.mark.parametrize(("poles", "best"), [([-0.5], "TC"), ([0.85] * 3, "SS")])
def test_of_two_kernels_the_one_of_larger_likelihood_is_taken(poles, best):
    # signs that alternate from sample to sample; a bell that sets in smoothly
    rng = np.random.default_rng(5)
    u = rng.normal(size=600)
    y = lfilter([1.0], np.poly(poles), u) + 0.05 * rng.normal(size=600)
    equations = normal_equations(u[None], y[None], 40)
    one = {name: fit_kernel(equations, 40, name) for name in ("TC", "SS")}
    chosen = fit_kernel(equations, 40, "auto")
    assert chosen.kernel == best == max(one, key=lambda name: one[name].evidence)
    assert_allclose(chosen.markov, one[best].markov, rtol=0, atol=1e-12)
