"""Controllers with lines of a hundred thousand past outputs, and what cannot be made."""

import pickle

import control as ct
import numpy as np
import pytest

import ctrl_realize as cr
from ctrl_realize.errors import DelayRangeError, UnsuitableSystemError
from ctrl_realize.numerics.state_space.line_sums import LineSum

CORES = {
    "lag": (np.array([[0.999]]), np.array([[1.0]])),
    "two lags": (np.array([[0.999, 0.01], [0, 0.98]]), np.array([[0.0], [1]])),
    "integrator": (np.array([[1.0, 0.01], [0, 0.98]]), np.array([[0.0], [1]])),
    "resonant": (
        0.9995 * np.array([[np.cos(0.03), np.sin(0.03)], [-np.sin(0.03), np.cos(0.03)]]),
        np.array([[0.0], [1]]),
    ),
}


@pytest.mark.parametrize("kind", CORES)
def test_a_long_line_in_closed_form_is_the_sum_that_it_stands_for(kind):
    A, B = CORES[kind]
    C = np.array([[1.0, -0.3], [0.02, 0.5]])[:, : A.shape[0]]
    rows = np.zeros((2, 2000))
    state = B
    for i in range(rows.shape[1]):
        rows[:, i : i + 1] = C @ state
        state = A @ state
    rows[:, -1] += [0.7, -2.0]
    # the last points lie on and beside the poles, where the closed form cancels
    near = np.exp(1j * np.array([0.0, 1e-9, 1e-6, 1e-3, 0.03, 1.0, 3.0, np.pi]))
    z = np.concatenate([near, np.linalg.eigvals(A)])
    expected = rows @ (1 / z[None]) ** np.arange(1, 2001)[:, None]
    scale = np.abs(rows).sum() * np.abs(z[-1]) ** -2000.0
    np.testing.assert_allclose(LineSum(rows, (A, B, C))(z), expected, atol=1e-10 * scale)
    np.testing.assert_allclose(LineSum(rows)(z), expected, atol=1e-10 * scale)


def plant_of(delay):
    """A lag of twice the dead time."""
    core = ct.ss([[np.exp(-0.5 / delay)]], [[1.0]], [[1 - np.exp(-0.5 / delay)]], [[0.0]], 0.01)
    return cr.DelayedStateSpace(core, delay)


def pi_of(delay):
    return cr.design.PIDController(0.5, 0.02 * delay, dt=0.01)


@pytest.mark.parametrize("design", ["smith", "lqg"])
def test_margins_of_long_lines_are_those_of_short_ones_in_other_units(design):
    found = []
    for delay in (200, 4000):
        plant = plant_of(delay)
        if design == "smith":
            controller = cr.design.smith_predictor(plant, pi_of(delay))
        else:
            a, c = float(plant.delay_free.A[0, 0]), float(plant.delay_free.C[0, 0])
            # The same continuous problem: noise of the state grows with the square root of time,
            # and that of a measurement averages out with it.
            controller = cr.design.lqg(plant, c * c, 0.1, (1 - a) / c**2, delay / 200)
        found.append(controller.check.margins)
    short, long = found
    assert long.stable
    # what the sampling adds falls with 1 / delay
    assert long.delay_margin_samples / 4000 == pytest.approx(
        short.delay_margin_samples / 200, rel=0.05
    )


def test_controllers_of_delays_beyond_dense_matrices_are_made():
    delay = 20_000
    plant = plant_of(delay)
    predictor = cr.design.smith_predictor(plant, pi_of(delay))
    assert predictor.nstates == delay + 2
    assert predictor.check.stable
    # Against feedback of the difference of the two models.
    z = np.exp(1j * np.array([1e-5, 1e-4, 0.3]))
    core, pi = plant.delay_free(z), pi_of(delay)(z)
    np.testing.assert_allclose(predictor(z), pi / (1 + pi * core * (1 - z**-delay)), rtol=1e-8)
    again = pickle.loads(pickle.dumps(predictor))
    np.testing.assert_array_equal(again(z), predictor(z))
    with pytest.raises(DelayRangeError, match="need no matrices"):
        _ = predictor.A
    law = cr.design.predictor_lqr(plant, 1.0, 1.0)
    assert law.gain.shape == (1, delay + 1)
    assert law.check.stable
    assert "on the design model" in law.report()


def test_what_does_not_fit_into_memory_is_refused_with_what_to_do():
    core = ct.ss([[0.9]], [[0.1, 1.0]], [[1.0]], 0, 0.1)
    apart = cr.delayed_ss(core, [0, 100_000])
    with pytest.raises(DelayRangeError, match="Use a longer sample time"):
        cr.design.predictor_lqr(apart, 1.0, np.eye(2))
    alike = cr.delayed_ss(core, [100_000, 100_000])
    with pytest.raises(DelayRangeError, match="one channel at a time"):
        cr.design.lqg(alike, 1.0, np.eye(2), 1.0, 1.0)
    late = cr.DelayedStateSpace(
        ct.ss([[0.9]], [[1.0]], [[1.0], [0.5]], 0, 0.1), 0, output_delay=[0, 100_000]
    )
    with pytest.raises(DelayRangeError, match="use one output"):
        cr.design.kalman_predictor(late, 1.0, np.eye(2))


@pytest.mark.parametrize("name", ["predictor_lqr", "kalman_predictor", "lqg"])
def test_a_static_plant_has_no_state_to_feed_back(name):
    plant = cr.delayed_ss(ct.ss([], [], [], [[2.0]], 0.1), 3)
    weights = (1.0, 1.0, 1.0, 1.0) if name == "lqg" else (1.0, 1.0)
    with pytest.raises(UnsuitableSystemError, match="static gain with dead time"):
        getattr(cr.design, name)(plant, *weights)
    # What the message names works.
    integral = ct.ss([[1.0]], [[1.0]], [[0.1]], [[0.0]], 0.1)
    assert cr.design.smith_predictor(plant, integral).check.stable
    assert cr.design.pid(plant, "optimal", "PI").check.stable


def test_an_unstable_core_behind_a_very_long_dead_time_is_refused():
    plant = cr.delayed_ss(ct.ss([[1.02]], [[1.0]], [[0.1]], [[0.0]], 0.01), 100_000)
    with pytest.raises(UnsuitableSystemError, match="overflows within the delay of 100000 samples"):
        cr.design.lqg(plant, 1.0, 1.0, 1.0, 1.0)


@pytest.mark.parametrize("rule", ["amigo", "imc", "optimal"])
def test_a_dead_time_in_another_unit_is_refused_before_memory_ends(rule):
    # a lag in s, a dead time in us: an array of 102 GiB was asked for
    with pytest.raises(cr.errors.UnsuitableSystemError, match="units of its times"):
        cr.design.pid(cr.design.ProcessModel(1.0, 1e-3, 1e6), rule, "PI")
