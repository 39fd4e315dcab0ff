"""Print the table of speeds and write it for the docs: ``python -m benchmarks.speed``."""

from __future__ import annotations

import argparse
import os
import platform
from collections.abc import Iterator
from pathlib import Path

import control
import numpy
import scipy

from . import models, scans, sizes
from .measure import Line

TABLE = Path(__file__).resolve().parents[2] / "docs" / "tables" / "performance_table.md"


def conditions() -> str:
    """Say on what the figures were taken."""
    return (
        "One BLAS thread, CPU time of the process (least of several calls, on both sides), "
        f"{platform.machine()}, Python {platform.python_version()}, NumPy {numpy.__version__}, "
        f"SciPy {scipy.__version__}, python-control {control.__version__}; {os.cpu_count()} cores, "
        f"load average {os.getloadavg()[0]:.1f} at the start (wall times suffer from it, CPU times "
        "by half at most). Data are simulated. Ratios are baseline over ours, in the same run."
    )


def row(line: Line) -> str:
    """Write one line of the table."""
    ratio = "" if line.ratio is None else f"{line.ratio:,.0f}".replace(",", " ")
    cells = (line.work, line.ours, line.baseline, ratio, line.must, line.aim, line.how)
    return "| " + " | ".join(cells) + " |"


def main() -> None:
    """Time what was asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("parts", nargs="*", help="scans, sizes, long, models (default: all)")
    parser.add_argument("--full", action="store_true", help="run baselines of minutes and 2 GB")
    parser.add_argument("--table", type=Path, default=TABLE, help="where to write the table")
    options = parser.parse_args()
    parts = options.parts or ["scans", "sizes", "long", "models"]

    def lines() -> Iterator[Line]:
        if "scans" in parts:
            yield from scans.lines()
        if "sizes" in parts:
            yield from sizes.lines(full=options.full)
        if "long" in parts:
            yield from sizes.long_lines(full=options.full)
        if "models" in parts:
            yield from models.lines()

    text = [
        conditions(),
        "",
        "| work | ours | baseline | times faster | must | aim | baseline is |",
        "|---|---|---|---|---|---|---|",
    ]
    print("\n".join(text))
    for line in lines():
        text.append(row(line))
        print(text[-1], flush=True)
    if not options.parts:
        options.table.parent.mkdir(parents=True, exist_ok=True)
        options.table.write_text("\n".join(text) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
