"""Performance of a closed loop: against simulation, without a guess of its time."""

from __future__ import annotations

import control as ct
import matplotlib.pyplot as plt
import numpy as np
import pytest

import ctrl_realize as cr
from ctrl_realize.design import performance
from ctrl_realize.design.tuning.table import UNSTABLE
from ctrl_realize.errors import ModelWarning, OptionError, UnsuitableSystemError

DT = 0.01


def plant(lag=0.8, dead_time=0.3):
    return cr.delayed_ss(ct.tf([2.0], [lag, 1]), dead_time=dead_time, dt=DT)


def pi(gain, integral_time):
    return ct.ss(ct.tf([gain * (1 + DT / integral_time), -gain], [1, -1], DT))


@pytest.mark.parametrize("controller", [pi(0.4, 0.8), pi(0.02, 0.8), pi(0.7, 0.6)])
def test_the_numbers_are_those_of_a_simulated_loop_without_a_guess(controller):
    found = performance(plant(), controller)
    time = DT * np.arange(20_000)
    loop = ct.feedback(ct.ss(plant()) * controller, 1)
    output = ct.step_response(loop, time).outputs
    # the transform leaves 1e-6 of the height at every sample
    assert found.setpoint_error == pytest.approx(np.abs(1 - output).sum() * DT, rel=2e-3)
    assert found.overshoot == pytest.approx(max(output.max() - 1, 0), abs=1e-4)
    outside = np.flatnonzero(np.abs(output - 1) > 0.02)
    assert found.settling_time == pytest.approx((outside[-1] + 1) * DT, abs=2 * DT)


@pytest.mark.parametrize("controller", [pi(0.4, 0.8), 0.5])
def test_a_guess_changes_nothing(controller):
    free = performance(plant(), controller)
    for guess in (0.1, 30.0):
        told = performance(plant(), controller, guess)
        # a response counts as settled where its last part moves by 1e-4
        assert told.settling_time == pytest.approx(free.settling_time, abs=2 * DT)
        assert told.overshoot == pytest.approx(free.overshoot, abs=1e-3)
        assert told.setpoint_error == pytest.approx(free.setpoint_error, rel=2e-3)


def test_a_loop_that_is_not_stable_is_refused():
    with pytest.raises(UnsuitableSystemError, match=r"the loop is not stable.*margins"):
        performance(plant(), 40.0)
    with pytest.raises(UnsuitableSystemError, match="the loop with 'mad' is not stable"):
        cr.plots.closed_loop_plot(plant(), {"good": pi(0.4, 0.8), "mad": 40.0})
    with pytest.raises(OptionError, match="total_time"):
        performance(plant(), 0.1, -1.0)


def test_a_loop_that_outlasts_what_is_computed_says_so():
    with pytest.warns(ModelWarning, match="not settled after 262144 samples"):
        performance(plant(), pi(1e-6, 0.8))


@pytest.mark.parametrize("scale", [1.0, 100.0])
def test_a_plot_ends_when_the_slowest_of_its_loops_has_settled(scale):
    system = cr.delayed_ss(ct.tf([2.0], [0.8 * scale, 1]), dead_time=0.3 * scale, dt=DT * scale)
    loops = {
        name: ct.ss(ct.tf([gain * (1 + DT / 0.8), -gain], [1, -1], DT * scale))
        for name, gain in (("quick", 0.4), ("slow", 0.1))
    }
    drawn = cr.plots.closed_loop_plot(system, loops)
    last = [np.max(line.get_xdata()) for line in np.ravel(drawn.lines)[0]]
    slowest = max(performance(system, each).settling_time for each in loops.values())
    assert slowest <= min(last)
    assert max(last) <= 2 * slowest
    response = np.ravel(drawn.lines)[0][1].get_ydata()
    assert abs(response[-1] - 1) < 0.02
    plt.close(drawn.figure)


def test_performance_is_told_in_words():
    assert repr(performance(plant(), pi(0.4, 0.8))) == (
        "<Performance: set-point error 1 s, load error 2 s, overshoot 0 %, settled after 2.81 s>"
    )
    assert "set-point error stays" in repr(performance(plant(), 0.5))
    assert repr(UNSTABLE) == (
        "<Performance: set-point error stays, load error stays, overshoot unknown, does not settle>"
    )
