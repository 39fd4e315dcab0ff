"""Simulated records through actuators, with what is true of them. Noise is 0.5 % of the range."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

import ctrl_realize as cr
from ctrl_realize.actuators import Characteristic
from ctrl_realize.numerics.actuators.friction import backlash, kano
from ctrl_realize.numerics.actuators.limits import slew_limited

from ..honesty.worlds import DT as HONESTY_DT
from ..honesty.worlds import NOISES, step_case
from ..worlds.simulation import DT, Case, H, Plant, drawn, held, noisy, record, sampled, step
from ..worlds.steps import fills_faster_than_it_empties, play, slewing, sticking

Rng = np.random.Generator
LAGS = ((1, 1), (2, 2), (3, 3))
"""Structures for staircases, to save time."""
_SHOWN = (30, 60, 80)  # levels whose flows are judged


@dataclass(frozen=True, eq=False)
class Trial:
    """Records, the actuator to ask for, and what is true; NaN or nothing where it is not judged.

    Errors of `values` are parts of themselves, or of `sizes` where there is one.
    """

    records: cr.Record | tuple[cr.Record, ...]
    actuator: str
    dead_time: float
    values: dict[str, float] = field(default_factory=dict)
    structures: tuple[tuple[int, int], ...] | None = None
    sizes: dict[str, float] = field(default_factory=dict)


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
    jump = float(rng.uniform(0.4, 0.7))
    stick = jump + float(rng.uniform(0.2, 0.5))
    made = small_steps(rng, lambda u: kano(u, stick, jump, 1.0), plant)
    return Trial(made, "stiction", plant.dead_time, {"S": stick, "J": jump}, LAGS)


def small_steps(rng: Rng, moved: Callable[[np.ndarray], np.ndarray], plant: Plant) -> cr.Record:
    # In small steps alone, a dead time is that of a slip at the next step: large ones tell it.
    large = staircase([1.5, -1.5, 1.5], 100)
    u = np.concatenate([large, 1.5 + staircase([0.08] * 12 + [-0.08] * 24 + [0.08] * 24, 20)])
    # Held on the fine grid, a command pauses within every sample, as it does between steps.
    y = sampled(plant.respond(moved(held(u))))
    return record(u, noisy(rng, y))


def up_and_down(rng: Rng, plant: Plant, up: float, down: float) -> cr.Record:
    u = staircase([1.0, -1.0, 0.6, -0.6], 200)
    y = sampled(plant.respond(slew_limited(held(u), up, down, H)))
    return record(u, noisy(rng, y))


def slew_rates(rng: Rng) -> Trial:
    """Two steps up and down; opening takes 0.3 to 1 s, closing 1.5 to 3 times as long"""
    plant = drawn(rng)
    up = 1 / float(rng.uniform(0.3, 1.0))
    down = up / float(rng.uniform(1.5, 3.0))
    truth = {"slew_rate_opening": up, "slew_rate_closing": down}
    return Trial(up_and_down(rng, plant, up, down), "slew_rate", plant.dead_time, truth, LAGS)


def one_slew_rate(rng: Rng) -> Trial:
    """Two steps up and down, one rate for both directions: 0.3 to 1 s"""
    plant = drawn(rng)
    rate = 1 / float(rng.uniform(0.3, 1.0))
    return Trial(
        up_and_down(rng, plant, rate, rate), "slew_rate", plant.dead_time, {"slew_rate": rate}, LAGS
    )


POSITIONS = staircase([10.0, 10.0, 10.0, 10.0, -20.0, -10.0, -20.0, -20.0, 10.0], 120)
"""Nine moves through 20 to 90 % of the travel, from 50 %."""


def positions(rng: Rng, moved: Callable[[np.ndarray], np.ndarray], plant: Plant) -> cr.Record:
    u = 50.0 + POSITIONS
    y = sampled(plant.respond(moved(held(u))))
    return cr.Record(DT * np.arange(u.size), u, noisy(rng, y), units={"u": "%"})


def end_of_travel(rng: Rng) -> Trial:
    """Staircase of nine moves, 20 to 90 %; the travel ends 3 to 15 % before the highest command"""
    plant, cut = drawn(rng), float(rng.uniform(3.0, 15.0))
    made = positions(rng, lambda u: np.minimum(u, 90.0 - cut), plant)
    truth, sizes = {"travel_high": 90.0 - cut}, {"travel_high": cut}
    return Trial(made, "saturation", plant.dead_time, truth, LAGS, sizes)


def both_ends(rng: Rng) -> Trial:
    """The same, with both ends within the commands by 3 to 15 %"""
    plant, (below, above) = drawn(rng), rng.uniform(3.0, 15.0, 2).tolist()
    made = positions(rng, lambda u: np.clip(u, 20.0 + below, 90.0 - above), plant)
    truth = {"travel_low": 20.0 + below, "travel_high": 90.0 - above}
    sizes = {"travel_low": below, "travel_high": above}
    return Trial(made, "saturation", plant.dead_time, truth, LAGS, sizes)


def characteristic(rng: Rng, plug: Callable[[np.ndarray], np.ndarray]) -> Trial:
    plant = drawn(rng)
    low, high = plug(np.array([20.0, 90.0]))
    flows = (plug(np.array(_SHOWN, dtype=float)) - low) / (high - low)
    truth = {f"flow_at_{u}": float(flow) for u, flow in zip(_SHOWN, flows, strict=True)}
    made = positions(rng, plug, plant)
    return Trial(made, "characteristic", plant.dead_time, truth, LAGS)


def equal_percentage(rng: Rng) -> Trial:
    """The same staircase through equal percentages of rangeability 5 to 50: flows at its levels"""
    ratio = float(np.exp(rng.uniform(np.log(5), np.log(50))))
    return characteristic(rng, Characteristic("equal-percentage", rangeability=ratio).simulate)


def quick_opening(rng: Rng) -> Trial:
    """The same staircase through a travel to the power of 0.4 to 0.6: flows at its levels"""
    power = float(rng.uniform(0.4, 0.6))
    return characteristic(rng, lambda u: u**power)


def resolution(rng: Rng) -> Trial:
    """The record of stiction, with S = J of 0.4 to 0.7"""
    plant, step = drawn(rng, ((0.03, 0.06), (0.06, 0.1))), float(rng.uniform(0.4, 0.7))
    made = small_steps(rng, lambda u: kano(u, step, step, 1.0), plant)
    return Trial(made, "stiction", plant.dead_time, {"resolution": step}, LAGS)


def linear_positions(rng: Rng) -> Trial:
    """Two lags, the staircase of the ends of the travel, and all that it can tell"""
    plant = drawn(rng)
    return Trial(positions(rng, lambda u: u, plant), "auto", plant.dead_time, {}, LAGS)


def linear_small_steps(rng: Rng) -> Trial:
    """Two lags, the staircase of the stiction, asked for stiction"""
    plant = drawn(rng, ((0.03, 0.06), (0.06, 0.1)))
    return Trial(small_steps(rng, lambda u: u, plant), "stiction", plant.dead_time, {}, LAGS)


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


ESTIMATED = {
    slew_rate: ("slew_rate",),
    one_slew_rate: ("slew_rate",),
    slew_rates: ("slew_rate_opening", "slew_rate_closing"),
    dead_band: ("dead_band",),
    stiction: ("S", "J"),
    resolution: ("resolution",),
    end_of_travel: ("travel_high",),
    both_ends: ("travel_low", "travel_high"),
    equal_percentage: tuple(f"flow_at_{u}" for u in _SHOWN),
    quick_opening: tuple(f"flow_at_{u}" for u in _SHOWN),
}
"""Names of the parameters that are judged."""
LINEAR = (linear_step, linear_staircase, linear_positions, linear_small_steps)
WORLDS = (
    of_world(slewing, "auto"),
    of_honesty("slew limit"),
    of_world(sticking, "auto"),
    of_honesty("static friction"),
    of_world(play, "auto"),
    of_world(fills_faster_than_it_empties, "slew_rate"),
)
CASES = (*ESTIMATED, *LINEAR, *WORLDS)
