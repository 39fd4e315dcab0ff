"""Laws of systems with delays inside, against augmented matrices and closed forms."""

import tracemalloc
from math import factorial

import control as ct
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.optimize import brentq

import ctrl_realize as cr
from ctrl_realize.errors import DataError, ModelWarning, UnsuitableSystemError
from tests.rigs import TWO_INPUTS

DT = 0.1
Z = np.exp(1j * np.geomspace(0.05, 0.97 * np.pi / DT, 25) * DT)
LAG = ct.tf([1], [0.8, 1])
PI = ct.ss([[1.0]], [[1.0]], [[0.02]], [[0.4]], DT)


def test_delays_of_zero_are_closed_at_once():
    D = [[0.1, 0.2, 0.3], [0.3, 0.1, 0.0], [0.2, 0.5, 0.4]]
    core = ct.ss([[0.5]], [[1.0, 0.3, 0.1]], [[1.0], [0.7], [0.2]], D, DT, inputs=["u", "a", "b"])
    system = cr.DelaySystem(core, [0, 3])
    assert (system.internal_delays, system.nstates, system.input_labels) == ((3,), 4, ["u"])
    M = core(Z)
    late = np.stack([1 + 0 * Z, Z**-3.0])[None, :, :]
    loop = np.eye(2)[:, :, None] - M[1:, 1:] * late
    inner = np.linalg.solve(np.moveaxis(loop, -1, 0), np.moveaxis(M[1:, :1], -1, 0))[..., 0].T
    expected = M[0, 0] + np.sum(M[0, 1:] * late[0] * inner, axis=0)
    assert_allclose(system(Z), expected, rtol=1e-12)
    assert_allclose(system.step(60), ct.step_response(system, DT * np.arange(60)).outputs, 1e-12)
    with pytest.raises(UnsuitableSystemError, match="delays of 0 s close an algebraic loop"):
        cr.DelaySystem(ct.ss([], [], [], np.eye(2), DT), [0])


@pytest.mark.parametrize("kind", ["plant", "loop"])
def test_long_simulations_without_matrices_are_named_by_python_control_s(kind):
    plant = cr.delayed_ss(LAG, 600, dt=0.002) * 0.5
    system = plant if kind == "plant" else ct.feedback(plant)
    for ask, count in ((ct.step_response, 30), (ct.impulse_response, 30), (ct.step_info, 1700)):
        t = 0.002 * np.arange(count)
        with pytest.warns(ModelWarning, match=r"601 states.*sys\.step_response") as caught:
            ask(system, t)
        assert {one.filename for one in caught} == {__file__}
    # the length of a response is that of its slowest pole
    response = system.step_response()
    settled = response.outputs[-1]
    assert settled == pytest.approx(system.dcgain(), rel=2e-3)
    with pytest.raises(DataError, match="3 values; expected 601"):
        system.step_response(t, [1.0, 2.0, 3.0])


@pytest.mark.parametrize("delays", [(0, 3), (1, 40), (17, 200)])
def test_poles_are_those_of_the_augmented_matrix(delays):
    a, b = (cr.delayed_ss(LAG, d, dt=DT) for d in delays)
    loop = ct.feedback(3 * a * PI, b)
    ours, dense = loop.poles(), np.linalg.eigvals(loop.A)
    assert ours.size == loop.nstates == dense.size
    # LAPACK's are right to 1e-10 at the most sensitive pole of 218
    assert max(np.abs(ours - pole).min() for pole in dense) < 1e-8
    slowest = loop.dominant_poles(4)
    assert_allclose(np.abs(slowest), np.sort(np.abs(dense))[::-1][: slowest.size], rtol=1e-9)
    assert loop.is_stable() == (np.abs(dense).max() < 1)


def test_dominant_poles_of_a_long_loop_are_roots_of_its_equation():
    d, a, k = 5000, 0.99, 0.015
    loop = ct.feedback(cr.delayed_ss(ct.ss(a, 1, k, 0, DT), d))
    poles = loop.dominant_poles(6)
    # (z - a) z^d + k = 0; the derivative is (d + 1) z^d - d a z^(d-1)
    error = ((poles - a) * poles**d + k) / ((d + 1) * poles**d - d * a * poles ** (d - 1))
    assert poles.size >= 6
    assert np.abs(error).max() < 1e-12
    assert_allclose(loop.dominant_poles(1)[0], poles[0], rtol=1e-12)
    # k > 1 - a: the loop turns by pi before its gain is below 1
    assert not loop.is_stable()
    assert ct.feedback(cr.delayed_ss(ct.ss(a, 1, 0.009, 0, DT), d)).is_stable()


@pytest.mark.parametrize("gain", [2.7, 0.9, -0.5])
def test_poles_of_a_gain_behind_a_long_delay_are_roots_of_the_gain(gain):
    # z^d = -gain; an iteration for all of them takes minutes
    loop = ct.feedback(cr.delayed_ss(ct.ss([], [], [], gain, DT), 10_000))
    assert_allclose(loop.dominant_poles(5) ** 10_000, -gain, rtol=1e-10)
    assert loop.is_stable() == (abs(gain) < 1)


@pytest.mark.parametrize(("seed", "delays"), [(0, [700]), (1, [250, 301]), (2, [90, 200, 333])])
def test_dominant_poles_of_random_long_loops_are_the_largest_of_all(seed, delays):
    rng = np.random.default_rng(seed)
    q = len(delays)
    A = rng.standard_normal((3, 3))
    A *= 0.98 / np.abs(np.linalg.eigvals(A)).max()
    B, C, D = (0.3 * rng.standard_normal(shape) for shape in ((3, 1 + q), (1 + q, 3), (1 + q,) * 2))
    loop = cr.DelaySystem(ct.ss(A, B, C, D, DT), delays)
    sizes = np.sort(np.abs(loop.poles()))[::-1]
    found = np.abs(loop.dominant_poles(8))
    assert_allclose(found, sizes[: found.size], rtol=1e-9)
    assert loop.is_stable() == (sizes[0] < 1)


GAINS = np.geomspace(0.05, 2.5, 30)  # of the gain margin
ROOT_LOCI = {
    "discrete": (cr.delayed_ss(LAG, 12, dt=DT), lambda p: p**-12 * (LAG.sample(DT))(p)),
    "loop": (ct.feedback(cr.delayed_ss(LAG, 12, dt=DT), 0.5), None),
    "continuous": (LAG * cr.delay(1.0), lambda p: np.exp(-p) * LAG(p)),
}


@pytest.mark.parametrize("case", ROOT_LOCI)
def test_a_root_locus_solves_its_equation_on_continuous_branches(case):
    system, response = ROOT_LOCI[case]
    gains = None if case == "discrete" else cr.design.margins(system).gain_margin * GAINS
    locus = cr.design.root_locus(system, gains, count=6)
    assert locus.loci.shape == (locus.gains.size, 6)
    values = (response or system)(locus.loci.ravel())
    values = values.reshape(locus.loci.shape)
    # rounding of exp(-p) far to the left, and of p^-12 near 0
    assert_allclose(locus.gains[:, None] * values, -1, rtol=1e-6)
    # the boundary of stability is passed at the gain margin
    inside = (np.abs(locus.loci) < 1 if system.dt else locus.loci.real < 0).all(axis=1)
    assert_array_equal(inside, locus.gains < cr.design.margins(system).gain_margin)
    # the dominant pair moves in small steps
    steps = np.abs(np.diff(locus.loci[:, :2], axis=0)).max()
    assert steps < 0.1 * np.ptp(np.abs(locus.loci[:, :2] - locus.loci[0, :2])) + 0.05


def test_a_root_locus_of_a_long_chain_is_that_of_its_closed_loops():
    locus = cr.design.root_locus(cr.delayed_ss(LAG, 1000, dt=0.001), [0.5, 1.2], count=4)
    for gain, branch in zip(locus.gains, locus.loci, strict=True):
        loop = ct.feedback(gain * cr.delayed_ss(LAG, 1000, dt=0.001))
        largest = np.sort(np.abs(loop.dominant_poles(4)))
        assert_allclose(np.sort(np.abs(branch)), largest, rtol=1e-12)
    with pytest.raises(DataError, match="gains must increase"):
        cr.design.root_locus(LAG, [1.0, 0.5])
    with pytest.raises(UnsuitableSystemError, match="2 inputs"):
        cr.design.root_locus(TWO_INPUTS)


def test_zeros_of_a_loop_are_those_of_its_parts():
    plant = cr.delayed_ss(ct.ss(ct.zpk([0.3], [0.8, 0.9], 0.05, dt=DT)), 25)
    loop = ct.feedback(plant, cr.delayed_ss(PI, 3))
    # of the forward path, and the poles of what feeds back, its delay included
    expected = [0.3, 1.0, 0.0, 0.0, 0.0]
    assert_allclose(np.sort(loop.zeros().real), np.sort(expected), atol=1e-6)
    sensitivity = 1 / (1 + plant)
    assert np.count_nonzero(sensitivity.zeros() == 0) == 25
    assert_allclose(np.sort(sensitivity.zeros().real)[-2:], [0.8, 0.9], rtol=1e-9)


MERGING = {
    "sum of equal delays": (lambda P, Q: P + Q * 3, (), 17),
    "difference from itself": (lambda P, Q: P - P, (), 17),
    "series": (lambda P, Q: P * Q, (), 34),
    "series with a loop": (lambda P, Q: P * ct.feedback(Q) * P, (17, 34), None),
    "delays that add up in a loop": (lambda P, Q: ct.feedback(P * Q), (34,), None),
    "delay in both paths": (lambda P, Q: ct.feedback(P, Q), (17, 17), None),
    "complementary sensitivity": (lambda P, Q: ct.feedback(P), (17,), None),
    "one plant, used twice": (lambda P, Q: ct.feedback(np.array([[1.0], [1]]) * P, np.ones((1, 2))),
                              (17,), None),
    "nothing goes through": (lambda P, Q: 1 + 0 * P, (), 0),
}  # fmt: skip


@pytest.mark.parametrize("case", MERGING)
def test_delays_that_meet_merge(case):
    make, inside, ends = MERGING[case]
    P = cr.delayed_ss(LAG, 17, dt=DT)
    made = make(P, cr.delayed_ss(ct.tf([2], [0.3, 1]), 17, dt=DT))
    if inside:
        assert isinstance(made, cr.DelaySystem)
        assert tuple(sorted(made.internal_delays)) == inside
    else:
        assert isinstance(made, cr.DelayedStateSpace)
        assert made.delay == ends


def test_names_go_through_interconnections():
    P = cr.delayed_ss(LAG, 30, dt=DT, name="P", inputs="u", outputs="y")
    C = ct.ss(PI, name="C", inputs="e", outputs="u")
    error = ct.summing_junction(["r", "-y"], "e")
    ours = cr.interconnect([P, C, error], inputs="r", outputs=["y", "u"], name="loop")
    with pytest.warns(ModelWarning, match="cr.interconnect instead"):
        theirs = ct.interconnect([P, C, error], inputs="r", outputs=["y", "u"], name="loop")
    assert isinstance(ours, cr.DelaySystem)
    assert ours.internal_delays == (30,)
    assert (ours.name, ours.input_labels, ours.output_labels) == ("loop", ["r"], ["y", "u"])
    assert ours.core.state_labels == ["P_x[0]", "C_x[0]"]
    assert set(ours.core.state_labels) <= set(theirs.state_labels)
    assert_allclose(ours(Z), theirs(Z), rtol=1e-9)
    assert_allclose(ours["u", "r"](Z), theirs(Z)[1, 0], rtol=1e-9)
    loop = ct.feedback(P, C)
    assert (loop.input_labels, loop.output_labels) == (["u"], ["y"])
    assert ct.append(P, ct.feedback(C * P)).input_labels == ["u[0]", "u[1]"]


@pytest.mark.parametrize("d", [5, 37, 300, 1000])
def test_margins_of_python_control_are_right_at_any_delay(d):
    L = cr.delayed_ss(LAG, d, dt=DT / d) * 2
    right = cr.design.margins(L)
    ours = ct.margin(L)
    # interpolated by cubic splines through points a tenth of a radian apart
    assert ours[0] == pytest.approx(right.gain_margin, rel=1e-5)
    assert ours[1] == pytest.approx(right.phase_margin, rel=1e-5)
    assert ct.stability_margins(L)[2] == pytest.approx(right.modulus_margin, rel=1e-5)


def test_margins_of_a_loop_with_an_inner_loop_are_right():
    inner = ct.feedback(cr.delayed_ss(LAG, 60, dt=0.01) * 2, 0.1)
    gain, phase, _, crossover = ct.margin(inner)
    at = inner(np.exp(1j * crossover * 0.01))
    # interpolated as above
    assert abs(at) == pytest.approx(1, rel=1e-5)
    assert np.degrees(np.angle(-at)) == pytest.approx(phase, rel=1e-5)
    assert ct.margin(gain * inner)[0] == pytest.approx(1, rel=1e-4)
    exact = cr.design.margins(inner)
    assert (exact.gain_margin, exact.phase_margin) == pytest.approx((gain, phase), rel=1e-5)
    assert exact.stable
    assert not cr.design.margins(inner, 1.01 * gain).stable
    assert cr.design.margins(inner, 0.99 * gain).stable
    # of plain matrices: 62 states
    augmented = cr.design.margins(ct.ss(inner))
    assert exact.delay_margin == pytest.approx(augmented.delay_margin, rel=1e-9)


FILTER = ct.tf([0.5], [1, -0.5], DT)
LOST = {
    "tf * sys": lambda L: FILTER * L,
    "tf + sys": lambda L: FILTER + L,
    "tf in front": lambda L: ct.feedback(FILTER, L),
    "polynomial": ct.tf,
    "system in front": lambda L: ct.feedback(PI, L),
    "number in front": lambda L: ct.feedback(1, L),
    "append": lambda L: ct.append(PI, L),
    "lft": lambda L: ct.append(PI, PI).lft(L),
}


@pytest.mark.parametrize("case", LOST)
def test_where_python_control_loses_the_delay_the_warning_says_what_keeps_it(case):
    loop = ct.feedback(cr.delayed_ss(LAG, 60, dt=DT))
    with pytest.warns(ModelWarning, match=r"dominant_poles|root_locus|cr\.DelaySystem") as caught:
        LOST[case](loop)
    said = [one for one in caught if one.category is ModelWarning]
    assert len(said) == 1
    assert said[0].filename == __file__


def test_bandwidth_is_where_the_gain_has_dropped():
    for loop, at in (
        (ct.feedback(cr.delayed_ss(LAG, 300, dt=0.001) * 0.5), lambda w: np.exp(1j * w * 0.001)),
        (ct.feedback(LAG * cr.delay(0.3) * 0.5), lambda w: 1j * w),
    ):
        w = loop.bandwidth()
        assert abs(loop(at(w))) == pytest.approx(abs(loop.dcgain()) * 10 ** (-3 / 20), rel=1e-9)
        # the first such frequency
        below = np.array([at(x) for x in np.linspace(1e-3, 0.999 * w, 200)])
        assert np.abs(loop(below)).min() > abs(loop.dcgain()) * 10 ** (-3 / 20)


def test_a_loop_with_an_integrator_has_its_static_gain():
    L = cr.delayed_ss(ct.tf([1], [1, 0]), 30, dt=0.01) * 0.5
    assert ct.feedback(L).dcgain() == pytest.approx(1, abs=1e-12)
    assert ((1 + L) ** -1).dcgain() == pytest.approx(0, abs=1e-12)
    # 1e-6 of the loop's gain is left of the sensitivity; the parts of its response cancel to that
    omega = np.array([1e-6])
    z = np.exp(1j * omega * 0.01)
    s = (1 + L) ** -1
    assert_allclose(s(z), 1 / (1 + L(z)), rtol=1e-9)


def test_memory_grows_with_the_delay_and_not_with_its_square():
    plant = cr.delayed_ss(LAG, 10_000, dt=1e-4)
    ct.feedback(plant).step(5)  # imports and caches are not the system's
    tracemalloc.start()
    loop = ct.feedback(0.5 * plant)
    loop(Z)
    loop.step(20_000)
    loop.dominant_poles(3)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 3e7  # the matrix alone has 8e8


@pytest.mark.parametrize("delay", [10, 100, 1000])
@pytest.mark.parametrize("lag", [5.0, 50.0, 5000.0])
def test_rise_and_settling_time_of_a_lag_are_those_of_the_closed_form(lag, delay):
    found = cr.delayed_ss(ct.tf([2], [lag, 1]), delay, dt=1.0).step_info()
    # 1 - exp(-t / T) reaches 10, 90 and 98 %; each time is rounded up to a sample
    assert found["RiseTime"] == pytest.approx(lag * np.log(9), abs=1)
    assert 0 <= found["SettlingTime"] - delay - lag * np.log(50) <= 1
    assert found["SteadyStateValue"] == pytest.approx(2, rel=1e-9)


@pytest.mark.parametrize("delay", [10.0, 1000.0, 10000.0])
def test_rise_and_settling_time_of_a_continuous_lag_behind_a_long_dead_time(delay):
    # at the times of a plot, 200 s apart behind 10000 s, it rose in 0 s
    found = (ct.ss(-0.2, 1, 0.2, 0) * cr.delay(delay)).step_info()
    # as above; 5000 times begin up to an interval of the plot early, 1 % of the rise at most
    assert found["RiseTime"] == pytest.approx(5 * np.log(9), rel=0.01)
    assert found["SettlingTime"] == pytest.approx(delay + 5 * np.log(50), abs=0.1)


def test_a_fast_rise_before_a_slow_end_is_seen():
    # 1 - b exp(-t) - a exp(-t / 1000): all equal intervals to its end were 15 s each
    a = 0.01 / 0.999
    b = 1 - a
    plant = ct.tf([1], [1, 1]) * ct.tf([990, 1], [1000, 1]) * cr.delay(0.5)
    found = plant.step_info()

    def reached(part):
        return brentq(lambda t: 1 - b * np.exp(-t) - a * np.exp(-t / 1000) - part, 0, 50)

    # both times are rounded up to intervals of a twentieth of the lag
    assert found["RiseTime"] == pytest.approx(reached(0.9) - reached(0.1), abs=0.05)
    assert found["SettlingTime"] == pytest.approx(0.5 + reached(0.98), abs=0.05)


def test_the_overshoot_of_a_loop_beside_a_slow_mode_is_that_of_its_fast_part():
    # y' = 0.8 u, u = 1 - y(t - 1): 0.8 (t - 1) up to t = 2, then 0.8 (t - 1) - 0.32 (t - 2)^2, ...
    fast = ct.feedback(0.8 * cr.delay(1.0) * ct.tf([1], [1, 0]))
    t = np.linspace(0, 12, 4001)
    y = np.zeros(t.size)
    for k in range(12):  # method of steps: powers of (t - 1 - k)
        y -= (-0.8) ** (k + 1) * np.clip(t - 1 - k, 0, None) ** (k + 1) / factorial(k + 1)
    slow = ct.tf([4950, 1], [5000, 1])  # 1 - 0.01 / (5000 s + 1), seen in 12 s as a gain of 0.99
    found = (fast * slow).step_info()
    # a peak between two times is missed by 0.03 % of it
    assert found["Overshoot"] == pytest.approx(100 * (0.99 * y.max() - 1), abs=0.1)
    assert found["PeakTime"] == pytest.approx(t[y.argmax()], abs=0.05)  # an interval


@pytest.mark.parametrize("gain", [-0.5, 0.8])
def test_a_loop_of_gain_and_delay_settles_by_its_powers(gain):
    # y = g (1 - (-g)^k) / (1 + g) after k passes of d samples
    loop = ct.feedback(cr.delayed_ss(ct.ss([], [], [], [[gain]], 1.0), 1000))
    found = loop.step_info()
    assert found["SteadyStateValue"] == pytest.approx(gain / (1 + gain), rel=1e-12)
    passes = next(k for k in range(99) if abs(gain) ** k < 0.02)
    assert found["SettlingTime"] == 1000 * passes
    assert found["RiseTime"] == (0 if gain > 0 else 3000)


def test_a_step_that_does_not_settle_is_refused_with_what_to_try():
    slow = cr.delayed_ss(ct.tf([1], [50, 1]), 100, dt=1.0)
    with pytest.raises(UnsuitableSystemError, match=r"not risen.*step_info\(end\)"):
        slow.step_info(120)
    for unstable in (ct.feedback(slow * 40.0), cr.delayed_ss(ct.ss(1, 1, 1, 0, 1.0), 3)):
        with pytest.raises(UnsuitableSystemError, match=r"not stable.*step_response"):
            unstable.step_info()
    with pytest.raises(UnsuitableSystemError, match="more than 1000000 samples"):
        cr.delayed_ss(ct.tf([1], [1e6, 1]), 100, dt=1.0).step_info()
    assert slow.step_info(T=3000) == pytest.approx(slow.step_info(3000), rel=1e-12)
    both = ct.append(slow, 2 * slow).step_info()
    assert both[1][1]["SteadyStateValue"] == pytest.approx(2)
    assert both[0][0] == pytest.approx(slow.step_info(), rel=1e-12)


def test_a_chosen_end_of_a_response_that_leaves_out_the_delay_is_warned_of():
    plant = cr.delayed_ss(ct.tf([1], [5, 1]), 100, dt=1.0)
    with pytest.warns(ModelWarning, match=r"sys\.step_info\(\)"), pytest.raises(IndexError):
        ct.step_info(plant)
    assert ct.step_info(plant, np.arange(200.0))["RiseTime"] == plant.step_info()["RiseTime"]


def test_polynomials_of_a_thousand_registers_are_refused_with_the_right_call():
    plant, gain = cr.delayed_ss(ct.tf([1], [0.5, 1]), 1000, dt=0.01), ct.tf([0.3], [1], 0.01)
    for asked in (lambda: ct.margin(gain * plant), lambda: ct.tf(plant)):
        with pytest.raises(UnsuitableSystemError, match=r"sys \* tf"):
            asked()


GAIN = cr.DelaySystem(ct.ss([], [], [], [[2.0]]))
DEAD = ct.tf([1], [5, 1]) * cr.delay(3.0)


@pytest.mark.parametrize("other", [DEAD, DEAD.to_discrete(0.5)])
def test_a_gain_without_a_time_base_adopts_that_of_the_other_system(other):
    z = np.exp(0.3j) if other.dt else 0.3j
    G = other(z)
    for made, expected in (
        (GAIN * other, 2 * G),
        (other * GAIN, 2 * G),
        (GAIN + other, 2 + G),
        (other - GAIN, G - 2),
        (ct.feedback(GAIN, other), 2 / (1 + 2 * G)),
        (ct.feedback(other, GAIN), G / (1 + 2 * G)),
    ):
        assert made.dt == other.dt
        assert made(z) == pytest.approx(expected, rel=1e-12)
    at = cr.design.margins(other, 0.1 * GAIN)
    assert at.gain_margin == pytest.approx(cr.design.margins(other, 0.2).gain_margin, rel=1e-9)


def test_a_gain_without_a_time_base_stays_one(tmp_path):
    for made, value in ((GAIN * GAIN, 4), (-GAIN, -2), (GAIN**-1, 0.5), (GAIN.feedback(), 2 / 3)):
        assert made.dt is None
        assert made(0.3j) == pytest.approx(value)
    assert "any time base" in repr(GAIN)
    assert (GAIN.is_stable(), GAIN.poles().size, GAIN.dcgain()) == (True, 0, 2.0)
    cr.save_model(tmp_path / "gain.json", GAIN)
    back = cr.load_model(tmp_path / "gain.json")
    assert (back.dt, back.D.tolist()) == (None, [[2.0]])
    with pytest.raises(UnsuitableSystemError, match="expected a sample time"):
        cr.DelaySystem(ct.ss([], [], [], np.ones((2, 2))), [1.0])


@pytest.mark.parametrize("system", [cr.delay(0.5), cr.delayed_ss(ct.tf([1], [2, 1]), 5, dt=0.1)])
@pytest.mark.parametrize("key", [(0, 1), (5, 5)])
def test_channels_that_are_not_there_are_refused(system, key):
    with pytest.raises(cr.errors.OptionError, match="there are 1 outputs and 1 inputs"):
        system[key]


@pytest.mark.parametrize("scale", [1.0, 1e-7, 1e-12, 1e9])
def test_the_unit_of_a_signal_does_not_close_an_algebraic_loop(scale):
    # a plant in m/V with a controller of 1.9e8 V/m was refused, though it acts after 3 s
    s = ct.tf("s")
    plant = ct.ss(scale / (10 * s + 1)) * cr.delay(3.0)
    controller = ct.ss((1.9 + 0.2 / s + 2 * s / (0.2 * s + 1)) / scale)
    points = 1j * np.geomspace(1e-3, 10, 20)
    loop = plant(points) * controller(points)
    closed = plant.feedback(controller)
    assert_allclose(closed(points), plant(points) / (1 + loop), rtol=1e-9)
    assert_allclose(cr.design.gang_of_four(plant, controller)(points)[0, 0], loop / (1 + loop))
    answers_itself = ct.ss([], [], [], [[1 / scale]])
    with pytest.raises(UnsuitableSystemError, match="algebraic loop"):
        (plant + scale).feedback(answers_itself, sign=1)


@pytest.mark.parametrize("lag", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("gain", [1.0, 1e6])
def test_the_response_of_parallel_paths_does_not_depend_on_units(lag, gain):
    # lags of microseconds have output matrices of 1e15, and both paths share their poles
    lags = np.polymul(np.polymul([3 * lag, 1], [9 * lag, 1]), [20 * lag, 1])
    plant = cr.delayed_ss(ct.tf([gain], lags), dead_time=5.5 * lag, dt=lag)
    filtered = cr.DelayedStateSpace(ct.ss(ct.tf([0.1, -0.05], [1, -0.7], lag)), 7)
    z = np.exp(1j * np.linspace(0.01, 3, 30))
    # rounding grows with the distance of the poles from z, up to 1 / 0.01
    assert_allclose((plant + filtered * plant)(z), plant(z) * (1 + filtered(z)), rtol=1e-12)
    loop = ct.feedback(plant / gain * filtered, filtered)
    through = plant(z) / gain * filtered(z)
    assert_allclose(loop(z), through / (1 + through * filtered(z)), rtol=1e-10)


def test_feedback_by_a_list_is_that_of_its_matrix_and_a_ragged_one_is_refused():
    plant = cr.delayed_ss(ct.tf([1], [5, 1]), 10, dt=0.1)
    for system in (plant, ct.ss(-0.2, 1, 0.2, 0) * cr.delay(1.0)):
        at = np.exp(0.3j * 0.1) if system.dt else 0.3j
        loop = system.feedback([[0.5]])  # P / (1 + P / 2)
        assert loop(at) == pytest.approx(system(at) / (1 + 0.5 * system(at)), rel=1e-12)
        with pytest.raises(DataError, match="rows have different lengths"):
            system.feedback([[1, 2], [3]])
