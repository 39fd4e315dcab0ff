"""Lags that are nearly equal, or not there: intervals, and what the formula says."""

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.stats import chi2

import ctrl_realize as cr

DT, AT = 0.5, 20.0
LAGS, DEAD_TIME, GAIN, NOISE = (10.0, 4.0, 1.5), 3.0, 2.0, 0.02


def response(t, lags, dead_time):
    """Step response of lags in series, which must differ, behind a dead time."""
    after = np.clip(t - AT - dead_time, 0, None)
    out = np.ones_like(t)
    for i, lag in enumerate(lags):
        others = [lag / (lag - other) for j, other in enumerate(lags) if j != i]
        out = out - np.prod(others) * np.exp(-after / lag)
    return np.where(t >= AT + dead_time, out, 0.0)


def record(seed, lags=LAGS, dead_time=DEAD_TIME):
    t = DT * np.arange(300)
    y = GAIN * response(t, lags, dead_time)
    y = y + NOISE * np.random.default_rng(seed).standard_normal(t.size)
    return cr.Record(t, (t >= AT).astype(float), y)


def least(step, lag_2=None):
    """Least sum of squares of ordered lags: by another program, with the closed form."""
    t, y = step.time, step.output

    def misfit(x):
        ratio_1, ratio_3 = 1 + np.exp(x[1]), 1 / (1 + np.exp(x[2]))
        middle = np.exp(x[0]) if lag_2 is None else lag_2
        # equal lags are approached, not reached: the closed form has poles there
        lags = middle * max(ratio_1, 1.0001), middle, middle * min(ratio_3, 0.9999)
        model = np.stack([response(t, lags, x[3]), np.ones_like(t)], axis=1)
        left = y - model @ np.linalg.lstsq(model, y, rcond=None)[0]
        return left @ left

    starts = [(np.log(4.0), np.log(1.5), out, 3.0) for out in (-3.0, 0.5)]
    options = {"maxiter": 3000, "xatol": 1e-6, "fatol": 1e-9}
    found = [minimize(misfit, x, method="Nelder-Mead", options=options).fun for x in starts]
    return min(found)


@pytest.fixture(scope="module")
def nearly_equal():
    """A record whose best second and third lag are equal: by the curvature +-3e5 s."""
    step = record(1)
    return step, cr.identify(step, structures="P3D", loss="least_squares").fit


def test_the_ends_of_a_lag_are_those_of_the_profile_likelihood(nearly_equal):
    step, fit = nearly_equal
    lag = fit.parameter_table().loc["lag_2"]
    assert lag["low"] < LAGS[1] < lag["high"] < 6.0
    assert lag["std_given_structure"] == pytest.approx((lag["high"] - lag["low"]) / 3.92, rel=1e-3)
    best = least(step)
    variance = best / (step.time.size - 6)
    for end in ("low", "high"):
        excess = (least(step, lag[end]) - best) / variance
        # the lag is solved to 2 %, and the variance of the noise estimated in two ways
        assert excess == pytest.approx(chi2.ppf(0.95, 1), rel=0.05)


def test_a_lag_that_need_not_be_there_begins_at_zero():
    fit = cr.identify(record(4), structures="P3D").fit
    lag = fit.parameter_table().loc["lag_3"]
    assert lag["low"] == 0.0
    assert lag["value"] < LAGS[2] < lag["high"]
    assert "(0 s + 1)" not in fit.formula


def test_a_lag_that_is_not_there_is_not_in_the_formula_and_the_report_says_so():
    fit = cr.identify(record(5, lags=LAGS[:2]), structures="P3D").fit
    assert fit.parameter_table().loc["lag_3", "value"] < 0.1 * DT
    assert fit.formula.count("s + 1)") == 2
    assert "lag 3 (at most " in fit.report()
    assert "not distinguished from 0" in fit.report()


@pytest.mark.parametrize("seed", [0, 11])
def test_a_second_lag_of_nothing_leaves_the_total_delay_known(seed):
    """Its slope is that of the dead time: the error of their sum was rounding (0 to 202 s)."""
    t = 0.5 * np.arange(160)
    y = 2 * (t >= 13) * (1 - np.exp(-(t - 13) / 5))
    y += 0.01 * np.random.default_rng(seed).standard_normal(t.size)
    fit = cr.identify(cr.Record(t, (t >= 10).astype(float), y)).fit
    first, last = fit.total_delay_interval
    assert first < 8.0 < last < first + 0.1
    assert fit.structure == (1, 1)


@pytest.mark.parametrize("seed", [6, 13])
def test_lags_that_pass_between_samples_leave_the_total_delay_known(seed):
    """No sample shows them: the error of their sum was up to 39 627 s beside a lag of 40 s."""
    t = 15.0 * np.arange(60)
    y = 1.5 * (t >= 92) * -np.expm1(-np.maximum(t - 92, 0) / 40)
    y += 0.01 * np.random.default_rng(seed).standard_normal(t.size)
    first, last = cr.identify(cr.Record(t, np.where(t < 60, 40, 50.0), y)).fit.total_delay_interval
    assert first < 72.0 < last < first + 4.0


@pytest.mark.parametrize("structure", ["P1D", "P2D"])
@pytest.mark.parametrize("seed", [0, 2])
def test_a_pure_dead_time_is_told_in_samples(structure, seed):
    t = DT * np.arange(300)
    y = GAIN * (t >= AT + 3.2) + NOISE / 2 * np.random.default_rng(seed).standard_normal(t.size)
    fit = cr.identify(cr.Record(t, (t >= AT).astype(float), y), structures=structure).fit
    assert fit.interval[0] <= 3.2 <= fit.interval[1]
    assert fit.total_delay_interval == fit.interval
    assert "e^(-3.5 s)" in fit.formula
    assert "7 samples (3.00 to 3.50 s give the same samples" in fit.report()
    assert np.isreal(fit.poles).all()  # P2D has two lags, no pair
