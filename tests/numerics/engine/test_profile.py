"""Misfit over a dead time that is held, and minima that are found to the bottom."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares, minimize

from ctrl_realize.numerics.engine.descend import descend, fit_batch
from ctrl_realize.numerics.engine.eliminate import evaluate
from ctrl_realize.numerics.engine.modal import parameters_from_poles
from ctrl_realize.numerics.engine.newton import settle, solve_level
from ctrl_realize.numerics.engine.problem import Bounds, KnownFactor, Structure
from ctrl_realize.numerics.engine.profile import dead_time_error, dead_time_profile, profile_limits
from ctrl_realize.numerics.engine.structures import (
    Candidate,
    at_dead_time,
    converged,
    on_new_data,
    parameter_bounds,
    search,
)
from ctrl_realize.numerics.output_error.step_data import step_data, step_scales, window

SIGMA, DEAD, LAGS = 0.01, 20.3, (12.0, 30.0)


def problem_of(lags=LAGS, unit=1.0, seed=3, dead_time=DEAD):
    """Lags behind a dead time, in noise; times in samples of `unit` seconds."""
    k = np.arange(-300, 600, dtype=float)
    rates = 1 / np.array(lags)
    shares = [1 / np.prod(1 - p / np.delete(rates, i)) for i, p in enumerate(rates)]
    late = np.clip(k - dead_time, 0, None)
    y = 1 - np.exp(-np.outer(late, rates)) @ np.array(shares)
    y = y + SIGMA * np.random.default_rng(seed).standard_normal(k.size)
    data = step_data(y, (k >= 0).astype(float), unit, [(300, 1)])
    return window(data, k.size, KnownFactor()).problem, step_scales(data, k.size, None)


def start(dead_time: float, *lags: float) -> np.ndarray:
    return np.append(dead_time, parameters_from_poles(-1 / np.array(lags, dtype=complex)))


@pytest.fixture
def found():
    """Two lags behind a dead time, in noise, and their fit."""
    problem, scales = problem_of()
    structure = Structure(2, 2)
    bounds = parameter_bounds(structure, scales)
    parameters, cost = fit_batch(problem, structure, start(DEAD, *LAGS)[None], bounds)
    return problem, Candidate(structure, parameters[0], float(cost[0])), scales


def test_the_profile_is_the_misfit_of_the_best_lags_at_each_dead_time(found):
    problem, candidate, scales = found
    variance = SIGMA**2
    dead_time, excess = dead_time_profile(problem, candidate, variance, scales)
    assert np.all(np.diff(dead_time) >= 0)
    assert (dead_time[0], dead_time[-1]) == (scales.earliest, scales.latest)
    assert excess[np.flatnonzero(dead_time == candidate.dead_time)].min() == pytest.approx(
        0, abs=1e-6
    )
    assert excess.min() == 0

    def cost(lags, held):
        theta = np.append(held, lags)[None]
        return evaluate(problem, candidate.structure, theta).cost

    for i in np.flatnonzero(np.abs(dead_time - candidate.dead_time) < 3)[::4]:
        best = least_squares(
            lambda lags, held: np.sqrt(cost(lags, held)),
            candidate.parameters[1:],
            args=(dead_time[i],),
            x_scale=0.1,
        )
        least = float(cost(best.x, dead_time[i])[0])
        # a search without derivatives of a root ends within a hundredth of a chi-square
        assert excess[i] == pytest.approx((least - candidate.cost) / variance, abs=0.02)


def test_near_the_optimum_it_is_the_parabola_of_the_standard_error(found):
    problem, candidate, scales = found
    error = dead_time_error(problem, candidate, SIGMA**2)
    low, high = profile_limits(*dead_time_profile(problem, candidate, SIGMA**2, scales))
    # the parabola bends a little over two standard errors
    assert (high - low) / (2 * 1.96) == pytest.approx(error, rel=0.05)
    assert low < DEAD < high
    # twice the noise, twice the interval
    wide = profile_limits(*dead_time_profile(problem, candidate, 4 * SIGMA**2, scales))
    assert wide[1] - wide[0] == pytest.approx(2 * (high - low), rel=0.05)


def test_a_dead_time_that_crosses_a_hundred_samples_ends_where_one_beside_it_does():
    problem, scales = problem_of((30.0, 60.0), dead_time=140.3)
    structure = Structure(2, 2)
    bounds = parameter_bounds(structure, scales)
    starts = np.array([start(at, 30.0, 60.0) for at in (140.0, 40.0)])
    near, far = (descend(problem, structure, one[None], bounds, scales.dt) for one in starts)
    # within the decrease at which Newton's method takes over, 0.05 variances
    assert far[1][0] - near[1][0] < 0.1 * SIGMA**2
    assert abs(far[0][0, 0] - near[0][0, 0]) < 0.1


@pytest.mark.parametrize(
    ("order", "degree", "within"),
    # along the valley of a superfluous lag a search ends 0.005 variances above the minimum
    [(2, 2, 1e-4), (2, 1, 1e-4), (3, 3, 2e-2), (3, 2, 2e-2)],
)
def test_at_the_minimum_nothing_slopes(order, degree, within):
    problem, scales = problem_of()
    structure = Structure(order, degree)
    bounds = parameter_bounds(structure, scales)
    first = start(20.0, *np.linspace(8, 35, order))[None]
    near = descend(problem, structure, first, bounds, scales.dt)[0][0]
    x, cost = settle(problem, structure, near, bounds, scales.dt)
    state = evaluate(problem, structure, x[None])
    # a second method from there: Nelder and Mead's simplex
    lower = minimize(
        lambda theta: float(evaluate(problem, structure, theta[None]).cost[0]), x,
        method="Nelder-Mead", bounds=list(zip(bounds.low, bounds.high, strict=True)),
    ).fun  # fmt: skip
    assert cost - lower < 0.01 * SIGMA**2
    slope = state.jacobian[0].T @ state.residual[0]
    size = np.linalg.norm(state.jacobian[0], axis=0) * SIGMA
    free = (x > bounds.low) & (x < bounds.high)
    # in standard errors, were the others known
    assert np.all(np.abs(slope)[free] <= within * size[free] + 1e-12)


def test_a_minimum_in_a_kink_is_at_the_sample_and_both_of_its_sides_rise():
    # A first-order response begins with a slope: with little noise many minima are at samples.
    structure, kinks = Structure(1, 1), 0
    for seed in range(20):
        problem, scales = problem_of((3.0,), seed=seed, dead_time=20.0)
        bounds = parameter_bounds(structure, scales)
        near = descend(problem, structure, start(20.0, 3.0)[None], bounds, scales.dt)[0][0]
        x, cost = settle(problem, structure, near, bounds, scales.dt)
        beside = np.tile(x, (2, 1))
        beside[:, 0] += [-1e-4, 1e-4]
        assert np.all(evaluate(problem, structure, beside).cost > cost)
        kinks += x[0] == round(x[0])
    assert 0 < kinks < 20


@pytest.mark.parametrize(("order", "degree"), [(2, 2), (2, 1)])
def test_a_level_is_met_by_the_least_cost_at_that_dead_time(order, degree):
    problem, scales = problem_of()
    structure = Structure(order, degree)
    bounds = parameter_bounds(structure, scales)
    near = descend(problem, structure, start(20.0, 10.0, 30.0)[None], bounds, scales.dt)[0][0]
    x, cost = settle(problem, structure, near, bounds, scales.dt)
    goal = cost + 3.84 * SIGMA**2
    aside = x.copy()
    aside[0] -= 0.5
    found = solve_level(problem, structure, aside, bounds, scales.dt, goal, SIGMA**2)
    assert found is not None
    assert found[0] < x[0]
    held = found[None].copy()
    held[:, 1:] = x[1:]
    again, _ = descend(problem, structure, held, bounds, scales.dt, dead_time_fixed=True)
    least = settle(problem, structure, again[0], bounds, scales.dt, dead_time_fixed=True)[1]
    assert least == pytest.approx(goal, abs=1e-5 * SIGMA**2)


def test_what_is_compared_has_no_slope_and_the_cost_of_the_data_of_now():
    problem, scales = problem_of()
    shapes = [Structure(1, 1), Structure(2, 2), Structure(2, 1), Structure(3, 3), Structure(3, 2)]
    rough = search(problem, shapes, scales)
    found = converged(problem, rough, scales, SIGMA**2, 600.0)
    for shape in shapes:
        assert found[shape].cost <= rough[shape].cost
    # nested: a pole more, or a zero more, is never worse
    assert found[Structure(2, 1)].cost <= found[Structure(2, 2)].cost * (1 + 1e-9)
    assert found[Structure(3, 2)].cost <= found[Structure(2, 2)].cost * (1 + 1e-9)
    moved = replace(problem, data=problem.data + 0.1 * np.sin(np.arange(problem.data.size)))
    for shape, candidate in on_new_data(moved, found).items():
        state = evaluate(moved, shape, candidate.parameters[None])
        # the same sum over other rows
        assert candidate.cost == pytest.approx(float(state.cost[0]), rel=1e-12)


@pytest.mark.parametrize("dead_time", [0.0, 1.0])
def test_no_random_start_beats_the_model_at_a_dead_time_far_from_the_best(dead_time):
    # what creeps as a logarithm is of no finite order: at other dead times other poles are best
    k = np.arange(-50, 150, dtype=float)
    y = np.log1p(np.clip(k - 2.3, 0, None) / 10) / 3
    y = y + SIGMA * np.random.default_rng(0).standard_normal(k.size)
    data = step_data(y, (k >= 0).astype(float), 1.0, [(50, 1)])
    scales = step_scales(data, k.size, None)
    problem = window(data, k.size, KnownFactor()).problem
    structure = Structure(3, 1)
    best = search(problem, [structure], scales)[structure]
    box = parameter_bounds(structure, scales)
    starts = np.random.default_rng(9).uniform(box.low, box.high, size=(30, 4))
    held = Bounds(*(np.append(dead_time, ends[1:]) for ends in (box.low, box.high)))
    cost = fit_batch(problem, structure, starts, held, most_iterations=60)[1]
    assert at_dead_time(problem, best, scales, dead_time).cost <= cost.min()
