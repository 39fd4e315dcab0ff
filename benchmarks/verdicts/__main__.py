"""How often verdicts are right: `python -m benchmarks.verdicts --seeds 100 130 --store FILE`.

With `--measured FOLDER` (of the measured records, which are no part of the project) the table is
that of dead times beside the bands in which they are believed to be.

Limits and marks were chosen with seeds below 100; the table is of seeds from 100 on.
"""

from __future__ import annotations

import argparse
import json
import sys
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

import ctrl_realize as cr
from ctrl_realize.errors import DataError
from ctrl_realize.numerics.engine.plausible_models import PlausibleModel
from ctrl_realize.numerics.loops.reference import (
    controller_response,
    grid,
    largest_sensitivity,
    model_response,
    robust_pi,
)

from ..peers.measured import records
from .cases import KINDS, Case, case

BAND = (0.1, 0.3, 1.0)  # of the crossover: where the true response is looked for in the envelope


def judged(one: Case) -> dict[str, object]:
    """What the fit of a case says, and what is true."""
    fit = cr.fit_output_error(one.record).fit
    said = {verdict.question: verdict for verdict in fit.verdicts}
    plant, low, high = one.plant, *fit.interval
    latest = float(np.fmin(fit.onset, high))  # any input has no onset
    reach = max(0.2 * latest, 2 * fit.dt, 0.1 * fit.total_delay)
    row: dict[str, object] = {
        "kind": one.kind,
        "seed": one.seed,
        "levels": [verdict.level for verdict in fit.verdicts],
        "flags": [flag.code for flag in fit.flags],
        "held": bool(low - 1e-9 <= plant.dead_time <= high + 1e-9),
        "near": bool(abs(fit.dead_time - plant.dead_time) <= reach),
        "narrow": bool(high - low <= max(0.4 * latest, reach)),
        "gain held": bool(fit.gain_interval[0] <= plant.gain <= fit.gain_interval[1]),
        "gain error": float(abs(fit.gain / plant.gain - 1)),
        "worst Ms": said["tuning"].number,
    }
    return row | _loop(one, fit)


def _loop(one: Case, fit: cr.identification.OutputErrorFit) -> dict[str, object]:
    """Largest sensitivity on the true plant; whether the envelope holds its response."""
    models = fit.estimate.plausible
    model = PlausibleModel(fit.dead_time, fit.poles, fit.estimate.numerator)
    if np.sum(model.poles == 0) > 1:
        return {"true Ms": float("inf"), "inside": []}
    omega = grid(model, fit.dt)
    controller = controller_response(*robust_pi(model, fit.dt), omega, fit.dt)
    above = np.flatnonzero(np.abs(controller * model_response(model, omega)) > 1)
    crossover = omega[above[-1]] if above.size else omega[0]
    inside = []
    for part in BAND:
        at = np.array([part * crossover])
        ratio = np.array([model_response(m, at)[0] for m in models]) / one.plant.response(at)[0]
        for values in (np.log(np.abs(ratio)), np.angle(ratio)):
            inside.append(bool(values.min() <= 0 <= values.max()))
    true = largest_sensitivity(controller * one.plant.response(omega))
    return {"true Ms": float(true), "inside": inside}


def rows(path: Path | None, seeds: range, kinds: Sequence[str]) -> list[dict[str, object]]:
    """Judge kinds and seeds; what is stored already is not judged again."""
    lines = path.read_text("utf-8").splitlines() if path is not None and path.exists() else []
    done = {(row["kind"], row["seed"]): row for row in map(json.loads, lines)}
    for seed in seeds:
        for kind in kinds:
            if (kind, seed) not in done:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    try:
                        done[kind, seed] = judged(case(kind, seed))
                    except DataError:  # noise that hides the response of a loop
                        done[kind, seed] = {"kind": kind, "seed": seed, "refused": True}
                if path is not None:
                    with path.open("a", encoding="utf-8") as file:
                        file.write(json.dumps(done[kind, seed]) + "\n")
    wanted = (done[kind, seed] for kind in kinds for seed in seeds)
    return [row for row in wanted if "refused" not in row]


def table(found: list[dict[str, object]]) -> Iterator[str]:
    """Rows of the table of the docs, a kind each, and all together."""
    yield (
        "| kind | records | dead time: held | good | of these wrong | useful, called good | "
        "gain: held | good | of these wrong | tuning: right | good | of these wrong | "
        "envelope holds |"
    )
    yield "|" + "---|" * 13
    kinds = dict.fromkeys(row["kind"] for row in found)
    for name in (*kinds, "all"):
        some = [row for row in found if name in ("all", row["kind"])]
        levels = np.array([row["levels"] for row in some]) == "good"
        right = np.array(
            [
                [row["near"] and row["held"], row["gain error"] <= 0.05, row["true Ms"] <= 2]
                for row in some
            ]
        )
        held = [np.mean([row[key] for row in some]) for key in ("held", "gain held")]
        inside = np.mean([x for row in some for x in row["inside"]])
        wrong = np.sum(levels & ~right, axis=0)
        good = np.sum(levels, axis=0)
        parts = [
            f"{100 * held[0]:.0f} %",
            f"{100 * held[1]:.0f} %",
            f"{100 * right[:, 2].mean():.0f} %",
        ]
        cells = [f"{parts[i]} | {good[i]} | {wrong[i]}" for i in range(3)]
        useful = right[:, 0] & np.array([row["narrow"] for row in some])
        cells[0] += f" | {np.sum(levels[useful, 0])} of {np.sum(useful)}"
        yield f"| {name} | {len(some)} | {' | '.join(cells)} | {100 * inside:.0f} % |"


def measured_table(folder: Path) -> Iterator[str]:
    """Rows of measured plants, and all together."""
    yield "| plant | records | in band | interval meets it | good | of these in band |"
    yield "|" + "---|" * 6
    found: dict[str, list[tuple[bool, bool, bool]]] = {}
    for one in records(folder):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            fit = cr.fit_output_error(one.task.record).fit
        low, high = fit.delay_interval
        row = (
            one.outside(fit.delay) == 0,
            low <= one.band[1] and high >= one.band[0],
            fit.verdicts[0].level == "good",
        )
        for name in (one.plant, "all"):
            found.setdefault(name, []).append(row)
    found["all"] = found.pop("all")
    for name, some in found.items():
        inside, meets, good = np.array(some).T
        counts = (len(some), inside.sum(), meets.sum(), good.sum(), (good & inside).sum())
        yield f"| {name} | {' | '.join(map(str, counts))} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, nargs=2, default=(100, 125))
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=KINDS)
    parser.add_argument("--store", type=Path)
    parser.add_argument("--table", type=Path, help="write the table there")
    parser.add_argument("--measured", type=Path, metavar="FOLDER")
    options = parser.parse_args()
    if options.measured is not None:
        lines = measured_table(options.measured)
    else:
        lines = table(rows(options.store, range(*options.seeds), options.kinds))
    text = "\n".join(lines) + "\n"
    if options.table is not None:
        options.table.write_text(text, encoding="utf-8")
    sys.stdout.write(text)


if __name__ == "__main__":
    main()
