"""Decisions within a thousandth of their threshold are reported, others are not."""

from dataclasses import replace

import numpy as np
import pytest

from ctrl_realize.identification.output_error.flags import sampled_flags
from ctrl_realize.numerics.output_error.interval import likelihood_fit
from ctrl_realize.numerics.output_error.margins import CLOSE, close_to
from ctrl_realize.numerics.output_error.step_data import step_data, step_scales, window
from ctrl_realize.numerics.separable.structures import PLAUSIBLE, needless_parameters
from ctrl_realize.numerics.separable.varpro import KnownFactor, Structure
from ctrl_realize.numerics.separable.window import fit_window

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
    close, flags = decided(whole, 0.5 * CLOSE * PLAUSIBLE)
    assert [(one.key, one.structure) for one in close] == [("structure", LAGS[1])]
    assert "order 2, relative degree 2 fits as well" in flags[0].message


@pytest.mark.parametrize("excess", [0.1, 3.0])
def test_a_clear_choice_is_none(whole, excess):
    assert decided(whole, excess) == ((), [])


def test_a_value_near_its_threshold_is_told_on_both_of_its_sides():
    assert [len(close_to("adequate", x, 2.0)) for x in (1.99, 1.999, 2.001, 2.01)] == [0, 1, 1, 0]
