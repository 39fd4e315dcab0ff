"""Design functions take systems with dead time inside, and return them."""

import control as ct
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import brentq

import ctrl_realize as cr
from ctrl_realize import design

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


@pytest.mark.parametrize("fast", [1e-3, 1e-5])
def test_margins_of_a_loop_with_dead_time_and_a_fast_pole_count_right(fast):
    core = ct.tf([1], [0.08, 1]) * ct.tf([1], [fast, 1])
    pi = design.PIDController(1.3, 0.08)
    plant = core * cr.delay(0.029)
    limit = design.margins(plant, pi).gain_margin
    for share, stable in ((0.5, True), (0.99, True), (1.01, False)):
        loop = share * limit * pi
        assert design.margins(plant, loop).stable is stable
        assert design.margins(core, loop, dead_time=0.029).stable is stable
        assert ct.feedback(plant * loop).is_stable() is stable


@pytest.mark.parametrize(
    ("rule", "kind"),
    [("simc", "PID"), ("amigo", "PI"), ("ziegler_nichols_ultimate", "PID"), ("optimal", "PI")],
)
@pytest.mark.filterwarnings("ignore:Ms is:ctrl_realize.errors.ModelWarning")  # on purpose
def test_a_continuous_plant_is_tuned_as_the_limit_of_short_samples(rule, kind):
    plant = ct.tf([1], [0.08, 1]) * ct.tf([1], [0.02, 1]) * cr.delay(0.03)
    ours = design.pid(plant, rule, kind)
    fine = design.pid(plant.to_discrete(1e-4), rule, kind)
    assert ours.dt == 0
    # half a sample of 0.1 ms more dead time, of 30 ms
    assert_allclose([ours.kp, ours.ti, ours.td], [fine.kp, fine.ti, fine.td], rtol=4e-3)
    exact = design.margins(plant, ours)
    assert ours.check.margins.ms == exact.ms
    assert ct.feedback(plant * ours).is_stable()
    if rule == "optimal":
        assert exact.ms == pytest.approx(1.4, rel=2e-3)  # read on a grid of 0.05 rad


@pytest.mark.filterwarnings("ignore:Ms is:ctrl_realize.errors.ModelWarning")  # on purpose
def test_the_ultimate_gain_of_a_continuous_plant_is_exact():
    # tan(w) = -w at the ultimate frequency of exp(-s) / (s + 1), K = sqrt(1 + w^2)
    omega = 2.028757838110434
    found = design.pid(ct.tf([1], [1, 1]) * cr.delay(1.0), "ziegler_nichols_ultimate", "P")
    assert found.kp == pytest.approx(0.5 * np.sqrt(1 + omega**2), rel=1e-9)
    of_model = design.pid(design.ProcessModel(1.0, 1.0, 1.0), "ziegler_nichols_ultimate", "P")
    assert of_model.kp == pytest.approx(found.kp, rel=1e-12)
    sampled = design.pid(ct.tf([1], [1, 1]) * cr.delay(1.0), "simc", dt=0.01)
    assert sampled.dt == 0.01
    table = design.compare_pid(ct.tf([1], [1, 1]) * cr.delay(1.0), ["simc"], ["PI"])
    assert table.margins[0].ms == design.pid(ct.tf([1], [1, 1]) * cr.delay(1.0)).check.margins.ms


@pytest.mark.parametrize("gain", [1, -1])
def test_the_ultimate_gain_of_an_integrator_with_a_lead(gain):
    # (10 s + 1) exp(-0.1 s) / (s (s + 1)): the lead turns the slow response to a positive real part
    plant = gain * ct.tf([10, 1], [1, 1, 0]) * cr.delay(0.1)
    found = design.ultimate(plant)

    def phase(w):
        return np.arctan(10 * w) - np.pi / 2 - np.arctan(w) - 0.1 * w + np.pi

    w = brentq(phase, 1, 40)
    assert found.period == pytest.approx(2 * np.pi / w, rel=1e-8)
    size = w * np.hypot(1, w) / np.hypot(1, 10 * w)
    assert found.gain == pytest.approx(gain * size, rel=1e-8)


@pytest.mark.parametrize("unit", [1e-3, 1e6])
def test_an_integrator_in_any_states_is_one_in_any_unit_of_time(unit):
    turn = np.random.default_rng(3).standard_normal((3, 3))
    back = np.linalg.inv(turn)
    A = turn @ np.array([[0, 1, 0], [0, -1, 1], [0, 0, -3.0]]) @ back / unit
    core = ct.ss(A, turn[:, 2:] / unit, back[:1], 0)
    plant = cr.DelaySystem(core) * cr.delay(0.5 * unit)
    # 1/3 exp(-0.5 s) / (s (s + 1)(s/3 + 1)): half of the lag of 1/3 s goes to either side
    found = design.reduce_sopdt(plant, method="half_rule")
    assert found.integrating
    values = [found.gain * unit, found.lag / unit, found.dead_time / unit]
    # rounding of these states makes zeros at some 4e7 rad/s: the dead time has 2e-8 s more
    assert_allclose(values, [1 / 3, 7 / 6, 2 / 3], rtol=1e-6)
    assert design.ultimate(plant).gain > 0


def test_robustness_to_the_dead_time_ends_where_the_loop_becomes_unstable():
    plant = ct.tf([1], [0.08, 1]) * cr.delay(0.1)
    predictor = design.smith_predictor(plant, ct.tf([0.24, 3.0], [0.08, 0]))
    found = design.delay_robustness(plant, predictor, (0.08, 0.12))
    assert found.dt == 0
    assert found.delays[[0, -1]].tolist() == [0.08, 0.12]
    assert found.nominal == 0.1
    core = ct.tf([1], [0.08, 1])
    for dead_time, inside in ((found.stable_from, 1), (found.stable_to, -1)):
        for step, stable in ((1e-6 * inside, True), (-1e-6 * inside, False)):
            loop = ct.feedback(core * cr.delay(dead_time + step) * predictor)
            assert loop.is_stable() is stable
    assert found.stable == (found.stable_from <= 0.08 and found.stable_to >= 0.12)
    for delay, size in zip(found.delays[::7], found.modulus_margin[::7], strict=True):
        exact = design.margins(core * cr.delay(delay), predictor)
        assert size == pytest.approx(exact.modulus_margin if exact.stable else 0.0, rel=1e-9)
    assert "samples" not in found.report()
    assert found.plot().axes.size == 1


def test_a_bound_for_continuous_plants_holds_all_of_them():
    others = [1.2 * P, CORE * cr.delay(0.36), ct.tf([2], [1.3, 1]) * cr.delay(0.3)]
    bound = design.uncertainty_bound(others, P, dead_time_interval=(0.25, 0.33))
    s = 1j * bound.omega
    for other in others:
        assert np.all(np.abs(other(s) / P(s) - 1) <= bound.bound + 1e-12)
    assert_allclose(bound.delay_part, 2 * np.sin(np.minimum(0.05 * bound.omega, np.pi) / 2))
    pi = design.pid(P, "amigo")
    found = bound.check(pi)
    assert found.robust
    for other in others:
        assert ct.feedback(other * pi).is_stable()
        assert design.margins(other, pi).ms <= found.performance * (1 + 1e-6)


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


@pytest.mark.parametrize("dead_time", [1e-5, 1e-3, 0.0])
def test_performance_of_a_slow_loop_around_a_short_dead_time_has_its_closed_form(dead_time):
    lag, pi = ct.tf([1], [1, 1]), design.PIDController(0.5, 1.0)
    found = design.performance(lag * cr.delay(dead_time) if dead_time else lag, pi)
    # errors that do not change sign are ti / (K kp) and ti / kp; the open loop is 0.5 e^(-Ls) / s
    assert found.setpoint_error == pytest.approx(2.0, rel=1e-4)
    assert found.load_error == pytest.approx(2.0, rel=1e-4)
    assert found.settling_time == pytest.approx(2 * np.log(50), rel=5e-3)
    assert found.overshoot == 0


def test_the_setpoint_error_in_continuous_time_has_its_closed_form():
    # L = exp(-tau s) / (4 tau s): no overshoot, since the gain of 1/4 is below 1/e, so that the
    # integral of the absolute error is that of the error, 4 tau
    plant = ct.tf([1], [0.08, 1]) * cr.delay(0.029)
    found = design.performance(plant, design.PIDController(0.08 / 4 / 0.029, 0.08))
    assert found.overshoot == 0
    assert found.setpoint_error == pytest.approx(4 * 0.029, rel=3e-4)


@pytest.mark.parametrize("kind", ["PI", "PID"])
def test_a_plant_of_short_dead_time_has_the_optimum_of_an_integrator(kind):
    # 1 / (s + 1) behind 1 ms is 1 / s behind 1 ms for a loop of 10 ms; Ms on a grid of 0.05 rad,
    # and with a hold of 1/50 of the dead time
    short, integrating = (
        design.pid(design.ProcessModel(1.0, lag, 1e-3, integrating=not lag), "optimal", kind)
        for lag in (1.0, 0.0)
    )
    assert_allclose([short.kp, short.ti], [integrating.kp, integrating.ti], rtol=0.03)
    assert short.check.margins.ms == pytest.approx(1.4, rel=1e-2)


def test_responses_of_a_fast_loop_around_a_slow_plant_are_resolved():
    # the integrated error of a load is ti / kp if the response has one sign
    model = design.ProcessModel(gain=1.0, lag=1.0, dead_time=1e-3)
    plant = ct.tf(model.transfer_function()) * cr.delay(1e-3)
    pi = design.pid(model, "amigo")
    found = design.performance(plant, pi)
    assert found.load_error == pytest.approx(pi.ti / pi.kp, rel=1e-4)
    fine = design.performance(model.system(5e-6), pi.discretised(5e-6))
    table = design.compare_pid(model, ["amigo"], ["PI"]).performance[0]
    for of in (found, table):
        assert of.overshoot == pytest.approx(fine.overshoot, rel=0.03)
        assert of.settling_time == pytest.approx(fine.settling_time, rel=0.01)
        assert of.setpoint_error == pytest.approx(fine.setpoint_error, rel=0.02)


def test_performance_of_a_gain_without_dead_time_is_that_of_the_lag_of_its_controller():
    found = design.performance(2 * cr.delay(0), ct.tf([1], [1, 0]))
    assert found.setpoint_error == pytest.approx(0.5, rel=1e-3)
    assert found.settling_time == pytest.approx(np.log(50) / 2, rel=0.01)
    assert np.isinf(design.performance(cr.delay(0), 0.1).load_error)
