"""The regressions behind a pulse response against plain least squares on a tall matrix."""

from __future__ import annotations

import control as ct
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import stats
from scipy.signal import lfilter

import ctrl_realize as cr
from ctrl_realize.errors import DataError
from ctrl_realize.identification.pulse_regression import (
    MOST_GROWTH,
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


def test_the_silent_output_is_named():
    one = record(p=2)
    y = one.output.copy()
    y[1] = np.random.default_rng(9).standard_normal(80)
    mixed = cr.Record(one.time, one.input, y)
    for found in (
        without_prior((mixed,), 4, "unknown"),
        with_prior((mixed,), 4, "unknown", ("TC", "TC")),
        through_arx((mixed,), 4, "unknown", 2),
    ):
        assert [str(flag) for flag in found.flags] == [
            "output 1 shows no response to the input above the noise"
        ]


def test_as_many_rows_as_unknowns_leave_no_noise_and_are_refused():
    # 2 inputs of 4 lags and a level, with one more for the noise: 10 rows are 13 samples
    enough = without_prior((record(n=13, m=2),), 4, "unknown")
    assert enough.rows == 10
    with pytest.raises(DataError, match="only 9 samples have a complete past of 4 samples, and 10"):
        without_prior((record(n=12, m=2),), 4, "unknown")
    assert with_prior((record(n=16, m=2),), 4, "unknown", ("TC",)).rows == 13
    with pytest.raises(DataError, match=r"only 12 samples .* and 13 are needed"):
        with_prior((record(n=15, m=2),), 4, "unknown", ("TC",))
    # 3 lags of two inputs and of an output, a level and one more
    assert through_arx((record(n=13, m=2),), 4, "unknown", 2).rows == 11
    with pytest.raises(
        DataError, match="only 10 samples have a complete past of 3 samples, and 11"
    ):
        through_arx((record(n=12, m=2),), 4, "unknown", 2)
    # of two records each has its own level
    with pytest.raises(DataError, match=r"only 10 samples .* and 11 are needed"):
        without_prior((record(n=8, m=2), record(n=8, m=2, seed=1)), 4, "unknown")


def sines(count, n=200, noise=0.1):
    k = np.arange(n)
    u = sum(np.sin(w * k + w**2) for w in (0.3, 0.9, 1.7, 2.3)[:count])
    rng = np.random.default_rng(0)
    y = lfilter([0, 1.0, 0.5], [1], u) + noise * rng.standard_normal(n)
    return cr.Record(DT * k, u, y)


def test_sines_excite_two_lags_each_and_a_prior_needs_more_than_one():
    with pytest.raises(DataError, match=r"2 of the 6 .*shorter length, method='reg.* or a richer"):
        without_prior((sines(2),), 6, "unknown")
    with pytest.raises(DataError, match=r"4 of the 6 lags asked for .*shorter length or a richer"):
        without_prior((sines(1),), 6, "unknown")
    with pytest.raises(DataError, match="4 of the 6"):
        with_prior((sines(1),), 6, "unknown", ("TC",))
    found = with_prior((sines(2),), 6, "unknown", ("TC",))
    assert [flag.code for flag in found.flags] == ["partly_excited"]
    assert "excites 4 of 6 lags" in str(found.flags[0])
    # two lags need no more than two
    assert with_prior((sines(1),), 2, "unknown", ("TC",)).flags == ()
    assert with_prior((sines(3),), 6, "unknown", ("TC",)).flags == ()


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


def test_a_response_that_a_prior_takes_for_silence_is_weaker_than_its_noise():
    told = [
        len(with_prior((record(n=60, seed=s, follows=f),), 6, "unknown", ("TC",)).flags)
        for f in (0.0, 0.2, 1.0)
        for s in range(20)
    ]
    # a strong Bayes factor comes of noise once in 20 or less, and two tenths are not always seen
    assert sum(told[:20]) >= 19
    assert 0 < sum(told[20:40]) < 20
    assert sum(told[40:]) == 0


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


def test_records_join_to_one_arx_model_with_a_level_each():
    one, other = record(seed=1), record(seed=2, level=-30.0)
    # one of three samples has no past of three
    found = through_arx((one, record(n=3, seed=3), other), 5, "unknown", 3)
    (X, y), (Z, z) = (tall(each, 3, 4, of_output=3) for each in (one, other))
    split = np.zeros((154, 9))
    split[:77, [0, *range(2, 9)]], split[77:, 1:] = X, Z
    theta, std, _ = plain(split, np.concatenate([y, z], axis=1))
    assert found.rows == 154
    assert_allclose(found.arx.a[:, 0, 0], -theta[2:5, 0], rtol=0, atol=1e-10)
    assert_allclose(found.arx.b[:, 0, 0], theta[5:, 0], rtol=0, atol=1e-10)
    assert_allclose(found.arx.b_std[:, 0, 0], std[5:, 0], rtol=1e-8)


def test_an_arx_model_of_other_units_is_the_same_in_other_units():
    one = record()
    small = cr.Record(one.time, 1e3 * one.input, 1e-9 * one.output)
    usual, scaled = (through_arx((each,), 4, "unknown", 2) for each in (one, small))
    assert_allclose(1e12 * scaled.markov, usual.markov, rtol=0, atol=1e-11)
    assert_allclose(1e12 * scaled.std, usual.std, rtol=1e-9)


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


@pytest.mark.parametrize(
    ("n", "count", "top"),
    [
        (150, 40, 12),  # five samples for each of 2 (q + 1) unknowns: q <= 14
        (130, 40, 12),  # q <= 12
        (129, 40, 8),  # q <= 11
        (1000, 9, 8),  # shorter than the window
        (1000, 8, 6),
        (20, 40, 1),  # none of the list fits
    ],
)
def test_the_longest_order_tried_leaves_five_samples_for_an_unknown(n, count, top):
    found = through_arx((record(n=n),), count, "unknown", None)
    assert found.rows == n - top


def test_of_an_input_that_excites_little_shorter_models_are_tried():
    # six lags and their sines' six directions: order 5 is the longest, of the list 4
    one = sines(3, n=400, noise=0.5)
    found = through_arx((one,), 20, "unknown", None)
    assert found.rows == 396
    with pytest.raises(
        DataError, match="does not excite 3 of the 9 lags of an ARX model of order 8"
    ):
        through_arx((one,), 20, "unknown", 8)
    with pytest.raises(
        DataError, match="does not excite 1 of the 3 lags of an ARX model of order 2"
    ):
        through_arx((sines(1, n=400),), 20, "unknown", None)


def test_outputs_that_stand_still_have_no_response():
    one = record()
    flat = cr.Record(one.time, one.input, np.full((1, 80), 5.0))
    for estimate in (
        lambda: without_prior((flat,), 4, "unknown"),
        lambda: with_prior((flat,), 4, "unknown", ("TC",)),
        lambda: through_arx((flat,), 4, "unknown", 2),
    ):
        with pytest.raises(DataError, match="an output is constant"):
            estimate()
    # one that moves at its end alone is no past for anything, but for rounding
    y = np.full((1, 80), 5.0)
    y[0, -1] = 6.0
    with pytest.raises(DataError, match=r"does not move at all|are rounding"):
        through_arx((cr.Record(one.time, one.input, y),), 4, "unknown", 2)


def test_a_model_that_grows_beyond_all_numbers_is_refused():
    u = np.random.default_rng(0).standard_normal((1, 60))
    y = lfilter([0, 1.0], [1, -1.5], u)  # 0.176 decades a sample
    one = cr.Record(DT * np.arange(60), u, y)
    longest = int(MOST_GROWTH / np.log10(1.5))
    assert through_arx((one,), longest, "unknown", 1).markov.max() > 1e59
    with pytest.raises(DataError, match=r"order 1 is unstable.*1e60 within 341 samples"):
        through_arx((one,), longest + 1, "unknown", 1)


def test_okid_calls_silent_what_lies_within_the_bound_of_all_numbers():
    flagged = [
        len(through_arx((record(n=60, seed=s, follows=0.0),), 4, "unknown", 2).flags)
        for s in range(40)
    ]
    # one in a hundred: three or more of 40 happen once in 130
    assert sum(flagged) >= 38
    # the level of one of eight numbers, in standard deviations
    found = through_arx((record(n=60, seed=3, m=2, follows=0.06),), 4, "unknown", 2)
    limit = stats.norm.isf(0.01 / 2 / 8)
    share = float(np.max(np.abs(found.markov) / found.std))
    assert bool(found.flags) == (share <= limit)


def test_an_arx_model_of_exact_data_of_too_high_an_order_is_one_of_many():
    plant = cr.DelayedStateSpace(ct.ss([[0.8]], [[1.0]], [[0.2]], [[0.0]], DT), 1)
    u = np.random.default_rng(0).standard_normal(200)
    one = cr.Record(DT * np.arange(200), u, plant.simulate(u))
    found = through_arx((one,), 30, "unknown", 6)
    # a ridge of 1e-9 of the sums
    assert_allclose(found.markov[0, 0], plant.markov(30), rtol=0, atol=1e-6)
