"""Design functions take systems with dead time inside, and return them."""

from __future__ import annotations

import pickle

import control as ct
import numpy as np
import pytest
from numpy.testing import assert_allclose

import ctrl_realize as cr
from ctrl_realize import design
from ctrl_realize.errors import OptionError, UnsuitableSystemError

OMEGA = np.geomspace(0.05, 60, 25)
CORE = ct.tf([2], [1, 1])
P = CORE * cr.delay(0.3)
C = ct.tf([2, 2], [1, 0])
DT = 0.001
PLANT = cr.delayed_ss(ct.tf([1], [0.08, 1]), dead_time=0.1, dt=DT)
PI = ct.tf([2, -1.98], [1, -1], DT)


def test_a_smith_predictor_s_loop_is_the_delay_free_loop_later():
    predictor = design.smith_predictor(P, C)
    assert isinstance(predictor, cr.DelaySystem)
    assert predictor.internal_delays == (0.3,)
    # controller and one copy of the core
    assert predictor.core.nstates == 2
    s = 1j * OMEGA
    free = ct.feedback(CORE * C)
    loop = ct.feedback(P * predictor)
    assert_allclose(loop(s), free(s) * np.exp(-0.3 * s), rtol=1e-12)
    t = np.linspace(0, 4, 41)
    late = ct.step_response(free, t).outputs
    assert_allclose(loop.step_response(t).outputs[3:], late[:-3], atol=1e-8)
    assert loop.is_stable()
    assert (predictor.name, predictor.input_labels) == ("smith", ["e"])


def test_a_filter_makes_the_predictor_robust():
    plain, filtered = (design.smith_predictor(P, C, filter_time=time) for time in (None, 0.3))
    slower = CORE * cr.delay(0.4)
    assert (
        design.margins(slower, filtered).modulus_margin
        > design.margins(slower, plain).modulus_margin
    )
    # the filter has gain 1 at rest: no steady-state error
    assert ct.feedback(P * filtered).dcgain() == pytest.approx(1, abs=1e-9)


def test_a_sampled_smith_predictor_is_a_controller_with_an_internal_delay():
    predictor = design.smith_predictor(PLANT, PI)
    loop = PLANT * predictor
    assert isinstance(loop, cr.DelaySystem)
    assert loop.internal_delays == (100, 100)
    z = np.exp(1j * np.geomspace(0.1, 3000, 25) * DT)
    assert_allclose(loop(z), PLANT(z) * predictor(z), rtol=1e-8)
    closed = ct.feedback(loop)
    free = ct.feedback(PLANT.delay_free * ct.ss(PI))
    assert_allclose(closed(z), free(z) * z**-100.0, rtol=1e-8, atol=1e-14)
    assert_allclose(closed.step(600)[100:], cr.DelayedStateSpace(free).step(500), atol=1e-10)
    assert closed.is_stable()
    assert_allclose(predictor.feedback(PLANT)(z), predictor(z) / (1 + loop(z)), rtol=1e-8)


@pytest.mark.parametrize("length", [10, 100])
def test_controllers_of_every_design_close_loops_with_the_delay_inside(length):
    plant = cr.delayed_ss(ct.tf([1], [0.08, 1]), dead_time=length * 0.002, dt=0.002)
    z = np.exp(1j * np.geomspace(0.1, 1000, 20) * 0.002)
    pid = design.pid(plant)
    lqg = design.lqg(plant, 1.0, 0.1, 1.0, 0.01)
    for controller in (pid, lqg):
        loop = ct.feedback(plant, controller)
        assert isinstance(loop, cr.DelaySystem)
        assert loop.is_stable()
        expected = plant(z) / (1 + plant(z) * controller(z))
        assert_allclose(loop(z), expected, rtol=1e-7, atol=1e-10 * np.abs(expected).max())
        opposite = ct.feedback(controller, plant)
        assert_allclose(
            opposite(z), controller(z) / (1 + plant(z) * controller(z)), rtol=1e-6, atol=1e-9
        )
    difference = pid - plant
    assert_allclose(difference(z), pid(z) - plant(z), rtol=1e-9)


def test_margins_are_those_of_plant_and_dead_time_given_apart():
    inside, apart = design.margins(P, C), design.margins(CORE, C, dead_time=0.3)
    for name in ("gain_margin", "phase_margin", "modulus_margin", "delay_margin"):
        assert getattr(inside, name) == pytest.approx(getattr(apart, name), rel=1e-8)
    # as much dead time as the margin allows, and a little more
    for extra, stable in ((0.99, True), (1.01, False)):
        later = P * cr.delay(extra * inside.delay_margin) * C
        assert ct.feedback(later).is_stable() is stable
        assert design.margins(later).stable is stable


@pytest.mark.parametrize(
    ("plant", "controller", "points"),
    [
        (P, C, 1j * OMEGA),
        (P, ct.feedback(C * P), 1j * OMEGA),
        (CORE, 0.7, 1j * OMEGA),
        (PLANT, PI, np.exp(1j * np.geomspace(0.1, 3000, 25) * DT)),
        (2.0, PLANT, np.exp(1j * np.geomspace(0.1, 3000, 25) * DT)),
    ],
)
def test_the_gang_of_four_are_the_four_quotients(plant, controller, points):
    four = design.gang_of_four(plant, controller)
    g, k = (x if np.isscalar(x) else x(points) for x in (plant, controller))
    expected = np.array([[g * k, g + 0 * points], [k + 0 * points, 1 + 0 * points]]) / (1 + g * k)
    assert_allclose(four(points), expected, rtol=1e-9, atol=1e-12)
    assert (four.input_labels, four.output_labels) == (["r", "d"], ["y", "v"])


def test_margins_of_an_outer_loop_count_the_poles_of_the_inner_one():
    # the inner loop alone is unstable: K = 20 with a critical gain of 6.2 / 2
    inner = ct.feedback(10 * P)
    assert not inner.is_stable()
    found = design.margins(inner, 1e-3)
    assert not found.stable
    assert found.unstable_poles == np.sum(inner.poles().real > 0)


def test_performance_in_continuous_time_is_the_limit_of_short_samples():
    lag = ct.tf([1], [0.08, 1])
    pid = design.PIDController(1.379, 0.08)
    continuous = design.performance(lag * cr.delay(0.029), pid)
    # an ideal PI: ti / kp, for a load response that does not change sign
    assert continuous.load_error == pytest.approx(0.08 / 1.379, rel=1e-3)
    sampled = design.performance(
        cr.delayed_ss(lag, dead_time=0.029, dt=1e-3), pid.discretised(1e-3)
    )
    for name in ("setpoint_error", "load_error", "settling_time"):
        # half a sample of the hold, of some 60
        assert getattr(continuous, name) == pytest.approx(getattr(sampled, name), rel=0.03)


def test_performance_of_a_plant_that_is_a_loop_itself():
    inner = ct.feedback(PLANT, 0.3)
    plain = cr.DelayedStateSpace(ct.ss(inner.A, inner.B, inner.C, inner.D, DT))
    ours, theirs = (design.performance(plant, 0.5) for plant in (inner, plain))
    assert ours.overshoot == pytest.approx(theirs.overshoot, abs=1e-5)
    assert ours.settling_time == pytest.approx(theirs.settling_time)


def test_identified_models_become_continuous_systems_and_come_back():
    plant = cr.delayed_ss(ct.tf([2], [0.08, 1]), dead_time=0.0289, dt=DT, inputs="i", outputs="x")
    model = design.to_continuous(plant)
    system = model.system
    assert isinstance(system, cr.DelaySystem)
    assert_allclose(
        system(1j * OMEGA), 2 * np.exp(-0.0289j * OMEGA) / (1 + 0.08j * OMEGA), rtol=1e-9
    )
    assert (system.input_labels, system.output_labels) == (["i"], ["x"])
    back = design.to_discrete(system, dt=DT)
    assert back.delay == plant.delay
    assert_allclose(back.step(300), plant.step(300), atol=1e-10)
    assert pickle.loads(pickle.dumps(system)).internal_delays == system.internal_delays


BAD = {
    "integrator": (
        lambda: design.smith_predictor(ct.tf([1], [1, 0]) * cr.delay(1.0), 0.1),
        UnsuitableSystemError,
        "pole at s = 0.*to_discrete",
    ),
    "no dead time": (
        lambda: design.smith_predictor(cr.DelaySystem(ct.ss(CORE)), C),
        OptionError,
        "no dead time",
    ),
    "delay inside": (
        lambda: design.smith_predictor(ct.feedback(P), C),
        UnsuitableSystemError,
        "internal delays",
    ),
    "discrete controller": (
        lambda: design.smith_predictor(P, PI),
        UnsuitableSystemError,
        "continuous controller",
    ),
    "unstable loop": (
        lambda: design.smith_predictor(P, -C),
        UnsuitableSystemError,
        "is unstable",
    ),
    "discrete designs": (lambda: design.pid(P), UnsuitableSystemError, r"sys\.to_discrete"),
    "dead time twice": (
        lambda: design.to_discrete(P, 0.1, 0.1),
        OptionError,
        "that already has one",
    ),
    "dead time of a discrete loop": (
        lambda: design.margins(ct.feedback(PLANT), dead_time=0.1),
        OptionError,
        "discrete loop",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_what_cannot_be_designed_is_told(case):
    make, error, match = BAD[case]
    with pytest.raises(error, match=match):
        make()
