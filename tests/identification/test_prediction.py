"""Prediction from an autoregression that is given."""

from __future__ import annotations

import numpy as np

import ctrl_realize as cr
from ctrl_realize.identification import prediction

DT = 0.1
LEFT = np.array([[8.0, -4.0, 2.0, 0.0], [1.0, 2.0, 3.0, 4.0]])


def test_a_prediction_is_reported_with_fit_and_orders():
    record = cr.Record(DT * np.arange(4), np.ones(4), LEFT)
    found = prediction.Prediction(LEFT, np.array([87.256, 65.0]), 10, (3, 0), record)
    assert found.report().splitlines() == [
        "Prediction 10 samples ahead",
        "  fit                 87.26 %, 65.00 %",
        "  order of the noise  3, 0",
    ]
    assert repr(found) == "<Prediction 10 ahead: fit 87.3, 65.0 %>"
