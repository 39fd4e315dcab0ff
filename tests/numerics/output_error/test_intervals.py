"""Ends of intervals, and minima that profiles lead to."""

from dataclasses import replace

import numpy as np
import pytest

from ctrl_realize.numerics.output_error.profiles import laid_profiles, lower_minima
from ctrl_realize.numerics.output_error.result import DelayInterval
from ctrl_realize.numerics.output_error.step_data import step_data, step_scales, window
from ctrl_realize.numerics.separable.structures import Scales
from ctrl_realize.numerics.separable.varpro import KnownFactor, Structure, evaluate
from ctrl_realize.numerics.separable.window import WindowFit, fit_window

DT = 0.5
SCALES = Scales(10.0, 20.0, 400.0, DT, 50.0)


def test_ends_are_rounded_outwards_to_a_hundredth_of_the_width_at_most():
    # 41.237 to 44.561 samples: steps of a hundredth of a sample
    found = DelayInterval(41.2371 * DT, 44.5611 * DT, 1.0).rounded(43.0 * DT, SCALES)
    assert found == pytest.approx((41.23 * DT, 44.57 * DT, 1.0))
    # rounding errors about a round value change nothing
    for error in (-1e-9, 1e-9):
        again = DelayInterval(40 * DT + error, 44 * DT + error, 1.0).rounded(42 * DT, SCALES)
        assert again == pytest.approx((40 * DT, 44 * DT, 1.0), abs=1e-12)
    # neither beyond what is allowed, nor past the dead time
    low, high, _ = DelayInterval(0.0, SCALES.latest, 1.0).rounded(0.0, SCALES)
    assert (low, high) == (0.0, SCALES.latest)
    assert DelayInterval(3.0, 3.0, 0.0).rounded(3.0, SCALES) == (3.0, 3.0, 0.0)


def two_lags() -> WindowFit:
    k = np.arange(900.0)
    after = np.clip(k - 220, 0, None)
    fast, slow = 10.0, 60.0
    y = 1 - (slow * np.exp(-after / slow) - fast * np.exp(-after / fast)) / (slow - fast)
    y += 0.005 * np.random.default_rng(2).standard_normal(k.size)
    data = step_data(y, 1.0 * (k >= 200), DT, [(200, 1)])
    scales = step_scales(data, k.size, None)
    problem = window(data, k.size, KnownFactor())
    return fit_window(
        problem, [Structure(1, 1), Structure(2, 2)], scales, (data.sigma, data.quantum), huber=False
    )


def test_a_profile_leads_to_the_minimum_that_a_search_has_missed():
    whole, two = two_lags(), Structure(2, 2)
    best = whole.candidates[two]
    assert not lower_minima(whole, laid_profiles(whole, [two]))
    beside = best.parameters + np.array([0.3 * DT, 0.02, 0.02])
    cost = float(evaluate(whole.problem, two, beside[None]).cost[0])
    assert cost > best.cost + whole.variance
    missed = replace(best, parameters=beside, cost=cost)
    ended = replace(whole, candidates=whole.candidates | {two: missed})
    found = lower_minima(ended, laid_profiles(ended, [two]))
    assert found[two].cost == pytest.approx(best.cost, abs=1e-6 * whole.variance)
    assert found[two].dead_time == pytest.approx(best.dead_time, abs=1e-4 * DT)
