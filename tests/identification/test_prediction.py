"""Prediction from an autoregression that is given."""

from __future__ import annotations

import control as ct
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import ctrl_realize as cr
from ctrl_realize.errors import OptionError
from ctrl_realize.identification import prediction
from ctrl_realize.identification.prediction import NOISE_ORDER, predict

DT = 0.1
SIMULATED = np.array([[1.0, 2.0, 3.0, 4.0], [0.0, 0.0, 5.0, 5.0]])
LEFT = np.array([[8.0, -4.0, 2.0, 0.0], [1.0, 2.0, 3.0, 4.0]])
SYSTEM = ct.ss([], [], [], [[1.0], [1.0]], DT)


@pytest.fixture
def by_hand(monkeypatch):
    """A simulation that leaves `LEFT`; its first row halves from sample to sample."""
    asked = []

    def autoregression(row, most):
        asked.append(most)
        return np.array([0.5]) if row[0] == 8.0 else np.empty(0)

    monkeypatch.setattr(
        prediction, "simulate_record", lambda *args: asked.append(args) or SIMULATED
    )
    monkeypatch.setattr(prediction, "autoregression", autoregression)
    return asked


def test_what_is_left_is_carried_on_by_each_output_s_own_autoregression(by_hand):
    record = cr.Record(DT * np.arange(4), np.ones(4), SIMULATED + LEFT)
    one, two = (predict(SYSTEM, record, steps) for steps in (1, 2))
    # half of what was left a sample ago, a quarter of that of two samples ago; white noise: nothing
    assert_allclose(one.output[0], SIMULATED[0] + [0, 4, -2, 1], rtol=1e-12)
    assert_allclose(two.output[0], SIMULATED[0] + [0, 0, 2, -1], rtol=1e-12)
    assert_array_equal(one.output[1], SIMULATED[1])
    assert (one.steps, one.noise_order, one.record) == (1, (1, 0), record)
    # the second row: 1, 2, 8, 9 less its mean of 5 are squares of 50; 30 of them are left
    assert_allclose(one.fit_percent[1], 100 * (1 - np.sqrt(30 / 50)), rtol=1e-12)
    assert by_hand[0] == (SYSTEM, record, "estimate")
    predict(SYSTEM, record, 1, start="rest")
    assert "rest" in by_hand[-3]
    with pytest.raises(OptionError, match="steps"):
        predict(SYSTEM, record, 0)
    with pytest.raises(ValueError, match="read-only"):
        one.output[0] = 1.0


@pytest.mark.parametrize(("samples", "most"), [(9, 0), (39, 3), (40, 4), (1000, NOISE_ORDER)])
def test_ten_samples_are_needed_for_each_coefficient(monkeypatch, by_hand, samples, most):
    flat = np.zeros((1, samples))
    monkeypatch.setattr(prediction, "simulate_record", lambda *_: flat)
    waves = np.sin(np.arange(samples))
    found = predict(SYSTEM, cr.Record(DT * np.arange(samples), np.ones(samples), waves), 1)
    assert by_hand == [most]
    assert found.output.shape == (samples,)


def test_a_prediction_is_reported_with_fit_and_orders():
    record = cr.Record(DT * np.arange(4), np.ones(4), LEFT)
    found = prediction.Prediction(LEFT, np.array([87.256, 65.0]), 10, (3, 0), record)
    assert found.report().splitlines() == [
        "Prediction 10 samples ahead",
        "  fit                 87.26 %, 65.00 %",
        "  order of the noise  3, 0",
    ]
    assert repr(found) == "<Prediction 10 ahead: fit 87.3, 65.0 %>"
