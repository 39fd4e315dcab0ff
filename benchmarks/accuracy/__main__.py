"""Make the accuracy tables: ``python -m benchmarks.accuracy --short``."""

from __future__ import annotations

import argparse
import platform
import time
from datetime import date
from pathlib import Path

from .coloured import coloured_table
from .methods import METHODS
from .starts import starts_table
from .study import factorial_table, measured_table, rig_table


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--short", action="store_true", help="few seeds, under two minutes")
    parser.add_argument("--seeds", type=int, default=100)
    parser.add_argument("--fit-seeds", type=int, help="of the output-error fit, if not the same")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--measured", type=Path, help="folder of measured records")
    parser.add_argument("--output", type=Path, help="Markdown file to write")
    arguments = parser.parse_args()
    start = time.perf_counter()
    seeds = 5 if arguments.short else arguments.seeds
    fit_seeds = max(seeds, arguments.fit_seeds or 0)
    noises = (0.001, 0.005) if arguments.short else (0.001, 0.005, 0.01, 0.02)
    lines = [
        "*Simulated plants; seeds from 0 on, delay uniform in 30 to 45 samples of 1/1280 s, "
        "any gain and offset, white noise in percent of the step. Delays and errors in samples. "
        f"`python -m benchmarks.accuracy`, {date.today().isoformat()}, "
        f"Python {platform.python_version()}.*",
        "",
        *rig_table(seeds, fit_seeds, noises, METHODS, arguments.jobs),
        "",
        "### Coloured noise",
        "",
        f"{fit_seeds} records a row; the bound is that for the noise at hand.",
        "",
        *coloured_table(fit_seeds, arguments.jobs),
        "",
        "### Factorial experiment",
        "",
        *factorial_table(max(seeds // 5, 2), arguments.jobs),
        "",
        "### Local minima",
        "",
        *starts_table(5 if arguments.short else max(seeds, 100), arguments.jobs),
    ]
    if arguments.measured is not None:
        lines += ["", "### Measured plants, defaults only", "", *measured_table(arguments.measured)]
    lines += ["", f"*{time.perf_counter() - start:.0f} s with {arguments.jobs} processes.*", ""]
    text = "\n".join(lines)
    if arguments.output is None:
        print(text)
    else:
        arguments.output.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
