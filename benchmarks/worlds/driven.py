"""Worlds of records whose input moves all the time: random levels, binary signals, sweeps."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from ctrl_realize.numerics.actuators.friction import backlash

from .sensors import every
from .simulation import (
    DT,
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
    stepped,
    through,
)
from .steps import one_sided, piped

Rng = np.random.Generator


def pipe_with_random_flows(rng: Rng) -> Case:
    """A dead time that is a volume over the flow: levels of 1 to 3."""
    return piped(rng, levels(rng, (1.0, 1.5, 2.0, 3.0)))


def zero_on_the_left(rng: Rng) -> Case:
    """Random binary input, a lead of 0.5 to 1.5 s over three lags: overshoot."""
    return with_zero(rng, float(rng.uniform(0.5, 1.5)))


def zero_on_the_right(rng: Rng) -> Case:
    """Random binary input, a zero on the right."""
    return with_zero(rng, -float(rng.uniform(0.1, 0.4)))


def with_zero(rng: Rng, lead: float) -> Case:
    plant, u = drawn(rng, ((0.05, 0.1), (0.1, 0.25), (0.3, 0.5)), (0.05, 0.3)), binary(rng)
    fine = plant.respond(held(u))
    slope = np.append((fine[1:] - fine[:-1]) / H, 0.0)
    y = sampled(fine + lead * slope)
    total = plant.total_delay - lead
    # 20 % of a total delay that lead and lags cancel says nothing.
    clear = total > 0.5 * plant.total_delay
    return plant.case(record(u, noisy(rng, y, 0.01)), total_delay=total if clear else np.nan)


def two_clocks(rng: Rng) -> Case:
    """The output's clock is 0.5 to 1 % fast: true is the delay in the middle of the record."""
    plant, u = drawn(rng), binary(rng, 1000)
    fast = float(rng.uniform(0.005, 0.01))
    fine = plant.respond(held(u))
    index = (np.arange(u.size) - u.size / 2) * (1 - fast) + u.size / 2
    y = fine[np.clip(np.round(index * 10).astype(int), 0, fine.size - 1)]
    return plant.case(record(u, noisy(rng, y)), gain=np.nan)


def insensitive(rng: Rng) -> Case:
    """A dead zone of a fifth of the input's range about zero."""
    plant, u = drawn(rng), levels(rng, (-1.0, -0.4, 0.0, 0.4, 1.0))
    bent = np.sign(u) * np.maximum(np.abs(u) - 0.2, 0.0)
    return plant.case(record(u, noisy(rng, stepped(rng, plant, bent))), gain=np.nan)


def saturating(rng: Rng) -> Case:
    """The output ends at 60 % of its range on one side."""
    plant, u = drawn(rng), levels(rng, (-1.0, 0.0, 1.0))
    y = stepped(rng, plant, u)
    y = np.minimum(y, y.min() + 0.6 * np.ptp(y))
    return plant.case(record(u, noisy(rng, y)), gain=np.nan, total_delay=np.nan)


def rocking(rng: Rng) -> Case:
    """A sinusoidal disturbance of a fifth of the range with a period of 2 to 4 s."""
    plant, u = drawn(rng), binary(rng)
    y = stepped(rng, plant, u)
    wave = np.sin(2 * np.pi * DT * np.arange(u.size) / rng.uniform(2, 4) + rng.uniform(0, 6.28))
    return plant.case(record(u, noisy(rng, y) + 0.2 * np.ptp(y) * wave))


def wandering(rng: Rng) -> Case:
    """A random walk as large as the response."""
    plant, u = drawn(rng), binary(rng)
    y = stepped(rng, plant, u)
    walk = np.cumsum(rng.standard_normal(u.size)) / np.sqrt(u.size)
    return plant.case(record(u, noisy(rng, y) + np.ptp(y) * walk))


def equal_percentage(rng: Rng) -> Case:
    """A valve whose flow is an exponential of its lift: the gain rises fivefold."""
    plant, u = drawn(rng), levels(rng, (0.0, 0.25, 0.5, 0.75, 1.0))
    flow = 5.0**u
    return plant.case(record(u, noisy(rng, stepped(rng, plant, flow))), gain=np.nan)


def ageing(rng: Rng) -> Case:
    """The gain falls to a half during the record."""
    plant, u = drawn(rng), binary(rng, hold=15)
    y = stepped(rng, plant, u) * np.linspace(1, 0.5, u.size)
    return plant.case(record(u, noisy(rng, y)), gain=0.75 * plant.gain)


def growing_delay(rng: Rng) -> Case:
    """The dead time grows by a half during the record; true is its mean."""
    plant, u = drawn(rng), binary(rng, hold=15)
    fine = held(u)
    shift = np.linspace(0.8, 1.2, fine.size) * plant.dead_time / H
    index = np.clip(np.arange(fine.size) - shift, 0, None).astype(int)
    y = sampled(through(plant.gain * fine[index], *plant.lags))
    return plant.case(record(u, noisy(rng, y)))


def swept_wall(rng: Rng) -> Case:
    """A sweep from 0.05 to 2 Hz through ten equal lags that stand for a column."""
    dead, lag = float(rng.uniform(0.1, 0.3)), float(rng.uniform(0.03, 0.06))
    plant = Plant(round(dead / H) * H, (lag,) * 10, 2.0)
    time = DT * np.arange(1200)
    u = np.sin(2 * np.pi * (0.05 * time + (2 - 0.05) / 24 * time**2))
    return plant.case(record(u, noisy(rng, stepped(rng, plant, u))))


def sticking_ramps(rng: Rng) -> Case:
    """Ramps and rests through a valve that sticks until it is 10 % of the range behind."""
    plant = drawn(rng)
    u = np.interp(np.arange(1000), np.arange(0, 1001, 50), rng.uniform(-1, 1, 21))
    demand, stem = held(u), np.zeros(10000)
    stem[0] = demand[0]
    for k in range(1, demand.size):
        stem[k] = demand[k] if abs(demand[k] - stem[k - 1]) > 0.15 else stem[k - 1]
    y = sampled(plant.respond(stem))
    return plant.case(record(u, noisy(rng, y)), total_delay=np.nan)


def telegrams(rng: Rng) -> Case:
    """The output comes in telegrams every 5 to 12 samples and is held."""
    plant, u = drawn(rng), binary(rng, hold=12)
    return plant.case(
        record(u, every(noisy(rng, stepped(rng, plant, u)), int(rng.integers(5, 13)), rng))
    )


def gears(rng: Rng) -> Case:
    """Play of a fifth to a third of the input's range in front of the plant."""
    plant, u = drawn(rng), levels(rng, (-1.0, -0.5, 0.0, 0.5, 1.0))
    stem = backlash(held(u), float(rng.uniform(0.4, 0.7)))
    return plant.case(record(u, noisy(rng, sampled(plant.respond(stem)))), gain=np.nan)


def one_way_sensor(rng: Rng) -> Case:
    """A thermometer in a pocket that warms three times as fast as it cools."""
    plant, u = drawn(rng), levels(rng, (-1.0, 0.0, 1.0))
    fine = one_sided(late(plant.gain * held(u), plant.dead_time), 0.15, 0.45)
    return Case(record(u, noisy(rng, sampled(fine))), plant.dead_time)


def drawn_in(rng: Rng) -> Case:
    """A second input that nobody recorded moves with the first one half of the time."""
    plant, u = drawn(rng), levels(rng, (-1.0, 0.0, 1.0))
    other = 0.3 * np.where(rng.random(u.size // 40 + 1) < 0.5, 1.0, 0.0).repeat(40)[: u.size] * u
    side = stepped(rng, Plant(0.02, (0.1,), plant.gain), other)
    return plant.case(record(u, noisy(rng, stepped(rng, plant, u) + side)), gain=np.nan)


def noisy_input(rng: Rng) -> Case:
    """Noise of a third of the input in its measurement: errors in variables."""
    plant, u = drawn(rng), lfilter([0.1], [1, -0.9], binary(rng, 1000, 4))
    y = noisy(rng, stepped(rng, plant, u))
    return plant.case(record(u + 0.33 * np.std(u) * rng.standard_normal(u.size), y))


def bursts(rng: Rng) -> Case:
    """Coloured noise that comes and goes, as of flow that turns turbulent."""
    plant, u = drawn(rng), binary(rng)
    y = stepped(rng, plant, u)
    on = np.repeat(rng.random(10) < 0.4, 100)
    return plant.case(record(u, noisy(rng, y) + 0.2 * np.ptp(y) * on * coloured(rng, u.size)))


WORLDS = (
    pipe_with_random_flows,
    zero_on_the_left,
    zero_on_the_right,
    two_clocks,
    insensitive,
    saturating,
    rocking,
    wandering,
    equal_percentage,
    ageing,
    growing_delay,
    swept_wall,
    sticking_ramps,
    telegrams,
    gears,
    one_way_sensor,
    drawn_in,
    noisy_input,
    bursts,
)
