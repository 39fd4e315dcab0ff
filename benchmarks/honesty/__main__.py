"""Make the honesty table: ``python -m benchmarks.honesty --short``."""

from __future__ import annotations

import argparse
import platform
import time
from collections.abc import Callable
from datetime import date
from pathlib import Path

import control
import numpy as np
import scipy

import ctrl_realize as cr

from .runs import Store, Task, flag_tasks, interval_tasks, main_tasks, run
from .tables import (
    explanation,
    fit_flag_table,
    fit_tables,
    flag_table,
    interval_table,
    refusal_table,
)
from .trial import Seen

OTHERS = (
    "Nominal is 95 %, but for the flat sets and the scan, which claim no level. A band of many "
    "points counts with the part of them that holds the truth. Each record has noise of its own."
)


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--short", action="store_true", help="two seeds, few minutes")
    parser.add_argument("--seeds", type=int, default=1000, help="records of each world")
    parser.add_argument(
        "--interval-seeds",
        type=int,
        help="of the other intervals, cheap ones four times as many; default 1/25",
    )
    parser.add_argument("--flag-seeds", type=int, help="of each flag's worlds, default 1/25")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--minutes", type=float, default=float("inf"), help="stop after these")
    parser.add_argument("--only", nargs="+", default=(), help="families to run; all are tabulated")
    parser.add_argument("--store", type=Path, help="folder of finished cases; a run goes on there")
    parser.add_argument("--tables", action="store_true", help="of all the store has; run nothing")
    parser.add_argument("--note", default="", help="a sentence for the caption")
    parser.add_argument("--output", type=Path, help="Markdown file to write")
    return parser.parse_args()


def main() -> None:
    given = arguments()
    start = time.monotonic()
    deadline = start + 60 * given.minutes
    seeds = 2 if given.short else given.seeds
    others = given.interval_seeds or max(seeds // 25, 1)
    flags = given.flag_seeds or max(seeds // 25, 2)
    if given.store is not None:
        given.store.mkdir(parents=True, exist_ok=True)

    def seen(part: str, tasks: list[Task]) -> list[Seen]:
        store = Store(None if given.store is None else given.store / f"{part}.jsonl")
        if given.tables:
            return list(store.seen.values())
        return run(tasks, store, given.jobs, deadline, given.only)

    made = {
        "fit": seen("fit", main_tasks(seeds)),
        "intervals": seen("intervals", interval_tasks(others)),
        "flags": seen("flags", flag_tasks(flags)),
    }
    text = "\n".join([*caption(made, given.note), "", *sections(made), ""])
    if given.output is None:
        print(text)
    else:
        given.output.write_text(text, encoding="utf-8")


def caption(made: dict[str, list[Seen]], note: str) -> list[str]:
    """Say what was run, when, and with what."""
    counts = f"{len(made['fit'])} single fits, {len(made['intervals'])} cases of other intervals, "
    return [
        f"*Simulated; {counts}{len(made['flags'])} flag worlds, seeds from 0 on. In parentheses: "
        "Wilson's 95 % interval of each rate. "
        f"`python -m benchmarks.honesty`, {date.today().isoformat()}, ctrl_realize "
        f"{cr.__version__}, Python {platform.python_version()}, numpy {np.__version__}, scipy "
        f"{scipy.__version__}, control {control.__version__}.{note and ' ' + note}*"
    ]


def sections(made: dict[str, list[Seen]]) -> list[str]:
    tables: list[tuple[str, str, Callable[[list[Seen]], list[str]], str]] = [
        ("fit", "fit_output_error, one step record", fit_tables, explanation()),
        ("fit", "Its flags in these worlds", fit_flag_table, ""),
        ("intervals", "Every other interval", interval_table, OTHERS),
        ("flags", "Flags where they are due and where they are not", flag_table, ""),
        ("intervals", "Refused", refusal_table, ""),
    ]
    lines = []
    for part, title, table, words in tables:
        if made[part]:
            lines += [f"### {title}", "", *([words, ""] if words else [])]
            lines += folded(table(made[part]))
    return lines


def folded(table: list[str]) -> list[str]:
    """Fold what is longer than a screen; a page shows its heading."""
    rows = sum(line.startswith("| ") for line in table)
    if rows < 20:
        return [*table, ""]
    return [
        f'<details class="long"><summary>{rows} rows</summary>',
        "",
        *table,
        "",
        "</details>",
        "",
    ]


if __name__ == "__main__":
    main()
