"""A structure that is asked for and is wrong gives an apparent dead time, and is called so."""

from __future__ import annotations

import numpy as np
import pytest

import ctrl_realize as cr
from ctrl_realize import report

DELAY, SLOW, FAST = 45.0, 180.0, 40.0
T = np.arange(900.0)
U = np.where(T < 100, 0.0, 1.0)


def two_lags(seed=0, noise=0.003):
    x = np.maximum(T - 100 - DELAY, 0)
    y = 1 - (SLOW * np.exp(-x / SLOW) - FAST * np.exp(-x / FAST)) / (SLOW - FAST)
    return cr.Record(T, U, 0.8 * y + noise * np.random.default_rng(seed).standard_normal(T.size))


def one_lag(seed=0):
    y = -np.expm1(-np.maximum(T - 100 - DELAY, 0) / SLOW)
    return cr.Record(T, U, y + 0.003 * np.random.default_rng(seed).standard_normal(T.size))


def codes(system):
    return {flag.code for flag in system.fit.flags}


@pytest.fixture(scope="module")
def forced():
    return cr.identify(two_lags(), order=1)


def test_a_first_order_model_of_two_lags_has_an_apparent_dead_time(forced):
    fit = forced.fit
    assert fit.interval[0] > DELAY + 5  # tight, and wrong
    assert "apparent_dead_time" in codes(forced)
    assert (fit.better.order, fit.better.relative_degree) == (2, 2)
    low, high = fit.better.interval
    assert low <= DELAY <= high
    assert fit.better.dead_time == pytest.approx(DELAY, abs=3)


def test_the_result_says_what_the_better_structure_would(forced):
    text = forced.fit.report()
    assert text.startswith("Output-error fit: apparent dead time")
    assert "if the structure is right" in text
    assert "order 2, relative degree 2 gives" in text
    verdict = report.verdict_of(forced)
    assert verdict.level != "good"
    assert verdict.headline.startswith("Apparent dead time")


@pytest.mark.parametrize(
    ("record", "asked"),
    [
        (two_lags(1), {"order": 2}),
        (one_lag(1), {"order": 1}),
        (one_lag(2), {"order": 3}),
        (one_lag(3), {"structures": [(2, 2)]}),
    ],
)
def test_a_structure_that_holds_the_plant_is_not_objected_to(record, asked):
    system = cr.identify(record, **asked)
    assert system.fit.better is None
    assert "apparent_dead_time" not in codes(system)


def test_a_search_of_all_structures_has_no_better_one():
    assert cr.identify(two_lags()).fit.better is None


def test_records_of_other_inputs_are_looked_at_too():
    rng = np.random.default_rng(5)
    u = np.repeat(rng.choice([-1.0, 1.0], 150), 4)
    core = cr.design.ProcessModel(1.0, 12.0, 3.0, second_lag=6.0).system(1.0).delay_free
    y = cr.delayed_ss(core, 3).simulate(u) + 0.01 * rng.standard_normal(u.size)
    record = cr.Record(np.arange(u.size) * 1.0, u, y)
    fit = cr.fit_output_error(record, structures=[(1, 1)]).fit
    assert fit.dead_time > 4
    assert fit.better is not None
    assert fit.better.dead_time == pytest.approx(3.0, abs=0.5)
    assert cr.fit_output_error(record, structures=[(2, 2)]).fit.better is None
