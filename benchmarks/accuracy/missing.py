"""Coverage with missing samples: ``python -m benchmarks.accuracy.missing --seeds 200``.

A simulated furnace, two lags of 400 s and 80 s behind a dead time of 90 s to 150 s, as a historian
stores it: an input that is stored at its changes and holds, an output of which samples are missing.
"""

from __future__ import annotations

import argparse
import functools
import platform
from collections.abc import Callable
from datetime import date
from pathlib import Path

import numpy as np

import ctrl_realize as cr

from .coloured import SLOW, noise_of
from .study import repeated

SCAN = 10.0
"""Distance of the samples of the output, in s."""
LAGS = (400.0, 80.0)
GAIN = 1.5
MOVES = np.array([900.0])
"""Times of the step, in s; operating records move at random."""


def response(time: np.ndarray) -> np.ndarray:
    """Step response without its dead time."""
    slow, fast = LAGS
    late = np.maximum(time, 0.0)
    decay = slow * np.exp(-late / slow) - fast * np.exp(-late / fast)
    return GAIN * (1.0 - decay / (slow - fast))


def furnace(time: np.ndarray, moves: np.ndarray, sizes: np.ndarray, delay: float) -> np.ndarray:
    """Output at any times, for an input that moves at others."""
    late = time[:, None] - moves[None] - delay
    return 50.0 + response(late) @ sizes


def at_random(rng: np.random.Generator, count: int) -> np.ndarray:
    """Keep 70 % of the samples."""
    return rng.random(count) >= 0.3


def outages(rng: np.random.Generator, count: int) -> np.ndarray:
    """Lose 30 % of the samples, a dozen in a row."""
    kept = np.ones(count, dtype=bool)
    while kept.mean() > 0.7:
        first = rng.integers(count)
        kept[first : first + rng.integers(4, 20)] = False
    return kept


def one(world: str, given: bool, *, seed: int) -> tuple[float, bool, float]:
    """Error of the dead time in s, whether the interval covers it, and its width."""
    rng = np.random.default_rng([seed, 20])
    delay = float(rng.uniform(90.0, 150.0))
    count = 500
    time = SCAN * np.arange(count)
    moves, sizes = MOVES.copy(), np.array([rng.choice([-1.0, 1.0]) * rng.uniform(2, 6)])
    noise = 0.02
    if world.startswith("operating"):
        count = 800
        time = SCAN * np.arange(count)
        moves = np.sort(rng.choice(time[20:-60], 25, replace=False))
        sizes = rng.uniform(-4, 4, moves.size)
    if "irregular" in world:
        time = np.cumsum(rng.uniform(0.4, 1.6, count)) * SCAN
    if "multi-rate" in world:
        moves = np.round(moves + rng.uniform(0, SCAN))
    errors = rng.standard_normal(count)
    if "coloured" in world:
        errors = noise_of(SLOW, count, rng)
    y = furnace(time, moves, sizes, delay) + noise * errors
    if "outages" in world:
        y[~outages(rng, count)] = np.nan
    elif "missing" in world:
        y[~at_random(rng, count)] = np.nan
    stored = np.concatenate([[time[0]], moves])
    record = cr.Record.from_samples(
        time, 20.0 + np.concatenate([[0.0], np.cumsum(sizes)]), y, input_time=stored
    )
    fit = cr.identify(record, structures=[(2, 2)] if given else None).fit
    low, high = fit.interval
    return fit.dead_time - delay, bool(low <= delay <= high), high - low


WORLDS = (
    "step, complete",
    "step, 30 % missing at random",
    "step, 30 % missing in outages",
    "step, irregular stamps (4 s to 16 s)",
    "step, multi-rate (input 1 s, output 10 s)",
    "step, 30 % missing, coloured noise",
    "operating data, complete",
    "operating data, 30 % missing at random",
    "operating data, 30 % missing in outages",
    "operating data, irregular stamps (4 s to 16 s)",
    "operating data, multi-rate (input 1 s, output 10 s)",
    "operating data, 30 % missing, coloured noise",
)


def missing_table(seeds: int, jobs: int, worlds: tuple[str, ...] = WORLDS) -> list[str]:
    """Tabulate coverage of the dead time with and without missing samples."""
    lines = [
        "| record | structure | records | rms error | coverage | median width |",
        "|---|---|---|---|---|---|",
    ]
    for world in worlds:
        for given in (False, True):
            rows = repeated(functools.partial(one, world, given), seeds, jobs)
            lines.append(row_of(world, given, rows))
    return lines


def row_of(world: str, given: bool, rows: np.ndarray) -> str:
    """Row of the table, from error, coverage and width (seeds, 3)."""
    rms = float(np.sqrt(np.mean(rows[:, 0] ** 2)))
    return (
        f"| {world} | {'given' if given else 'chosen'} | {len(rows)} | {rms:.3g} s "
        f"| {100 * rows[:, 1].mean():.1f} % | {np.median(rows[:, 2]):.3g} s |"
    )


def main(write: Callable[[str], None] = print) -> None:
    """Make the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=200)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--worlds", default="", help="only worlds that contain this")
    parser.add_argument("--output", type=Path, help="Markdown file to write")
    arguments = parser.parse_args()
    chosen = tuple(world for world in WORLDS if arguments.worlds in world)
    lines = [
        f"*Simulated furnace (lags {LAGS[0]:g} s and {LAGS[1]:g} s, dead time 90 s to 150 s, a "
        f"sample every {SCAN:g} s, noise 0.02 beside steps of 3 to 9). `python -m "
        f"benchmarks.accuracy.missing`, {date.today().isoformat()}, Python "
        f"{platform.python_version()}.*",
        "",
        *missing_table(arguments.seeds, arguments.jobs, chosen),
        "",
    ]
    text = "\n".join(lines)
    if arguments.output is None:
        write(text)
    else:
        arguments.output.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
