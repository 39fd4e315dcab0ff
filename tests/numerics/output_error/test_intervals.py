"""Ends of intervals, minima that profiles lead to, bounds, and decisions close to a threshold."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.accuracy.cramer_rao import dead_time_bound
from ctrl_realize.identification.output_error.flags import sampled_flags
from ctrl_realize.numerics.constants import VERY_STRONG
from ctrl_realize.numerics.engine.eliminate import evaluate
from ctrl_realize.numerics.engine.problem import KnownFactor, Structure
from ctrl_realize.numerics.engine.structures import Scales, needless_parameters
from ctrl_realize.numerics.engine.window_fit import WindowFit, fit_window
from ctrl_realize.numerics.output_error.interval import laid_profiles, likelihood_fit, lower_minima
from ctrl_realize.numerics.output_error.result import DelayInterval
from ctrl_realize.numerics.output_error.selection import CLOSE, close_to
from ctrl_realize.numerics.output_error.step_data import step_data, step_scales, window
from tests import rigs

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


LAGS = Structure(1, 1), Structure(2, 2)


@pytest.fixture(scope="module")
def whole():
    k = np.arange(-100, 300, dtype=float)
    late = np.clip(k - 10.3, 0, None)
    noise = 0.01 * np.random.default_rng(0).standard_normal(k.size)
    data = step_data(1 - np.exp(-late / 20) + noise, (k >= 0).astype(float), 1.0, [(100, 1)])
    problem = window(data, k.size, KnownFactor())
    scales = step_scales(data, k.size, None)
    return fit_window(problem, LAGS, scales, (data.sigma, data.quantum), huber=True)


def decided(whole, excess):
    """Estimate and flags where the second-order model has a criterion larger by so much."""
    best = whole.criterion[LAGS[0]] + needless_parameters(LAGS[0])
    values = {LAGS[0]: best, LAGS[1]: best + excess}
    fit = likelihood_fit(replace(whole, criterion=values), adequate=True)
    flags = sampled_flags(fit, 1.0, 300.0, None)
    return fit.close, [flag for flag in flags if flag.code == "marginal_decision"]


def test_two_structures_with_one_criterion_are_a_marginal_decision(whole):
    close, flags = decided(whole, 0.5 * CLOSE * VERY_STRONG)
    assert [(one.key, one.structure) for one in close] == [("structure", LAGS[1])]
    assert "order 2, relative degree 2 fits as well" in flags[0].message


@pytest.mark.parametrize("excess", [0.1, 3.0])
def test_a_clear_choice_is_none(whole, excess):
    assert decided(whole, excess) == ((), [])


def test_a_value_near_its_threshold_is_told_on_both_of_its_sides():
    assert [len(close_to("adequate", x, 2.0)) for x in (1.99, 1.999, 2.001, 2.01)] == [0, 1, 1, 0]


SENSOR = 2 * np.pi * 30.0


def bound(plant, **kwargs):
    poles = plant.poles().astype(complex)
    gain = np.array([np.prod(-poles).real])
    return (
        dead_time_bound(poles, gain, 37 * rigs.TS, rigs.TS, (3840, 1101), 0.01, **kwargs) / rigs.TS
    )


@pytest.mark.parametrize(
    ("plant", "kwargs", "samples"),
    [
        (rigs.R3, {}, 0.920),
        (rigs.R4, {}, 4.33),
        (rigs.R3, {"known": KnownFactor(np.array([-SENSOR + 0j]), np.array([SENSOR]))}, 0.959),
    ],
)
def test_bounds_are_those_computed_independently(plant, kwargs, samples):
    # Samples per 1 % noise, from a separate program with numerical derivatives, three digits.
    assert bound(plant, **kwargs) == pytest.approx(samples, rel=2e-3)
