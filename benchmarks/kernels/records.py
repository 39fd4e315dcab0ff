"""Records that are identified under every kernel: all measured ones, and small simulated ones."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

import ctrl_realize as cr
from benchmarks.honesty import worlds

DATA = Path(__file__).resolve().parents[3] / "shared" / "data"
SIMULATED = 200
_STEPS = 140  # of them, the others have an input that moves all the time
_HEADER = "time_s,input,output"


def measured() -> Iterator[tuple[str, cr.Record]]:
    """Every measured record of one input and one output on a uniform time axis, with its name."""
    for path in sorted(DATA.glob("*/*.csv")):
        with path.open() as file:
            if file.readline().strip() != _HEADER:
                continue
        table = np.loadtxt(path, delimiter=",", skiprows=1)
        # Stamps are rounded; their mean step is the sample time.
        time = np.linspace(table[0, 0], table[-1, 0], len(table))
        yield f"{path.parent.name}/{path.stem}", cr.Record(time, table[:, 1], table[:, 2])
    path = DATA / "motor_bench_multisine.npz"
    if path.is_file():
        with np.load(path) as arrays:
            time = float(arrays["dt"]) * np.arange(arrays["u"].size)
            yield path.stem, cr.Record(time, arrays["u"], arrays["y"])


def simulated() -> Iterator[tuple[str, cr.Record]]:
    """Steps and driven records of the honesty worlds, small ones, in turn."""
    kinds, noises = worlds.KINDS, worlds.NOISES
    plants, wrong = tuple(worlds.PLANTS), worlds.WRONG
    for i in range(SIMULATED):
        kind, noise = kinds[i % len(kinds)], noises[i // len(kinds) % len(noises)]
        if i < _STEPS:
            row = i // (len(kinds) * len(noises))
            plant = (wrong if kind == "wrong structure" else plants)[
                row % len(wrong if kind == "wrong structure" else plants)
            ]
            record = worlds.step_case(kind, plant, noise, i, before=150, after=450).record
            name = f"step {i}: {plant}"
        else:
            record = worlds.driven_case(kind, noise, i, samples=400).record
            name = f"driven {i}"
        yield f"{name}, {kind}, noise {100 * noise:g} %", record


def changed(record: cr.Record, change: str) -> cr.Record:
    """Give a record one-ulp noise on its output, another unit of time, or other units of signals.

    The units are no powers of two, so that everything is rounded otherwise.
    """
    time, u, y = record.time, record.input, record.output
    if change == "one ulp":
        sign = np.random.default_rng(0).choice([-1.0, 1.0], y.shape)
        return cr.Record(time, u, y * (1 + sign * np.finfo(np.float64).eps))
    if change == "milliseconds":
        return cr.Record(1000 * time, u, y)
    if change == "scaled":
        return cr.Record(time, 0.3 * u, 700.0 * y)
    return record
