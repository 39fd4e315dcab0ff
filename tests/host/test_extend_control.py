"""python-control's own functions and operators for systems with dead time, while extended."""

import control as ct
import numpy as np
import pytest
from numpy.testing import assert_allclose

import ctrl_realize as cr

S = ct.tf("s")
TAU, OMEGA = 4.3, np.geomspace(0.01, 3.0, 40)
LAG, PI = 2 / (10 * S + 1), 0.8 + 0.08 / S
EXACT = LAG(1j * OMEGA) * np.exp(-1j * OMEGA * TAU)
CONTROLLER = PI(1j * OMEGA)
SYSTEMS = {"transfer function": PI, "state space": ct.ss(PI)}


@pytest.fixture
def plant():
    return ct.ss(LAG) * cr.delay(TAU)


@pytest.mark.parametrize("controller", SYSTEMS.values(), ids=list(SYSTEMS))
def test_operators_that_begin_with_a_plain_system_are_exact(plant, controller):
    with cr.extend_control():
        made = {
            "product": (controller * plant, CONTROLLER * EXACT),
            "series": (ct.series(plant, controller), CONTROLLER * EXACT),
            "sum": (controller + plant, CONTROLLER + EXACT),
            "difference": (controller - plant, CONTROLLER - EXACT),
            "parallel": (ct.parallel(controller, plant), CONTROLLER + EXACT),
            "feedback": (ct.feedback(controller, plant), CONTROLLER / (1 + CONTROLLER * EXACT)),
            "quotient": (
                controller / (1 + controller * plant),
                CONTROLLER / (1 + CONTROLLER * EXACT),
            ),
            "sensitivity": (ct.feedback(1, controller * plant), 1 / (1 + CONTROLLER * EXACT)),
        }
        both = ct.append(controller, plant)
    for name, (system, response) in made.items():
        assert isinstance(system, cr.DelaySystem), name
        assert_allclose(system(1j * OMEGA), response, rtol=1e-12, err_msg=name)
    assert_allclose(both(1j * OMEGA)[1, 1], EXACT, rtol=1e-12)
    assert_allclose(both(1j * OMEGA)[0, 1], 0, atol=1e-15)


def test_a_dead_time_is_written_as_in_a_textbook():
    with cr.extend_control():
        plants = [LAG * ct.exp(-TAU * S), np.exp(-TAU * S) * LAG]
    plants.append(LAG * cr.exp(-TAU * S))
    for plant in plants:
        assert_allclose(plant(1j * OMEGA), EXACT, rtol=1e-12)
    assert not hasattr(ct, "exp")


def test_the_dead_time_in_an_exponent_may_be_zero():
    assert (LAG * cr.exp(-0.0 * S))(1j) == pytest.approx(LAG(1j), rel=1e-15)


@pytest.mark.parametrize("wrong", [2.0, 1 / S, -S - 1, ct.tf([-1, 0], [1], 0.1), -(S**2)])
def test_other_exponents_are_refused(wrong):
    with pytest.raises(cr.errors.UnsuitableSystemError, match=r"expected -tau \* s"):
        cr.exp(wrong)
    with pytest.raises(cr.errors.DelayRangeError, match=">= 0"):
        cr.exp(2 * S)


def test_responses_of_a_continuous_loop_are_those_of_its_methods(plant):
    times = np.linspace(0, 60, 121)
    with cr.extend_control():
        loop = ct.feedback(PI * plant, 1)
        steps = ct.step_response([loop, plant], times)
        pulse = ct.impulse_response(plant, times)
        forced = ct.forced_response(loop, T=times, U=np.sin(times))
        found = ct.step_info(loop)
        gang = ct.gangof4_response(plant, PI, OMEGA)
    assert_allclose(steps[0].outputs, loop.step_response(times).outputs)
    assert_allclose(steps[1].outputs[times > TAU], -2 * np.expm1(-(times[times > TAU] - TAU) / 10))
    assert_allclose(pulse.outputs, plant.impulse_response(times).outputs)
    assert_allclose(forced.outputs, loop.forced_response(times, np.sin(times)).outputs)
    assert found == loop.step_info()
    loop_gain = CONTROLLER * EXACT
    expected = np.array([[loop_gain, EXACT], [CONTROLLER, np.ones_like(EXACT)]]) / (1 + loop_gain)
    assert_allclose(gang.complex, expected, rtol=1e-10)


def test_discrete_loops_of_a_thousand_samples_keep_their_delays():
    plant = cr.delayed_ss(ct.tf([0.02], [1, -0.98], 1.0), 1000, name="P", inputs="u", outputs="y")
    controller = ct.ss([[1.0]], [[1.0]], [[2e-4]], [[0.1]], 1.0, name="C", inputs="e", outputs="u")
    with cr.extend_control():
        loop = ct.feedback(ct.ss2tf(controller) * plant, 1)
        junction = ct.summing_junction(["r", "-y"], "e")
        wired = ct.interconnect([plant, controller, junction], inputs="r", outputs="y")
        response = ct.step_response(loop, 3000)
        gang = ct.gangof4_response(plant, controller, OMEGA)
    assert isinstance(wired, cr.DelaySystem)
    assert loop.nstates == 1002
    assert_allclose(response.outputs, wired.step_response(3000).outputs, atol=1e-12)
    # python-control 0.10.2 evaluates the gang of four of a discrete loop at s = j omega
    z = np.exp(1j * OMEGA)
    assert_allclose(gang.complex[1, 1], 1 / (1 + plant(z) * controller(z)), rtol=1e-10)


def test_a_root_locus_and_a_sampled_model_are_exact(plant):
    with cr.extend_control():
        locus = ct.root_locus_map(plant, [0.5, 1.0])
        drawn = ct.root_locus(plant, [0.5, 1.0])
        sampled = ct.sample_system(plant, 0.5)
    assert drawn.axes.size == 1
    for k, poles in zip(locus.gains, locus.loci, strict=True):
        assert_allclose(10 * poles + 1 + 2 * k * np.exp(-TAU * poles), 0, atol=1e-8)
    assert isinstance(sampled, cr.DelayedStateSpace)
    assert_allclose(
        sampled.step_response(30).outputs,
        plant.step_response(np.arange(61) * 0.5).outputs,
        atol=1e-7,
    )
    with pytest.raises(cr.errors.OptionError, match="expected 'zoh'"):
        ct.sample_system(plant, 0.5, method="tustin")


def test_a_sensitivity_of_several_channels_begins_with_the_number_one():
    plant = ct.append(LAG * cr.delay(1.0), LAG * cr.delay(2.0))
    with cr.extend_control():
        sensitivity = ct.feedback(1, plant)
    for i, tau in enumerate((1.0, 2.0)):
        expected = 1 / (1 + LAG(1j * OMEGA) * np.exp(-1j * OMEGA * tau))
        assert_allclose(sensitivity(1j * OMEGA)[i, i], expected, rtol=1e-12)


def test_python_control_is_as_before_afterwards(plant):
    names = ("step_response", "interconnect", "root_locus", "gangof4", "feedback", "append")
    before = {name: getattr(ct, name) for name in names}
    operators = dict(vars(ct.TransferFunction)), dict(vars(ct.StateSpace))
    outer = cr.extend_control()
    assert ct.step_response is not before["step_response"]
    with pytest.raises(ZeroDivisionError), cr.extend_control():
        raise ZeroDivisionError
    assert isinstance(PI * plant, cr.DelaySystem)
    outer.undo()
    outer.undo()
    assert {name: getattr(ct, name) for name in names} == before
    assert (dict(vars(ct.TransferFunction)), dict(vars(ct.StateSpace))) == operators
    with pytest.raises(cr.errors.UnsuitableSystemError, match="transfer function"):
        PI * plant


def test_plain_systems_do_not_notice():
    plain = ct.tf([1], [1, 2, 1])
    calls = {
        "product": lambda: (PI * plain).num_array[0, 0],
        "feedback": lambda: ct.feedback(PI, plain).poles(),
        "positive feedback": lambda: ct.ss(plain).feedback(np.array([[0.5]]), sign=1).poles(),
        "step": lambda: ct.step_response(ct.ss(plain), 10).outputs,
        "locus": lambda: ct.root_locus_map(plain, [1.0, 2.0]).loci,
        "gang": lambda: ct.gangof4_response(plain, PI, OMEGA).complex,
        "info": lambda: ct.step_info(plain)["RiseTime"],
    }
    expected = {name: call() for name, call in calls.items()}
    with cr.extend_control():
        for name, call in calls.items():
            assert_allclose(call(), expected[name], rtol=0, atol=0, err_msg=name)
