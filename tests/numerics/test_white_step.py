"""One step of generalised least squares, against the plant that made the data."""

from __future__ import annotations

import control as ct
import numpy as np
import pytest
from scipy.signal import lfilter

import ctrl_realize as cr
from ctrl_realize.numerics.validation.white_step import white_step

DT = 0.05
N = 800
TRUE = np.poly([-1.2, -4.0])  # 3 (1 + 0.3 s) behind two lags and 0.32 s
NUMERATOR = 3 * TRUE[-1] * np.array([1.0, 0.3])
DELAY = 0.32
TOTAL = DELAY + 1 / 1.2 + 1 / 4.0 - 0.3


def record(seed, size, pole):
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.choice([-1.0, 0.0, 1.0], N // 20), 20)
    plant = cr.delayed_ss(ct.tf(NUMERATOR[::-1], TRUE), dead_time=DELAY, dt=DT)
    noise = lfilter([np.sqrt(1 - pole**2)], [1, -pole], rng.standard_normal(N + 300))[300:]
    return u, np.ravel(plant.simulate(u)) + size * noise


def step(u, y, *, late=0.0, slow=1.0, gain=1.0):
    poles = np.array([-1.2 / slow, -4.0], dtype=complex)
    b = gain * NUMERATOR / slow
    return white_step(y, u, DT, DELAY + late, poles, b)


def test_a_step_from_a_neighbouring_model_leads_to_the_plant():
    u, y = record(0, 0.05, 0.0)
    found = step(u, y, late=0.005, slow=1.01, gain=0.98)
    assert abs(found.delay - DELAY) < 3 * found.delay_error < 0.01
    assert abs(found.gain - 3.0) < 3 * found.gain_error < 0.1
    assert abs(found.total - TOTAL) < 3 * found.total_error < 0.1


@pytest.mark.parametrize("pole", [0.0, 0.95])
def test_errors_are_those_that_come(pole):
    scores = []
    for seed in range(24):
        found = step(*record(seed, 0.2, pole))
        scores.append(
            [
                (found.delay - DELAY) / found.delay_error,
                (found.gain - 3.0) / found.gain_error,
                (found.total - TOTAL) / found.total_error,
            ]
        )
    spread = np.sqrt(np.mean(np.square(scores), axis=0))
    # 24 records: chi-square leaves 0.72 to 1.28; the colour is estimated along.
    assert np.all((spread > 0.6) & (spread < 1.5))


def test_units_are_carried_through():
    u, y = record(3, 0.1, 0.9)
    one = step(u, y)
    other = white_step(
        10 * y, u / 2, DT, DELAY, np.array([-1.2, -4.0], dtype=complex), 20 * NUMERATOR
    )
    assert other.gain == pytest.approx(20 * one.gain, rel=1e-6)
    assert other.delay_error == pytest.approx(one.delay_error, rel=1e-6)
    assert other.total_error == pytest.approx(one.total_error, rel=1e-6)


def test_too_few_data_give_no_step():
    u, y = record(0, 0.1, 0.0)
    assert step(u[:45], y[:45]) is None
