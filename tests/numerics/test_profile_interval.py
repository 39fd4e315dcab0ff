"""Misfit over a delay that is held, against a fit of the same by another way."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import least_squares

from ctrl_realize.numerics.output_error.step_data import step_data, step_scales, window
from ctrl_realize.numerics.separable.poles import parameters_from_poles
from ctrl_realize.numerics.separable.profile import delay_error, delay_profile
from ctrl_realize.numerics.separable.profile_ends import profile_limits
from ctrl_realize.numerics.separable.structures import Candidate, parameter_bounds
from ctrl_realize.numerics.separable.varpro import KnownFactor, Structure, evaluate, fit_batch

SIGMA, DEAD, LAGS = 0.01, 20.3, (12.0, 30.0)


@pytest.fixture
def found():
    """Two lags behind a dead time, in noise, and their fit."""
    k = np.arange(-300, 600, dtype=float)
    late = np.clip(k - DEAD, 0, None)
    fast, slow = LAGS
    y = 1 - (slow * np.exp(-late / slow) - fast * np.exp(-late / fast)) / (slow - fast)
    y = y + SIGMA * np.random.default_rng(3).standard_normal(k.size)
    data = step_data(y, (k >= 0).astype(float), 1.0, [(300, 1)])
    scales = step_scales(data, k.size, None)
    problem = window(data, k.size, KnownFactor()).problem
    structure = Structure(2, 2)
    start = np.append(DEAD, parameters_from_poles(-1 / np.array(LAGS, dtype=complex)))
    parameters, cost = fit_batch(
        problem, structure, start[None], parameter_bounds(structure, scales)
    )
    return problem, Candidate(structure, parameters[0], float(cost[0])), scales


def test_the_profile_is_the_misfit_of_the_best_lags_at_each_delay(found):
    problem, candidate, scales = found
    variance = SIGMA**2
    delay, excess = delay_profile(problem, candidate, variance, scales)
    assert np.all(np.diff(delay) >= 0)
    assert (delay[0], delay[-1]) == (scales.earliest, scales.latest)
    assert excess[np.flatnonzero(delay == candidate.delay)].min() == pytest.approx(0, abs=1e-6)
    assert excess.min() == 0

    def cost(lags, held):
        theta = np.append(held, lags)[None]
        return evaluate(problem, candidate.structure, theta).cost

    for i in np.flatnonzero(np.abs(delay - candidate.delay) < 3)[::4]:
        best = least_squares(
            lambda lags, held: np.sqrt(cost(lags, held)),
            candidate.parameters[1:],
            args=(delay[i],),
            x_scale=0.1,
        )
        least = float(cost(best.x, delay[i])[0])
        # a search without derivatives of a root ends within a hundredth of a chi-square
        assert excess[i] == pytest.approx((least - candidate.cost) / variance, abs=0.02)


def test_near_the_optimum_it_is_the_parabola_of_the_standard_error(found):
    problem, candidate, scales = found
    error = delay_error(problem, candidate, SIGMA**2)
    low, high = profile_limits(*delay_profile(problem, candidate, SIGMA**2, scales))
    # the parabola bends a little over two standard errors
    assert (high - low) / (2 * 1.96) == pytest.approx(error, rel=0.05)
    assert low < DEAD < high
    # twice the noise, twice the interval
    wide = profile_limits(*delay_profile(problem, candidate, 4 * SIGMA**2, scales))
    assert wide[1] - wide[0] == pytest.approx(2 * (high - low), rel=0.05)
