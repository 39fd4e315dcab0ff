"""Feedback, nonlinearity, change, repetition and instability, seen in what a model leaves over."""

import control as ct
import numpy as np
import pytest
from scipy.signal import lfilter

import ctrl_realize as cr
from ctrl_realize.numerics.validation.innovations import (
    feedback_chance,
    late_samples,
    nonlinear_chance,
    shows_feedback,
)
from ctrl_realize.numerics.validation.instability import unstable_chance
from ctrl_realize.numerics.validation.parameter_change import parameter_change
from ctrl_realize.numerics.validation.white_step import white_step

N = 600
SURE = 1e-6


def levels(rng):
    return np.repeat(rng.choice([-1.0, 0.0, 1.0], N // 12), 12)


def first_order(drive, delay=5):
    late = np.concatenate([np.zeros(delay), drive[:-delay]])
    return lfilter([0.0, 0.1], [1, -0.9], late)


def loop(rng, gain, integral, disturbance):
    """First-order plant with a delay of five samples under a PI controller."""
    target = np.repeat(rng.choice([-1.0, 0.0, 1.0], N // 60), 60)
    u, y, state, total = np.zeros(N), np.zeros(N), 0.0, 0.0
    for k in range(N):
        y[k] = state + disturbance[k]
        total += integral * (target[k] - y[k])
        u[k] = gain * (target[k] - y[k]) + total
        state = 0.9 * state + 0.1 * (u[k - 5] if k >= 5 else 0.0)
    return u, y


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("pole", [0.0, 0.9])
def test_no_feedback_is_found_in_open_loop(seed, pole):
    rng = np.random.default_rng(seed)
    u = levels(rng)
    noise = 0.05 * lfilter([1.0], [1, -pole], rng.standard_normal(N))
    assert feedback_chance(first_order(u) + noise, u, 20) > 1e-3
    assert not shows_feedback([(first_order(u) + noise, u)])


def rounded(values):
    """Values as stored by a system that resolves their usual change and no more."""
    step = np.median(np.abs(np.diff(values)))
    return step * np.round(values / step)


@pytest.mark.parametrize("late", [0, 3])
@pytest.mark.parametrize("held", [1, 12])
def test_neither_a_feedthrough_nor_a_late_input_is_a_controller(held, late):
    rng = np.random.default_rng(1)
    u = np.repeat(rng.standard_normal(N // held), held)
    noise = 0.05 * lfilter([1.0], [1, -0.95], rng.standard_normal(N))
    y = first_order(u, 1) - 0.5 * u + noise
    assert late or feedback_chance(y, u, 20) < SURE
    assert not shows_feedback([(y[: N - late], u[late:])])
    if held == 1:
        assert not shows_feedback([(rounded(y[: N - late]), rounded(u[late:]))])


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(("gain", "integral"), [(1.0, 0.0), (0.5, 0.03)])
def test_a_controller_is_found_by_the_noise_that_it_passes_on(seed, gain, integral):
    rng = np.random.default_rng(seed)
    noise = 0.05 * lfilter([1.0], [1, -0.9], rng.standard_normal(N))
    u, y = loop(rng, gain, integral, noise)
    assert feedback_chance(y, u, 20) < SURE
    assert shows_feedback([(y, u)])
    assert shows_feedback([(rounded(y), rounded(u))])


@pytest.mark.parametrize("seed", range(5))
def test_a_pulse_into_an_integrator_tells_of_no_feedback(seed):
    rng = np.random.default_rng(seed)
    u = np.where(np.arange(N) // 30 == 4, 1.0, 0.0)
    y = 0.03 * np.cumsum(first_order(u)) + 0.02 * rng.standard_normal(N)
    assert feedback_chance(y, u, 60) == 1.0


@pytest.mark.parametrize("samples", [0, 1, 4])
@pytest.mark.parametrize("held", [1, 3, 12])
@pytest.mark.parametrize("pole", [0.0, 0.8])
def test_samples_by_which_an_input_is_late_are_counted(samples, held, pole):
    rng = np.random.default_rng(held)
    u = np.repeat(rng.choice([-1.0, 0.0, 1.0], N // held), held)
    y = lfilter([0.0, 1 - pole], [1, -pole], u) + 0.02 * rng.standard_normal(N)
    late, part = late_samples(y[: N - samples], np.r_[np.zeros(samples), u][: N - samples], 30)
    assert late == samples
    assert (part > 0.5) == (samples > 0)


@pytest.mark.parametrize("seed", range(5))
def test_a_linear_plant_is_not_called_nonlinear(seed):
    rng = np.random.default_rng(seed)
    u = levels(rng)
    y = first_order(u) + 0.02 * rng.standard_normal(N)
    assert nonlinear_chance(y, u, 40)[0] > 1e-3


@pytest.mark.parametrize("bent", [lambda u: u + 0.4 * u**2, lambda u: np.sign(u) * u**2 + 0.3 * u])
def test_a_static_nonlinearity_is_found(bent):
    rng = np.random.default_rng(1)
    u = np.repeat(rng.choice([-1.0, -0.5, 0.0, 0.5, 1.0], N // 12), 12)
    y = first_order(bent(u)) + 0.01 * rng.standard_normal(N)
    chance, part = nonlinear_chance(y, u, 40)
    assert chance < 1e-5
    assert 0.05 < part < 1


SAMPLES = 900
THIRDS = 3 * np.arange(SAMPLES) // SAMPLES


def response(rng):
    u = np.repeat(rng.choice([-1.0, 0.0, 1.0], SAMPLES // 15), 15)
    return lfilter([0.0, 0.15], [1, -0.85], u)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("pole", [0.0, 0.9])
def test_parts_of_one_plant_do_not_differ(seed, pole):
    rng = np.random.default_rng(seed)
    noise = 0.03 * lfilter([1.0], [1, -pole], rng.standard_normal(SAMPLES))
    assert parameter_change(noise, response(rng), THIRDS).chance > 1e-3


def test_a_gain_that_falls_is_measured_part_by_part():
    rng = np.random.default_rng(0)
    model = response(rng)
    truth = np.array([0.2, 0.0, -0.2])
    residual = truth[THIRDS] * model + 0.01 * rng.standard_normal(SAMPLES)
    found = parameter_change(residual, model, THIRDS)
    assert found.chance < 1e-6
    assert np.all(np.abs(found.gains - truth) < 4 * found.gain_errors + 0.02)


DT = 0.05
LENGTH = 800
TRUE = np.poly([-1.2, -4.0])  # 3 (1 + 0.3 s) behind two lags and 0.32 s
NUMERATOR = 3 * TRUE[-1] * np.array([1.0, 0.3])
DELAY = 0.32
TOTAL = DELAY + 1 / 1.2 + 1 / 4.0 - 0.3


def record(seed, size, pole):
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.choice([-1.0, 0.0, 1.0], LENGTH // 20), 20)
    plant = cr.delayed_ss(ct.tf(NUMERATOR[::-1], TRUE), dead_time=DELAY, dt=DT)
    noise = lfilter([np.sqrt(1 - pole**2)], [1, -pole], rng.standard_normal(LENGTH + 300))[300:]
    return u, np.ravel(plant.simulate(u)) + size * noise


def step(u, y, *, late=0.0, slow=1.0, gain=1.0):
    poles = np.array([-1.2 / slow, -4.0], dtype=complex)
    b = gain * NUMERATOR / slow
    return white_step(y, u, DT, DELAY + late, poles, b)


@pytest.mark.parametrize("pole", [0.0, 0.95])
def test_errors_are_those_that_come(pole):
    scores = []
    for seed in range(24):
        found = step(*record(seed, 0.2, pole))
        scores.append(
            [
                (found.dead_time - DELAY) / found.dead_time_error,
                (found.gain - 3.0) / found.gain_error,
                (found.total - TOTAL) / found.total_error,
            ]
        )
    spread = np.sqrt(np.mean(np.square(scores), axis=0))
    # 24 records: chi-square leaves 0.72 to 1.28; the colour is estimated along.
    assert np.all((spread > 0.6) & (spread < 1.5))


def test_a_delay_that_depends_on_the_direction_is_measured():
    rng = np.random.default_rng(0)
    model = response(rng)
    rising = (np.gradient(model) > 0).astype(int)
    late = np.array([0.5, -0.5])  # samples; small, the regression being one on the derivative
    residual = -late[rising] * np.gradient(model) + 0.002 * rng.standard_normal(SAMPLES)
    found = parameter_change(residual, model, rising)
    assert found.chance < 1e-6
    assert found.shifts == pytest.approx(late, abs=0.1)


def test_set_points_hide_no_feedback_and_units_change_no_chance():
    rng = np.random.default_rng(0)
    u, y = loop(rng, 2.0, 0.0, 0.02 * rng.standard_normal(N))  # the input moves more than noise
    assert feedback_chance(y, u, 20) < SURE
    u, y = loop(rng, 0.3, 0.01, 0.05 * rng.standard_normal(N))
    one = feedback_chance(y, u, 20)
    assert feedback_chance(1e3 * y + 7, 1e-3 * u - 2, 20) == pytest.approx(one, rel=1e-4)


@pytest.mark.parametrize("level", [0.0, 1e5, 1e7])  # such as a pressure in Pa
def test_a_smooth_input_is_told_by_its_own_past_at_any_level(level):
    """Fifteen sinusoids follow an equation of thirty past samples exactly: nothing can be asked."""
    tones = np.arange(1, 16)[:, None]
    u = np.sin(2 * np.pi * tones * np.arange(N) / N + tones**2).sum(axis=0)
    y = first_order(u) + 0.05 * np.random.default_rng(0).standard_normal(N)
    assert feedback_chance(y, u + level, 60) == 1.0
    assert nonlinear_chance(y, u + level, 60) == (1.0, 0.0)


def test_where_nothing_can_be_told_nothing_is_said():
    rng = np.random.default_rng(0)
    u = np.sin(0.1 * np.arange(N))  # told by its own past
    assert feedback_chance(first_order(u) + 0.05 * rng.standard_normal(N), u, 20) == 1.0
    short = rng.standard_normal(80)
    assert feedback_chance(short, short, 20) == 1.0
    assert nonlinear_chance(short, short, 20) == (1.0, 0.0)
    noise = rng.standard_normal(SAMPLES)
    assert parameter_change(noise, response(rng), np.zeros(SAMPLES, dtype=int)) is None
    assert parameter_change(np.zeros(SAMPLES), response(rng), THIRDS) is None
    u, y = record(0, 0.1, 0.0)
    assert step(u[:45], y[:45]) is None


def held(rng, pole, gain=2.0, noise=0.02):
    """First-order plant with a delay of two samples, held by a proportional controller."""
    target = np.repeat(rng.choice([-1.0, 0.0, 1.0], N // 60), 60)
    u, y, state = np.zeros(N), np.zeros(N), 0.0
    for k in range(N):
        y[k] = state + noise * rng.standard_normal()
        u[k] = gain * (target[k] - y[k])
        state = pole * state + 0.05 * (u[k - 2] if k >= 2 else 0.0)
    return u, y


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("pole", [1.02, 1.05])
def test_a_pole_outside_the_unit_circle_is_found_in_a_loop(seed, pole):
    u, y = held(np.random.default_rng(seed), pole)
    assert unstable_chance(y, u, 30) < SURE


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("pole", [0.9, 0.98, 1.0])
def test_no_stable_plant_in_a_loop_and_no_integrator_is_called_unstable(seed, pole):
    u, y = held(np.random.default_rng(seed), pole)
    assert unstable_chance(y, u, 30) > 1e-2


@pytest.mark.parametrize("seed", range(10))
def test_a_random_walk_is_not_called_unstable(seed):
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.choice([-1.0, 1.0], N // 12), 12)
    y = lfilter([0.0, 0.1], [1, -0.9], u) + 0.1 * np.cumsum(rng.standard_normal(N))
    assert unstable_chance(y, u, 30) > 1e-3


def test_the_units_and_levels_of_the_signals_do_not_matter():
    u, y = held(np.random.default_rng(0), 1.02, noise=0.3)
    one = unstable_chance(y, u, 30)
    assert unstable_chance(1e3 * y + 7, 1e-3 * u - 2, 30) == pytest.approx(one, rel=1e-4)


def test_a_second_input_takes_nothing_from_the_test():
    rng = np.random.default_rng(1)
    u, y = held(rng, 1.02)
    assert unstable_chance(y, np.stack([u, rng.standard_normal(N)]), 30) < SURE


def test_without_noise_or_with_few_samples_nothing_is_said():
    u, y = held(np.random.default_rng(0), 1.02, noise=0.0)
    assert unstable_chance(y, u, 30) == 1.0
    assert unstable_chance(y[:80], u[:80], 30) == 1.0
