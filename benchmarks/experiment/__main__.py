"""Achieved over predicted errors: `python -m benchmarks.experiment --seeds 200 --store FILE`.

The seeds of a case are those below its number; what is stored already is not fitted again.
"""

from __future__ import annotations

import argparse
import json
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from .cases import (
    CASES,
    DEAD_TIME,
    PLANTS,
    Case,
    dead_time,
    planned,
    simulated,
)

Rows = dict[tuple[Case, int], float]


def rows(path: Path | None, seeds: int) -> Rows:
    """Identify all cases and seeds."""
    lines = path.read_text("utf-8").splitlines() if path is not None and path.exists() else []
    done: Rows = {(Case(*row["case"]), row["seed"]): row["found"] for row in map(json.loads, lines)}
    plans = {case: planned(case) for case in CASES}
    wanted = [(case, seed) for case in CASES for seed in range(min(CASES[case], seeds))]
    for case, seed in wanted:
        if (case, seed) not in done:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                done[case, seed] = dead_time(case, simulated(case, plans[case], seed))
            if path is not None:
                row = {"case": case, "seed": seed, "found": done[case, seed]}
                with path.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(row) + "\n")
    return {key: row for key, row in done.items() if key[1] < min(CASES[key[0]], seeds)}


def table(found: Rows) -> Iterator[str]:
    """Rows of the table of the docs, a case each."""
    yield (
        "| plant | noise, pole | test | structure | records | predicted [s] | achieved [s] "
        "| ratio |"
    )
    yield "|" + "---|" * 8
    for case in CASES:
        plan = planned(case)
        every = [one - DEAD_TIME for (own, _), one in found.items() if own == case]
        errors = [one for one in every if np.isfinite(one)]
        if errors:
            told = f"{len(errors)} of {len(every)}" if len(errors) < len(every) else len(errors)
            rms = float(np.sqrt(np.mean(np.square(errors))))
            test = f"{plan.kind}, {plan.chosen.detail}"
            yield (
                f"| {case.plant} | {case.noise:g}, {case.pole:g} | {test} | "
                f"{case.way} | {told} | {plan.std:.4f} | {rms:.4f} | {rms / plan.std:.2f} |"
            )


def gains(found: Rows) -> Iterator[str]:
    """Rows of the second table: planned test over one step of the same time and amplitude."""
    yield "| plant | planned test | better by the bound | better, achieved |"
    yield "|" + "---|" * 4
    for plant in PLANTS:
        both = [Case(plant, 0.0, best, "given") for best in (True, False)]
        errors = [[one - DEAD_TIME for (own, _), one in found.items() if own == case]
                  for case in both]  # fmt: skip
        if all(errors):
            plan = planned(both[0])
            best, step = (np.sqrt(np.nanmean(np.square(each))) for each in errors)
            yield (
                f"| {plant} | {plan.kind} | {plan.step.std / plan.std:.2f} | {step / best:.2f} |"
            )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=20, help="of every case at most")
    parser.add_argument("--store", type=Path)
    parser.add_argument("--table", type=Path, help="write the tables there")
    options = parser.parse_args()
    found = rows(options.store, options.seeds)
    text = "\n".join([*table(found), "", *gains(found)]) + "\n"
    if options.table is not None:
        options.table.write_text(text, encoding="utf-8")
    sys.stdout.write(text)


if __name__ == "__main__":
    main()
