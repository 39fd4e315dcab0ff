"""Records for fits of actuators, against exact responses."""

from __future__ import annotations

import control as ct
import numpy as np

import ctrl_realize as cr
from ctrl_realize.numerics.actuated.family import actuated_family
from ctrl_realize.numerics.actuated.records import MOST_SAMPLES, ActuatedRecord, Records
from ctrl_realize.numerics.engine.modal import parameters_from_poles
from ctrl_realize.numerics.engine.structures import Scales


def test_one_model_explains_a_long_record_and_its_means_over_blocks():
    dt, rate = 0.005, 12.0
    command = np.repeat([0.0, 40.0, 25.0], [7001, 6000, 7000])
    plant = cr.delayed_ss(ct.tf([1], [0.5, 1.5, 1]), dead_time=0.73, dt=dt)
    position = cr.actuators.SlewRateLimit(rate).simulate(command, dt)
    output = np.ravel(plant.simulate(position))
    output[9000:9003] = np.nan
    whole = ActuatedRecord(command, dt, output, np.ones((command.size, 1)))
    thinned = whole.thinned()
    assert thinned.command.size <= MOST_SAMPLES < command.size
    x = np.concatenate([[0.73], parameters_from_poles(np.array([-1.0, -2.0])), [np.log(rate)]])
    scales = Scales(onset=0.7, rise=2.0, length=100.0, dt=dt, latest=3.0)
    for record in (whole, thinned):
        records = Records((record,))
        family = actuated_family(records, scales, 2, "slew_rate", "input", (0.0, 40.0))
        model = family.evaluate(records.problem, x[None])
        # `SlewRateLimit` moves from sample to sample, which is half a sample early.
        assert abs(model.numerator[0, 0] / 2 - 1) < 1e-3
        assert np.abs(model.residual).max() < 0.6 * dt * rate
