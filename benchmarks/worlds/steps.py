"""Worlds of step records of plants and actuators that are more, or less, than lags."""

from __future__ import annotations

import numpy as np

from ctrl_realize.numerics.actuators.friction import backlash
from ctrl_realize.numerics.actuators.limits import slew_limited

from .simulation import (
    DT,
    Case,
    H,
    Plant,
    drawn,
    held,
    late,
    noisy,
    record,
    sampled,
    step,
    stepped,
    through,
)

Rng = np.random.Generator


def ends_while_rising(rng: Rng) -> Case:
    """Three lags of 0.25 to 0.6 s behind 0.4 s; 1.1 s of record after the step."""
    plant = Plant(0.4, tuple(rng.uniform(0.25, 0.6, 3)), 2.0)
    u = step(210)
    y = stepped(rng, plant, u)
    return plant.case(record(u, y + 0.002 * np.ptp(y) * rng.standard_normal(y.size)))


def slow_tail(rng: Rng) -> Case:
    """A fast lag and one of 2 s with 30 % of the gain; 2.5 s of record."""
    plant, u = drawn(rng), step(350)
    slow = Plant(plant.dead_time, (2.0,), plant.gain)
    y = 0.7 * stepped(rng, plant, u) + 0.3 * stepped(rng, slow, u)
    total = 0.7 * plant.total_delay + 0.3 * slow.total_delay
    return plant.case(record(u, noisy(rng, y)), total_delay=total)


def moved_before(rng: Rng) -> Case:
    """The input had moved within the dead time before the record began, by half as much."""
    plant = drawn(rng)
    ago = int(rng.uniform(0.1, 0.9) * plant.dead_time / DT)
    before = 1 + ago
    rest = int(rng.uniform(0.2, 0.7) * plant.dead_time / DT)
    u = step(500 + before + rest, before + rest)
    u[:1] = float(rng.choice([-0.5, 0.5]))
    y = noisy(rng, stepped(rng, plant, u))
    return plant.case(record(u[before:], y[before:]))


def still_coming_to_rest(rng: Rng) -> Case:
    """The input had moved 0.3 to 1 s before the record; the step comes 0.15 s after its start."""
    plant = drawn(rng)
    before = int(rng.uniform(30, 100))
    u = step(515 + before, before + 15)
    u[:1] = float(rng.choice([-1.0, 1.0]))
    y = noisy(rng, stepped(rng, plant, u))
    return plant.case(record(u[before:], y[before:]))


def slewing(rng: Rng) -> Case:
    """The actuator needs 0.3 to 1 s for the step."""
    plant, u = drawn(rng), step()
    duration = float(rng.uniform(0.3, 1.0))
    y = sampled(plant.respond(slew_limited(held(u), 1 / duration, 1 / duration, H)))
    return plant.case(record(u, noisy(rng, y)), total_delay=plant.total_delay + duration / 2)


def sticking(rng: Rng) -> Case:
    """A positioner's demand has to pull the stem loose: 3 to 8 % of the step, half in motion."""
    plant, u = drawn(rng), step()
    static = float(rng.uniform(0.03, 0.08))
    stem = pulled_loose(through(held(u), plant.lags[0]), static)
    y = sampled(through(late(plant.gain * stem, plant.dead_time), plant.lags[1]))
    loose = -plant.lags[0] * np.log(1 - static)
    return plant.case(record(u, noisy(rng, y)), dead_time=plant.dead_time + loose, gain=plant.gain)


def pulled_loose(demand: np.ndarray, static: float) -> np.ndarray:
    """Follow a demand at half the distance `static` at which it sets a stem in motion."""
    stem, moving = np.zeros_like(demand), False
    for k in range(1, demand.size):
        pull = demand[k] - stem[k - 1]
        moving = abs(pull) > static * (0.5 if moving else 1.0)
        stem[k] = demand[k] - np.sign(pull) * static / 2 if moving else stem[k - 1]
    return stem


def play(rng: Rng) -> Case:
    """A gear with a play of 2 to 6 % of the step between the actuator's lag and the plant.

    The gear is in the middle of it, and the dead time lasts until it takes the plant along.
    """
    plant, u = drawn(rng), step()
    width = float(rng.uniform(0.02, 0.06))
    stem = backlash(through(held(u), plant.lags[0]), width)
    y = sampled(through(late(plant.gain * stem, plant.dead_time), plant.lags[1]))
    taken = -plant.lags[0] * np.log(1 - width / 2)
    return plant.case(record(u, noisy(rng, y)), dead_time=plant.dead_time + taken)


def recycle(rng: Rng) -> Case:
    """A third of the product returns to the feed after a way of 0.3 to 1 s."""
    plant, u = drawn(rng), step(800)
    part, way = 0.33, round(float(rng.uniform(0.3, 1.0)) / H)
    fine, feed = held(u), late(held(u), plant.dead_time)
    out, (a, b) = np.zeros((2, fine.size)), np.exp(-H / np.array(plant.lags))
    for k in range(1, fine.size):
        back = part * out[1, k - way] if k >= way else 0.0
        out[0, k] = a * out[0, k - 1] + (1 - a) * (feed[k - 1] + back)
        out[1, k] = b * out[1, k - 1] + (1 - b) * out[0, k - 1]
    y = plant.gain * sampled(out[1])
    around = sum(plant.lags) + way * H
    total = plant.total_delay + part / (1 - part) * around
    return plant.case(record(u, noisy(rng, y)), gain=plant.gain / (1 - part), total_delay=total)


def wall(rng: Rng) -> Case:
    """Heat through a wall, 1/cosh(sqrt(T s)), behind the dead time: 12 modes of it."""
    plant, u = drawn(rng), step()
    T = float(rng.uniform(0.5, 1.2))
    time = DT * (np.arange(u.size) - 100) - plant.dead_time
    odd = 2 * np.arange(30) + 1
    sign = np.where(odd % 4 == 1, 1.0, -1.0)
    decay = np.exp(-np.outer(np.clip(time, 0, None), (odd * np.pi / 2) ** 2 / T))
    y = plant.gain * np.where(time > 0, 1 - 4 / np.pi * (decay * sign / odd).sum(axis=1), 0.0)
    return plant.case(record(u, noisy(rng, y)), total_delay=plant.dead_time + T / 2)


def wrong_way(rng: Rng) -> Case:
    """A drum that shrinks and swells: a zero on the right at 2 to 6 rad/s."""
    plant, u = drawn(rng), step()
    zero = float(rng.uniform(2, 6))
    fine = plant.respond(held(u))
    y = sampled(fine - np.gradient(fine, H) / zero)
    total = plant.total_delay + 1 / zero
    return plant.case(record(u, noisy(rng, y)), total_delay=total)


def bypass(rng: Rng) -> Case:
    """A third of the flow takes a way that is 0.3 to 0.6 s longer."""
    plant, u = drawn(rng), step()
    longer = Plant(plant.dead_time + float(rng.uniform(0.3, 0.6)), plant.lags, plant.gain)
    y = (2 * stepped(rng, plant, u) + stepped(rng, longer, u)) / 3
    total = (2 * plant.total_delay + longer.total_delay) / 3
    return plant.case(record(u, noisy(rng, y)), total_delay=total)


def leaking_tank(rng: Rng) -> Case:
    """A level that goes on for 4 s with a time constant of 20 s."""
    plant, u = drawn(rng), step(500)
    slow = Plant(plant.dead_time, (20.0, plant.lags[0]), plant.gain)
    return slow.case(record(u, noisy(rng, stepped(rng, slow, u))))


def up_and_down(heights: tuple[float, ...], hold: int = 200) -> np.ndarray:
    return np.concatenate([np.zeros(60), *(np.full(hold, height) for height in heights)])


def fills_faster_than_it_empties(rng: Rng) -> Case:
    """One lag upwards, twice to four times as long downwards: steps up and down."""
    plant, u = drawn(rng), up_and_down((1.0, 0.0, 1.0, 0.0))
    slower = float(rng.uniform(2, 4))
    demand = late(plant.gain * held(u), plant.dead_time)
    y = sampled(one_sided(demand, 0.25, 0.25 * slower))
    return Case(record(u, noisy(rng, y)), plant.dead_time, plant.gain)


def one_sided(demand: np.ndarray, up: float, down: float) -> np.ndarray:
    """Lag with one time constant for rising and another for falling outputs."""
    out = np.zeros_like(demand)
    for k in range(1, demand.size):
        away = demand[k - 1] - out[k - 1]
        out[k] = out[k - 1] + away * H / (up if away > 0 else down)
    return out


def delay_with_flow(rng: Rng) -> Case:
    """A pipe: the dead time is a volume over the flow, which is the input, 1 to 3."""
    flows = 1.0 + rng.permutation([0.0, 1.0, 2.0])
    u = np.concatenate([np.full(60, flows[0]), *(np.full(220, flow) for flow in flows[1:])])
    return piped(rng, np.append(u, np.full(220, flows[0])))


def piped(rng: Rng, u: np.ndarray) -> Case:
    """Let what enters a pipe come out when the flow has filled it; then a lag.

    True is the dead time at the mean flow.
    """
    volume, gain = float(rng.uniform(0.5, 0.8)), 2.0
    flow = held(u)
    filled = np.cumsum(flow) * H
    entered = np.interp(filled - volume, filled, np.arange(flow.size), left=0.0)
    y = sampled(through(gain * flow[entered.astype(int)], 0.3))
    return Case(record(u, noisy(rng, y)), volume / float(flow.mean()), gain)


def magnetic(rng: Rng) -> Case:
    """Hysteresis of 10 to 20 % between the lag and the sensor: staircase up and down."""
    plant, u = drawn(rng), up_and_down((0.5, 1.0, 0.5, 0.0), 160)
    y = sampled(backlash(plant.respond(held(u)), float(rng.uniform(0.1, 0.2)) * plant.gain))
    return plant.case(record(u, noisy(rng, y)), gain=np.nan, total_delay=np.nan)


def fouling(rng: Rng) -> Case:
    """The gain falls by a third to a half during the record: steps up and down."""
    plant, u = drawn(rng), up_and_down((1.0, 0.0, 1.0, 0.0))
    y = stepped(rng, plant, u) * np.linspace(1, rng.uniform(0.5, 0.67), u.size)
    return plant.case(record(u, noisy(rng, y)), gain=np.nan, total_delay=np.nan)


def ringing(rng: Rng) -> Case:
    """Three resonances behind the dead time, as of a long shaft."""
    plant, u = drawn(rng), step()
    time = np.clip(DT * (np.arange(u.size) - 100) - plant.dead_time, 0, None)
    y = np.zeros(u.size)
    for part, hz in zip((0.6, 0.3, 0.1), rng.uniform(1, 8, 3), strict=True):
        w, zeta = 2 * np.pi * hz, 0.15
        fast = w * np.sqrt(1 - zeta**2)
        wave = np.cos(fast * time) + zeta / np.sqrt(1 - zeta**2) * np.sin(fast * time)
        y += part * plant.gain * (1 - np.exp(-zeta * w * time) * wave)
    return plant.case(record(u, noisy(rng, y)), total_delay=np.nan)


def split_range(rng: Rng) -> Case:
    """A dead zone: the valve opens only from 10 to 20 % of the step on, behind its lag."""
    plant, u = drawn(rng), step()
    zone = float(rng.uniform(0.1, 0.2))
    stem = np.maximum(through(held(u), plant.lags[0]) - zone, 0.0)
    y = sampled(through(late(plant.gain * stem, plant.dead_time), plant.lags[1]))
    opens = -plant.lags[0] * np.log(1 - zone)
    return Case(record(u, noisy(rng, y)), plant.dead_time + opens, plant.gain * (1 - zone))


def load_moves(rng: Rng) -> Case:
    """A load of 10 to 80 % of the response moves during the test, through a lag of its own."""
    plant, u = drawn(rng), step()
    load = float(rng.choice([-1, 1]) * rng.choice([0.1, 0.3, 0.8])) * plant.gain
    moved = np.where(np.arange(u.size) < rng.integers(200, 500), 0.0, load)
    other = sampled(through(held(moved), float(rng.uniform(0.1, 0.6))))
    return plant.case(record(u, noisy(rng, stepped(rng, plant, u)) + other))


WORLDS = (
    ends_while_rising,
    slow_tail,
    moved_before,
    still_coming_to_rest,
    slewing,
    sticking,
    play,
    recycle,
    wall,
    wrong_way,
    bypass,
    leaking_tank,
    fills_faster_than_it_empties,
    delay_with_flow,
    magnetic,
    fouling,
    ringing,
    split_range,
    load_moves,
)
