"""Table of what the long fuzz lane has run: ``python3 tools/fuzz_table.py LOG... --output FILE``.

Reads what `FUZZ_LOG` was written to, in runs that may overlap: a case counts once.
"""

from __future__ import annotations

import argparse
import json
import platform
from collections import defaultdict
from collections.abc import Iterable
from datetime import date
from importlib.metadata import version
from pathlib import Path
from typing import Any

RENAMED = {"test_an_exact_delay_is_found_exactly": "test_an_exact_response_is_found_exactly"}
"""Earlier names of targets; their cases are others than those of the new name."""

PACKAGES = ("control", "numpy", "scipy", "pandas", "pyarrow", "matplotlib")


def union(ranges: Iterable[tuple[int, int]]) -> int:
    """Count the cases in ranges ``first <= case < end`` that may overlap.

    Examples
    --------
    >>> union([(0, 10), (5, 12), (20, 21)])
    13
    """
    total, reached = 0, 0
    for first, end in sorted(ranges):
        total += max(end - max(first, reached), 0)
        reached = max(reached, end)
    return total


def table(lines: Iterable[dict[str, Any]]) -> list[str]:
    """One row a target, in the order in which they first ran."""
    ranges: dict[str, dict[str, list[tuple[int, int]]]] = defaultdict(lambda: defaultdict(list))
    failed: dict[str, set[tuple[str, str]]] = defaultdict(set)
    for line in lines:
        drawn, first = line["target"], line.get("first", 0)
        name = RENAMED.get(drawn, drawn)
        source = f"{drawn}:{line['seed']}"
        ranges[name][source].append((first, first + line["cases"]))
        failed[name] |= {(source, text.split(":")[0]) for text in line["failures"]}
    rows = ["| target | cases | failed, and is repaired |", "|---|---:|---:|"]
    for name, seeds in ranges.items():
        cases = sum(map(union, seeds.values()))
        words = name.removeprefix("test_").replace("_", " ")
        count = f"{cases:,}".replace(",", " ")
        rows.append(f"| {words} | {count} | {len(failed[name])} |")
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("logs", nargs="+", type=Path)
    parser.add_argument("--output", type=Path, required=True)
    parser.add_argument("--date", default=date.today().isoformat(), help="of the runs")
    asked = parser.parse_args()
    lines = [json.loads(row) for log in asked.logs for row in log.read_text().splitlines()]
    seeds = ", ".join(sorted({line["seed"] for line in lines}, key=lambda seed: (len(seed), seed)))
    installed = ", ".join(f"{name} {version(name)}" for name in PACKAGES)
    caption = (
        f"*Runs of {asked.date} with the seeds {seeds}: Python {platform.python_version()}, "
        f"{installed}. A case counts once, in however many runs it was.*"
    )
    text = "\n".join([*table(lines), "", caption, ""])
    asked.output.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
