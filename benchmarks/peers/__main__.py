"""Run all packages on all tasks and write the table."""

from __future__ import annotations

import argparse
import contextlib
import os
import platform
import sys
import time
import warnings
from collections.abc import Iterator
from datetime import date
from importlib import metadata
from pathlib import Path

import numpy as np

from .runners import GIVEN, PACKAGE, RUNNERS
from .tasks import CRAMER_RAO, DELAY, NOISES, frequency_error, make_task


@contextlib.contextmanager
def silence() -> Iterator[None]:
    """Send what Python and compiled code write to the terminal nowhere."""
    sys.stdout.flush()
    kept = os.dup(1)
    with open(os.devnull, "w") as nowhere:
        os.dup2(nowhere.fileno(), 1)
        try:
            with contextlib.redirect_stdout(nowhere):
                yield
        finally:
            os.dup2(kept, 1)
            os.close(kept)


def one_cell(name: str, noise: float, seeds: int) -> tuple[str, str, float] | str:
    delays, errors, seconds = [], [], []
    for seed in range(seeds):
        task = make_task(noise, seed)
        start = time.process_time()
        try:
            # Some packages write to the terminal, and warn of what is not ours to judge.
            with (
                warnings.catch_warnings(),
                silence(),
                np.errstate(all="ignore"),
            ):
                warnings.simplefilter("ignore")
                answer = RUNNERS[name](task)
        except ImportError:
            return "not installed"
        except Exception as error:
            return f"failed: {type(error).__name__}"
        seconds.append(time.process_time() - start)
        errors.append(frequency_error(answer))
        if answer.delay is not None:
            delays.append(answer.delay - DELAY)
    rms = f"{np.sqrt(np.mean(np.square(delays))):.3g}" if delays else "-"
    middle = float(np.median(errors))
    return rms, f"{100 * middle:.2g} %" if middle < 10 else "> 1000 %", float(np.mean(seconds))


def version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "not installed"


def table(seeds: int) -> str:
    head = ["way", "told beforehand"]
    head += [f"{100 * noise:g} % noise" for noise in NOISES] + ["CPU time"]
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    bound = [f"{100 * noise * CRAMER_RAO:.2g}" for noise in NOISES]
    lines.append("| *Cramér-Rao bound* | order, relative degree | " + " | ".join(bound) + " | |")
    for name in RUNNERS:
        cells, seconds = [], []
        for noise in NOISES:
            cell = one_cell(name, noise, seeds)
            if isinstance(cell, str):
                cells.append(cell)
                continue
            cells.append(f"{cell[0]} / {cell[1]}")
            seconds.append(cell[2])
        took = f"{np.mean(seconds):.2g} s" if seconds else "-"
        lines.append(f"| {name} | {GIVEN[name]} | " + " | ".join(cells) + f" | {took} |")
        print(lines[-1], flush=True)
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=10, help="records for each cell")
    parser.add_argument("--output", type=Path, help="Markdown file to write")
    arguments = parser.parse_args()
    if os.environ.get("OMP_NUM_THREADS") != "1":
        raise SystemExit("set OMP_NUM_THREADS=1, so that times can be compared")
    rows = table(arguments.seeds)
    versions = ", ".join(
        f"{package} {version(package)}" for package in [*dict.fromkeys(PACKAGE.values()), "numpy"]
    )
    text = (
        f"{rows}\n\n"
        "Each cell: root mean square error of the delay in samples (- where the way estimates "
        "none) / median over the records of the relative error of the frequency response, "
        f"root mean square over 0.1-13 Hz. {arguments.seeds} simulated records a cell; true delay "
        f"{DELAY} samples; one BLAS thread. Made on {date.today()} with Python "
        f"{platform.python_version()}, {versions}.\n"
    )
    if arguments.output:
        arguments.output.parent.mkdir(parents=True, exist_ok=True)
        arguments.output.write_text(text, encoding="utf-8")


main()
