"""Records of any input as one problem."""

from __future__ import annotations

import numpy as np
import pytest

from ctrl_realize.numerics.pole_factors import poles_from_parameters
from ctrl_realize.numerics.sampled_data import SampledData, cut
from ctrl_realize.numerics.separable_fit import KnownFactor, Structure, evaluate, respond

NOTHING = KnownFactor()


def records(*lengths):
    rng = np.random.default_rng(0)
    outputs = [rng.standard_normal(n) for n in lengths]
    return outputs, [rng.standard_normal(n) + 5.0 for n in lengths]


def two(**changed):
    outputs, inputs = records(9, 6)
    given = {"starts": (2, 1), "scales": (1.0, 4.0), "dt": 0.5} | changed
    return SampledData(tuple(inputs), tuple(outputs), **given)


@pytest.mark.parametrize("unit", [1.0, 1e-6])
def test_every_record_has_its_own_clock_level_and_drift(unit):
    stretches = two(dt=0.5 * unit).problem(NOTHING).stretches
    assert stretches.edges.tolist() == [0, 7, 12]
    clock = np.array([0, 0.5, 1, 1.5, 2, 2.5, 3, 0, 0.5, 1, 1.5, 2])
    assert stretches.clock == pytest.approx(unit * clock)
    level, drift = stretches.regressors.T
    assert level.tolist() == [1.0] * 12
    # from nothing to one
    assert drift == pytest.approx(np.concatenate([np.linspace(0, 1, 7), np.linspace(0, 1, 5)]))


def test_slow_cosines_go_down_to_the_shortest_period():
    # a record of 3 s: half periods of 3, 1.5 and 1 s are periods of 2 s and longer
    stretches = two(period=2.0).problem(NOTHING).stretches
    time = np.linspace(0, 1, 7)
    expected = [np.ones(7), time, *(np.cos(np.pi * k * time) for k in (1, 2, 3))]
    assert stretches.regressors[:7] == pytest.approx(np.stack(expected, axis=1))
    # a record of 2 s has one less
    time = np.linspace(0, 1, 5)
    expected = [np.ones(5), time, *(np.cos(np.pi * k * time) for k in (1, 2)), np.zeros(5)]
    assert stretches.regressors[7:] == pytest.approx(np.stack(expected, axis=1))
    assert stretches.shapes == 5 + 4
    # shorter periods are left out, whatever comes close
    assert two(period=2.01).problem(NOTHING).stretches.shapes == 4 + 3
    assert two(period=7.0).problem(NOTHING).stretches.shapes == 2 + 2


def test_two_records_of_one_plant_leave_nothing_of_either():
    # a lag behind a delay; the first has a level and a drift, the second starts in motion
    parameters = np.array([1.2, np.log(0.8)])
    (pole,), _ = poles_from_parameters(parameters[None, 1:])
    _, inputs = records(40, 30)
    zero = [np.zeros(u.size) for u in inputs]
    at_rest = cut(zero, inputs, 0.5)
    model = respond(at_rest.problem(NOTHING).drive, NOTHING, np.array([2.0]), parameters)
    first = model[:40] + 3.0 - 0.1 * np.arange(40)
    second = model[40:] + 5.0 * np.exp(pole.real * 0.5 * np.arange(30))
    state = evaluate(
        cut([first, second], inputs, 0.5).problem(NOTHING), Structure(1, 1), parameters[None]
    )
    assert np.abs(state.residual).max() < 1e-12
    assert state.numerator[0] == pytest.approx([2.0])
