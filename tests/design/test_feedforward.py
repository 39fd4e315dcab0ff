"""Feedforward from a measured load: exact cancellation, and what cannot be cancelled."""

import numpy as np
import pytest

import ctrl_realize as cr

PLANT = cr.design.ProcessModel(gain=2.0, lag=20.0, dead_time=5.0)
T = np.arange(200)


def left(made, plant, load, dt):
    """Response to a unit step of the load with the compensator, at the samples."""
    step = np.ones(T.size)
    return load.system(dt).simulate(step) + plant.system(dt).simulate(made.system.simulate(step))


@pytest.mark.parametrize(("lags", "integrating"), [((20.0, 30.0), False), ((0.0, 0.0), True)])
def test_a_load_that_comes_late_is_cancelled_at_every_sample(lags, integrating):
    plant = cr.design.ProcessModel(2.0, lags[0], 5.0, integrating=integrating)
    load = cr.design.ProcessModel(-1.2, lags[1], 9.0, integrating=integrating)
    made = cr.design.feedforward(plant, load, dt=1.0)
    assert made.uncovered == 0
    assert made.system.delay == 4
    assert np.abs(left(made, plant, load, 1.0)).max() < 1e-12


def test_what_a_load_that_comes_early_leaves_is_told():
    load = cr.design.ProcessModel(gain=-1.2, lag=30.0, dead_time=2.0)
    made = cr.design.feedforward(PLANT, load, dt=1.0)
    rest = left(made, PLANT, load, 1.0)
    assert np.abs(rest).max() == pytest.approx(made.peak, rel=1e-12)
    assert made.peak == pytest.approx(1.2 * -np.expm1(-3 / 30), rel=1e-12)
    assert abs(rest[-1]) < 0.01 * made.peak
    assert "3 s before the plant input can" in made.report()


def test_both_paths_of_one_model_are_used_as_they_are_identified():
    load = cr.design.ProcessModel(gain=-1.2, lag=30.0, dead_time=9.0)
    both = PLANT.system(1.0).append(load.system(1.0))
    whole = np.ones((1, 2)) * both
    made = cr.design.feedforward(whole[0, 0], whole[0, 1])
    assert made.gain == pytest.approx(0.6, rel=1e-3)
    assert made.lead == pytest.approx(20, rel=1e-2)
    assert np.abs(left(made, PLANT, load, 1.0)).max() < 0.01 * 1.2


def test_paths_of_different_kinds_and_models_without_time_are_refused():
    ramp = cr.design.ProcessModel(1.0, 0.0, 2.0, integrating=True)
    with pytest.raises(cr.errors.UnsuitableSystemError, match="expected both or neither"):
        cr.design.feedforward(PLANT, ramp, dt=1.0)
    with pytest.raises(cr.errors.UnsuitableSystemError, match="give dt"):
        cr.design.feedforward(PLANT, PLANT)


def test_what_parts_of_a_sample_leave_of_the_load_is_told():
    plant = cr.design.ProcessModel(gain=2.0, lag=3.0, dead_time=3.4)
    load = cr.design.ProcessModel(gain=-1.2, lag=3.0, dead_time=4.0)
    made = cr.design.feedforward(plant, load, dt=1.0)
    # the load acts 0.6 s after the plant input, which waits for a whole sample
    assert (made.delay, made.uncovered) == (1.0, 0.0)
    time = np.arange(0.0, 40.0)
    left = load.step(time) + 0.6 * plant.step(time - 1.0)
    assert made.peak == pytest.approx(np.abs(left).max(), rel=1e-12)
    assert "a part of a sample: up to 0.123" in made.report()
