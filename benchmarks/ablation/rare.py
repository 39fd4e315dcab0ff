"""Worlds in which rules matter that touch hardly any of the other records. All simulated."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.signal import lfilter

import ctrl_realize as cr
from benchmarks.closed_loop import cases as loops
from benchmarks.worlds import driven, sensors, steps
from benchmarks.worlds import loops as answered
from benchmarks.worlds.simulation import (
    DT,
    FINE,
    Case,
    H,
    Plant,
    binary,
    coloured,
    drawn,
    held,
    late,
    levels,
    noisy,
    record,
    sampled,
    step,
    stepped,
    through,
)
from ctrl_realize.numerics.output_error.step_data import step_data
from ctrl_realize.numerics.rules import Rule
from tests import rigs

Rng = np.random.Generator


def tanks_in_a_row(rng: Rng) -> Case:
    """Six to twelve lags that differ by a tenth, 0.2 % noise."""
    count, lag = int(rng.integers(6, 13)), float(rng.uniform(0.04, 0.1))
    plant = drawn(rng, ((0.95 * lag, 1.05 * lag),) * count)
    u = step()
    return plant.case(record(u, noisy(rng, stepped(rng, plant, u), 0.002)))


def friction_behind_lags(rng: Rng) -> Case:
    """A stem behind two lags comes loose at 3 to 8 % of the step; noise of 0.2 to 2 %.

    The dead time lasts until then.
    """
    plant, u = drawn(rng), step()
    static = float(rng.uniform(0.03, 0.08))
    demand = through(held(u), *plant.lags)
    y = through(late(plant.gain * steps.pulled_loose(demand, static), plant.dead_time), 0.01)
    loose = float(np.argmax(demand[100 * FINE :] > static)) * H
    part = float(rng.uniform(0.002, 0.02))
    return plant.case(record(u, noisy(rng, sampled(y), part)), dead_time=plant.dead_time + loose)


def spiky(rng: Rng) -> Case:
    """Two to eight of 500 samples are spikes of up to five responses; 0.5 % noise."""
    plant, u = drawn(rng), step()
    y = noisy(rng, stepped(rng, plant, u), 0.005)
    at = rng.choice(np.arange(120, y.size), int(rng.integers(2, 9)), replace=False)
    y[at] += plant.gain * rng.uniform(-5.0, 5.0, at.size)
    return plant.case(record(u, y))


def seldom_updated(rng: Rng) -> Case:
    """An analyser, telegrams at random levels, or a historian with a dead band of 2 to 4 %."""
    if rng.random() < 2 / 3:
        return (sensors.analyser if rng.random() < 0.5 else driven.telegrams)(rng)
    plant, u = drawn(rng), step()
    y = noisy(rng, stepped(rng, plant, u), 0.002)
    return plant.case(record(u, sensors.stored(y, float(rng.uniform(0.02, 0.04)) * np.ptp(y))))


def held_beneath_noise(rng: Rng) -> Case:
    """An analyser holds its result for 3 to 12 samples and is read with 0.3 to 3 % noise."""
    plant, u = drawn(rng), step()
    y = sensors.every(stepped(rng, plant, u), int(rng.integers(3, 13)), rng)
    return plant.case(record(u, noisy(rng, y, 10 ** rng.uniform(-2.5, -1.5))))


def step_behind_a_filter(rng: Rng) -> Case:
    """A step behind a lag of 3 to 30 samples without noise; 1e-6 to 1e-4 of it in the output."""
    plant = drawn(rng)
    since = np.maximum(np.arange(800) - 99.0, 0.0)
    u = 1.0 - np.exp(-since / rng.uniform(3.0, 30.0))
    return plant.case(record(u, noisy(rng, stepped(rng, plant, u), 10 ** rng.uniform(-6, -4))))


def settling_in_a_long_rest(rng: Rng) -> Case:
    """The input had moved 0.3 to 1 s before the record; the step comes 1 to 3 s after its start."""
    plant = drawn(rng, ((0.1, 0.25), (0.4, 1.0)))
    before, rest = int(rng.uniform(30, 100)), int(rng.uniform(100, 300))
    u = step(500 + before + rest, before + rest)
    u[:1] = float(rng.choice([-1.0, 1.0]))
    y = noisy(rng, stepped(rng, plant, u), 0.002)
    return plant.case(record(u[before:], y[before:]))


def pulse_before(rng: Rng) -> Case:
    """A pulse of the input ends just before the record, which starts while the output rises."""
    plant = drawn(rng, ((0.1, 0.25), (0.4, 1.0)))
    before, rest = 40, int(rng.uniform(60, 150))
    u = step(500 + before + rest, before + rest)
    u[10 : int(rng.uniform(30, 40))] = float(rng.uniform(0.5, 1.0))
    y = noisy(rng, stepped(rng, plant, u), 0.002)
    return plant.case(record(u[before:], y[before:]))


def moved_before(rng: Rng) -> Case:
    """A step 0.3 to 0.9 s before the record, one after 0.1 to 0.6 s, up to five later; 1 % noise.

    All are of any height, and the earlier one begins to show before the record does.
    """
    plant, before = drawn(rng, ((0.1, 0.4),), (0.1, 0.28)), int(rng.integers(30, 90))
    first, count = int(rng.integers(10, 60)), int(rng.integers(0, 6))
    u = np.zeros(before + 400)
    for at in (20, before + first, *(before + rng.integers(first + 40, 380, count))):
        u[at:] += rng.choice([-1.0, 1.0]) * rng.uniform(0.5, 1.5)
    y = noisy(rng, stepped(rng, plant, u), 0.01)
    return plant.case(record(u[before:], y[before:]))


def little_step_in_noise(rng: Rng) -> Case:
    """Noise of 40 to 80 % of the step."""
    plant, u = drawn(rng), step(1500, 300)
    part = float(rng.uniform(0.4, 0.8))
    return plant.case(record(u, noisy(rng, stepped(rng, plant, u), part)))


def humming(rng: Rng) -> Case:
    """A line of 3 to 10 % of the step at any frequency."""
    plant, u = drawn(rng), step(600, 150)
    y = noisy(rng, stepped(rng, plant, u))
    turns = float(rng.uniform(0.03, 0.45)) * np.arange(u.size) + rng.uniform()
    return plant.case(record(u, y + rng.uniform(0.03, 0.1) * np.ptp(y) * np.sin(2 * np.pi * turns)))


def slow_noise_in_a_short_rest(rng: Rng) -> Case:
    """AR(1) noise with a pole at 0.98 and 2 % of the step; 25 to 60 samples of rest."""
    plant, u = drawn(rng), step(800, int(rng.integers(25, 61)))
    y = stepped(rng, plant, u)
    return plant.case(record(u, y + 0.02 * np.ptp(y) * coloured(rng, u.size, 0.98)))


def noise_as_slow_as_the_rest(rng: Rng) -> Case:
    """AR(1) noise with a pole at 0.9 and 2 % of the step; 40 to 120 samples of rest."""
    plant, u = drawn(rng), step(400, int(rng.integers(40, 121)))
    y = stepped(rng, plant, u)
    return plant.case(record(u, y + 0.02 * np.ptp(y) * coloured(rng, u.size, 0.9)))


def swing_after_the_step(rng: Rng) -> Case:
    """AR(1) noise of 1 % of the step that, within the dead time, swings twelve times as far as it
    does in the 20 samples of rest.
    """
    plant = replace(drawn(rng), dead_time=float(rng.uniform(0.3, 0.6)))
    u, noise = step(400, 20), np.zeros(400)
    while np.abs(noise[20:50]).max() <= 12 * np.std(noise[:20]):
        noise = coloured(rng, u.size, 0.9)
    y = stepped(rng, plant, u)
    return plant.case(record(u, y + 0.01 * np.ptp(y) * noise))


def steps_of_a_converter(rng: Rng) -> Case:
    """A converter of 10 to 40 steps over the range, hardly any noise."""
    plant, u = drawn(rng), step()
    y = noisy(rng, stepped(rng, plant, u), 0.001)
    quantum = float(np.ptp(y) / rng.uniform(10, 40))
    return plant.case(record(u, quantum * np.round(y / quantum + rng.uniform(-0.5, 0.5))))


def unequal_sensors(rng: Rng) -> Case:
    """Three records of random levels with noise of 0.3, 1 and 5 %."""
    plant = drawn(rng)
    several = []
    for part in (0.003, 0.01, 0.05):
        u = levels(rng, (-1.0, 0.0, 1.0), 600, 15)
        y = noisy(rng, stepped(rng, plant, u), part)
        several.append(record(u, y))
    return Case(tuple(several), plant.dead_time, plant.gain, plant.total_delay)


def waves_on_a_canal(rng: Rng) -> Case:
    """Noise that rings with a period of 50 to 100 samples, 1 % of the step, behind a long rest."""
    plant, u = drawn(rng), step(1000, 400)
    y, angle = stepped(rng, plant, u), 2 * np.pi / float(rng.uniform(50, 100))
    noise, e = np.zeros(u.size + 300), rng.standard_normal(u.size + 300)
    for k in range(2, noise.size):
        noise[k] = 1.94 * np.cos(angle) * noise[k - 1] - 0.97**2 * noise[k - 2] + e[k]
    noise = noise[300:] / float(np.std(noise[300:]))
    return plant.case(record(u, y + 0.01 * np.ptp(y) * noise))


def far_away(rng: Rng) -> Case:
    """A fast lag behind a dead time of 1 to 2.4 s, an input that moves every sample or two."""
    plant = drawn(rng, ((0.02, 0.1),), (1.0, 2.4))
    u = binary(rng, 1200, int(rng.integers(1, 3)))
    return plant.case(record(u, noisy(rng, stepped(rng, plant, u), 0.05)))


def stairs_up(rng: Rng) -> Case:
    """Three steps up from rest, a dead time of 0.55 to 0.8 of a stair, one lag, 0.5 % noise."""
    plant = drawn(rng, ((0.05, 0.15),), (0.55, 0.8))
    u = np.clip((np.arange(360) + 60) // 100, 0, 3).astype(np.float64)
    return plant.case(record(u, noisy(rng, stepped(rng, plant, u), 0.005)))


def load_beside_a_binary_input(rng: Rng) -> Case:
    """Two lags, a random binary input, a load of 10 to 40 % of its range from 300 to 700 on."""
    plant, u = drawn(rng, ((0.05, 0.15), (0.1, 0.25)), (0.06, 0.2)), binary(rng, 1000, 20)
    load = rng.uniform(0.2, 0.8) * step(1000, int(rng.integers(300, 700)))
    y = stepped(rng, plant, u) + stepped(rng, Plant(0.0, plant.lags, plant.gain), load)
    return plant.case(record(u, noisy(rng, y)))


def slow_disturbance(rng: Rng) -> Case:
    """A slow sine, or AR(1) noise with a pole at 0.998, as large as a third of the response."""
    plant, u = drawn(rng, ((0.05, 0.15), (0.1, 0.25)), (0.12, 0.3)), binary(rng, 1500, 8)
    y = noisy(rng, stepped(rng, plant, u))
    turns = np.arange(u.size) / rng.uniform(500, 1500) + rng.uniform()
    sine = np.sin(2 * np.pi * turns)
    slow = sine if rng.uniform() < 0.5 else coloured(rng, u.size, 0.998)
    return plant.case(record(u, y + 0.3 * np.ptp(y) * slow))


def wandering_output(rng: Rng) -> Case:
    """One lag, a coloured input, and a random walk of 5 % of the response a sample, 300 samples."""
    plant, u = drawn(rng, ((0.03, 0.06),), (0.02, 0.05)), coloured(rng, 300, 0.9)
    y = stepped(rng, plant, u)
    walk = np.cumsum(rng.standard_normal(u.size)) + rng.standard_normal(u.size)
    return plant.case(record(u, y + 0.05 * float(np.std(y)) * walk))


def noise_of_the_response(rng: Rng) -> Case:
    """Slow noise of 0.5 % throughout; in the response white noise, two to four times as large."""
    plant, u = drawn(rng, ((0.03, 0.1),), (0.2, 0.5)), step(1200, 600)
    y = stepped(rng, plant, u)
    noise = coloured(rng, u.size, 0.95)
    noise /= float(np.std(noise))
    moving = np.abs(np.gradient(y)) > 1e-6 * np.ptp(y)
    noise += float(rng.uniform(2.0, 4.0)) * moving * rng.standard_normal(u.size)
    return plant.case(record(u, y + 0.005 * np.ptp(y) * noise))


def padded_rest(rng: Rng) -> Case:
    """Samples before the step are the first value, repeated; 1 % noise from then on."""
    plant, u = drawn(rng), step(600, 150)
    y = noisy(rng, stepped(rng, plant, u), 0.01)
    y[:150] = y[0]
    return plant.case(record(u, y))


def louder_from_the_step_on(rng: Rng) -> Case:
    """Noise of 0.5 %, from the step on two to three times as much; the record ends in the rise."""
    plant, u = drawn(rng, ((0.5, 1.0), (0.2, 0.4))), step(400, 150)
    y = stepped(rng, plant, u)
    noise = rng.standard_normal(u.size)
    noise[150:] *= float(rng.uniform(2.0, 3.0))
    return plant.case(record(u, y + 0.005 * np.ptp(y) * noise))


def rest_like_a_slope(rng: Rng) -> Case:
    """AR(1) noise with a pole at 0.99 and 2 % of the step; 100 samples at rest look drifting."""
    plant, u = drawn(rng), step(400, 100)
    y = stepped(rng, plant, u)
    while True:
        seen = noisy(rng, y + 0.02 * np.ptp(y) * coloured(rng, u.size, 0.99), 0.002)
        if step_data(seen, u, DT, [(100, 100)]).drift:
            return plant.case(record(u, seen))


def drive_with_friction(rng: Rng) -> Case:
    """A drive with dry friction, a flexible shaft and a differenced encoder; slow noise of 2.5 %.

    The dead time is one to three samples.
    """
    dead_time, friction = float(rng.uniform(1, 3)), float(rng.uniform(0.2, 0.4))
    return Case(record(*rigs.drive_with_friction(rng, dead_time, friction, 0.05)), DT * dead_time)


def swinging_before(rng: Rng) -> Case:
    """A pair with a damping of 3 to 6 % still swings from a step 2 to 4 s before; 0.2 % noise."""
    size, damping = float(rng.uniform(3.0, 6.0)), float(rng.uniform(0.03, 0.06))
    late_by, earlier = float(rng.uniform(0.1, 0.5)), float(rng.uniform(2.0, 4.0))
    time = DT * np.arange(2400)

    def response(since: np.ndarray) -> np.ndarray:
        along = size * np.sqrt(1 - damping**2) * np.maximum(since - late_by, 0.0)
        decay = damping / np.sqrt(1 - damping**2)
        return 1 - np.exp(-decay * along) * (np.cos(along) + decay * np.sin(along))

    u, y = step(2400, 600), response(time + earlier) + 2.0 * response(time - 600 * DT)
    return Case(record(u, noisy(rng, y, 0.002)), late_by, 2.0)


def faster_than_a_sample(rng: Rng) -> Case:
    """One lag of a fifth to four fifths of a sample, 1 % noise."""
    plant, u = drawn(rng, ((0.002, 0.008),), (0.05, 0.3)), step(400, 150)
    return plant.case(record(u, noisy(rng, stepped(rng, plant, u), 0.01)))


def long_ramp(rng: Rng) -> Case:
    """An integrator and a lag of 3 to 10 samples, 4000 samples; noise of 0.1 % of 10 s of ramp."""
    plant, u = drawn(rng, ((0.03, 0.1),), (0.12, 0.4)), step(4000, 200)
    slope = plant.respond(held(u))
    y = sampled(H * (np.cumsum(slope) - slope / 2))
    noise = 0.01 * abs(plant.gain) * rng.standard_normal(u.size)
    return Case(record(u, y + noise), plant.dead_time)


WORLDS = (
    tanks_in_a_row,
    settling_in_a_long_rest,
    pulse_before,
    little_step_in_noise,
    humming,
    slow_noise_in_a_short_rest,
    steps_of_a_converter,
    unequal_sensors,
    waves_on_a_canal,
    far_away,
    slow_disturbance,
    wandering_output,
    noise_of_the_response,
)


def running_loop(rng: Rng, noise: tuple[float, float] = (0.01, 0.15)) -> Case:
    """A gain of 0.5 to 1.5, with an integral or not, and 6 to 15 levels of a set point.

    The set point is not recorded; the noise of 1 to 15 % has a pole at 0.6 to 0.9.
    """
    count, gain, slow = 100 * int(rng.integers(6, 16)), rng.uniform(0.5, 1.5), rng.uniform(0.6, 0.9)
    integral = float(rng.choice([0.0, 0.04]))
    wanted = np.repeat(rng.choice([-1.0, 1.0], count // 100), 100)
    white = np.sqrt(1 - slow**2) * rng.standard_normal(count)
    added = rng.uniform(*noise) * lfilter([1.0], [1.0, -slow], white)
    u, y, state, left = np.zeros(count), np.zeros(count), 0.0, 0.0
    for k in range(count):
        # a lag of ten samples behind a dead time of three, and the hold
        state += (1 - np.exp(-0.1)) * ((u[k - 4] if k > 3 else 0.0) - state)
        y[k] = state + added[k]
        left += wanted[k] - y[k]
        u[k] = gain * (wanted[k] - y[k] + integral * left)
    return Case(record(u, y), 3 * DT, 1.0, 4 * DT)


def quiet_loop(rng: Rng) -> Case:
    """As `running_loop`, with a noise of 0.01 %, beside which no controller is told."""
    return running_loop(rng, (1e-4, 1e-4))


def rounded_loop(rng: Rng) -> Case:
    """A loop of `benchmarks.closed_loop`, rounded to 0.7 to 2 usual changes between samples.

    The set point, which moves three times, is not recorded.
    """
    plant = loops.PLANTS[str(rng.choice(list(loops.PLANTS)))]
    noise = loops.CASES[str(rng.choice(["white", "AR(0.9)"]))]
    _, made = loops.record(plant, noise, "three", int(rng.integers(2**31)))
    signals = np.stack([np.ravel(made.input), np.ravel(made.output)])
    change = np.median(np.abs(np.diff(signals)), axis=1, keepdims=True)
    step = rng.uniform(0.7, 2.0) * change
    u, y = step * np.round(signals / step)
    total = plant.dead_time + sum(plant.lags)
    return Case(cr.Record(made.time, u, y), plant.dead_time, loops.GAIN, total)


def coarse_controller(rng: Rng) -> Case:
    """A loop without its set point, which moves once; most outputs of the controller are alike."""
    plant = loops.PLANTS[str(rng.choice(["0.4", "0.3", "1", "1.5"]))]
    _, made = loops.record(plant, loops.CASES["quantised"], "one", int(rng.integers(2**31)))
    return Case(made, plant.dead_time, loops.GAIN, plant.dead_time + sum(plant.lags))


MADE_FOR = {
    Rule.UNLIKE: noise_of_the_response,
    Rule.WHITENED: waves_on_a_canal,
    Rule.COLOUR: slow_noise_in_a_short_rest,
    Rule.SHORT_REST: noise_as_slow_as_the_rest,
    Rule.GOES_ON: noise_as_slow_as_the_rest,
    Rule.SLOW_REST: noise_as_slow_as_the_rest,
    Rule.CHAINS: tanks_in_a_row,
    Rule.IMPROVING: tanks_in_a_row,
    Rule.DIFFUSION: steps.wall,
    Rule.SLOWER: faster_than_a_sample,
    Rule.MEANS: little_step_in_noise,
    Rule.EXPONENTIAL: settling_in_a_long_rest,
    Rule.BEND: pulse_before,
    Rule.SWING: swinging_before,
    Rule.BRIEF_REST: moved_before,
    Rule.HUM: humming,
    Rule.LOAD: steps.load_moves,
    Rule.COARSE: steps_of_a_converter,
    Rule.COLOURED: slow_disturbance,
    Rule.FOLLOWED: slow_disturbance,
    Rule.INTEGRATOR: long_ramp,
    Rule.CORRELATION: far_away,
    Rule.FROM_REST: stairs_up,
    Rule.SAMPLED_LOADS: load_beside_a_binary_input,
    Rule.RINGING: wandering_output,
    Rule.RECORD_NOISE: unequal_sensors,
    Rule.CURVES: step_behind_a_filter,
    Rule.SPIKES: spiky,
    Rule.REPEATS: seldom_updated,
    Rule.HOLDS: held_beneath_noise,
    Rule.CONSTANT_REST: padded_rest,
    Rule.LOUDER: louder_from_the_step_on,
    Rule.FRICTION: friction_behind_lags,
    Rule.ROUNDED: steps_of_a_converter,
    Rule.MOTION_EVIDENCE: rest_like_a_slope,
    Rule.NO_SLOPE: rest_like_a_slope,
    Rule.NO_DISPERSION: sensors.coarse,
    Rule.PINNED: drive_with_friction,
    Rule.HELD_STEPS: quiet_loop,
    Rule.LOOP: running_loop,
    Rule.LOOP_ROUNDED: rounded_loop,
    Rule.PAST: coarse_controller,
    Rule.SLOW_TURN: answered.relay_with_load,
    Rule.NOISE_ONSET: swing_after_the_step,
}
"""Rules, and the world that each was made for."""
