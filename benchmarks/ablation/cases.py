"""Records on which rules are judged: simulated ones of five kinds, and measured plants."""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import control as ct
import numpy as np

import ctrl_realize as cr
from benchmarks.honesty.worlds import MORE_WRONG, PLANTS, WRONG, driven_case, step_case
from benchmarks.peers import measured as peers
from benchmarks.worlds import described, driven, sensors, steps
from benchmarks.worlds.simulation import World
from tests import rigs

from . import rare

DATA = Path(__file__).resolve().parents[3] / "shared" / "data"
LAGS = (("white", 0.005), ("coloured", 0.02), ("quantised", 0.02))
DRIVEN: tuple[World, ...] = (
    described.random_levels, described.random_binary, described.binary_in_slow_noise,
)  # fmt: skip
STEPPED = tuple(world for world in described.WORLDS if world not in DRIVEN)
TWO_MODES = ct.tf([25.0], [1, 0.8, 25.0]) + ct.tf([60.0], [1, 0.6, 144.0])
MANY_LAGS = rigs.lag(0.8) * rigs.lag(1.5) * rigs.lag(2.5) * rigs.lag(4.0)
PLACES = {"before": 150, "after": 450}


@dataclass(frozen=True, eq=False)
class Case:
    """A record and what its dead time is: a truth, or a band where the plant is a real one (s)."""

    name: str
    kind: str
    records: cr.Record | tuple[cr.Record, ...]
    band: tuple[float, float]
    dt: float


def cases(seeds: int) -> Iterator[Case]:
    """All records, `seeds` of each simulated kind.

    They were chosen by kind, before any of the results was known: the plants that the model
    describes, in three kinds of noise, for what a rule may cost where it is not needed; and all
    worlds of the table of worlds but loops (of the driven ones every second), structures that the
    model does not have, and measured plants, for what it was made for. The rare ones are worlds of
    rules that touch hardly any of these.
    """
    for seed in range(seeds):
        for kind, noise in LAGS:
            for plant in PLANTS:
                yield _step("lags", kind, plant, noise, seed)
        for world in STEPPED:
            yield of_world("lags", world, seed)
        for plant in (*WRONG, *MORE_WRONG):
            yield _step("wrong", "wrong structure", plant, 0.005, seed)
        for world in steps.WORLDS:
            yield of_world("wrong", world, seed)
        for slope in ("drift", "drift that ends"):
            yield _drifting(slope, seed)
        for world in sensors.WORLDS:
            yield of_world("disturbed", world, seed)
        for world in (*DRIVEN, *driven.WORLDS[::2]):
            yield of_world("driven", world, seed)
        for core, noise in ((None, 0.02), (TWO_MODES, 0.05), (MANY_LAGS, 0.01)):
            for kind in ("white", "coloured"):
                yield _driven(kind, noise, seed, core)
    for seed in range(2 * seeds):
        for world in rare.WORLDS:
            yield of_world("rare", world, seed)
        for plant in WRONG[:3] + MORE_WRONG:
            yield _step("rare", "wrong structure", plant, (0.001, 0.02)[seed % 2], seed)
    for one in peers.records(DATA) if DATA.is_dir() else ():
        dt = one.task.record.dt
        band = one.band[0] * dt, one.band[1] * dt
        yield Case(f"{one.plant}/{one.name}", "measured", one.task.record, band, dt)


def _step(group: str, kind: str, plant: str, noise: float, seed: int) -> Case:
    case = step_case(kind, plant, noise, seed, **PLACES)
    truth = case.delay * case.record.dt
    name = f"{plant}, {kind}, {100 * noise:g} %, {seed}"
    return Case(name, group, case.record, (truth, truth), case.record.dt)


def of_world(group: str, world: World, seed: int) -> Case:
    case = world(np.random.default_rng([seed, zlib.crc32(world.__name__.encode())]))
    dt = case.records.dt if isinstance(case.records, cr.Record) else case.records[0].dt
    return Case(
        f"{world.__name__}, {seed}", group, case.records, (case.dead_time, case.dead_time), dt
    )


def _drifting(slope: str, seed: int) -> Case:
    """A drift of 10 % of the step in the rest; it goes on, or ends a rest after the step."""
    plain = step_case("white", "R2", 0.005, seed, **PLACES)
    before = PLACES["before"]
    k = np.arange(plain.record.n_samples)
    last = 2 * before if slope == "drift that ends" else k.size
    height = plain.gain * float(np.ptp(plain.record.input))
    y = plain.record.output + 0.1 * height * np.minimum(k, last) / before
    record = cr.Record(plain.record.time, plain.record.input, y)
    truth = plain.delay * record.dt
    return Case(f"{slope}, {seed}", "disturbed", record, (truth, truth), record.dt)


def _driven(kind: str, noise: float, seed: int, core: ct.TransferFunction | None) -> Case:
    case = driven_case(kind, noise, seed, samples=600, core=core)
    truth = case.delay * case.record.dt
    plant = {None: "two lags", TWO_MODES: "two modes", MANY_LAGS: "four lags"}[core]
    name = f"random levels, {plant}, {kind}, {seed}"
    return Case(name, "driven", case.record, (truth, truth), case.record.dt)
