from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.signal import lfilter

from ctrl_realize.numerics.regression.arx import (
    arx_equations,
    arx_markov,
    arx_markov_std,
    arx_state_space,
    excited_directions,
    solve_arx,
)
from ctrl_realize.numerics.regression.normal_equations import normal_equations
from ctrl_realize.numerics.state_space.responses import markov


def test_arx_of_the_hairdryer_has_the_published_coefficients(shared_data):
    table = np.loadtxt(shared_data / "hairdryer" / "record.csv", delimiter=",", skiprows=1)[:300]
    u, y = (table[:, [i]].T - table[:, i].mean() for i in (1, 2))
    fit = solve_arx(arx_equations(u, y, 2, 2, 3, offset=False), 2, 2, 3)
    # five decimals are printed
    assert_allclose(fit.a.ravel(), [-1.27374, 0.39355], rtol=0, atol=6e-6)
    assert_allclose(fit.b.ravel(), [0.06662, 0.04448], rtol=0, atol=6e-6)


def test_pulse_response_of_an_arx_model_is_b_over_a():
    rng = np.random.default_rng(0)
    u = rng.normal(size=200)
    y = lfilter([0, 0, 0.5, 0.2], [1, -1.2, 0.5], u)
    fit = solve_arx(arx_equations(u[None], y[None], 2, 2, 2), 2, 2, 2)
    pulse = lfilter([0, 0, 0.5, 0.2], [1, -1.2, 0.5], np.eye(1, 40)[0])
    # exact data; the normal equations square a condition number of 10
    assert_allclose(arx_markov(fit, 40)[0, 0], pulse, rtol=0, atol=1e-11)


def test_the_state_space_form_has_the_pulse_response_of_the_arx_model():
    rng = np.random.default_rng(0)
    u, y = rng.normal(size=(2, 200)), rng.normal(size=(3, 200))
    for na, nb, delay in ((2, 3, 0), (3, 1, 0), (1, 2, 2)):
        fit = solve_arx(arx_equations(u, y, na, nb, delay), na, nb, delay)
        assert_allclose(markov(*arx_state_space(fit), 30), arx_markov(fit, 30), atol=1e-12)


def test_std_of_the_pulse_response_is_the_scatter_over_many_records():
    a = np.array([[[-0.8, 0.1], [0.2, -0.5]]])
    b = np.array([[0.9, 0.2], [0.3, 0.7]])
    found, claimed = [], []
    for seed in range(150):
        rng = np.random.default_rng(seed)
        u, e = rng.normal(size=(2, 300)), 0.3 * rng.normal(size=(2, 300))
        e[1] += 0.5 * e[0]
        y = np.zeros((2, 300))
        for k in range(1, 300):
            y[:, k] = -a[0] @ y[:, k - 1] + b @ u[:, k - 1] + e[:, k]
        fit = solve_arx(arx_equations(u, y, 1, 2), 1, 2)
        found.append(arx_markov(fit, 10))
        claimed.append(arx_markov_std(fit, 10))
    ratio = np.std(found, axis=0) / np.mean(claimed, axis=0)
    # a standard deviation of 150 draws is known to 1/sqrt(300) = 6 %; 40 of them, 3.5 sigma
    assert_allclose(ratio, 1.0, rtol=0, atol=0.2)


@pytest.mark.parametrize(
    ("signal", "directions"),
    [
        (np.ones(200), 0),
        (np.sin(0.3 * np.arange(200)), 2),
        (np.sin(0.3 * np.arange(200)) + np.cos(1.1 * np.arange(200)), 4),
        (np.random.default_rng(0).normal(size=200), 12),
    ],
)
def test_a_sine_excites_two_directions_and_a_constant_none(signal, directions):
    assert excited_directions(normal_equations(signal[None], signal[None], 12).gram) == directions
