"""Make the table of worlds: ``python -m benchmarks.worlds``."""

from __future__ import annotations

import argparse
import json
import platform
import time
from collections import Counter
from dataclasses import asdict
from datetime import date
from pathlib import Path

import numpy as np
import scipy

import ctrl_realize as cr

from . import described, driven, loops, sensors, steps
from .judge import DELAY, GAIN, MODEL, Judged, judged

GROUPS = {
    "steps": steps,
    "sensors": sensors,
    "driven": driven,
    "loops": loops,
    "described": described,
}
PAGE = Path(__file__).parents[2] / "docs" / "tables" / "worlds_table.md"
DOUBTS = DELAY | GAIN | MODEL


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--seeds", type=int, default=10, help="records of each world; the stored table has 3"
    )
    parser.add_argument("--only", nargs="+", default=(), help="worlds to run; prints every record")
    parser.add_argument("--store", type=Path, help="file of finished records, one line each")
    parser.add_argument("--output", type=Path, default=PAGE, help="Markdown file to write")
    given = parser.parse_args()
    seen = stored(given.store)
    for seed in range(given.seeds):
        for module in GROUPS.values():
            for world in module.WORLDS:
                name = world.__name__
                if (name, seed) in seen or (given.only and name not in given.only):
                    continue
                start = time.monotonic()
                one = judged(world, seed)
                seen[name, seed] = one
                if given.only:
                    print(f"{name} {seed} {time.monotonic() - start:.1f} s", *line(one), flush=True)
                if given.store is not None:
                    with given.store.open("a", encoding="utf-8") as file:
                        file.write(json.dumps(asdict(one)) + "\n")
    if given.only:
        return
    text = "\n".join(page(seen))
    given.output.write_text(text, encoding="utf-8")
    print(text)


def stored(path: Path | None) -> dict[tuple[str, int], Judged]:
    if path is None or not path.exists():
        return {}
    lines = path.read_text(encoding="utf-8").splitlines()
    found = [Judged(**json.loads(text)) for text in lines]
    return {(one.world, one.seed): one for one in found}


def line(one: Judged) -> list[str]:
    numbers = " ".join(f"{name} {value:.3g}" for name, value in one.numbers.items())
    return [f"silent: {one.silent}" * bool(one.silent), f"missed: {one.missed}", numbers,
            ", ".join(one.flags), one.refused[:80]]  # fmt: skip


def page(seen: dict[tuple[str, int], Judged]) -> list[str]:
    """Write the table, all records of a world in one row."""
    worlds = {w.__name__: (group, w) for group, m in GROUPS.items() for w in m.WORLDS}
    rows: dict[str, list[Judged]] = {name: [] for name in worlds}
    for one in seen.values():
        if one.world in rows:
            rows[one.world].append(one)
    strange = [
        one for name, group in rows.items() if worlds[name][0] != "described" for one in group
    ]
    plain = [one for name, group in rows.items() if worlds[name][0] == "described" for one in group]
    silent = sum(bool(one.silent) for one in strange)
    missed = sum(bool(one.missed) for one in strange)
    needless = sum(bool(set(one.flags) & DOUBTS) for one in plain)
    lines = [
        f"*Simulated; {len(strange)} records of {len(rows) - len(described.WORLDS)} worlds that no "
        f"rule was made for, {len(plain)} of {len(described.WORLDS)} that the model describes. "
        f"Seeds {min(one.seed for one in seen.values())} to "
        f"{max(one.seed for one in seen.values())}. "
        f"`python -m benchmarks.worlds`, {date.today().isoformat()}, ctrl_realize "
        f"{cr.__version__}, Python {platform.python_version()}, numpy {np.__version__}, scipy "
        f"{scipy.__version__}.*",
        "",
        f"A miss is a dead time outside of its interval, or a gain or total delay that is off by "
        f"more than 20 %; it is silent where no flag concerns that quantity. Silent: {silent} of "
        f"{len(strange)} records ({100 * silent / max(len(strange), 1):.1f} %); missed at all: "
        f"{missed}. Of the records that the model describes, {needless} of {len(plain)} carry a "
        "flag that doubts it.",
        "",
        "| world | records | dead time missed | gain | total delay | silent | refused | flags |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for name, group in rows.items():
        if not group:
            continue
        missed_by = Counter(what for one in group for what in one.missed)
        quiet = Counter(what for one in group for what in one.silent)
        flags = Counter(code for one in group for code in one.flags)
        what = ", ".join(f"{kind} {count}" for kind, count in quiet.items())
        lines.append(
            f"| {(worlds[name][1].__doc__ or '').splitlines()[0].rstrip('.')} (`{name}`) | "
            f"{len(group)} | {missed_by['dead time']} | {missed_by['gain']} | "
            f"{missed_by['total delay']} | {what} | {sum(bool(o.refused) for o in group)} | "
            + ", ".join(f"`{code}` {count}" for code, count in flags.most_common())
            + " |"
        )
    return [*lines, ""]


if __name__ == "__main__":
    main()
