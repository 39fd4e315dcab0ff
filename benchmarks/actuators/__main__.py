"""Fit simulated records, and write docs/tables/actuators_table.md.

``python -m benchmarks.actuators --seeds 200`` writes every trial as a line of JSON as well and goes
on where it was stopped.
"""

from __future__ import annotations

import argparse
import json
import os
import time
import zlib
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

import ctrl_realize as cr

from ..honesty.trial import quietly
from ..worlds.judge import DELAY
from .cases import CASES
from .tables import page

Row = dict[str, object]


def tried(case, seed: int) -> Row:  # type: ignore[no-untyped-def]
    """Fit one record."""
    trial = case(np.random.default_rng([seed, zlib.crc32(case.__name__.encode())]))
    begun = time.process_time()
    row: Row = {"case": case.__name__, "seed": seed}
    with quietly():
        try:
            fit = cr.fit_output_error(
                trial.records, actuator=trial.actuator, structures=trial.structures
            ).fit
        except cr.CtrlRealizeError as error:
            return row | {"refused": f"{type(error).__name__}: {error}"}
    low, high = fit.interval
    held = bool(low - 1e-9 <= trial.dead_time <= high + 1e-9)
    codes = sorted({flag.code for flag in fit.flags})
    row |= {
        "held": held,
        "silent": not held and not DELAY & set(codes),
        "width": (high - low) / fit.dt,
        "error": (fit.dead_time - trial.dead_time) / fit.dt,
        "flags": codes,
        "kind": "" if fit.actuator is None else type(fit.actuator.model).__name__,
        "at": "" if fit.actuator is None else fit.actuator.actuator_at,
        "seconds": time.process_time() - begun,
    }
    for name, truth in trial.values.items():
        try:
            found = fit.actuator[name]
        except (KeyError, TypeError):
            continue
        size = trial.sizes.get(name, truth)
        row[name] = (found.value - truth) / size
        row[f"{name} held"] = bool(found.low <= truth <= found.high)
        row[f"{name} width"] = (found.high - found.low) / size
    return row


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.actuators", description=__doc__)
    parser.add_argument("--seeds", type=int, default=40)
    parser.add_argument("--rows", type=Path, default=Path("actuators_rows.jsonl"))
    parser.add_argument("--out", type=Path, default=Path("docs/tables/actuators_table.md"))
    parser.add_argument("--only", nargs="*", default=[], help="names of cases")
    parser.add_argument("--table", action="store_true", help="write the page from the rows alone")
    parser.add_argument("--note", default="", help="a sentence about the rows, for the page")
    asked = parser.parse_args()
    rows: list[Row] = []
    if asked.rows.exists():
        rows = [json.loads(line) for line in asked.rows.read_text("utf-8").splitlines()]
    done = {(row["case"], row["seed"]) for row in rows}
    wanted = [case for case in CASES if not asked.only or case.__name__ in asked.only]
    with asked.rows.open("a", encoding="utf-8") as store:
        for seed in range(0 if asked.table else asked.seeds):
            for case in wanted:
                if (case.__name__, seed) in done:
                    continue
                rows.append(tried(case, seed))
                store.write(json.dumps(rows[-1]) + "\n")
                store.flush()
    asked.out.write_text(page(rows, asked.note), encoding="utf-8")


if __name__ == "__main__":
    main()
