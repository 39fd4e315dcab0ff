"""Errors of models with an actuator, against the normal equations of all their parameters."""

from __future__ import annotations

import numpy as np
import pytest

from ctrl_realize.numerics.actuated.family import actuated_family
from ctrl_realize.numerics.actuated.records import ActuatedRecord, Records
from ctrl_realize.numerics.engine.static_gain import static_gain
from ctrl_realize.numerics.engine.structures import Candidate, Scales


@pytest.mark.parametrize("place", ["input", "stem"])
def test_errors_of_gain_and_total_delay_count_what_the_actuator_leaves_open(place):
    command, dt, length, variance = np.repeat([0.0, 1.0], [20, 280]), 0.1, 28.0, 1e-4
    scales = Scales(onset=0.7, rise=2.0, length=length, dt=dt, latest=3.0)
    x = np.array([0.73, np.log(0.8), np.log(0.5)])  # dead time, a lag of 1.25 s, and a rate
    empty = ActuatedRecord(command, dt, np.zeros(300), np.ones((300, 1)))
    family = actuated_family(Records((empty,)), scales, 1, "slew_rate", place, (0.0, 1.0))
    output = 2 * family.unit(x[None])[0]
    problem = Records((ActuatedRecord(command, dt, output, np.ones((300, 1))),)).problem
    found = static_gain(problem, Candidate(family, x, 0.0), variance, length)
    columns = family.directions(problem, x)[0]
    covariance = variance * np.linalg.inv(columns.T @ columns)
    assert found.gain == pytest.approx(2)
    assert found.total == pytest.approx(0.73 + 1.25)
    assert found.gain_std == pytest.approx(np.sqrt(covariance[-1, -1]), rel=1e-4)
    along = np.array([1.0, -1.25, 0.0, 0.0])
    assert found.total_std == pytest.approx(np.sqrt(along @ covariance @ along), rel=1e-4)
