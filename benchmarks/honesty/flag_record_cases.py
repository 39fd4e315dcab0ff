"""Worlds for the flags that a record raises against any model of it."""

from __future__ import annotations

import control as ct
import numpy as np
from scipy.signal import lfilter

import ctrl_realize as cr

from ..worlds import described, driven, loops, sensors, steps
from ..worlds.simulation import World
from .flag_case import Codes, FlagCase, Run, codes


def fitted(world: World) -> Run:
    """Fit a record of a world, the seed being its own."""

    def run(seed: int) -> Codes:
        record = world(np.random.default_rng([seed, 41])).records
        return codes(cr.fit_output_error(record).fit)

    return run


def _case(code: str, due: World, not_due: World, result: str = "fit_output_error") -> FlagCase:
    names = [f"worlds: {world.__name__}" for world in (due, not_due)]
    return FlagCase(result, code, names[0], fitted(due), names[1], fitted(not_due))


def recorded_late(samples: int) -> Run:
    """Three levels into a lag behind five samples in slow noise, the input stored too late."""

    def run(seed: int) -> Codes:
        rng, size = np.random.default_rng([seed, 42]), 800
        u = np.repeat(rng.choice([-1.0, 0.0, 1.0], size // 20 + 2), 20)[: size + 40]
        plant = cr.delayed_ss(ct.tf([2.0], [0.3, 1]), dead_time=0.1, dt=0.02)
        noise = lfilter([1.0], [1, -0.97], rng.standard_normal(size + 40))
        y = np.ravel(plant.simulate(u)) + 0.05 * noise
        stored = u[40 - samples : size - samples], y[40:size]
        return codes(cr.fit_output_error(cr.Record(0.02 * np.arange(size - 40), *stored)).fit)

    return run


def stuck(part: float) -> Run:
    """One lag, whose sensor holds its value for a part of the record from the middle on."""

    def run(seed: int) -> Codes:
        record = described.one_lag(np.random.default_rng([seed, 43])).records
        y, first = record.output.copy(), record.n_samples // 2
        y[first : first + round(part * y.size)] = y[first]
        return codes(cr.fit_output_error(cr.Record(record.time, record.input, y)).fit)

    return run


def seldom_stored(part: float) -> Run:
    """A plain step whose output is stored when it has changed by a part of its range."""

    def run(seed: int) -> Codes:
        record = described.two_lags(np.random.default_rng([seed, 45])).records
        y = np.ravel(record.output)
        y = sensors.stored(y, part * np.ptp(y))
        return codes(cr.fit_output_error(cr.Record(record.time, record.input, y)).fit)

    return run


def without(where: str) -> Run:
    """One lag of 0.3 s behind 0.5 s, without samples where its response begins, or later."""

    def run(seed: int) -> Codes:
        rng, t = np.random.default_rng([seed, 44]), 0.02 * np.arange(400)
        y = np.where(t < 1.5, 0.0, -np.expm1(-(t - 1.5) / 0.3)) + 0.01 * rng.standard_normal(400)
        first = 1.3 if where == "onset" else 2.0
        y[(t > first) & (t < first + 0.4)] = np.nan
        return codes(cr.fit_output_error(cr.Record(t, t >= 1.0, y, missing="keep")).fit)

    return run


def beside_a_sine(amplitude: float) -> Run:
    """A random binary input into a lag behind ten samples, and a sine with a period of 3 s."""

    def run(seed: int) -> Codes:
        rng, size = np.random.default_rng([seed, 43]), 1200
        u = np.repeat(rng.choice([-1.0, 1.0], size // 15), 15)
        plant = cr.delayed_ss(ct.tf([2.0], [0.3, 1]), dead_time=0.2, dt=0.02)
        time = 0.02 * np.arange(size)
        sine = amplitude * np.sin(2 * np.pi * time / 3 + rng.uniform(0, 2 * np.pi))
        y = np.ravel(plant.simulate(u)) + sine + 0.03 * rng.standard_normal(size)
        return codes(cr.fit_output_error(cr.Record(time, u, y)).fit)

    return run


MOVING = "fit_output_error, moving input"
CASES = [
    FlagCase(
        MOVING,
        "noncausal",
        "input stored ten samples late",
        recorded_late(10),
        "input stored in time",
        recorded_late(0),
    ),
    _case("gain_not_resolved", steps.ends_while_rising, described.one_lag),
    _case("not_settled", steps.ends_while_rising, described.two_lags),
    FlagCase(
        "fit_output_error",
        "held_output",
        "stored when it has changed by a twelfth",
        seldom_stored(1 / 12),
        "stored with all digits",
        seldom_stored(0.0),
    ),
    _case("repeats_left_out", sensors.analyser, described.fine_converter),
    _case("output_at_limit", sensors.clipped, described.one_lag),
    FlagCase(
        "fit_output_error",
        "stuck_output",
        "a tenth of the samples at one value",
        stuck(0.1),
        "a hundredth of the samples at one value",
        stuck(0.01),
    ),
    FlagCase(
        "fit_output_error",
        "onset_in_gap",
        "no samples for 0.4 s where the response begins",
        without("onset"),
        "no samples for 0.4 s while it rises",
        without("rise"),
    ),
    _case("earlier_input", steps.moved_before, described.two_lags),
    _case("not_linear", steps.fills_faster_than_it_empties, described.several_steps),
    _case("feedback", loops.set_points, described.random_binary, MOVING),
    _case("not_linear", driven.pipe_with_random_flows, described.random_levels, MOVING),
    _case("gain_not_resolved", driven.drawn_in, described.random_levels, MOVING),
    FlagCase(
        MOVING,
        "cancelled_pair",
        "a sinusoidal disturbance of a quarter of the response",
        beside_a_sine(0.5),
        "no such disturbance",
        beside_a_sine(0.0),
    ),
    _case("time_varying", driven.ageing, described.random_levels, MOVING),
]
