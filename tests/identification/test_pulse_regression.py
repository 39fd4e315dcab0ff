"""The regressions behind a pulse response against plain least squares on a tall matrix."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import stats
from scipy.signal import lfilter

import ctrl_realize as cr
from ctrl_realize.identification.impulse.regression import (
    OKID_ORDERS,
    through_arx,
    with_prior,
    without_prior,
)

DT = 0.1


def record(n=80, m=1, p=1, seed=0, follows=1.0, noise=0.3, level=5.0):
    """Outputs that follow every input at lags 1 and 2, about levels; `noise` is white."""
    rng = np.random.default_rng(seed)
    u = rng.standard_normal((m, n))
    drive = sum((j + 1) * u[j] for j in range(m))
    one = lfilter([0, 1.0, 0.5], [1], drive)
    y = np.stack([(a + 1) * follows * one for a in range(p)])
    y = y + noise * rng.standard_normal(y.shape) + level
    return cr.Record(DT * np.arange(n), u, y)


def tall(one, first, lags, of_output=0):
    """Rows from sample `first` on: a one, lags 0... of every input, lags 1... of every output."""
    u, y = np.atleast_2d(one.input), np.atleast_2d(one.output)
    k = np.arange(first, one.n_samples)
    columns = [np.ones(k.size)]
    columns += [y[a, k - i] for i in range(1, of_output + 1) for a in range(y.shape[0])]
    columns += [u[j, k - i] for j in range(u.shape[0]) for i in range(lags)]
    return np.stack(columns, axis=1), y[:, k]


def plain(X, y):
    """Coefficients, their std and noise variance of ordinary least squares."""
    theta, *_ = np.linalg.lstsq(X, y.T, rcond=None)
    variance = ((y.T - X @ theta) ** 2).sum(axis=0) / (X.shape[0] - X.shape[1])
    spread = np.diag(np.linalg.inv(X.T @ X))
    return theta, np.sqrt(np.outer(spread, variance)), variance


@pytest.mark.parametrize(("m", "p"), [(1, 1), (2, 3)])
def test_without_a_prior_it_is_least_squares_with_a_free_level(m, p):
    one = record(m=m, p=p)
    found = without_prior((one,), 4, "unknown")
    theta, std, variance = plain(*tall(one, 3, 4))
    # normal equations by FFT beside a decomposition of the tall matrix
    assert_allclose(found.markov, theta[1:].T.reshape(p, m, 4), rtol=0, atol=1e-12)
    assert_allclose(found.std, std[1:].T.reshape(p, m, 4), rtol=1e-10)
    assert_allclose(found.noise_std, np.sqrt(variance), rtol=1e-10)
    assert (found.rows, found.method, found.flags) == (77, "least squares", ())


def test_at_rest_the_past_is_the_first_sample():
    one = record(n=40)
    u, y = (np.concatenate([np.full((1, 3), z[0, 0]), z], axis=1) for z in (one.input, one.output))
    longer = cr.Record(DT * np.arange(43), u, y)
    found, known = without_prior((one,), 4, "rest"), without_prior((longer,), 4, "unknown")
    assert found.rows == 40
    assert_allclose(found.markov, known.markov, rtol=0, atol=1e-12)
    assert_allclose(found.std, known.std, rtol=1e-10)


def test_records_join_with_a_level_each_and_short_ones_without_a_past_say_nothing():
    one, other = record(seed=1), record(seed=2, level=-300.0)
    short = record(n=3, seed=3)
    found = without_prior((one, short, other), 4, "unknown")
    (X, y), (Z, z) = tall(one, 3, 4), tall(other, 3, 4)
    split = np.zeros((154, 6))
    split[:77, [0, 2, 3, 4, 5]], split[77:, [1, 2, 3, 4, 5]] = X, Z
    theta, std, _ = plain(split, np.concatenate([y, z], axis=1))
    assert_allclose(found.markov[0, 0], theta[2:, 0], rtol=0, atol=1e-11)
    assert_allclose(found.std[0, 0], std[2:, 0], rtol=1e-9)
    # a record of four samples has one row, which its own level takes
    four = record(n=4, seed=3)
    assert without_prior((one, four, other), 4, "unknown").rows == found.rows + 1


@pytest.mark.parametrize("follows", [0.0, 0.1])
def test_silence_is_the_f_test_at_one_per_cent(follows):
    flagged, chances = [], []
    for seed in range(60):
        one = record(n=40, m=2, seed=seed, follows=follows)
        found = without_prior((one,), 2, "unknown")
        X, y = tall(one, 1, 2)
        full = float(plain(X, y)[2][0]) * (39 - 5)
        none = float(((y - y.mean()) ** 2).sum())
        chances.append(stats.f.sf((none - full) / 4 / (full / 34), 4, 34))
        flagged.append([flag.code for flag in found.flags] == ["no_response"])
    assert flagged == [chance > 0.01 for chance in chances]
    assert sum(flagged) > 0
    assert (sum(flagged) < 55) == (follows > 0)


def test_under_a_prior_every_output_is_estimated_by_itself():
    one = record(n=120, m=2, p=2)
    both = with_prior((one,), 8, "unknown", ("TC", "SS"))
    alone = [
        with_prior((cr.Record(one.time, one.input, one.output[[a]]),), 8, "unknown", (kernel,))
        for a, kernel in enumerate(("TC", "SS"))
    ]
    for a in range(2):
        assert_allclose(both.markov[a], alone[a].markov[0], rtol=0, atol=1e-12)
        assert_allclose(both.std[a], alone[a].std[0], rtol=1e-9)
        assert_allclose(both.noise_std[a], alone[a].noise_std[0], rtol=1e-9)
    assert both.kernels == ("TC", "SS")
    assert both.method.startswith("TC, SS kernel, ")
    counts = [
        float(count) for count in both.method.split("kernel, ")[1].split(" free")[0].split(",")
    ]
    assert len(counts) == 2
    # no more than the data have to decide on, no fewer than the four that are not zero
    assert all(3.5 <= count <= 16 for count in counts)
    same = with_prior((one,), 8, "unknown", ("TC", "TC"))
    assert same.method.startswith("TC kernel, ")
    # noise of 0.3, known to 1 / sqrt(2 * 100) of it, 3 times
    assert_allclose(both.noise_std, 0.3, rtol=0.25)


@pytest.mark.parametrize(("m", "p"), [(1, 1), (2, 2)])
def test_an_arx_model_is_least_squares_and_its_first_markov_parameters_are_its_own(m, p):
    one = record(n=150, m=m, p=p, noise=0.3)
    found = through_arx((one,), 5, "unknown", 3)
    theta, std, variance = plain(*tall(one, 3, 4, of_output=3))
    direct = [1 + 3 * p + j * 4 for j in range(m)]  # lag 0 of every input
    assert_allclose(found.markov[:, :, 0], theta[direct].T, rtol=0, atol=1e-11)
    assert_allclose(found.std[:, :, 0], std[direct].T, rtol=1e-8)
    assert_allclose(found.noise_std, np.sqrt(variance), rtol=1e-10)
    # G_1 = B_1 - A_1 G_0
    past = theta[1 : 1 + p]
    second = theta[[at + 1 for at in direct]] + theta[direct] @ past
    assert_allclose(found.markov[:, :, 1], second.T, rtol=0, atol=1e-11)
    assert (found.rows, found.method) == (147, "OKID, ARX order 3")
    assert found.arx.a.shape == (3, p, p)


def test_the_order_of_arx_is_that_of_the_least_criterion():
    rng = np.random.default_rng(0)
    n, u = 400, np.random.default_rng(1).standard_normal((1, 400))
    y = lfilter([0, 1.0], [1, -1.2, 0.8, -0.3], u + 0.2 * rng.standard_normal((1, n)))
    one = cr.Record(DT * np.arange(n), u, y)
    tried = [q for q in OKID_ORDERS if q <= 19]
    top = tried[-1]

    def criterion(order):
        # all over the rows of the longest
        X, z = tall(one, top, order + 1, of_output=order)
        _, _, variance = plain(X, z)
        return z.size * np.log(variance[0]) + (2 * order + 1) * np.log(z.size)

    best = min(tried, key=criterion)
    assert best > tried[0]
    assert through_arx((one,), 20, "unknown", None).method == f"OKID, ARX order {best}"
