"""Laws of systems that carry a dead time."""

import pickle
import tracemalloc

import control as ct
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

import ctrl_realize as cr
from ctrl_realize.errors import OptionError
from ctrl_realize.io import FitSummary
from tests.rigs import R3, TS, TWO_INPUTS, exact_step

CONTROLLER = ct.ss([[1.0]], [[1.0]], [[0.02]], [[0.5]], TS)  # a PI controller


def valve(delay: int = 37, **names) -> cr.DelayedStateSpace:
    return cr.delayed_ss(R3, delay, dt=TS, **names)


def circle(count: int = 60, dt: float = TS) -> np.ndarray:
    return np.exp(1j * np.geomspace(0.1, 0.99 * np.pi / dt, count) * dt)


@pytest.mark.parametrize("delay", [0, 1, 37, 300])
def test_response_is_core_times_shift(delay):
    sys = valve(delay)
    z = np.concatenate([circle(), 0.9 * circle(7)])
    free = cr.DelayedStateSpace(sys.delay_free)
    assert_array_equal(sys(z), free(z) * z**-delay if delay else free(z))
    # python-control solves for the core at each point: 5e-12 is lost near Nyquist.
    assert_allclose(sys(z), sys.delay_free(z) * z ** float(-delay), rtol=1e-10)


def test_states_are_core_then_past_inputs():
    sys = valve(3, inputs="i", outputs="x")
    assert sys.state_labels == ["x[0]", "x[1]", "x[2]", "i[k-1]", "i[k-2]", "i[k-3]"]
    u = np.arange(1.0, 9.0)
    states = ct.forced_response(sys, TS * np.arange(8), u, return_states=True).states
    assert_array_equal(states[3, 1:], u[:-1])
    assert_array_equal(states[5, 3:], u[:-3])


def test_a_fit_survives_copies_and_names_but_not_algebra():
    S = valve(2).replace(fit=FitSummary("Fit", "found here", ()))
    for kept in (S.copy("b"), pickle.loads(pickle.dumps(S)), S.replace(name="c")):
        assert kept.fit.report() == "found here"
    assert (2 * S).fit is None


CONNECTED = {
    "channel": lambda m: m[0, 0],
    "number": lambda m: 2 * m,
    "sign": lambda m: -m,
    "power": lambda m: m**2,
    "product": lambda m: m * CONTROLLER,
    "later factor": lambda m: cr.DelaySystem(CONTROLLER) * m,
    "sum": lambda m: valve(3) + m,
    "loop": lambda m: ct.feedback(m * CONTROLLER),
    "channel of a loop": lambda m: ct.feedback(m * CONTROLLER)[0, 0],
    "around another": lambda m: cr.DelaySystem(CONTROLLER).feedback(m),
    "appended": lambda m: valve(3).append(m),
    "around a delay": lambda m: cr.DelayedStateSpace(m, 2),
    "continuous": lambda m: cr.design.to_continuous(m).system,
    "sampled": lambda m: cr.design.to_discrete(cr.design.to_continuous(m), dt=2 * TS),
    "sampled loop": lambda m: cr.design.to_continuous(m).system.to_discrete(TS),
    "reduced": lambda m: cr.design.reduce(m + 0.1 * m**2, 2),
    "by names": lambda m: cr.interconnect(
        [m, ct.summing_junction(["r", "-y"], "u")], inputs="r", outputs="y"
    ),
}


@pytest.mark.parametrize("connected", CONNECTED.values(), ids=CONNECTED)
def test_what_is_made_of_a_model_in_minutes_is_in_minutes(connected, tmp_path):
    made = connected(valve(2, inputs="u", outputs="y", time_unit="min"))
    cr.save_model(tmp_path / "made.json", made)
    again = pickle.loads(pickle.dumps(made)), made.copy("b"), cr.load_model(tmp_path / "made.json")
    assert [each.time_unit for each in (made, *again)] == ["min"] * 4


def test_a_model_has_the_unit_of_its_fit():
    fit = FitSummary("Fit", "found here", (), values=(("time_unit", "h"),))
    assert (valve(2).time_unit, valve(2).replace(fit=fit).time_unit) == ("s", "h")
    assert (2 * valve(2).replace(fit=fit)).time_unit == "h"


def test_a_fit_that_is_none_is_refused():
    with pytest.raises(OptionError, match="fit is a dict; expected None or"):
        valve(2).replace(fit={"found": "here"})


def test_a_long_delay_costs_memory_only_where_matrices_are_asked_for():
    cr.delayed_ss(CONTROLLER, 5)  # imports and caches are not the system's
    tracemalloc.start()
    S = cr.delayed_ss(CONTROLLER, 3000)
    assert S.step(4000)[3000] == 0.5
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    # The dense A alone would be 72 MB; the labels of 3000 states are 0.3 MB.
    assert peak < 3e6
    # Core, delay and names are all that is pickled: no chain.
    assert len(pickle.dumps(S)) < 1000
    assert S.A is S.A
    assert S.A.shape == (3001, 3001)


def test_a_delay_too_long_for_matrices_has_all_that_needs_none():
    S = cr.delayed_ss(ct.tf([1], [0.08, 1]), dead_time=1.0, dt=1e-6)
    assert (S.delay, S.nstates) == (10**6, 10**6 + 1)
    assert S.step(10**6 + 2)[10**6] == 0
    # the exact step response one sample after the dead time; 1e-5 of it is left of 1 - exp
    assert_allclose(S.step(10**6 + 2)[-1], -np.expm1(-1e-6 / 0.08), rtol=1e-9)
    w = np.array([1.0, 30.0])
    # the hold adds half a sample of phase, 5e-7 w
    assert_allclose(S(np.exp(1j * w * 1e-6)), np.exp(-1j * w) / (1 + 0.08j * w), rtol=2e-5)
    assert (S * S).delay == 2 * 10**6
    assert pickle.loads(pickle.dumps(S)).delay == 10**6
    slower = cr.design.to_discrete(*cr.design.to_continuous(S), 0.01)
    assert slower.delay == 100
    assert_allclose(slower.delay_free.poles(), np.exp(-0.01 / 0.08), rtol=1e-9)


def test_poles_of_the_delay_are_exactly_zero():
    poles = valve(300).poles()
    assert np.count_nonzero(poles == 0) == 300
    assert_allclose(np.sort(poles[:3]), np.sort(valve(0).poles()), rtol=0, atol=0)


@pytest.mark.parametrize("delay", [0, 37, 300])
def test_fast_step_and_markov_equal_python_control(delay):
    S = valve(delay)
    t = TS * np.arange(800)
    assert_allclose(S.step(800), ct.step_response(S, t).outputs, rtol=0, atol=1e-12)
    assert_allclose(S.markov(800), TS * ct.impulse_response(S, t).outputs, rtol=0, atol=1e-13)
    u = np.random.default_rng(0).standard_normal(800)
    assert_allclose(S.simulate(u), ct.forced_response(S, t, u).outputs, rtol=0, atol=1e-12)


@given(samples=st.floats(0, 60, allow_nan=False), dt=st.floats(1e-4, 5e-3))
def test_a_fractional_dead_time_is_sampled_exactly(samples, dt):
    S = cr.delayed_ss(R3, dead_time=samples * dt, dt=dt)
    t = dt * np.arange(120)
    # The exact step response jumps nowhere, so rounding of the dead time moves it by 1e-12.
    assert_allclose(S.step(120), exact_step(R3, t - samples * dt), rtol=0, atol=1e-9)
    assert S.delay_free.nstates == 3


def test_several_channels_have_their_own_delays():
    S = cr.delayed_ss(TWO_INPUTS.delay_free, [2, 5], output_delay=[0, 3, 1])
    total = np.add.outer([0, 3, 1], [2, 5])
    z = circle(dt=S.dt)
    assert_allclose(S(z), S.delay_free(z) * z ** -total[:, :, None], rtol=1e-12)
    assert_array_equal(S.delay, total)
    assert S.nstates == 2 + 7 + 4
    t = S.dt * np.arange(40)
    pulses = S.dt * ct.impulse_response(ct.ss(S), t).outputs
    assert_allclose(S.markov(40), pulses, rtol=0, atol=1e-12)
    u = np.random.default_rng(1).standard_normal((2, 40))
    forced = ct.forced_response(ct.ss(S), t, u).outputs
    assert_allclose(S.simulate(u), forced, rtol=0, atol=1e-12)
    assert_allclose(S.step(40), ct.step_response(ct.ss(S), t).outputs, rtol=0, atol=1e-12)


@pytest.mark.parametrize("delay", [0, 37, 300])
def test_zeros_are_those_that_were_given(delay):
    zeros = [0.3 - 0.4j, 0.3 + 0.4j]
    core = ct.ss(ct.zpk(zeros, [0.2, 0.5, 0.8], 2.0, dt=TS))
    found = cr.delayed_ss(core, delay).zeros()
    # far apart from each other: a few digits are lost in the companion form
    assert_allclose(np.sort_complex(found), zeros, rtol=1e-10)
