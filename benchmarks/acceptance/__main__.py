"""Errors of every parameter: ``python -m benchmarks.acceptance --store FILE --table TABLE``.

Six plants with dead time, white noise, three kinds of records: one step, a random binary input,
and a loop whose set point moves. Rows that are stored are kept; further seeds are added to them.
"""

from __future__ import annotations

import argparse
import json
import warnings
from collections.abc import Iterable, Iterator
from datetime import date
from pathlib import Path
from typing import NamedTuple

import numpy as np

import ctrl_realize as cr

from .cases import KINDS, PLANTS, WAYS, bounds, estimated, made, ways

Row = dict[str, object]
Key = tuple[str, str, str]
"""Plant, kind of record, way."""
TITLES = {"step": "One step", "binary": "Random binary input", "loop": "Loop, set point moved"}


class Cell(NamedTuple):
    """What the records of one plant, kind and way tell of one parameter."""

    count: int
    bias: float
    std: float
    told: float
    bound: float
    held: int
    intervals: int

    @property
    def ratio(self) -> float:
        return self.std / self.bound

    @property
    def significance(self) -> float:
        """Bias over its standard error."""
        return self.bias / (self.std / np.sqrt(self.count))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--store", type=Path, required=True, help="rows that are there are kept")
    parser.add_argument("--seeds", type=int, nargs=2, default=(0, 4), metavar=("FIRST", "STOP"))
    parser.add_argument("--ways", nargs="*", default=WAYS)
    parser.add_argument("--kinds", nargs="*", default=KINDS)
    parser.add_argument("--table", type=Path, help="Markdown file to write, from what is stored")
    options = parser.parse_args()
    store = options.store
    done = [json.loads(line) for line in store.read_text().splitlines()] if store.exists() else []
    known = {(row["plant"], row["kind"], row["way"], row["seed"]) for row in done}
    with store.open("a") as out:
        for row in rows(options.seeds, options.kinds, options.ways, known):
            out.write(json.dumps(row) + "\n")
            out.flush()
            done.append(row)
    if options.table is not None:
        options.table.write_text("\n".join(table(done)) + "\n", encoding="utf-8")


def rows(
    seeds: tuple[int, int], kinds: Iterable[str], asked: Iterable[str], known: set[tuple]
) -> Iterator[Row]:
    """Estimate from every record in every way; a record that is refused has no parameters."""
    every = [(s, name, kind) for s in range(*seeds) for name in PLANTS for kind in kinds]
    for seed, name, kind in every:
        left = [w for w in ways(name, kind) if w in asked and (name, kind, w, seed) not in known]
        if not left:
            continue
        record, sigma = made(name, kind, seed)
        least = bounds(PLANTS[name], kind, record.input.ravel(), sigma)
        for way in left:
            row: Row = {"plant": name, "kind": kind, "way": way, "seed": seed, "bound": least}
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    row["told"], row["flags"] = estimated(name, way, record)
            except cr.CtrlRealizeError as error:
                row["refused"] = str(error)[:120]
            yield row


def cells(done: list[Row]) -> dict[Key, dict[str, Cell]]:
    """Errors of every parameter, by plant, kind and way."""
    groups: dict[Key, list[Row]] = {}
    for row in done:
        groups.setdefault((row["plant"], row["kind"], row["way"]), []).append(row)
    found: dict[Key, dict[str, Cell]] = {}
    for key in ((name, kind, way) for kind in KINDS for name in PLANTS for way in WAYS):
        own = groups.get(key, [])
        for name, true in PLANTS[key[0]].values.items():
            both = [
                (row["told"][name], row["bound"][name])
                for row in own
                if name in row.get("told", {})
            ]
            if len(both) > 1:
                found.setdefault(key, {})[name] = cell(
                    true, *map(np.array, zip(*both, strict=True))
                )
    return found


def cell(true: float, told: np.ndarray, bound: np.ndarray) -> Cell:
    """Errors of a parameter from (n, 4) values, standard errors and ends, and bounds (n,)."""
    value, error, low, high = told.T
    asked = np.isfinite(low + high)
    held = int(np.sum((low <= true) & (true <= high)))
    mean = float(np.mean(error))
    least = float(np.sqrt(np.mean(bound**2)))
    spread = float(np.std(value, ddof=1))
    return Cell(value.size, float(value.mean() - true), spread, mean, least, held, int(asked.sum()))


def table(done: list[Row]) -> list[str]:
    """All parameters together for every kind and way, then each of them."""
    every, seeds = cells(done), sorted({int(row["seed"]) for row in done})
    lines = [
        f"*Simulated: {len(PLANTS)} plants with dead time, 800 samples, white noise; seeds from "
        f"{seeds[0]} on. Over all parameters of all plants: standard deviation over the Cramer-Rao "
        "bound (median, least and largest), told standard error over standard deviation (median), "
        "intervals that hold, and how many biases exceed three of their standard errors. "
        f"`python -m benchmarks.acceptance`, {date.today().isoformat()}.*",
        "",
        "| record | way | records | refused | parameters | deviation over bound "
        "| told over deviation | intervals hold | of the dead time | biased |",
        "|" + "---|" * 10,
    ]
    for kind in KINDS:
        for way in WAYS:
            own = [row for row in done if row["kind"] == kind and row["way"] == way]
            some = {key: found for key, found in every.items() if key[1:] == (kind, way)}
            if some:
                lines.append(summary(kind, way, own, list(some.values())))
    lines += ["", *by_plant(every)]
    for kind in KINDS:
        lines += ["", f"### {TITLES[kind]}", ""]
        lines += [
            "| plant | parameter | true | bound | way | records | bias | standard deviation "
            "| over bound | told standard error | interval holds |",
            "|" + "---|" * 11,
        ]
        for name, plant in PLANTS.items():
            for parameter, true in plant.values.items():
                for way in WAYS:
                    one = every.get((name, kind, way), {}).get(parameter)
                    if one is not None:
                        words = f"| {name} | {parameter} | {true:g} | {one.bound:.2g} | {way} "
                        lines.append(words + detail(one))
    return lines


def summary(kind: str, way: str, own: list[Row], found: list[dict[str, Cell]]) -> str:
    """One row for a kind and a way."""
    each = [one for some in found for one in some.values()]
    ratios = [one.ratio for one in each]
    told = [one.told / one.std for one in each if np.isfinite(one.told)]
    biased = sum(abs(one.significance) > 3 for one in each)
    refused = sum("refused" in row for row in own)
    size = f"{np.median(ratios):.2f} ({min(ratios):.2f} to {max(ratios):.2f})"
    return (
        f"| {TITLES[kind].lower()} | {way} | {len(own)} | {refused} | {len(each)} | {size} "
        f"| {f'{np.median(told):.2f}' if told else ''} | {coverage(each)} "
        f"| {coverage([some['dead_time'] for some in found])} | {biased} |"
    )


def by_plant(every: dict[Key, dict[str, Cell]]) -> list[str]:
    """Intervals that hold of all parameters of a plant, the structure stated."""
    columns = [(kind, way) for kind in KINDS for way in WAYS[:2] if way in ways("one lag", kind)]
    names = [f"{TITLES[kind].lower()}{way.removeprefix(WAYS[0])}" for kind, way in columns]
    lines = [f"| structure stated | {' | '.join(names)} |", "|" + "---|" * (1 + len(columns))]
    for name in PLANTS:
        found = [coverage([*every.get((name, *column), {}).values()]) for column in columns]
        lines.append(f"| {name} | {' | '.join(found)} |")
    return lines


def coverage(found: list[Cell]) -> str:
    """Share of intervals that hold; empty if none are told."""
    held, asked = (sum(getattr(one, name) for one in found) for name in ("held", "intervals"))
    return f"{100 * held / asked:.1f} % of {asked}" if asked else ""


def detail(one: Cell) -> str:
    """Errors of one parameter."""
    told = f"{one.told:.2g}" if np.isfinite(one.told) else ""
    return (
        f"| {one.count} | {one.bias:+.1g} ± {one.std / np.sqrt(one.count):.1g} | {one.std:.2g} "
        f"| {one.ratio:.2f} | {told} | {coverage([one])} |"
    )


if __name__ == "__main__":
    main()
