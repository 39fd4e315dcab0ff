"""Continuous systems with dead time: closed forms, Lambert's W, textbook systems."""

import pickle
from math import factorial

import control as ct
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import brentq
from scipy.special import lambertw

import ctrl_realize as cr
from ctrl_realize.errors import DelayRangeError, ModelWarning, UnsuitableSystemError

LAG = ct.tf([1], [1, 1])
OMEGA = np.geomspace(0.01, 200, 30)


def retarded(k: float, tau: float) -> cr.DelaySystem:
    """The system x' = -k x(t - tau) + u, seen at x."""
    core = ct.ss([[0]], [[1, -k]], [[1], [1]], np.zeros((2, 2)))
    return cr.DelaySystem(core, [tau])


# -- frequency responses --------------------------------------------------------------------------


def p1(s):
    return 2 * np.exp(-0.3 * s) / (s + 1)


def p2(s):
    return (s + 3) / (s**2 + 2 * s + 5) * np.exp(-1.1 * s)


P1 = ct.tf([2], [1, 1]) * cr.delay(0.3)
P2 = ct.tf([1, 3], [1, 2, 5]) * cr.delay(1.1)
C = ct.tf([1, 0.5], [1, 0])

ALGEBRA = {
    "plant": (P1, p1),
    "delay first": (cr.delay(0.3) * ct.tf([2], [1, 1]), p1),
    "series": (P1 * P2, lambda s: p1(s) * p2(s)),
    "controller in front": (C * P1, lambda s: (s + 0.5) / s * p1(s)),
    "sum": (P1 + P2, lambda s: p1(s) + p2(s)),
    "sum with a transfer function": (LAG + P2, lambda s: 1 / (s + 1) + p2(s)),
    "feedback": (ct.feedback(P1 * C), lambda s: 1 / (1 + s / (s + 0.5) / p1(s))),
    "feedback of feedback": (
        ct.feedback(ct.feedback(P1, 0.3 * P2), P2),
        lambda s: p1(s) / (1 + p1(s) * p2(s) * 0.3 + p1(s) * p2(s)),
    ),
    "sensitivity": ((1 + P1 * C) ** -1, lambda s: 1 / (1 + p1(s) * (1 + 0.5 / s))),
    "quotient": (P2 / (2 + P1), lambda s: p2(s) / (2 + p1(s))),
}


@pytest.mark.parametrize("case", ALGEBRA)
def test_frequency_responses_are_those_of_their_formulas(case):
    system, expression = ALGEBRA[case]
    assert isinstance(system, cr.DelaySystem)
    assert_allclose(system(1j * OMEGA), expression(1j * OMEGA), rtol=1e-10)
    again = pickle.loads(pickle.dumps(system))
    assert_allclose(again(1j * OMEGA), system(1j * OMEGA), rtol=0)
    assert type(again) is type(system)


def test_python_control_draws_from_the_exact_response():
    loop = ct.feedback(P1 * C)
    response = ct.frequency_response(loop, OMEGA)
    assert_allclose(response.complex, loop(1j * OMEGA), rtol=1e-12)
    assert_allclose(ct.frd(P1, OMEGA).frdata[0, 0], P1(1j * OMEGA), rtol=1e-12)
    assert_allclose((ct.frd(LAG, OMEGA) * P1).frdata[0, 0], LAG(1j * OMEGA) * P1(1j * OMEGA))
    for k, unstable in ((1.0, 0), (20.0, 4)):
        # x' = -x - 2 k x(t - 0.3): two more poles at every crossing of the gain
        assert ct.nyquist_response(k * P1).count == unstable
        assert np.sum(ct.feedback(k * P1).poles().real > 0) == unstable
    ours, right = ct.margin(C * P1), cr.design.margins(ct.tf([2], [1, 1]) * C, dead_time=0.3)
    assert ours[:2] == pytest.approx((right.gain_margin, right.phase_margin), rel=1e-5)


def test_margin_of_a_double_integrator_is_at_the_crossover_of_its_dead_time():
    # PI on a tank: the phase, -180 degrees at frequency 0, crosses -180 at atan(w ti) = w tau
    ti, tau = 1.0, 0.1
    w = brentq(lambda w: np.arctan(w * ti) - w * tau, 5.0, 30.0)
    found = ct.margin(1 * (ct.tf([ti, 1], [ti, 0, 0]) * cr.delay(tau)))
    # the spline of python-control is accurate to 1e-6
    assert found[0] == pytest.approx(w**2 * ti / np.hypot(1, w * ti), rel=1e-5)
    assert found[2] == pytest.approx(w, rel=1e-5)


def test_a_gain_margin_is_found_however_large_it_is():
    w = brentq(lambda w: np.arctan(w) + 1e-3 * w - np.pi, 1.0, 1e4)
    gain, _, at, _ = ct.margin(1 * (ct.tf([1], [1, 1]) * cr.delay(1e-3)))
    assert (gain, at) == pytest.approx((np.hypot(1, w), w), rel=1e-5)


# -- poles and stability --------------------------------------------------------------------------


@pytest.mark.parametrize(("k", "tau"), [(1.0, 1.0), (5.0, 0.3), (1.5, 1.2), (0.1, 2.0)])
def test_right_most_poles_are_those_of_lamberts_w(k, tau):
    poles = retarded(k, tau).dominant_poles(8)
    branches = np.array([lambertw(-k * tau, j) / tau for j in range(-10, 11)])
    expected = branches[np.argsort(-branches.real)][: poles.size]
    for pole in expected:
        assert np.abs(poles - pole).min() < 1e-10 * (1 + abs(pole))
    # stable as long as k tau < pi / 2
    assert retarded(k, tau).is_stable() == (k * tau < np.pi / 2)


@pytest.mark.parametrize(
    ("a", "b", "c", "stable"),
    [
        (2.0, 1.0, 0.5, True),  # |b| < a and |c| < 1: stable for every delay
        (2.0, 1.0, -0.9, True),
        (1.0, 3.0, 0.5, False),
        (2.0, 1.0, 1.1, False),  # poles without end near Re s = log(1.1) / tau
    ],
)
def test_neutral_systems_are_told_by_their_direct_terms(a, b, c, stable):
    # (x + c x(t - 1))' = -a x - b x(t - 1): s + a + (c s + b) exp(-s) = 0
    P = ct.tf([c, b], [1, a]) * cr.delay(1.0)
    loop = ct.feedback(P)
    assert loop.neutral_gain() == pytest.approx(abs(c))
    assert loop.is_stable() is stable
    s = loop.dominant_poles(6)
    assert_allclose(s + a + (c * s + b) * np.exp(-s), 0, atol=1e-8)
    assert ct.feedback(P * ct.tf([1], [0.1, 1])).neutral_gain() == 0


def lagging(A0: np.ndarray, A1: np.ndarray, tau: float) -> cr.DelaySystem:
    """x' = A0 x + A1 x(t - tau)."""
    n = A0.shape[0]
    core = ct.ss(A0, np.hstack([np.eye(n), A1]), np.vstack([np.eye(n)] * 2), np.zeros((2 * n,) * 2))
    return cr.DelaySystem(core, [tau] * n)


def neutral(A: np.ndarray, B: np.ndarray, C: np.ndarray, tau: float) -> cr.DelaySystem:
    """(x - C x(t - tau))' = A x + B x(t - tau), by v = x - C x(t - tau)."""
    n = A.shape[0]
    core = ct.ss(
        A,
        np.hstack([np.eye(n), A @ C + B]),
        np.vstack([np.eye(n)] * 2),
        np.block([[np.zeros((n, n)), C]] * 2),
    )
    return cr.DelaySystem(core, [tau] * n)


def crossing(sign: int) -> float:
    """Delay at which s^2 - 0.1 s + 2 - exp(-s r) has a root on the imaginary axis."""
    w = np.sqrt((3.99 + sign * np.sqrt(3.99**2 - 12)) / 2)
    return -float(np.angle(2 - w**2 - 0.1j * w)) / w


GU = np.array([[-2.0, 0.0], [0.0, -0.9]]), np.array([[-1.0, 0.0], [-1.0, -1.0]])
PENDULUM = np.array([[0.0, 1.0], [-2.0, 0.1]]), np.array([[0.0, 0.0], [1.0, 0.0]])
NEUTRAL = (
    np.array([[-0.9, 0.2], [0.1, -0.9]]),
    np.array([[-1.1, -0.2], [-0.1, -1.1]]),
    np.array([[-0.2, 0.0], [0.2, -0.1]]),
)
SCALAR = np.array([[-1.0]]), np.array([[-2.0]]), np.array([[-0.5]])


@pytest.mark.parametrize(
    ("system", "limit", "stable_below"),
    [
        # Gu, Kharitonov and Chen, Stability of Time-Delay Systems, Birkhauser 2003, chapter 5:
        # s + 0.9 + exp(-s r) = 0, printed as 6.17258
        (lambda r: lagging(*GU, r), np.arccos(-0.9) / np.sqrt(1 - 0.81), True),
        # s^2 - 0.1 s + 2 - exp(-s r) = 0: unstable without delay, stable in 0.10017 < r < 1.7178
        # exp(-j w r) = 2 - w^2 - 0.1 j w with w^4 - 3.99 w^2 + 3 = 0
        (lambda r: lagging(*PENDULUM, r), crossing(-1), False),
        (lambda r: lagging(*PENDULUM, r), crossing(+1), True),
        # a standard example of criteria for neutral systems; limit: det = 0 on the axis, by fsolve
        (lambda r: neutral(*NEUTRAL, r), 2.22547904, True),
        # s + 1 + (2 - 0.5 s) exp(-s r) = 0 (signs of C and B): w^2 = (4 - 1) / (1 - 0.25)
        (lambda r: neutral(*SCALAR, r), None, True),
    ],
)
def test_textbook_systems_lose_stability_at_their_printed_delays(system, limit, stable_below):
    if limit is None:
        w = 2.0
        turn = -(1j * w + 1) / (0.5j * w + 2)
        limit = (-np.angle(turn) % (2 * np.pi)) / w
    for share, below in ((0.999, True), (1.001, False)):
        assert system(share * limit).is_stable() is (below is stable_below)
    # a pair on the imaginary axis; the limits are printed with six digits and more
    assert np.abs(system(limit).dominant_poles(2).real).max() < 1e-6


def test_a_difference_equation_is_unstable_if_small_changes_of_its_delays_make_it_so():
    # x(t) + 0.75 x(t - 1) + 0.5 x(t - 2) = 0: |z| = sqrt(1/2) at these delays, but the sum of the
    # gains, 1.25, decides for others close to them (Hale and Verduyn Lunel, IMA J. Math. Control
    # Inform. 19 (2002) 5-23)
    def loop(second):
        lines = 0.75 * cr.delay(1.0) + 0.5 * cr.delay(second)
        return ct.feedback(cr.DelaySystem(ct.ss([], [], [], 1.0, 0)), lines)

    assert_allclose(loop(2.0).dominant_poles(6).real, -0.5 * np.log(2), atol=1e-10)
    assert loop(2.0).neutral_gain() == pytest.approx(1.25)
    assert not loop(2.0).is_stable()
    s = loop(2.03).dominant_poles(200)
    assert_allclose(1 + 0.75 * np.exp(-s) + 0.5 * np.exp(-2.03 * s), 0, atol=1e-9)
    assert s.real.max() > 0.15


def test_two_delays_in_two_loops():
    # x' = -x(t - 1) - x(t - 2) / 2, poles of largest real part from its equation
    core = ct.ss([[0]], [[1, -1, -0.5]], np.ones((3, 1)), np.zeros((3, 3)))
    poles = cr.DelaySystem(core, [1.0, 2.0]).dominant_poles(6)
    assert_allclose(poles + np.exp(-poles) + 0.5 * np.exp(-2 * poles), 0, atol=1e-9)


def test_zeros_of_loops_are_roots():
    zeros = (1 + P1).zeros()
    # poles of the loop around P1
    assert_allclose(1 + 2 * np.exp(-0.3 * zeros) / (zeros + 1), 0, atol=1e-8)
    parallel = ct.tf([1], [1, 2]) + ct.tf([3], [1, 1]) * cr.delay(1.0)
    z = parallel.zeros()
    assert z.size > 5
    assert_allclose(z + 1 + 3 * (z + 2) * np.exp(-z), 0, atol=1e-8 * np.abs(z).max())


# -- time responses -------------------------------------------------------------------------------


def test_the_method_of_steps_gives_its_polynomials():
    # x' = -x(t - 1), x = 1 before: sums of (-1)^j (t - (j - 1))^j / j!
    t = np.linspace(0, 8, 161)
    expected = sum(
        (-1) ** j * np.maximum(t - (j - 1), 0) ** j / factorial(j) * (t >= j - 1) for j in range(12)
    )
    system = retarded(1.0, 1.0)
    found = system.forced_response(t, 0.0, initial_state=1.0, history=1.0)
    assert_allclose(found.outputs, expected, atol=1e-12)


def test_a_loop_before_its_first_echo_is_the_plant():
    # 1.5 exp(-tau s) / (s + 1) in a loop: known in closed form up to two delays
    tau, k = np.sqrt(0.5), 1.5
    t = np.linspace(0, 2 * tau, 57)
    loop = ct.feedback(k * LAG * cr.delay(tau))
    expected = k * -np.expm1(-np.maximum(t - tau, 0))
    assert_allclose(loop.step_response(t).outputs, expected, atol=1e-9)
    impulse = loop.impulse_response(t).outputs[t > tau]
    assert_allclose(impulse, k * np.exp(-(t[t > tau] - tau)), atol=1e-7)


def test_a_gain_behind_a_dead_time_has_no_impulse_response_but_impulses():
    # rounding of 3e-11 was left of it, and a warning that it had not converged
    pure = 2 * cr.delay(3.3)
    for t in (np.linspace(0, 5, 50), None):
        assert not pure.impulse_response(t).outputs.any()


@pytest.mark.parametrize("unit", [1e-9, 1e6])
def test_the_unit_of_time_does_not_matter_to_a_response(unit):
    # five lags in companion form; the echoes make steps of unequal lengths
    t = np.linspace(0, 12, 41)

    def response(unit):
        den = np.poly(-1 / (unit * np.linspace(0.6, 1, 5)))
        loop = ct.feedback(1.5 * ct.tf([den[-1]], den) * cr.delay(0.37 * unit))
        return loop.step_response(unit * t).outputs

    # both within the tolerance of 1e-8
    assert_allclose(response(unit), response(1.0), atol=3e-8)


def test_any_input_is_taken_as_straight_between_its_samples_or_as_a_function():
    t = np.linspace(0, 6, 601)
    # a plant that remembers its own state, in a loop whose delay is another one
    plant = cr.DelaySystem(ct.ss([[-1.0]], [[1, -0.8]], [[1], [1]], np.zeros((2, 2))), [0.2])
    loop = ct.feedback(plant * cr.delay(0.3) * 0.8)
    assert sorted(loop.internal_delays) == [0.2, 0.3]
    function = loop.forced_response(t, lambda x: np.sin(2 * x)).outputs
    # after the transient the frequency response
    late = t > 5.5
    steady = np.imag(loop(2j) * np.exp(2j * t))
    slowest = np.exp(loop.dominant_poles(1).real.max() * 5.5)
    assert_allclose(function[late], steady[late], atol=5 * slowest)
    # linear interpolation of a sine every 0.01 s is off by 5e-5
    assert_allclose(loop.forced_response(t, np.sin(2 * t)).outputs, function, atol=1e-4)
    ramp = P2.forced_response(t, t).outputs
    lagged = ct.forced_response(ct.tf([1, 3], [1, 2, 5]), t, t).outputs
    assert_allclose(ramp[110:], lagged[:-110], atol=1e-8)


def test_a_response_is_not_cut_where_a_dead_time_is_far_below_the_lags():
    # the end was five dead times: modes of the dead time are a million times as fast as the slowest
    loop = ct.feedback(
        5 * ct.tf([1000, 1], [1000, 0]) * ct.tf([1], [250000, 1000, 1]) * cr.delay(0.005)
    )
    with pytest.raises(UnsuitableSystemError, match=r"steps, each no longer than the shortest"):
        loop.step_response()


def test_stiff_cores_and_several_outputs():
    core = ct.ss(ct.tf([1], [1e-4, 1]) * ct.tf([1], [1, 1]))
    loop = cr.interconnect(
        [ct.ss(core, name="P", inputs="u", outputs="y"),
         cr.DelaySystem(ct.ss([], [], [], [[0, 1], [1, 0]], 0), [0.5], name="D",
                        inputs="y", outputs="m"),
         ct.summing_junction(["r", "-m"], "u")],
        inputs="r", outputs=["y", "m"],
    )  # fmt: skip
    t = np.linspace(0, 4, 41)
    out = loop.step_response(t).outputs
    assert_allclose(out[1, 0, 5:], out[0, 0, :-5], atol=1e-8)
    # before the first echo
    assert_allclose(out[0, 0, :5], ct.step_response(core, t).outputs[:5], atol=1e-8)


# -- conversions ----------------------------------------------------------------------------------


def test_sampling_a_plant_is_exact_for_held_inputs():
    dt = 0.1
    discrete = P1.to_discrete(dt)
    assert isinstance(discrete, cr.DelayedStateSpace)
    t = np.arange(0, 5, dt)
    assert_allclose(discrete.step(t.size), P1.step_response(t).outputs, atol=1e-8)
    # a fraction of a sample
    other = P2.to_discrete(0.07)
    t = np.arange(0, 5, 0.07)
    assert_allclose(other.step(t.size), P2.step_response(t).outputs, atol=1e-8)
    both = ct.append(1 * P1, ct.tf([1], [1, 2]) * cr.delay(0.2)).to_discrete(0.1)
    assert both.delay[0, 0] == 3
    assert both.delay[1, 1] == 2


def test_sampling_parallel_paths_and_series_is_exact_too():
    for system, delays in ((P1 + 3 * LAG * cr.delay(0.8), (0.3, 0.8)), (P1 * P2, (1.4,))):
        assert sorted(system.internal_delays) == pytest.approx(delays)
        t = np.arange(0, 6, 0.1)
        ours = system.to_discrete(0.1).step(t.size)
        assert_allclose(ours, system.step_response(t).outputs, atol=1e-8)


def test_sampling_a_loop_states_its_error():
    loop = ct.feedback(P1)
    errors = []
    for dt in (0.1, 0.05, 0.025):
        with pytest.warns(ModelWarning, match=r"no exact sampled model.*error of the response"):
            sampled = loop.to_discrete(dt)
        t = np.arange(0, 4, dt)
        errors.append(np.abs(sampled.step(t.size) - loop.step_response(t).outputs).max())
    # of second order
    assert errors[0] < 0.005
    assert errors[2] < errors[0] / 12
    with pytest.raises(DelayRangeError, match=r"whole samples.*choose dt"):
        loop.to_discrete(0.07)


COUPLED = ct.ss(
    [[-1, 0.4, 0], [0, -2, 0.7], [-0.5, 0, -3]],
    [[1, 0], [0, 1], [0.3, 0.2]],
    [[1, 0, 0.5], [0, 1, -0.2]],
    np.zeros((2, 2)),
)


def ends(before, behind):
    """Two inputs and outputs, each with its own delay."""
    late = [np.diag([1.0, 0.0]) * cr.delay(a) + np.diag([0.0, 1.0]) * cr.delay(b)
            for a, b in (before, behind)]  # fmt: skip
    return late[1] * cr.DelaySystem(COUPLED) * late[0]


def pairs(delays):
    """A lag behind its own dead time for each pair of channels."""
    e = np.eye(2)
    return sum(
        e[:, [i]] * (ct.tf([1 + i - 2 * j], [1 + i + 0.5 * j, 1]) * cr.delay(delays[i][j])) * e[[j]]
        for i in range(2)
        for j in range(2)
    )


UNEQUAL = {
    "whole samples at both ends": ends((0.3, 0.5), (0, 0.2)),
    "fractions at the inputs": ends((0.33, 0.57), (0.1, 0.2)),
    "fractions at the outputs": ends((0.3, 0.5), (0.04, 0.21)),
    "one fraction at all outputs": ends((0.33, 0.57), (0.14, 0.24)),
    "one fraction at all inputs": ends((0.33, 0.53), (0.14, 0.21)),
    "a delay for each pair": pairs([[0.3, 0.5], [0.7, 0.2]]),
    "a fraction for each pair": pairs([[0.33, 0.51], [0.77, 0.26]]),
    "a sum of outputs": np.array([[1, 0], [0, 1], [0, 0]]) * P1
    + np.array([[0, 0], [0, 0], [1, 1]]) * cr.delay(0.42) * LAG,
    "one input, two outputs": np.array([[1], [2]]) * P1
    + np.array([[0], [1]]) * cr.delay(0.55) * P2,
    "an output beside its echo": (np.ones((2, 1)) + np.array([[0], [1]]) * cr.delay(0.42)) * LAG,
    "paths of one plant": P1 + 3 * LAG * cr.delay(0.87),
    "one fraction for two inputs": LAG * cr.delay(0.425) * np.array([[1, 2]]),
    "fractions before and behind": ct.append(cr.delay(0.0), cr.delay(0.37))
    * (np.array([[1], [2]]) * (LAG * cr.delay(0.03))),
    "a fraction behind the only output": cr.delay(0.05)
    * (
        cr.DelaySystem(ct.ss([[-1.0]], [[1, 2]], [[1]], [[0, 0]]))
        * ct.append(cr.delay(0.1), cr.delay(0.0))
    ),
}


@pytest.mark.parametrize("case", UNEQUAL)
def test_channels_with_delays_of_their_own_are_sampled_exactly_and_converted_back(case):
    plant, dt = UNEQUAL[case], 0.1
    t = np.arange(0, 5, dt)
    sampled = plant.to_discrete(dt)
    at_samples = sampled.step_response(t).outputs
    assert_allclose(at_samples, plant.step_response(t).outputs, atol=1e-10)
    if isinstance(sampled, cr.DelayedStateSpace):
        model = cr.design.to_continuous(sampled)
        back, again = model.system, cr.design.to_discrete(model)
        total = np.add.outer(model.output_delays, model.input_delays)
        assert_allclose(np.broadcast_to(model.dead_time, total.shape), total)
    else:
        back = sampled.to_continuous()
        again = back.to_discrete(dt)
    # the same system, not only the same samples
    assert_allclose(back(1j * OMEGA), plant(1j * OMEGA), atol=1e-12)
    assert_allclose(again.step_response(t).outputs, at_samples, atol=1e-12)


def test_what_has_no_exact_conversion_is_refused():
    with pytest.raises(DelayRangeError, match=r"different fractions.*both ends; choose dt"):
        ends((0.33, 0.57), (0.13, 0.24)).to_discrete(0.1)
    with pytest.raises(UnsuitableSystemError, match=r"direct feedthrough.*3\.5 samples"):
        (ct.tf([1, 2], [1, 1]) * cr.delay(0.35)).to_discrete(0.1)
    loop = ct.feedback(P1.to_discrete(0.1))
    with pytest.raises(UnsuitableSystemError, match="a loop that is closed in discrete time"):
        loop.to_continuous()
    with pytest.raises(UnsuitableSystemError, match="already continuous"):
        P1.to_continuous()


@pytest.mark.parametrize("order", [4, 8])
def test_pade_systems_come_close_where_they_should(order):
    loop = ct.feedback(P1 * P2 * 0.3)
    rational = loop.pade(order)
    assert type(rational) is ct.StateSpace
    assert rational.nstates == 3 + order * len(loop.internal_delays)
    slow = np.geomspace(0.01, 2.0, 20)
    # 1.4 s of delay at 2 rad/s
    assert_allclose(rational(1j * slow), loop(1j * slow), rtol={4: 1e-3, 8: 1e-9}[order])


def test_discrete_and_continuous_delays_are_made_alike():
    assert cr.delay(0.3, 0.1).delay == 3
    assert cr.delay(0).internal_delays == ()
    assert cr.delay(0.5)(1j) == pytest.approx(np.exp(-0.5j))


def lag_ring(gain, dead_times):
    """Lags of 1 s, each after a dead time, in one loop of negative feedback."""
    q = len(dead_times)
    before = np.roll(np.eye(q), 1, axis=0)
    before[0] *= -gain
    B = np.hstack([np.eye(q)[:, :1], np.eye(q)])
    C = np.vstack([np.eye(q)[-1:], before])
    return cr.DelaySystem(ct.ss(-np.eye(q), B, C, np.zeros((q + 1, q + 1))), dead_times)


@pytest.mark.parametrize("count", [1, 5, 40])
def test_a_ring_of_lags_and_dead_times_is_stable_up_to_its_ultimate_gain(count):
    dead_times = 0.3 + 0.01 * np.arange(count)
    # (j w + 1)^n exp(j w T) = -k: n atan(w) + w T = pi, k = (1 + w^2)^(n / 2)
    omega = brentq(lambda w: count * np.arctan(w) + w * dead_times.sum() - np.pi, 1e-6, 50)
    ultimate = (1 + omega**2) ** (count / 2)
    assert lag_ring(0.999 * ultimate, dead_times).is_stable()
    assert not lag_ring(1.001 * ultimate, dead_times).is_stable()


def test_many_loops_beside_one_another_are_stable_if_each_is():
    # tan(w) = -w at the ultimate frequency of exp(-s) / (s + 1), K = sqrt(1 + w^2)
    ultimate = np.sqrt(1 + 2.028757838110434**2)
    for share, stable in ((0.999, True), (1.001, False)):
        gains = np.full(60, 0.5)
        gains[37] = share * ultimate
        loops = cr.DelaySystem(
            ct.ss(
                -np.eye(60),
                np.hstack([np.ones((60, 1)), np.diag(-gains)]),
                np.vstack([np.ones((1, 60)), np.eye(60)]),
                np.zeros((61, 61)),
            ),
            np.ones(60),
        )
        assert loops.is_stable() is stable


@pytest.mark.parametrize("direct", [0.0, 0.2])
def test_stability_of_random_loops_is_that_of_their_rightmost_pole(direct):
    rng = np.random.default_rng(5)
    found = []
    for _ in range(30):
        n, q = rng.integers(1, 4, 2)
        A = rng.standard_normal((n, n)) - np.eye(n)
        B, C = rng.standard_normal((n, q + 1)), rng.standard_normal((q + 1, n))
        D = direct * rng.uniform(-1, 1, (q + 1, q + 1))
        loop = cr.DelaySystem(ct.ss(A, B, C, D), rng.uniform(0.1, 3, q))
        assert loop.neutral_gain() < 1
        found.append(loop.is_stable())
        assert found[-1] is bool(loop.dominant_poles(1)[0].real < 0)
    assert 5 < sum(found) < 25


@pytest.mark.parametrize("count", [3, 5])
def test_step_info_of_equal_lags_goes_on_until_the_response_has_settled(count):
    # 1 - exp(-t) (1 + t + ... ) of equal lags is within 2 % later than four times one of them
    plant = ct.tf([1], np.poly(-np.ones(count))) * cr.delay(0.3)
    t = brentq(lambda t: sum(t**n * np.exp(-t) / factorial(n) for n in range(count)) - 0.02, 4, 30)
    # to the distance of the times, a sixtieth of a lag at most
    for found, step in ((plant.step_info(), 0.04), (plant.to_discrete(0.01).step_info(), 0.011)):
        assert 0 <= found["SettlingTime"] - (t + 0.3) <= step


def test_step_responses_take_the_arguments_of_python_control():
    both = ct.append(P1, P2)
    whole = both.step_response(4.0, timepts_num=9)
    assert_allclose(whole.time, np.linspace(0, 4, 9))
    one = both.step_response(T=4.0, T_num=9, input=1, output=1)
    assert_allclose(one.outputs, whole.outputs[1, 1], rtol=1e-7)
    with cr.extend_control():
        assert_allclose(ct.step_response(both, 4.0, T_num=9).outputs, whole.outputs)
    with pytest.raises(TypeError, match=r"unrecognized.*: nonsense$"):
        both.step_response(4.0, nonsense=1)


@pytest.mark.parametrize("system", [cr.delayed_ss(ct.tf([1], [1, 1]), 3, dt=0.1), P1 * 1, P1])
def test_the_input_of_a_response_may_be_a_function(system):
    t = 0.1 * np.arange(50)
    # of a straight line, which is the same between the times
    assert_allclose(
        system.forced_response(t, lambda t: 2 * t).outputs,
        system.forced_response(t, 2 * t).outputs,
        atol=1e-7,
    )


def test_inputs_are_transposed_with_the_outputs():
    t, u = 0.1 * np.arange(30), np.stack([np.ones(30), np.arange(30.0)])
    core = ct.ss([[0.9]], [[1.0, 0.5]], [[1.0], [2.0]], 0, 0.1)
    for system in (cr.delayed_ss(core, [1, 4]), ct.append(P1, P2)):
        found = system.forced_response(t, u.T, transpose=True)
        assert_allclose(found.outputs, system.forced_response(t, u).outputs.T)
