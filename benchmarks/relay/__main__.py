"""What relay records tell: ``python -m benchmarks.relay --store FILE --output TABLE``.

Every plant is tested by a relay of six cycles. Noise is in % of half the swing of the clean cycle,
the hysteresis three standard deviations of all noise but the drift, unless the world is named for
it. The truth is the sampled one, behind a hold.
"""

from __future__ import annotations

import argparse
import json
import sys
import warnings
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np

import ctrl_realize as cr
from ctrl_realize.bench.linear import chain, integrator, lag

AMPLITUDE, CYCLES = 10.0, 6
PLANTS = {
    "a quarter of a lag": (2.0, (20.0,), 5.0),
    "two lags": (1.0, (12.0, 5.0), 8.0),
    "twice a lag": (0.5, (6.0,), 12.0),
    "integrating": (0.1, (4.0,), 6.0),
}
"""Gain (or rate), lags and dead time in s, sampled at 0.5 s."""
WORLDS = (
    ("biased", 2),
    ("biased", 10),
    ("symmetric", 2),
    ("hysteresis of half the swing", 2),
    ("drifting", 2),
    ("coloured noise", 2),
)
"""Name, and noise in %."""
Row = dict[str, float | str | bool]


def plant(name: str, noise: float, slow: float, slow_time: float) -> cr.bench.Plant:
    """Plant with noise and a disturbance of a time constant."""
    gain, lags, dead_time = PLANTS[name]
    parts = [lag(1 / (2 * np.pi * time)) for time in lags]
    core = chain([*parts, integrator(1.0)] if name == "integrating" else parts, gain)
    return cr.bench.Plant(
        truth=cr.bench.PlantTruth(core, dead_time, 0.5, ("%", "%"), name),
        dt=0.5, pre_step_time=20.0, hold=100.0, steady_state=(50.0, 50.0), amplitude=AMPLITUDE,
        input_range=(0.0, 100.0), noise=noise, disturbance=slow, disturbance_time=slow_time,
        resolution=None, labels=("u", "y"),
    )  # fmt: skip


def cycle_of(record: cr.Record) -> tuple[np.ndarray, float, float]:
    """Mean full cycle without the first, its period, and the share of the time that is up."""
    u, y = record.input.ravel(), record.output.ravel()
    starts = np.flatnonzero(np.diff(u) > 0)[1:] + 1
    phase = np.linspace(0, 1, 200, endpoint=False)
    cycles = [np.interp(a + phase * (b - a), np.arange(y.size), y) for a, b in pairwise(starts)]
    within = u[starts[0] : starts[-1]]
    period = (starts[-1] - starts[0]) * record.dt / (starts.size - 1)
    return np.mean(cycles, axis=0), period, float(np.mean(within == within.max()))


def described(record: cr.Record, hysteresis: float) -> tuple[float, float, float]:
    """Ultimate gain by the describing function and by the first harmonic, and the period."""
    cycle, period, share = cycle_of(record)
    moved = 4 * AMPLITUDE / np.pi * np.sin(np.pi * share)  # of the input, at the fundamental
    first = 2 * abs(np.fft.rfft(cycle)[1]) / cycle.size
    return moved / np.sqrt((np.ptp(cycle) / 2) ** 2 - hysteresis**2), moved / first, period


def judged(world: str, percent: float, name: str, seed: int) -> Row:
    """Test, identify and compare with the truth; errors in %."""
    bias = 0.3 * AMPLITUDE if world == "biased" else 0.0
    clean = plant(name, 0.0, 0.0, 1.0)
    swing = np.ptp(cycle_of(cr.bench.relay_test(clean, cycles=3, amplitude=AMPLITUDE))[0]) / 2
    level = percent / 100 * swing
    drift = (0.3 * swing, 1000.0)
    slow = {"drifting": drift, "coloured noise": (level, 5.0)}.get(world, (0.0, 1))
    tested = plant(name, 0.0 if world == "coloured noise" else level, *slow)
    width = 0.5 * swing if world.startswith("hysteresis") else 3 * level
    rng = np.random.default_rng([[*PLANTS].index(name), seed])
    record = cr.bench.relay_test(tested, AMPLITUDE, rng, hysteresis=width, bias=bias, cycles=CYCLES)
    sys_ = cr.identify(record)
    found = cr.design.ultimate(sys_, reverse=False)  # who heats knows that it gets warmer
    truth = cr.design.ultimate(tested.truth.sampled)
    by_function, by_harmonic, period = described(record, width)
    low, high = sys_.fit.interval
    row: Row = {
        "held": bool(low <= tested.truth.dead_time <= high),
        "gain": 100 * (found.gain / truth.gain - 1),
        "period": 100 * (found.period / truth.period - 1),
        "function": 100 * (by_function / truth.gain - 1),
        "harmonic": 100 * (by_harmonic / truth.gain - 1),
        "function period": 100 * (period / truth.period - 1),
    }
    for key in ("gain", "period"):
        interval = getattr(found, f"{key}_interval")
        if interval is not None:
            row[f"{key} held"] = bool(interval[0] <= getattr(truth, key) <= interval[1])
    return row


def rows(path: Path, seeds: int) -> list[Row]:
    """Judge all cases, seed by seed; what is stored already is not judged again."""
    lines = path.read_text("utf-8").splitlines() if path.exists() else []
    done = {tuple(row.pop("case")): row for row in map(json.loads, lines)}
    for seed in range(seeds):
        for world, percent in WORLDS:
            for name in PLANTS:
                case = (world, percent, name, seed)
                if case in done:
                    continue
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    done[case] = judged(*case)
                with path.open("a", encoding="utf-8") as file:
                    file.write(json.dumps({"case": case, **done[case]}) + "\n")
    return [{"world": w, "noise": p, "plant": n, **row} for (w, p, n, _), row in done.items()]


def table(found: list[Row]) -> Iterator[str]:
    """Rows of the table: each world on the three plants that settle, and on the integrating one."""
    yield (
        "| relay | noise | plants | records | gain: rms | worst | held | period: rms | worst "
        "| held | dead time held | describing function: gain | period | first harmonic: gain |"
    )
    yield "|" + "---|" * 14
    for integrating in (False, True):
        for world, percent in WORLDS:
            some = [
                row for row in found
                if (row["world"], row["noise"]) == (world, percent)
                and (row["plant"] == "integrating") is integrating
            ]  # fmt: skip
            if not some:
                continue
            cells = [world, f"{percent} %", "integrating" if integrating else "three", len(some)]
            for key in ("gain", "period"):
                errors = np.abs([row[key] for row in some])
                held = [bool(row[f"{key} held"]) for row in some if f"{key} held" in row]
                cells += [f"{np.sqrt(np.mean(errors**2)):.2g} %", f"{errors.max():.2g} %"]
                cells.append(f"{sum(held)} of {len(held)}")
            cells.append(sum(bool(row["held"]) for row in some))
            for key in ("function", "function period", "harmonic"):
                cells.append(f"{np.abs([row[key] for row in some]).max():.2g} %")
            yield "| " + " | ".join(map(str, cells)) + " |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--store", type=Path, required=True)
    parser.add_argument("--output", type=Path, help="write the table there")
    options = parser.parse_args()
    text = "\n".join(table(rows(options.store, options.seeds))) + "\n"
    if options.output is not None:
        options.output.write_text(text, encoding="utf-8")
    sys.stdout.write(text)


if __name__ == "__main__":
    main()
