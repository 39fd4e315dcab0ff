"""Dead times from loops: ``python -m benchmarks.closed_loop --store FILE --table TABLE``.

Every plant, set point and noise is simulated with a seed. The record is fitted without its set
point, with it, and with it and the number of lags. `--surface` evaluates the likelihood on a grid
instead, in a quarter of a second for a record: ways of choosing, averaging and projecting.
"""

from __future__ import annotations

import argparse
import json
import warnings
from collections.abc import Iterable, Iterator
from datetime import date
from pathlib import Path

import numpy as np

import ctrl_realize as cr

from .bound import bound
from .candidates import candidates
from .cases import CASES, MOVES, PLANTS, record
from .surface import projected, surface

WAYS = ("no set point", "set point", "set point and lags")
SHOWN = (
    *WAYS,
    *(f"direct: {way}" for way in ("BIC", "maximum, lags known", "mean, lags known")),
    *(f"direct: mean, {way}" for way in ("no charge", "Akaike", "twice", "BIC")),
    "projected: mean, Akaike",
)
"""Ways in the table; what begins with *direct* and *projected* is on the grid."""
BOUND = "Cramer-Rao bound, lags known"
Row = dict[str, float | str | bool | list[float]]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--store", type=Path, required=True, help="rows that are there are kept")
    parser.add_argument("--seeds", type=int, nargs=2, default=(0, 4), metavar=("FIRST", "STOP"))
    parser.add_argument("--ways", nargs="*", default=WAYS)
    parser.add_argument("--surface", action="store_true")
    parser.add_argument("--table", type=Path, help="Markdown file to write, from what is stored")
    arguments = parser.parse_args()
    store = arguments.store
    done = [json.loads(line) for line in store.read_text().splitlines()] if store.exists() else []
    known = {(row["seed"], row["case"], row["plant"], row["moves"], row["way"]) for row in done}
    setting = arguments.seeds, arguments.ways, known
    with store.open("a") as out:
        for row in grid_rows(*setting) if arguments.surface else rows(*setting):
            out.write(json.dumps(row) + "\n")
            out.flush()
            done.append(row)
    if arguments.table is not None:
        arguments.table.write_text("\n".join(table(done)) + "\n", encoding="utf-8")


def worlds(seeds: tuple[int, int]) -> Iterator[tuple[int, str, str, str]]:
    """Seed, case, plant and moves; random moves of one plant alone."""
    for seed in range(*seeds):
        for case in CASES:
            yield from ((seed, case, plant, moves) for plant in PLANTS for moves in MOVES)
            yield seed, case, "0.4", "nine"


def rows(seeds: tuple[int, int], ways: Iterable[str], known: set[tuple]) -> Iterator[Row]:
    """Fit every record in every way; a fit that is refused has no dead time."""
    for seed, case, plant, moves in worlds(seeds):
        wanted, bare = record(PLANTS[plant], CASES[case], moves, seed)
        data = cr.Record(bare.time, bare.input, bare.output, reference=wanted)
        lags = {"structures": PLANTS[plant].structure}
        for way in ways:
            if (seed, case, plant, moves, way) in known:
                continue
            row: Row = {"seed": seed, "case": case, "plant": plant, "moves": moves, "way": way}
            try:
                given = lags if way == WAYS[2] else {}
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    fit = cr.identify(bare if way == WAYS[0] else data, **given).fit
                row |= {"delay": fit.dead_time, "low": fit.interval[0], "high": fit.interval[1]}
                row |= {"total": fit.total_delay, "flags": [flag.code for flag in fit.flags]}
            except cr.CtrlRealizeError as error:
                row["refused"] = str(error)[:120]
            yield row


def grid_rows(seeds: tuple[int, int], ways: Iterable[str], known: set[tuple]) -> Iterator[Row]:
    """Candidates on the grid of `surface`, from the controller's output and its projection."""
    for seed, case, plant, moves in worlds(seeds):
        wanted, bare = record(PLANTS[plant], CASES[case], moves, seed)
        output, drive = bare.output.ravel(), bare.input.ravel()
        drives = {"direct": drive}
        if seed % 4 == 0:
            drives["projected"] = projected(drive, wanted)
        for source, signal in drives.items():
            found = candidates(surface(signal, output), len(PLANTS[plant].lags))
            for name, (delay, low, high) in found.items():
                way = f"{source}: {name}"
                if (seed, case, plant, moves, way) not in known:
                    yield {"seed": seed, "case": case, "plant": plant, "moves": moves, "way": way,
                           "delay": delay, "low": low, "high": high}  # fmt: skip


def table(done: list[Row]) -> list[str]:
    """Error, coverage and width of every way in every case."""
    seeds = sorted({int(row["seed"]) for row in done})
    lines = [
        f"*Simulated loops with PI controllers, {len(PLANTS)} plants with dead times of a tenth to "
        "three times the sum of their lags, one and three moves of the set point, nine of one "
        f"plant; seeds {seeds[0]} to {seeds[-1]} (fewer of the fits), errors in samples of 1 s. A "
        "miss is silent if no flag is raised. `python -m benchmarks.closed_loop`, "
        f"{date.today().isoformat()}.*",
        "",
        "| case | way | records | mean error | rms | interval holds | median width | silent misses "
        "|",
        "|---|---|---|---|---|---|---|---|",
    ]
    for case in CASES:
        if not CASES[case].load:
            least = [
                bound(*world) for world in worlds((seeds[0], seeds[0] + 1)) if world[1] == case
            ]
            size = np.sqrt(np.mean(np.square(least)))
            lines.append(f"| {case} | {BOUND} | {len(least)} | | {size:.2f} | | | |")
        for way in SHOWN:
            chosen = [row for row in done if row["case"] == case and row["way"] == way]
            fitted = [row for row in chosen if row.get("delay") is not None]
            if not fitted:
                continue
            truth = np.array([PLANTS[str(row["plant"])].dead_time for row in fitted])
            delay, low, high = (
                np.array([float(row[key]) for row in fitted]) for key in ("delay", "low", "high")
            )
            error, held = delay - truth, (low <= truth) & (truth <= high)
            flags = [bool(row.get("flags")) for row in fitted]
            silent = "" if "flags" not in fitted[0] else str(int(np.sum(~held & ~np.array(flags))))
            lines.append(
                f"| {case} | {way} | {len(fitted)} | {error.mean():+.2f} "
                f"| {np.sqrt(np.mean(error**2)):.2f} | {100 * held.mean():.0f} % "
                f"| {np.median(high - low):.1f} | {silent} |"
            )
    return lines


if __name__ == "__main__":
    main()
