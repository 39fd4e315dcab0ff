"""Process models and reductions against published examples and closed forms."""

import control as ct
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.linalg import solve_discrete_lyapunov

import ctrl_realize as cr
from ctrl_realize.numerics.state_space.process_models import half_rule, process_step

ProcessModel = cr.design.ProcessModel


def lags(*times):
    system = ct.tf([1.0], [1.0])
    for T in times:
        system = system * ct.tf([1.0], [T, 1.0])
    return system


def test_half_rule_reproduces_the_examples_of_the_paper():
    """Skogestad (2003), examples E1-E4 of section 2 and table 4."""
    factor, kept, wait = half_rule(np.array([1, 0.2]), np.zeros(0), np.zeros(0), 0.0, 1)
    assert (factor, kept[0], wait) == (1.0, pytest.approx(1.1), pytest.approx(0.1))
    # E2: k (-0.3 s + 1)(0.08 s + 1) / ((2 s + 1)(s + 1)(0.4 s + 1)(0.2 s + 1)(0.05 s + 1)^3)
    many = np.array([2, 1, 0.4, 0.2, 0.05, 0.05, 0.05])
    lead, inverse = np.array([0.08]), np.array([0.3])
    _, kept, wait = half_rule(many, lead, inverse, 0.0, 1)
    assert kept == pytest.approx([2.5])
    assert wait == pytest.approx(1.47)
    _, kept, wait = half_rule(many, lead, inverse, 0.0, 2)
    assert kept == pytest.approx([2.0, 1.2])
    assert wait == pytest.approx(0.77)


@pytest.mark.parametrize("dt", [0.05, 0.3])
def test_the_half_rule_keeps_the_gain_of_lags_without_a_dead_time(dt):
    # the zeros of a sampled model beyond its lags are rounding; half of 0.5 s to each side
    found = cr.design.reduce_fopdt(
        cr.delayed_ss(-2 * lags(1, 0.5, 0.3, 0.2), 0, dt=dt), method="half_rule"
    )
    values = [found.gain, found.lag, found.dead_time]
    np.testing.assert_allclose(values, [-2, 1.25, 0.75], rtol=1e-3)
    # rule T3 with the final dead time: of 0.2 s a lead of 10 ms leaves 0.19 s
    lead = lags(1, 0.5, 0.2) * ct.tf([0.01, 1], [1])
    found = cr.design.reduce_fopdt(lead, method="half_rule")
    values = [found.gain, found.lag, found.dead_time]
    np.testing.assert_allclose(values, [1, 1.25, 0.25 + 0.19], rtol=1e-6)


@given(
    lag=st.floats(0.1, 5), second=st.floats(0, 1), wait=st.floats(0, 3), integrating=st.booleans()
)
def test_step_response_in_closed_form_is_the_convolution(lag, second, wait, integrating):
    second *= lag
    time = np.array([0.5, 2.0, 9.0])
    found = process_step(time, lag, second, wait, integrating=integrating)
    plain = process_step(time, lag, 0.0, wait, integrating=integrating)
    if second < 0.01 * lag:
        np.testing.assert_allclose(found, plain, atol=2 * second + 1e-9)
        return
    expected = [
        quad(
            lambda x, t=t: np.exp(-x / second) / second
            * process_step(np.array([t - x]), lag, 0.0, wait, integrating=integrating)[0],
            0, max(t - wait, 0), epsabs=1e-9, limit=200,
        )[0]
        for t in time
    ]  # fmt: skip
    np.testing.assert_allclose(found, expected, atol=1e-6)


@pytest.mark.parametrize("method", ["optimal", "half_rule"])
@pytest.mark.parametrize("integrating", [False, True])
def test_a_model_of_the_right_structure_comes_back(method, integrating):
    truth = ProcessModel(-2.0, 1.0, 0.3, 0.5, integrating=False)
    reduce = cr.design.reduce_sopdt
    if integrating:
        truth = ProcessModel(-2.0, 0.6, 0.3, 0.0, integrating=True)
    for dt in (0.01, 0.013):  # whole samples of dead time, and a fraction
        found = reduce(truth.system(dt), method=method)
        expected = [truth.gain, truth.lag, truth.second_lag, truth.dead_time]
        values = [found.gain, found.lag, found.second_lag, found.dead_time]
        np.testing.assert_allclose(values, expected, rtol=1e-4, atol=1e-4)
        assert found.integrating == integrating
        assert found.error < 1e-4


@pytest.mark.parametrize("unit", [1e-6, 60.0])
@pytest.mark.parametrize("shape", [lags(5, 2, 0.7), lags(5, 2) * ct.tf([1], [1, 0])])
def test_the_unit_of_time_does_not_matter(shape, unit):
    scaled = ct.tf(
        *(part[0][0] * unit ** np.arange(len(part[0][0]))[::-1] for part in (shape.num, shape.den))
    )
    for reduce in (cr.design.reduce_fopdt, cr.design.reduce_sopdt):
        here, there = reduce(shape, dead_time=3), reduce(scaled, dead_time=3 * unit)
        times = [(m.lag, m.second_lag, m.dead_time) for m in (here, there)]
        # least squares end where the cost changes by 1e-8 of itself
        np.testing.assert_allclose(times[1], np.multiply(times[0], unit), rtol=1e-6)


def test_the_optimal_fit_is_never_worse_than_the_half_rule(valve):
    for system in (valve(37), lags(1, 0.5, 0.3, 0.1), lags(3, 3, 3)):
        for reduce in (cr.design.reduce_fopdt, cr.design.reduce_sopdt):
            half, best = reduce(system, method="half_rule"), reduce(system)
            assert best.error <= half.error * (1 + 1e-6)
        assert cr.design.reduce_sopdt(system).error < cr.design.reduce_fopdt(system).error


def test_the_error_is_the_distance_of_the_step_responses():
    system = lags(1.0, 0.5, 0.2)
    found = cr.design.reduce_fopdt(system, dead_time=0.4)
    time = np.linspace(0, 20, 10_001)
    true = ct.step_response(system, time).outputs
    true = np.interp(time - 0.4, time, true, left=0.0)
    rms = np.sqrt(np.trapezoid((found.step(time) - true) ** 2, time) / (1.7 + 0.4))
    assert found.error == pytest.approx(rms, rel=0.02)  # total time is itself an estimate


def random_core(seed, n, inputs=1, outputs=1):
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((n, n))
    A *= 0.97 / np.abs(np.linalg.eigvals(A)).max()
    matrices = (rng.standard_normal(s) for s in ((n, inputs), (outputs, n), (outputs, inputs)))
    return ct.ss(A, *matrices, 0.1)


@given(seed=st.integers(0, 1000), n=st.integers(1, 8), order=st.integers(0, 8))
def test_error_is_within_the_bound_and_the_delay_is_kept(seed, n, order):
    core, order = random_core(seed, n, 2, 1), min(order, n)
    small = cr.design.reduce(cr.delayed_ss(core, 37), order)
    assert small.delay == 37
    assert small.delay_free.nstates == order
    z = np.exp(1j * np.linspace(0, np.pi, 200))
    error = np.linalg.norm(core(z) - small.delay_free(z), axis=0).max()  # (1, 2, K)
    assert error <= small.fit.error_bound * (1 + 1e-6) + 1e-9


@given(seed=st.integers(0, 1000), n=st.integers(1, 6))
def test_singular_values_are_roots_of_the_product_of_gramians(seed, n):
    core = random_core(seed, n)
    P = solve_discrete_lyapunov(core.A, core.B @ core.B.T)
    Q = solve_discrete_lyapunov(core.A.T, core.C.T @ core.C)
    expected = np.sqrt(np.sort(np.abs(np.linalg.eigvals(P @ Q)))[::-1])
    found = cr.design.hankel_singular_values(cr.delayed_ss(core, 5))
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-7 * expected[0])


def test_integrators_and_unstable_poles_are_kept(cores):
    for kind, pole in (("integrating", 1.0), ("unstable", 1.0005)):
        small = cr.design.reduce(cr.delayed_ss(cores[kind], 9), 1)
        np.testing.assert_allclose(small.delay_free.poles(), [pole], rtol=1e-9)
        assert small.fit.kept_unstable == 1
        assert small.delay == 9
        z = np.exp(1j * np.array([0.1, 1.0]))
        error = np.abs(small.delay_free(z) - cores[kind](z)).max()
        assert error <= small.fit.error_bound * (1 + 1e-9)


def test_a_plant_without_dead_time_has_none_and_one_without_gain_is_refused():
    """1.1e-5 s was left by the optimizer, and the gain of SIMC was 22470."""
    lag = ct.tf([2], [1, 1])
    assert cr.design.reduce_fopdt(lag).dead_time == 0.0
    with pytest.raises(cr.errors.OptionError, match="the model has no dead time"):
        cr.design.pid(lag, "simc")
    washout = ct.tf([1, 0], [1, 2, 1]) * cr.delay(0.1)
    for plant in (washout, washout.to_discrete(0.05)):
        with pytest.raises(cr.errors.UnsuitableSystemError, match="the static gain is"):
            cr.design.reduce_fopdt(plant)
