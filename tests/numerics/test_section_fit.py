from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from ctrl_realize.numerics.state_space.responses import markov, simulate
from ctrl_realize.numerics.state_space.section_fit import Experiment, fit_sections
from ctrl_realize.numerics.state_space.sections import in_sections, motion

PLANT = (
    np.array([[0.7, 0.3, 0.0], [-0.3, 0.7, 0.2], [0.0, 0.0, 0.4]]),
    np.array([[1.0, 0.3], [0.2, 1.0], [0.5, -0.4]]),
    np.array([[1.0, 0.0, 0.5], [0.3, 1.0, -0.2]]),
    np.zeros((2, 2)),
)
NOISE = np.array([0.05, 0.5])


def experiment(seed, samples=500, noise=NOISE, level=0.0):
    rng = np.random.default_rng(seed)
    v = rng.standard_normal((2, samples))
    y = simulate(*PLANT, v, rng.standard_normal(3)) + level
    return Experiment(v, y + noise[:, None] * rng.standard_normal(y.shape))


def near():
    return in_sections(PLANT[0] * 0.9, PLANT[1], PLANT[2], PLANT[3])


def test_exact_data_give_the_plant_back_whatever_level_and_state_they_start_from():
    data = [experiment(k, 200, 0 * NOISE, level=k) for k in (0, 5)]
    found = fit_sections(data, near(), feedthrough=False).model
    # the squares of what is left end at rounding, 1e-12 of the output
    assert_allclose(markov(*found.matrices(), 40), markov(*PLANT, 40), rtol=0, atol=1e-8)


def test_errors_are_those_that_the_cramer_rao_bound_allows():
    # 24 records: the mean of chi-square over degrees of freedom is 1 within 3 x 0.08
    truth = in_sections(*PLANT)
    ratios = []
    for seed in range(24):
        data = experiment(seed, 300)
        found = fit_sections([data], near(), feedthrough=False)
        own = motion(truth, data.v)
        wrong = motion(found.model, data.v).output(found.model, data.v) - own.output(truth, data.v)
        linear = own.starts(truth)
        levels = np.broadcast_to(np.eye(2)[:, :, None], (2, 2, 300))
        base = np.concatenate([linear, levels], axis=1) / NOISE[:, None, None]
        base = base.transpose(0, 2, 1).reshape(600, -1)
        error = (wrong / NOISE[:, None]).ravel()
        error -= base @ np.linalg.lstsq(base, error, rcond=None)[0]
        ratios.append(error @ error / (3 * 4))  # n (p + m) parameters of the response
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.24)


def test_samples_that_are_missing_are_left_out():
    data = experiment(0)
    y = data.y.copy()
    y[0, 50:90], y[1, 7] = np.nan, np.nan
    spoiled = data.y.copy()
    spoiled[0, 50:90] = 1e3
    gaps = fit_sections([Experiment(data.v, y)], near(), feedthrough=False)
    assert gaps.counts.tolist() == [460.0, 499.0]
    assert_allclose(markov(*gaps.model.matrices(), 30), markov(*PLANT, 30), atol=0.2)
    wrong = fit_sections([Experiment(data.v, spoiled)], near(), feedthrough=False)
    assert np.abs(markov(*wrong.model.matrices(), 30) - markov(*PLANT, 30)).max() > 0.2
