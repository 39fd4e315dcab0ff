"""Run all packages on all tasks and write the tables."""

from __future__ import annotations

import argparse
import contextlib
import os
import platform
import signal
import sys
import time
import warnings
from collections.abc import Iterator
from datetime import date
from importlib import metadata
from pathlib import Path

import numpy as np

from . import driven
from .answers import Answer
from .crossed import crossed_table
from .joint import joint_table
from .measured import FIRST, SETS, Measured, records
from .runners import GIVEN, PACKAGE, RUNNERS
from .starts import STARTS
from .tasks import CRAMER_RAO, DELAY, NOISES, Task, frequency_error, make_task

DATA = Path(__file__).resolve().parents[3] / "shared" / "data"
SHOWN = {
    "identify": "ctrl_realize: identify",
    "scan": "ctrl_realize: scan",
    "SciPy, order 1": "SciPy: curve_fit, first order and dead time",
    "SciPy, order 2": "SciPy: curve_fit, second order and dead time",
    "pysib, OE": "pysib: OE(3, 3) for 26 delays",
    "SIPPY, ARX": "SIPPY: ARX(3, 3) for each delay",
    "SRIVC": "SRIVC (a prototype of ours), order 3",
    "FIR": "regularised FIR (TC, of ours), dead time by likelihood",
}
"""Ways that find a delay, in the table of single records."""

IDENTIFY = SHOWN["identify"]
RIVALS = {
    "order 1": SHOWN["SciPy, order 1"],
    "order 2": SHOWN["SciPy, order 2"],
    "50 starts": f"SciPy: least_squares from {STARTS} starts",
    "ARX": "pysib: ARX(3, 3) for each delay",
    "pysib, OE": SHOWN["pysib, OE"],
    "SRIVC": SHOWN["SRIVC"],
    "FIR": SHOWN["FIR"],
}
"""Ways in the table of fits."""
MANY = (SHOWN["FIR"],)
"""Ways whose models have hundreds of coefficients: not asked for the best fit of a record."""
NEARLY = 0.5
"""Points of fit by which a rival must be better to be named."""

PATIENCE = 45
"""Seconds of CPU time that a way may take for one record."""


@contextlib.contextmanager
def patience() -> Iterator[None]:
    """Raise TimeoutError when the CPU time is used up."""

    def stop(*_: object) -> None:
        raise TimeoutError

    before = signal.signal(signal.SIGVTALRM, stop)
    signal.setitimer(signal.ITIMER_VIRTUAL, PATIENCE)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0)
        signal.signal(signal.SIGVTALRM, before)


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


def answer_of(name: str, task: Task) -> tuple[Answer, float] | str:
    """Ask one way: its answer and the CPU time, or why there is none."""
    start = time.process_time()
    try:
        # Some packages write to the terminal, and warn of what is not ours to judge.
        with warnings.catch_warnings(), silence(), patience(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            answer = RUNNERS[name](task)
    except ImportError:
        return "not installed"
    except TimeoutError:
        return f"over {PATIENCE} s"
    except Exception as error:
        return f"failed: {type(error).__name__}"
    return answer, time.process_time() - start


def simulated_cell(name: str, noise: float, seeds: int) -> tuple[str, float] | str:
    delays, errors, seconds = [], [], []
    for seed in range(seeds):
        found = answer_of(name, make_task(noise, seed))
        if isinstance(found, str):
            return found
        answer, took = found
        seconds.append(took)
        errors.append(frequency_error(answer))
        if answer.delay is not None:
            delays.append(answer.delay - DELAY)
    rms = f"{np.sqrt(np.mean(np.square(delays))):.3g}" if delays else "-"
    middle = float(np.median(errors))
    error = f"{100 * middle:.2g} %" if middle < 0.995 else f"{100 * middle:.0f} %"
    return f"{rms} / {error if middle < 10 else '> 1000 %'}", float(np.mean(seconds))


def simulated_table(seeds: int, part: str = "") -> list[str]:
    head = ["way", "told beforehand"]
    head += [f"{100 * noise:g} % noise" for noise in NOISES] + ["CPU time"]
    lines = _header(head)
    bound = [f"{100 * noise * CRAMER_RAO:.2g}" for noise in NOISES]
    lines.append("| *Cramér-Rao bound* | order, relative degree | " + " | ".join(bound) + " | |")
    for name in step_ways(part):
        cells, seconds = [], []
        for noise in NOISES:
            cell = simulated_cell(name, noise, seeds)
            cells.append(cell if isinstance(cell, str) else cell[0])
            if not isinstance(cell, str):
                seconds.append(cell[1])
        lines.append(_row(name, cells, seconds))
    return lines


def plants_table(found: dict[tuple[str, Measured], tuple[Answer, float] | str]) -> list[str]:
    """Tabulate plants, one column each."""
    measured = list(dict.fromkeys(one for _, one in found))
    counts = {plant: sum(one.plant == plant for one in measured) for plant in SETS}
    head = ["way", "told beforehand"]
    head += [f"{plant} ({count})" for plant, count in counts.items()] + ["CPU time"]
    lines = _header(head)
    for name in dict.fromkeys(name for name, _ in found):
        cells, seconds = [], []
        for plant in SETS:
            good, refused = [], ["no answer"]
            for one in measured:
                answer = found[name, one]
                if one.plant != plant:
                    continue
                if isinstance(answer, str):
                    refused.append(answer)
                    continue
                good.append((one, answer[0]))
                seconds.append(answer[1])
            cells.append(_plant_cell(good, counts[plant]) if good else refused[-1])
        lines.append(_row(name, cells, seconds))
    return lines


def records_tables(found: dict[tuple[str, Measured], tuple[Answer, float] | str]) -> list[str]:
    """Tabulate delays and fits of the single records."""
    measured = list(dict.fromkeys(one for _, one in found))
    lines = ["", "Delays of the single records:", ""]
    lines += _header(["record", "band", *SHOWN])
    for one in measured:
        cells = [_delay_cell(one, found[name, one]) for name in SHOWN.values()]
        band = f"{one.band[0]:.3g} to {one.band[1]:.3g}"
        lines.append(f"| {one.plant}/{one.name} | {band} | " + " | ".join(cells) + " |")
    return [*lines, "", "Fits of the single records:", "", *_fits(measured, found, RIVALS)]


def driven_table(folder: Path) -> list[str]:
    """Tabulate the fits of records of moving inputs."""
    every = driven.driven(folder)
    found = {
        (name, one): answer_of(name, one.task)
        for name in (IDENTIFY, *driven.RIVALS.values())
        for one in every
    }
    lines = _fits(list(every), found, driven.RIVALS)
    return ["", "Fits of records of moving inputs:", "", *lines]


def _fits(
    measured: list[Measured],
    found: dict[tuple[str, Measured], tuple[Answer, float] | str],
    rivals: dict[str, str],
) -> list[str]:
    """Tabulate fits beside that of the best rival, and what `identify` says of its own."""
    lines = _header(["record", "identify", *rivals, "best of all", "what identify reports"])
    for one in measured:
        fits = {
            name: one.fit(answer[0])
            for name in dict.fromkeys(name for name, _ in found)
            if not isinstance(answer := found[name, one], str)
        }
        own = found[IDENTIFY, one]
        assert not isinstance(own, str)
        ours, reasons = fits.pop(IDENTIFY), own[0].reasons
        others = [n for n in fits if PACKAGE[n] != "ctrl-realize" and n not in MANY]
        best = max(others, key=fits.__getitem__)
        shown = [_percent(fits[name]) if name in fits else "-" for name in rivals.values()]
        ahead = fits[best] > ours + NEARLY
        rival = f"**{fits[best]:.1f}** {best}" if ahead else f"{fits[best]:.1f}"
        words = "; ".join(reasons) if ahead else ""
        lines.append(
            f"| {one.plant}/{one.name} | {_percent(ours)} | "
            + " | ".join([*shown, rival, words])
            + " |"
        )
    return lines


def step_ways(part: str = "") -> list[str]:
    """List the ways that take step records and have this in their name."""
    return [name for name in RUNNERS if name not in (driven.FIRST, driven.SECOND) and part in name]


def measured_ways(part: str = "") -> list[str]:
    """List the ways that are asked for measured step records."""
    # llsi takes minutes for one of these records, and is told the delay.
    return [name for name in step_ways(part) if PACKAGE[name] != "llsi"]


def _plant_cell(good: list[tuple[Measured, Answer]], count: int) -> str:
    fit = f"{_percent(float(np.median([one.fit(answer) for one, answer in good])))} %"
    delays = [(one, answer.delay) for one, answer in good if answer.delay is not None]
    if not delays:
        return f"- / {fit}"
    inside = sum(one.outside(delay) == 0 for one, delay in delays)
    return f"{inside} of {count} / {fit}"


def _percent(fit: float) -> str:
    return f"{round(fit, 1) + 0.0:.1f}" if fit > -100 else "below -100"


def _delay_cell(one: Measured, found: tuple[Answer, float] | str) -> str:
    if isinstance(found, str):
        return found
    delay = found[0].delay
    assert delay is not None
    text = f"{delay:.1f}" if delay % 1 else f"{delay:.0f}"
    return text if one.outside(delay) else f"**{text}**"


def _header(cells: list[str]) -> list[str]:
    return ["| " + " | ".join(cells) + " |", "|" + "---|" * len(cells)]


def _row(name: str, cells: list[str], seconds: list[float]) -> str:
    took = f"{np.mean(seconds):.2g} s" if seconds else "-"
    line = f"| {name} | {GIVEN[name]} | " + " | ".join(cells) + f" | {took} |"
    print(line, flush=True)
    return line


def version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "not installed"


def made(command: str) -> str:
    packages = [*dict.fromkeys(PACKAGE.values()), "numpy"]
    if command == "joint":  # of ours alone
        packages = ["ctrl-realize", "control", "scipy", "numpy"]
    versions = ", ".join(f"{package} {version(package)}" for package in packages)
    return (
        f"Made on {date.today()} by `python -m benchmarks.peers {command}` with Python "
        f"{platform.python_version()}, {versions}; one BLAS thread."
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("table", choices=("simulated", "measured", "crossed", "joint"))
    parser.add_argument("--seeds", type=int, default=10, help="simulated records for each cell")
    parser.add_argument("--data", type=Path, default=DATA, help="folder of the measured records")
    parser.add_argument("--way", default="", help="only rows of ways with this in their name")
    parser.add_argument("--output", type=Path, help="Markdown file to write")
    arguments = parser.parse_args()
    if os.environ.get("OMP_NUM_THREADS") != "1":
        raise SystemExit("set OMP_NUM_THREADS=1, so that times can be compared")
    if arguments.table == "simulated":
        lines = simulated_table(arguments.seeds, arguments.way)
        note = (
            "Each cell: root mean square error of the delay in samples (- where the way estimates "
            "none) / median over the records of the relative error of the frequency response, "
            f"root mean square over 0.1-13 Hz. {arguments.seeds} simulated records a cell; true "
            f"delay {DELAY} samples. Told the delay roughly: 26 delays around it, 25 to 50. "
        )
    elif arguments.table == "crossed":

        def ask(name: str, one: Measured) -> Answer | None:
            found = answer_of(name, one.task)
            return None if isinstance(found, str) else found[0]

        lines = crossed_table(records(arguments.data), ask)
        note = (
            "Each cell: median over all pairs of different records of a plant of the fit in "
            "percent (NRMSE after the step, offset taken off) of one record by the model of the "
            "other, as it is / with the best gain for that record. Way told the order: 3. "
            "The subspace methods' matrices of a single step are close to singular, so that some "
            "of their models differ from one processor to another. SRIVC: our prototype of a "
            "method that no package in Python has, from three starts. "
        )
    elif arguments.table == "joint":
        lines = joint_table(records(arguments.data))
        note = (
            "Each cell: median over the records of a plant, each left out once, of the fit in "
            "percent (NRMSE after the step, offset taken off) of that record by models of the "
            "others, as it is / with the best gain for that record. Single fits: median of the "
            "predictions of their models. Own gains, as it is: with the gain that the schedule has "
            "at the operating point of the record left out, which is beyond the others for two "
            "records of three. Records whose sample times differ by less than 0.1 % were "
            "resampled to the median. "
        )
    else:
        every = records(arguments.data)
        found = {
            (name, one): answer_of(name, one.task)
            for name in measured_ways(arguments.way)
            for one in every
        }
        lines = plants_table(found)
        if not arguments.way:
            lines += records_tables(found) + driven_table(arguments.data)
        note = (
            "Upper table, each cell: delays within the band (- where the way estimates none) / "
            "median of the percentage of the response that a simulation explains, offset taken "
            "off. Second table: delays in samples, in bold within the band. The bands are what "
            "the authors state or the first motion allows, themselves doubtful by a sample or "
            "two. Nobody knows the order of these plants: `order` is 3 here for whoever asks. "
            "Told the delay: the middle of the band. Told it roughly: 26 delays up to twice the "
            "end of the band, which is also where all other searches end, `identify` and the "
            "paper's settings excepted, which are told nothing of it. Fits in the last table: a "
            f"rival is named where it is better by more than {NEARLY:g} points, with what "
            "`identify` reports (there in per cent of the whole record): a drift or free response "
            "that it estimated together with the model is not in a simulation of the model alone; "
            "a structure that follows more closely was not chosen, since it does so by no more "
            "than its additional parameters follow noise, or since no structure is adequate. "
            "Inputs that move: means taken off, simulated from rest, the last nine tenths of the "
            "record, dead times up to 15 samples. The "
            "rules of `identify` "
            f"were made with the records of {', '.join(FIRST)} in view, and one of them with "
            "two_cart_drive, which flatters it. SRIVC: our prototype of a method that no package "
            "in Python has, from three starts. FIR: up to 800 coefficients; its fits, of the very "
            "record that it was estimated from, have a column of their own, not best of all. "
        )
    text = "\n".join([*lines, "", note + made(arguments.table), ""])
    if arguments.output:
        arguments.output.parent.mkdir(parents=True, exist_ok=True)
        arguments.output.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
