"""Simulated records through actuators, with what is true of them. Noise is 0.5 % of the range."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

import ctrl_realize as cr
from ctrl_realize.numerics.actuators.friction import backlash, kano
from ctrl_realize.numerics.actuators.limits import slew_limited

from ..honesty.worlds import DT as HONESTY_DT
from ..honesty.worlds import NOISES, step_case
from ..worlds.simulation import Case, H, drawn, held, noisy, record, sampled, step
from ..worlds.steps import fills_faster_than_it_empties, play, slewing, sticking

Rng = np.random.Generator
LAGS = ((1, 1), (2, 2), (3, 3))
"""Structures for staircases, to save time."""


@dataclass(frozen=True, eq=False)
class Trial:
    """Records, the actuator to ask for, and what is true; NaN or nothing where it is not judged."""

    records: cr.Record | tuple[cr.Record, ...]
    actuator: str
    dead_time: float
    values: dict[str, float] = field(default_factory=dict)
    structures: tuple[tuple[int, int], ...] | None = None


def staircase(moves: list[float], hold: int) -> np.ndarray:
    return np.repeat(np.cumsum([0.0, *moves]), hold)


def slew_rate(rng: Rng) -> Trial:
    """One step through a slew limit that needs 0.3 to 1 s for it, two lags behind."""
    plant, u = drawn(rng), step()
    rate = 1 / float(rng.uniform(0.3, 1.0))
    y = sampled(plant.respond(slew_limited(held(u), rate, rate, H)))
    return Trial(record(u, noisy(rng, y)), "slew_rate", plant.dead_time, {"slew_rate": rate})


def dead_band(rng: Rng) -> Trial:
    """Staircase of ten moves of a quarter of the range, with a dead band of 3 to 10 % of it."""
    plant = drawn(rng)
    u = staircase([0.25, 0.25, 0.25, -0.25, -0.25, -0.25, 0.25, -0.25, 0.5, 0.5], 150)
    width = float(rng.uniform(0.03, 0.1))
    y = sampled(plant.respond(backlash(held(u), width, float(rng.uniform(-1, 1)))))
    return Trial(record(u, noisy(rng, y)), "dead_band", plant.dead_time, {"dead_band": width}, LAGS)


def stiction(rng: Rng) -> Trial:
    """Three steps of 1.5, a staircase of 60 steps of 0.08; J of 0.4 to 0.7, S 0.2 to 0.5 more."""
    plant = drawn(rng, ((0.03, 0.06), (0.06, 0.1)))
    # In small steps alone, a dead time is that of a slip at the next step: large ones tell it.
    large = staircase([1.5, -1.5, 1.5], 100)
    u = np.concatenate([large, 1.5 + staircase([0.08] * 12 + [-0.08] * 24 + [0.08] * 24, 20)])
    jump = float(rng.uniform(0.4, 0.7))
    stick = jump + float(rng.uniform(0.2, 0.5))
    # Held on the fine grid, a command pauses within every sample, as it does between steps.
    y = sampled(plant.respond(kano(held(u), stick, jump, 1.0)))
    return Trial(
        record(u, noisy(rng, y)), "stiction", plant.dead_time, {"S": stick, "J": jump}, LAGS
    )


def linear_step(rng: Rng) -> Trial:
    """R1 to R4, one step."""
    plant = str(rng.choice(["R1", "R2", "R3", "R4"]))
    case = step_case("white", plant, 0.005, int(rng.integers(10**6)))
    return Trial(case.record, "slew_rate", case.delay * HONESTY_DT)


def linear_staircase(rng: Rng) -> Trial:
    """Two lags and the staircase of the dead band."""
    plant = drawn(rng)
    u = staircase([0.25, 0.25, 0.25, -0.25, -0.25, -0.25, 0.25, -0.25, 0.5, 0.5], 150)
    y = sampled(plant.respond(held(u)))
    return Trial(record(u, noisy(rng, y)), "dead_band", plant.dead_time, {}, LAGS)


def of_world(world: Callable[[Rng], Case], actuator: str) -> Callable[[Rng], Trial]:
    def made(rng: Rng) -> Trial:
        case = world(rng)
        return Trial(case.records, actuator, case.dead_time)

    made.__name__, made.__doc__ = world.__name__, world.__doc__
    return made


def of_honesty(name: str) -> Callable[[Rng], Trial]:
    def made(rng: Rng) -> Trial:
        noise = float(rng.choice(NOISES))
        case = step_case("wrong structure", name, noise, int(rng.integers(10**6)))
        return Trial(case.record, "auto", case.delay * HONESTY_DT)

    made.__name__ = name.replace(" ", "_") + "_behind_the_lags"
    made.__doc__ = f"{name} behind the lags of R2 or R3, noise 0.1 to 2 % (`honesty`)"
    return made


ESTIMATED = (slew_rate, dead_band, stiction)
LINEAR = (linear_step, linear_staircase)
WORLDS = (
    of_world(slewing, "auto"),
    of_honesty("slew limit"),
    of_world(sticking, "auto"),
    of_honesty("static friction"),
    of_world(play, "auto"),
    of_world(fills_faster_than_it_empties, "slew_rate"),
)
CASES = (*ESTIMATED, *LINEAR, *WORLDS)
