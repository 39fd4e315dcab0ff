"""Actuators as arrays, as systems of python-control, and in loops: the same motion each time."""

import control as ct
import numpy as np
import pytest
from numpy.testing import assert_allclose

import ctrl_realize as cr
from ctrl_realize.actuators import (
    Backlash,
    Characteristic,
    DeadZone,
    KanoStiction,
    Resolution,
    Saturation,
    Series,
    SlewRateLimit,
    Stiction,
)
from ctrl_realize.actuators.plain import from_plain, to_plain
from tests.oracles.lugre import LuGre, lugre_stem

STEM = LuGre(
    mass=1.0, spring=100.0, coulomb=100.0, static=150.0, stribeck=0.01, bristle=1e5,
    damping=300.0, viscous=60.0,
)  # fmt: skip
MODELS = [
    SlewRateLimit(5.0, 9.0),
    Backlash(3.0, start=0.5),
    Resolution(0.7),
    Saturation(45, 55),
    Saturation(-np.inf, 52),
    Saturation(high=55, low=-np.inf),
    DeadZone(-1, 52),
    Stiction(4, 1.5),
    Stiction(4, 1.5, start=1),
    KanoStiction(4, 1.5, start=-1),
    Characteristic("points", points=[(0, 0), (0.5, 0.2), (1, 1)]),
    Series([SlewRateLimit(5.0), KanoStiction(4, 1), Characteristic("equal-percentage")]),
]


def wandering(n: int) -> np.ndarray:
    rng = np.random.default_rng(0)
    return 50 + np.cumsum(rng.choice([-1, 0, 0, 1], n) * rng.uniform(0, 3, n))


@pytest.mark.parametrize("model", MODELS, ids=str)
def test_a_system_of_python_control_moves_as_the_array_simulation(model):
    u, dt = wandering(200), 0.5
    system = model.nlsys(dt)
    y = ct.input_output_response(
        system, dt * np.arange(u.size), u, model.initial_state(u[0])
    ).outputs
    assert_allclose(y, model.simulate(u, dt), rtol=0, atol=1e-12)
    assert system.isdtime(strict=True)
    assert system.nstates == len(model.state_names)


def test_numbers_and_text_of_a_file_make_the_same_model():
    for model in [one for one in MODELS if not isinstance(one, Series)]:
        assert from_plain(to_plain(model)) == model


@pytest.mark.parametrize("direction", [-1, 1])
@pytest.mark.parametrize(
    ("model", "needed"),
    [
        (Stiction(4, 1.5), 4.0),
        (Stiction(4, 1.5, start=-1), 4.0),
        (KanoStiction(4, 1.5), 2.75),  # (S + J) / 2 from the middle of the friction
        (Backlash(4), 2.0),
    ],
    ids=str,
)
def test_the_first_move_needs_its_change_of_the_command(model, needed, direction):
    below, above = (
        model.simulate(50 + direction * np.array([0.0, 0.0, needed + more]))
        for more in (-0.01, 0.01)
    )
    assert below[2] == below[0]
    assert direction * (above[2] - above[0]) > 0


def test_a_fast_damped_stem_with_lugre_friction_is_kanos_model():
    # S = 2.5 and J = 0.5 by the ratios of friction and spring.
    u = np.repeat(50 + np.array([0.0, 1, 2, 4, 3, 2, 1, 0, -1]), 15)
    simple = KanoStiction(S=2.5, J=0.5).simulate(u)
    # The stem stops at the Stribeck velocity, where viscous friction still holds 0.006, and
    # presliding is 0.0015.
    assert_allclose(lugre_stem(u, STEM, 0.5)[14::15][1:], simple[13::15][1:], atol=0.02)


def test_characteristics_are_those_of_the_standard():
    travel = np.array([-5.0, 0, 25, 50, 75, 100, 105])
    flow = Characteristic("equal-percentage", rangeability=16).simulate(travel)
    assert_allclose(flow, 100 * np.array([1, 1, 2, 4, 8, 16, 16]) / 16)
    assert_allclose(Characteristic("linear", full_flow=7).simulate([0, 50, 100]), [0, 3.5, 7])
    assert_allclose(Characteristic("quick-opening").simulate([25.0]), 50)


def closed_by_python_control(loop, n):
    """The loop of `bench.valve_loop`, connected from systems of python-control."""
    gain, integral_time = loop.controller
    z, dt = ct.tf("z"), loop.dt
    controller = ct.ss(gain * (1 + dt / integral_time * z / (z - 1)))
    pole = np.exp(-dt / loop.time_constant)
    process = ct.ss(pole, loop.gain * (1 - pole), 1, 0, dt)
    late = ct.ss(ct.tf([1], [1, *np.zeros(round(loop.dead_time / dt))], dt))
    (valve,) = loop.actuator
    parts = [
        ct.ss(controller, inputs="e", outputs="op", name="pi", dt=dt),
        valve.nlsys(dt, name="valve", inputs="op", outputs="position"),
        ct.ss(late, inputs="position", outputs="arriving", name="late"),
        ct.ss(process, inputs="arriving", outputs="flow", name="process"),
        ct.summing_junction(["-flow"], "e", name="error"),
    ]
    system = ct.interconnect(parts, inputs=[], outputs=["op", "position", "flow"], dt=dt)
    start = np.zeros(system.nstates)
    # All is at rest, except for the process, 5 % below its operating point of 0.
    start[[label.startswith("process") for label in system.state_labels]] = -5.0
    return ct.input_output_response(system, dt * np.arange(n), 0, start).outputs


@pytest.mark.parametrize("valve", [KanoStiction(5, 2), Backlash(2.0)], ids=str)
def test_a_loop_connected_by_python_control_is_the_loop_of_the_bench(valve):
    loop = cr.bench.valve_loop(valve, process="flow")
    here = loop.simulate(80.0, settle=0.0)  # rounding grows in a cycle of stiction
    op, position, flow = closed_by_python_control(loop, 80)
    # Rounding, of differences about 0 and about 50.
    assert_allclose(here.record.input - 50, op, atol=1e-9)
    assert_allclose(here.position - 50, position, atol=1e-9)
    assert_allclose(here.record.output - 50, flow, atol=1e-9)


@pytest.mark.parametrize("process", ["flow", "first-order", "integrating"])
def test_the_open_loop_is_process_and_controller(process):
    loop = cr.bench.valve_loop(process=process, dead_time=4.0, tightness=1.5)
    gain, integral_time = loop.controller
    lag = [1, 0] if process == "integrating" else [loop.time_constant, 1]
    plant = cr.delayed_ss(ct.tf([loop.gain], lag), dead_time=4.0, dt=1.0)
    controller = ct.tf([gain * (1 + 1 / integral_time), -gain], [1, -1], 1.0)
    points = np.exp(1j * np.geomspace(0.01, 3.0, 20))
    assert_allclose(loop.open_loop(points), (plant * ct.ss(controller))(points), rtol=1e-9)


@pytest.mark.parametrize(
    ("make", "match"),
    [
        (lambda: Stiction(0, 0), "S=0"),
        (lambda: Stiction(5, -1), "J=-1"),
        (lambda: KanoStiction(5, 1, start=2), "start=2"),
        (lambda: Backlash(-1), "width=-1"),
        (lambda: SlewRateLimit(0), "opening=0"),
        (lambda: Saturation(5, 5), "low < high"),
        (lambda: Saturation(float("nan"), 5), "finite"),
        (lambda: Characteristic("parabolic"), "kind"),
        (lambda: Characteristic("points", points=[(0, 0), (0, 1)]), "increasing"),
        (lambda: Characteristic("points", points=[(0, 0), (50, 20), (100, 100)]), "from 0 to 1"),
        (lambda: Characteristic("quick-opening", exponent=1), "below 1"),
        (lambda: Series([]), "at least one"),
        (lambda: Series([3]), "expected an actuator"),
        (lambda: SlewRateLimit(1).simulate([0, 1]), "needs dt"),
        (lambda: Backlash(1).simulate([[0, 1]]), "shape"),
        (lambda: Backlash(1).nlsys(-1), "sample time"),
        (lambda: cr.bench.valve_loop(process="level"), "process"),
        (lambda: cr.bench.valve_loop(process="integrating", time_constant=3), "integrating"),
        (lambda: cr.bench.valve_loop(oscillation=(1, 0)), "period"),
        (lambda: cr.bench.valve_loop().simulate(100, setpoint=[50.0]), "setpoint"),
    ],
)
def test_impossible_parameters_are_refused(make, match):
    with pytest.raises(ValueError, match=match):
        make()


@pytest.mark.parametrize("command", [np.nan, "50", None])
def test_a_stem_rests_at_a_number(command):
    with pytest.raises(cr.errors.OptionError, match="expected a finite number: command at rest"):
        Backlash(2.0).initial_state(command)
