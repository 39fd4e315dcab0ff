"""Heater, tank and flow loop, against closed forms and against what `identify` finds."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from ctrl_realize import bench
from ctrl_realize.errors import DataError, OptionError

CLEAN = {"noise": 0, "disturbance": 0, "resolution": None}


def quiet_valve(noise, disturbance, resolution):
    return bench.valve(noise=noise, input_noise=0, spikes=0, bits=resolution)


def two_lags(t, slow, fast):
    """Unit-step response of 1 / ((slow s + 1)(fast s + 1)) at t >= 0."""
    return 1 - (slow * np.exp(-t / slow) - fast * np.exp(-t / fast)) / (slow - fast)


def slope_behind_a_lag(t, fast):
    """Unit-step response of 1 / (s (fast s + 1)) at t >= 0."""
    return t + fast * np.expm1(-t / fast)


# plant, dead time in s, step, level before it, output per input, unit step without the dead time
CASES = {
    "heater": (bench.heater, 20.0, 30.0, 40.0, 0.9, lambda t: two_lags(t, 140.0, 12.0)),
    "heater, 3.3 s": (
        lambda **kwargs: bench.heater(dead_time=3.3, **kwargs),
        3.3, -15.0, 40.0, 0.9, lambda t: two_lags(t, 140.0, 12.0),
    ),
    "tank": (bench.tank, 12.0, 10.0, 30.0, 0.01, lambda t: slope_behind_a_lag(t, 4.0)),
    "flow loop": (bench.flow_loop, 0.4, 10.0, 48.0, 1.2, lambda t: two_lags(t, 0.8, 0.25)),
}  # fmt: skip


@pytest.mark.parametrize(
    ("make", "dead_time", "step", "level", "gain", "unit"), CASES.values(), ids=CASES
)
def test_a_clean_step_is_the_closed_form(make, dead_time, step, level, gain, unit):
    plant = make(**CLEAN)
    record = plant.step_record(step, name="one")
    later = np.maximum(record.time - plant.pre_step_time - dead_time, 0.0)
    # rounding of levels up to 67
    assert_allclose(record.output, level + gain * step * unit(later), atol=1e-11)
    assert record.name == "one"
    truth = plant.truth
    assert (truth.dead_time, truth.delay) == (dead_time, pytest.approx(dead_time / plant.dt))


def test_the_truth_of_an_integrating_plant_has_a_rate_and_no_gain():
    truth = bench.tank().truth
    assert truth.integrating_rate == pytest.approx(0.01)
    assert truth.gain == np.inf
    assert bench.tank(rate=-0.02).truth.gain == -np.inf
    assert truth.total_delay == pytest.approx(16.0)
    omega = 0.3
    expected = 0.01 * np.exp(-12j * omega) / (1j * omega * (4j * omega + 1))
    assert_allclose(truth.response(omega), expected, rtol=1e-12)
    with pytest.raises(OptionError, match="integrating: its response at omega=0 is infinite"):
        truth.frf(np.array([0.0, 1.0]))
    assert "0.01 %/% per s" in truth.report()


@pytest.mark.parametrize("make", [bench.heater, bench.tank, bench.flow_loop, quiet_valve])
def test_the_sampled_truth_simulates_any_record(make):
    plant = make(**CLEAN)
    moves = np.random.default_rng(0).integers(-3, 4, 40)
    held = 12.0 if make is quiet_valve else plant.steady_state[0]
    held = held + np.repeat(np.r_[0, moves], 12)
    record = plant.record(held)
    deviation = plant.truth.sampled.simulate(held - held[0])
    assert_allclose(record.output, record.output[0] + deviation, atol=1e-10)  # levels of 50
    assert_allclose(record.input, held, rtol=0)


def test_noise_disturbance_and_rounding_are_those_asked_for():
    resting = np.full(40_000, 40.0)
    noisy = bench.flow_loop(noise=0.2, disturbance=0, resolution=None).record(resting, rng=1)
    # 40 000 independent samples: 0.35 % of scatter of the standard deviation
    assert np.std(noisy.output) == pytest.approx(0.2, rel=0.015)
    slow = bench.flow_loop(noise=0, disturbance=0.3, disturbance_time=0.5, resolution=None)
    drawn = slow.record(resting, rng=2).output - 48.0
    # 4 000 samples of one correlation time in either direction: 2 % of scatter
    assert np.std(drawn) == pytest.approx(0.3, rel=0.08)
    pole = np.dot(drawn[1:], drawn[:-1]) / np.dot(drawn, drawn)
    assert pole == pytest.approx(np.exp(-0.05 / 0.5), abs=0.01)
    steps = bench.heater().step_record(rng=3).output / 0.1
    assert_allclose(steps, np.round(steps), atol=1e-9)
    again, other = (bench.heater().step_record(rng=seed).output for seed in (3, 4))
    assert_allclose(again / 0.1, steps, rtol=0)
    assert np.std(again - other) > 0.01


@pytest.mark.parametrize(
    ("error", "match", "attempt"),
    [
        (OptionError, "dead_time=-1; expected a value >= 0", lambda: bench.heater(dead_time=-1)),
        (OptionError, "rate=0; expected a value other than 0", lambda: bench.tank(rate=0)),
        (OptionError, "resolution=0", lambda: bench.flow_loop(resolution=0)),
        (OptionError, "noise=-1", lambda: bench.heater(noise=-1)),
        (OptionError, "from 20 to a value within 0-100 %", lambda: bench.heater().step_record(90)),
        (OptionError, "a step other than 0", lambda: bench.heater().step_record(0)),
        (
            DataError,
            "101 % at sample 1; expected 0-100",
            lambda: bench.tank().record([50, 101, 50]),
        ),
        (DataError, "expected N >= 3 real numbers", lambda: bench.tank().record(np.ones((2, 4)))),
    ],
)
def test_unusable_choices_are_refused(error, match, attempt):
    with pytest.raises(error, match=match):
        attempt()
