"""Pulse responses from any input, and the regressions behind them against plain least squares."""

import control as ct
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.signal import lfilter

import ctrl_realize as cr
from ctrl_realize.errors import DataError
from ctrl_realize.identification.impulse.regression import OKID_ORDERS, through_arx, without_prior
from tests import measured
from tests.rigs import DT, TWO_STATES

METHODS = [
    {"method": "regularized", "kernel": "TC"},
    {"method": "regularized", "kernel": "DC"},
    {"method": "regularized", "kernel": "SS"},
    {"method": "least_squares"},
    {"method": "okid"},
]


def record(n=600, noise=0.05, seed=0, plant=TWO_STATES, u0=0.0, y0=0.0, **options):
    rng = np.random.default_rng(seed)
    u = rng.choice([-1.0, 1.0], (n,) if plant.issiso() else (plant.ninputs, n))
    y = plant.simulate(u)
    y = y + noise * rng.standard_normal(y.shape)
    return cr.Record(DT * np.arange(n), u + u0, y + y0, **options)


@pytest.mark.parametrize("options", METHODS)
def test_the_true_response_lies_in_the_band_of_the_estimate(options):
    truth = TWO_STATES.markov(50)
    z = np.concatenate(
        [
            (g.markov - truth)[:30] / g.std[:30]
            for g in (cr.impulse_from_io(record(seed=s), 50, **options) for s in range(8))
        ]
    )
    # 240 values: white errors would give 1 -+ 0.05; neighbours are correlated, and a prior that
    # is not the truth's moves the estimate within its band
    assert 0.5 < np.sqrt(np.mean(z**2)) < 1.35
    assert np.mean(np.abs(z) < 3) > 0.97


def test_std_of_least_squares_is_the_cramer_rao_bound():
    estimates = [
        cr.impulse_from_io(record(n=300, seed=s), 30, method="least_squares") for s in range(150)
    ]
    scatter = np.std([g.markov for g in estimates], axis=0)
    bound = np.mean([g.std for g in estimates], axis=0)
    # 30 scatters of 150 draws each: 6 % per sigma, 3.5 sigma
    assert_allclose(scatter / bound, 1.0, rtol=0, atol=0.2)
    assert_allclose(np.mean(scatter / bound), 1.0, rtol=0, atol=0.03)


def test_missing_samples_take_out_the_equations_that_they_touch():
    whole = record()
    y = whole.output.copy()
    y[[100, 250, 251]] = np.nan
    u = whole.input.copy()
    u[400] = np.nan
    holes = cr.Record(whole.time, u, y, missing="keep")
    g = cr.impulse_from_io(holes, 40, method="least_squares")
    # rows 39...599, less 3 outputs, less the 40 rows that see u[400]
    assert g.rows == 561 - 3 - 40
    assert np.all(np.abs(g.markov - TWO_STATES.markov(40)) < 4.5 * g.std)


@pytest.mark.parametrize("options", METHODS)
@pytest.mark.parametrize(
    ("name", "u"), [("constant", np.full(400, 2.0)), ("sine", np.sin(0.2 * np.arange(400)))]
)
def test_an_input_that_does_not_excite_gets_no_answer(options, name, u):
    rng = np.random.default_rng(0)
    y = TWO_STATES.simulate(u) + 0.1 * rng.standard_normal(400)
    with pytest.raises(DataError, match="does not excite"):
        cr.impulse_from_io(cr.Record(DT * np.arange(400), u, y), 30, **options)


@pytest.mark.parametrize("options", METHODS)
def test_an_output_that_does_not_follow_is_flagged(options):
    flagged = 0
    for seed in range(20):
        rng = np.random.default_rng(seed)
        one = cr.Record(DT * np.arange(500), rng.normal(size=500), rng.normal(size=500))
        g = cr.impulse_from_io(one, 30, **options)
        flagged += "no_response" in [flag.code for flag in g.flags]
    assert flagged >= 18  # a test at 1 %, with room for two alarms


@pytest.mark.parametrize("kernel", ["auto", "TC", "DC", "SS"])
def test_the_errors_of_a_regularized_response_hold_the_truth_also_where_it_dies_away(kernel):
    # two lags of 0.8 and 4 Hz behind ten samples; the smooth prior alone held 22 % of the tail
    core = ct.tf([1], [1 / (2 * np.pi * 0.8), 1]) * ct.tf([1], [1 / (2 * np.pi * 4.0), 1])
    plant = cr.delayed_ss(core, dead_time=0.098, dt=0.01)
    rng = np.random.default_rng(5)
    held = []
    for _ in range(3):
        u = np.repeat(rng.choice([-1.0, 0.0, 1.0, 2.0], 834), 3)[:2500]
        y = plant.simulate(u) + 0.01 * rng.standard_normal(2500)
        taken = cr.Record(0.01 * np.arange(2500), u, y)
        found = cr.impulse_from_io(taken, 160, method="regularized", kernel=kernel)
        held.append(np.abs(found.markov - plant.markov(160)) <= 1.96 * found.std)
    # of three records: every part of the response, not only most of it
    assert np.mean(held, axis=0).reshape(8, 20).mean(axis=1).min() > 0.85


@pytest.mark.parametrize("options", METHODS)
@pytest.mark.parametrize(
    ("plant", "length", "delay"),
    [("hairdryer", 60, 3), ("gas_furnace", 40, 3), ("exchanger", 250, 0)],
)
def test_measured_plants_have_the_delay_that_their_authors_state(options, plant, length, delay):
    g = cr.impulse_from_io(measured.record(f"{plant}/record"), length, **options)
    assert cr.estimate_delay(g, 2, max_delay=15).delay == delay


@pytest.mark.parametrize("delay", [110, 250])
def test_a_response_that_begins_behind_the_first_window_is_found(delay):
    rng = np.random.default_rng(0)
    plant = cr.delayed_ss(ct.ss([[0.9]], [[1.0]], [[0.1]], [[0.0]], 0.01), delay)
    u = rng.choice([-1.0, 1.0], 1000)
    y = plant.simulate(u) + 0.05 * rng.standard_normal(u.size)
    g = cr.impulse_from_io(cr.Record(0.01 * np.arange(1000), u, y))
    assert g.n_samples > delay + 50
    # the largest value is 0.1 behind the delay, its noise 0.05 / sqrt(700)
    assert abs(int(np.argmax(g.markov)) - delay - 1) <= 1
    assert np.abs(g.markov[: delay - 5]).max() < 0.02


STEP = 0.1


def series(n=80, m=1, p=1, seed=0, follows=1.0, noise=0.3, level=5.0):
    """Outputs that follow every input at lags 1 and 2, about levels; `noise` is white."""
    rng = np.random.default_rng(seed)
    u = rng.standard_normal((m, n))
    drive = sum((j + 1) * u[j] for j in range(m))
    one = lfilter([0, 1.0, 0.5], [1], drive)
    y = np.stack([(a + 1) * follows * one for a in range(p)])
    y = y + noise * rng.standard_normal(y.shape) + level
    return cr.Record(STEP * np.arange(n), u, y)


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
    one = series(m=m, p=p)
    found = without_prior((one,), 4, "unknown")
    theta, std, variance = plain(*tall(one, 3, 4))
    # normal equations by FFT beside a decomposition of the tall matrix
    assert_allclose(found.markov, theta[1:].T.reshape(p, m, 4), rtol=0, atol=1e-12)
    assert_allclose(found.std, std[1:].T.reshape(p, m, 4), rtol=1e-10)
    assert_allclose(found.noise_std, np.sqrt(variance), rtol=1e-10)
    assert (found.rows, found.method, found.flags) == (77, "least squares", ())


@pytest.mark.parametrize(("m", "p"), [(1, 1), (2, 2)])
def test_an_arx_model_is_least_squares_and_its_first_markov_parameters_are_its_own(m, p):
    one = series(n=150, m=m, p=p, noise=0.3)
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
    one = cr.Record(STEP * np.arange(n), u, y)
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
