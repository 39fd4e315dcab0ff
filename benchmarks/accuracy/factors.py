"""Dead times by input, noise, plant and loop: ``python -m benchmarks.accuracy.factors``.

A factorial experiment after the factors of Bjorklund and Ljung [1]_ (signal-to-noise ratio, input,
system) and of Bjorklund [2]_ (open or closed loop); plants, lengths and levels are ours. Beside
`identify` stands the comparison of ARX(2, 2) models of all delays, on which MATLAB's `delayest` is
based by its documentation.

References
----------
.. [1] S. Bjorklund and L. Ljung, A review of time-delay estimation techniques, Proc. 42nd IEEE
   Conf. Decision and Control 2003, 2502-2507, doi:10.1109/CDC.2003.1272997.
.. [2] S. Bjorklund, A survey and comparison of time-delay estimation methods in linear systems,
   Licentiate thesis 1061, Linkopings universitet 2003.
"""

from __future__ import annotations

import argparse
import itertools
import json
import warnings
from collections.abc import Iterator, Sequence
from datetime import date
from pathlib import Path
from zlib import crc32

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.signal import butter, sosfilt

import ctrl_realize as cr

from ..closed_loop.bound import least_error, response
from ..closed_loop.cases import Case, Plant, looped

SAMPLES, REST = 600, 40  # of 1 s
PLANTS = {
    "slow, two lags": Plant((20.0, 5.0), 9.3),
    "fast, two lags": Plant((3.0, 1.0), 9.3),
    "slow, four lags": Plant((12.0, 6.0, 4.0, 3.0), 9.3),
    "fast, four lags": Plant((1.5, 1.0, 0.8, 0.7), 9.3),
}
INPUTS = ("steps", "binary, to 30 % of Nyquist", "binary, to Nyquist")
RATIOS = (1.0, 100.0)
"""Variance of the undisturbed output over that of white noise."""
LOOPS = ("open", "closed")
LONGEST = 40  # delay that ARX models are given
Row = dict[str, str | float | int | list[str]]


def signal(kind: str, rng: np.random.Generator) -> np.ndarray:
    """Input of the open loop, or set point of the closed one: -1 and 1 after a rest at 0."""
    moved = SAMPLES - REST
    if kind == "steps":
        made = np.repeat(rng.permutation(np.resize([1.0, -1.0], moved // 80)), 80)
    elif kind == "binary, to Nyquist":
        made = np.sign(rng.standard_normal(moved))
    else:
        band = butter(4, 0.3, output="sos")
        made = np.sign(sosfilt(band, rng.standard_normal(moved + 100))[100:])
    return np.concatenate([np.zeros(REST), made])


def record(plant: Plant, kind: str, ratio: float, loop: str, seed: int) -> tuple[cr.Record, float]:
    """Record, and the standard deviation of its noise."""
    rng = np.random.default_rng([seed, crc32(repr((plant, kind, ratio, loop)).encode())])
    moves, white = signal(kind, rng), rng.standard_normal(SAMPLES)
    time = np.arange(SAMPLES) * 1.0
    if loop == "open":
        clean = response(plant, moves)
        sigma = float(np.std(clean) / np.sqrt(ratio))
        return cr.Record(time, moves, clean + sigma * white), sigma
    at_rest = np.zeros(SAMPLES)
    _, clean = looped(plant, moves, at_rest, Case(), at_rest)
    sigma = float(np.std(clean) / np.sqrt(ratio))
    applied, output = looped(plant, moves, sigma * white, Case(), at_rest)
    return cr.Record(time, applied, output, reference=moves), sigma


def delay_of_arx(record: cr.Record) -> float:
    """Delay of the ARX(2, 2) model of the least loss, at the middle of its sample."""
    y, u = record.output.ravel(), record.input.ravel()
    first = LONGEST + 2
    past = sliding_window_view(y, 2)[first - 2 : -1]
    losses = []
    for delay in range(1, LONGEST):
        moved = sliding_window_view(u, 2)[first - delay - 1 : u.size - delay - 1]
        columns = np.concatenate([past, moved, np.ones((len(past), 1))], axis=1)
        left = y[first:] - columns @ np.linalg.lstsq(columns, y[first:], rcond=None)[0]
        losses.append(float(left @ left))
    return float(np.argmin(losses)) + 0.5  # with b at the samples delay and delay + 1


def rows(seeds: tuple[int, int], loops: Sequence[str], known: set[tuple]) -> Iterator[Row]:
    """One row for every record; a fit that is refused has no dead time."""
    levels = itertools.product(range(*seeds), loops, INPUTS, RATIOS, PLANTS)
    for seed, loop, kind, ratio, name in levels:
        if (seed, loop, kind, ratio, name) in known:
            continue
        made, sigma = record(PLANTS[name], kind, ratio, loop, seed)
        row: Row = {"seed": seed, "loop": loop, "input": kind, "ratio": ratio, "plant": name}
        row |= {
            "bound": least_error(PLANTS[name], made.input.ravel(), sigma),
            "arx": delay_of_arx(made),
        }
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                fit = cr.identify(made).fit
            row |= {"delay": fit.dead_time, "low": fit.interval[0], "high": fit.interval[1]}
            row |= {"flags": [flag.code for flag in fit.flags]}
        except cr.CtrlRealizeError as error:
            row["refused"] = str(error)[:120]
        yield row


def table(done: list[Row]) -> list[str]:
    """Errors, coverage and width for every loop, input and ratio, and for every plant."""
    seeds = sorted({int(row["seed"]) for row in done})
    lines = [
        f"*Simulated, {SAMPLES} samples of 1 s, dead time 9.3 s, white noise, four plants, seeds "
        f"{seeds[0]} to {seeds[-1]}; errors in samples. `identify` is given the set point of a "
        "loop and nothing else. Median error is that of the absolute value; the bound is that of "
        "Cramer and Rao for known lags, its median. A miss is silent if no flag is raised. "
        f"`python -m benchmarks.accuracy.factors`, {date.today().isoformat()}.*",
        "",
        "| loop | input or set point | signal to noise | records | refused | median error | rms "
        "error | bound | interval holds | median width | silent misses | ARX scan: median error "
        "| rms error |",
        "|---|---|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for loop, kind, ratio in itertools.product(LOOPS, INPUTS, RATIOS):
        some = [r for r in done if (r["loop"], r["input"], r["ratio"]) == (loop, kind, ratio)]
        lines.append(_line(f"{loop} | {kind} | {ratio:g}", some))
    for name in PLANTS:
        lines.append(_line(f"both | all, {name} | all", [r for r in done if r["plant"] == name]))
    return [*lines, _line("both | all | all", done)]


def _line(named: str, some: list[Row]) -> str:
    fitted = [row for row in some if "delay" in row]
    truth = PLANTS["slow, two lags"].dead_time
    delay, low, high, arx, least = (
        np.array([float(row[key]) for row in fitted])  # type: ignore[arg-type]
        for key in ("delay", "low", "high", "arx", "bound")
    )
    error, missed = delay - truth, ~((low <= truth) & (truth <= high))
    silent = sum(bool(miss) and not row["flags"] for miss, row in zip(missed, fitted, strict=True))
    return (
        f"| {named} | {len(fitted)} | {len(some) - len(fitted)} | {np.median(np.abs(error)):.2g} "
        f"| {np.sqrt(np.mean(error**2)):.2g} | {np.median(least):.2g} "
        f"| {100 * (1 - missed.mean()):.0f} % | {np.median(high - low):.2g} | {silent} "
        f"| {np.median(np.abs(arx - truth)):.2g} | {np.sqrt(np.mean((arx - truth) ** 2)):.2g} |"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--store", type=Path, required=True, help="rows that are there are kept")
    parser.add_argument("--seeds", type=int, nargs=2, default=(0, 4), metavar=("FIRST", "STOP"))
    parser.add_argument("--loops", nargs="+", default=LOOPS, choices=LOOPS)
    parser.add_argument("--table", type=Path, help="Markdown file to write, from what is stored")
    arguments = parser.parse_args()
    store = arguments.store
    done = [json.loads(line) for line in store.read_text().splitlines()] if store.exists() else []
    known = {(r["seed"], r["loop"], r["input"], r["ratio"], r["plant"]) for r in done}
    with store.open("a") as out:
        for row in rows(tuple(arguments.seeds), arguments.loops, known):
            out.write(json.dumps(row) + "\n")
            out.flush()
            done.append(row)
    if arguments.table is not None:
        arguments.table.write_text("\n".join(table(done)) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
