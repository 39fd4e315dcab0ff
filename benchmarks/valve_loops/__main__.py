"""Print what the methods say on loops and write it: ``python -m benchmarks.valve_loops``.

Simulated loops with known cause; and the measured loops in the folder of data beside the project,
as they stand, where that folder is at hand.
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import TypeAlias

import numpy as np

import ctrl_realize as cr

from .worlds import CAUSES, worlds

TABLE = Path(__file__).resolve().parents[2] / "docs" / "tables" / "valve_loops_table.md"
DATA = Path(__file__).resolve().parents[3] / "shared" / "data" / "valve_loops"
SEEDS = 10
VERDICTS = (
    "stiction", "no stiction: tuning or external oscillation", "no oscillation", "cannot tell",
)  # fmt: skip
SAID = ("stiction", "no stiction", "cannot tell", "not applicable")
MEASURED = (
    ("chem1", "flow", "op", "pv", "stiction"),
    ("pap2", "flow", "op", "pv", "stiction"),
    ("chem13", "self-regulating", "op", "pv", "no stiction"),
    ("pap9", "self-regulating", "op", "pv", "no stiction"),
    ("sugar_actuator_first_half", "flow", "command_percent", "stem_percent", "not known"),
    ("sugar_actuator_first_half", "flow", "command_percent", "flow", "not known"),
    ("LIC-106_historian", "flow", "LV_106", "FT_115", "not known"),
)


Fit: TypeAlias = tuple[str, bool, float, float, bool, bool, float]


def main() -> None:
    """Diagnose them all."""
    of_world: dict[tuple[str, str], Counter[str]] = {}
    of_method: dict[tuple[str, str], Counter[str]] = {}
    fits: list[Fit] = []
    measured = _measured_lines()
    for seed in range(SEEDS):
        for world in worlds():
            op, pv, cause = world.signals(seed)
            found = cr.valves.diagnose_loop(op, pv, dt=world.loop.dt, process=world.process)
            of_world.setdefault((world.name, cause), Counter())[found.verdict] += 1
            said = {one.key: (one.name, one.verdict) for one in found.methods}
            said["verdict"] = ("**verdict**", found.verdict.partition(":")[0])
            fit = found.stiction_fit
            if found.verdict == "stiction" and cause == "stiction" and fit is not None:
                S, J = world.loop.actuator[0].S, world.loop.actuator[0].J
                held = _within(S, fit.S_range), _within(J, fit.J_range)
                width = (fit.S_range[1] - fit.S_range[0]) / S
                fits.append(
                    (world.process, fit.independent, fit.S / S, found.apparent_stiction / S, *held,
                     width)
                )  # fmt: skip
            if found.oscillates is not False:
                for name, verdict in said.values():
                    of_method.setdefault((name, cause), Counter())[verdict] += 1
            print(seed, world.name, cause, found.verdict, flush=True)
        # after each seed, so that a run that is stopped leaves what it has
        lines = _method_lines(of_method, seed + 1)
        lines += ["", *_fit_lines(fits)]
        lines += ["", *_world_lines(of_world, seed + 1), "", *measured]
        TABLE.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _within(value: float, ends: tuple[float, float]) -> bool:
    return ends[0] <= value <= ends[1]


def _fit_lines(fits: list[Fit]) -> list[str]:
    lines = [
        "Apparent stiction of those that are told to stick, against the S and J of the simulation. "
        "The intervals are those of 95 % where the residual of the fit is white:",
        "",
        "| process | residual | records | S of the fit: median ratio | within 10 % "
        "| interval holds S | its median width over S | interval holds J "
        "| width of the ellipse: median ratio to S |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for process in dict.fromkeys(each[0] for each in fits):
        for white, word in ((True, "white"), (False, "not white")):
            own = np.array([each[2:] for each in fits if each[:2] == (process, white)])
            if not own.size:
                continue
            lines.append(
                f"| {process} | {word} | {len(own)} | {np.median(own[:, 0]):.2f} | "
                f"{np.mean(np.abs(own[:, 0] - 1) < 0.1):.0%} | {own[:, 2].mean():.0%} | "
                f"{np.median(own[:, 4]):.1%} | {own[:, 3].mean():.0%} | "
                f"{np.median(own[:, 1]):.2f} |"
            )
    white = np.array([each[4:6] for each in fits if each[1]])
    lines += [
        "",
        f"All {len(white)} with a white residual: S is held in {white[:, 0].mean():.0%}, J in "
        f"{white[:, 1].mean():.0%}.",
    ]
    return lines


def _method_lines(counts: dict[tuple[str, str], Counter[str]], seeds: int) -> list[str]:
    lines = [
        f"Simulated loops, {seeds} records each, whose process value oscillates, or may: of 100 "
        "records, in how many each method says stiction / no stiction / cannot tell.",
        "",
        "| method | records: sticking, others | valves that stick | tuning or external |",
        "|---|---|---|---|",
    ]
    for name in dict.fromkeys(name for name, _ in counts):
        both = [counts.get((name, cause), Counter()) for cause in CAUSES[:2]]
        total = sum(each[word] for each in both for word in SAID[:3])
        if any(each[word] for each in both for word in SAID[:2]) and total:
            cells = [" / ".join(f"{_percent(each, word)}" for word in SAID[:3]) for each in both]
            many = [sum(each[word] for word in SAID[:3]) for each in both]
            lines.append(f"| {name} | {many[0]}, {many[1]} | {cells[0]} | {cells[1]} |")
    return lines


def _percent(counts: Counter[str], word: str) -> str:
    total = sum(counts[each] for each in SAID[:3])
    return f"{100 * counts[word] / total:.0f}" if total else "-"


def _world_lines(counts: dict[tuple[str, str], Counter[str]], seeds: int) -> list[str]:
    lines = [
        f"Verdict, number of {seeds} records. Where the stem came to rest before the record, the "
        "cause is none:",
        "",
        "| simulated loop | cause | stiction | no stiction | no oscillation | cannot tell |",
        "|---|---|---|---|---|---|",
    ]
    for (name, cause), each in counts.items():
        cells = " | ".join(str(each[word]) for word in VERDICTS)
        lines.append(f"| {name} | {cause} | {cells} |")
    return lines


def _measured_lines() -> list[str]:
    if not DATA.exists():
        return []
    lines = ["Measured loops, as they stand:", "", "| loop | literature | verdict | methods |"]
    lines.append("|---|---|---|---|")
    for name, process, op, pv, truth in MEASURED:
        found = _measured(name, process, op, pv)
        said = "; ".join(
            f"{one.name} {one.verdict} ({one.index:.2g})"
            for one in found.methods
            if np.isfinite(one.index)
        )
        label = name if pv == "pv" else f"{name}: {pv} over {op}"
        lines.append(f"| {label} | {truth} | {found.verdict} | {said} |")
        print(lines[-1], flush=True)
    return lines


def _measured(name: str, process: str, op: str, pv: str) -> cr.valves.LoopDiagnosis:
    historian = "historian" in name
    table = np.genfromtxt(
        DATA / f"{name}.csv", delimiter=",", names=True, dtype=None, encoding="utf-8-sig"
    )
    ordered = table[::-1] if historian else table  # a historian exports the newest first
    step = 60.0 if historian else float(table["time_s"][1] - table["time_s"][0])
    return cr.valves.diagnose_loop(ordered[op], ordered[pv], dt=step, process=process)


if __name__ == "__main__":
    main()
