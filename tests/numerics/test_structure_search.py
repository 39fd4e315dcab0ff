"""Structures of a fit: their starts, bounds, criteria, and which the data leave standing."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from ctrl_realize.numerics.output_error.step_data import step_data, step_scales, window
from ctrl_realize.numerics.separable.poles import parameters_from_poles
from ctrl_realize.numerics.separable.structures import (
    FASTEST,
    PLAUSIBLE,
    SLOWER_WITH_ZEROS,
    Candidate,
    Scales,
    choose,
    needless_parameters,
    parameter_bounds,
    plausible,
    search,
)
from ctrl_realize.numerics.separable.varpro import KnownFactor, Structure

SCALES = Scales(onset=2.0, rise=0.5, length=10.0, dt=0.01, latest=3.0, earliest=0.25)


def candidate(n: int, r: int, cost: float = 1.0, poles: object = None) -> Candidate:
    at = -np.arange(1.0, n + 1) if poles is None else np.asarray(poles)
    found = np.concatenate([[1.5], parameters_from_poles(at.astype(np.complex128))])
    return Candidate(Structure(n, r), found, cost)


def test_bounds_reach_from_an_integrator_to_a_lag_shorter_than_a_sample():
    low, high = (
        getattr(parameter_bounds(Structure(1, 1), SCALES), side) for side in ("low", "high")
    )
    assert_allclose([low[0], high[0]], [0.25, 3.0])
    assert_allclose(np.exp([low[1], high[1]]), [1e-5, FASTEST / 0.01])
    beside_a_zero = parameter_bounds(Structure(3, 2), SCALES)
    assert_allclose(
        np.exp(beside_a_zero.low), np.exp([0.25, np.log(1e-5), np.log(1e-3), np.log(0.005)])
    )
    assert_allclose(np.exp(beside_a_zero.high[1:3]), SLOWER_WITH_ZEROS / 0.01)


def test_zeros_and_a_fourth_pole_must_be_worth_it():
    assert [needless_parameters(Structure(n, r)) for n, r in ((3, 3), (3, 1), (4, 4), (5, 4))] == [
        0, 12, 4, 14,
    ]  # fmt: skip
    simple, zero, fourth = Structure(3, 3), Structure(3, 2), Structure(4, 4)
    assert choose({simple: 100.0, zero: 94.5, fourth: 96.5}) == simple
    assert choose({simple: 100.0, zero: 93.5, fourth: 96.5}) == zero
    assert choose({simple: 100.0, zero: 94.5, fourth: 95.5}) == fourth


def test_what_is_near_the_best_is_plausible_and_so_are_lags_that_fit_no_worse():
    chosen = candidate(3, 2, 100.0)
    shapes = [(3, 2), (1, 1), (2, 2), (2, 1), (4, 4), (5, 5)]
    all_of = {Structure(n, r): candidate(n, r, 1000.0) for n, r in shapes}
    all_of[chosen.structure] = chosen
    all_of[Structure(2, 2)] = candidate(2, 2, 100.0 + PLAUSIBLE * 0.5)
    all_of[Structure(4, 4)] = candidate(4, 4, 50.0)
    values = dict(zip(all_of, [60.0, 900.0, 900.0, 69.0, 900.0, 71.0], strict=True))
    left = plausible(all_of, values, 0.5, chosen, 60.0)
    # itself; lags within 10 variances; within 10 of the best. Not: more, or four lags that fit
    assert set(left) == {chosen.structure, Structure(2, 2), Structure(2, 1)}
    # a chosen one whose simplicity counts: others have theirs counted as well
    assert Structure(5, 5) not in plausible(all_of, values, 0.5, chosen, 68.0)
    assert Structure(5, 5) in plausible(all_of, values, 0.5, chosen, 70.0)


def step_problem(noise: float = 1e-3):
    """One lag of 30 samples behind 20, and the candidates of a search in it."""
    k = np.arange(700.0)
    y = -np.expm1(-np.clip(k - 120, 0, None) / 30)
    y = y + noise * np.random.default_rng(0).standard_normal(k.size)
    made = step_data(y, 1.0 * (k >= 100), 1.0, [(100, 1)])
    return window(made, 700, KnownFactor()).problem, step_scales(made, 700, None)


def test_a_search_finds_the_lag_and_its_neighbours_cost_no_more():
    problem, scales = step_problem()
    shapes = [Structure(2, 1), Structure(1, 1), Structure(2, 2)]
    found = search(problem, shapes, scales)
    assert list(found) == [Structure(1, 1), Structure(2, 2), Structure(2, 1)]
    lag = found[Structure(1, 1)]
    assert lag.delay == pytest.approx(20.0, abs=0.1)
    assert_allclose(lag.poles, [-1 / 30], rtol=0.01)
    assert found[Structure(2, 1)].cost <= lag.cost * (1 + 1e-9)
    assert found[Structure(2, 1)].cost <= found[Structure(2, 2)].cost * (1 + 1e-9)
