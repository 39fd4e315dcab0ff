"""Run the Monte Carlo and make tables of it."""

from __future__ import annotations

import functools
from collections.abc import Iterable
from pathlib import Path

import control as ct
import numpy as np
from joblib import Parallel, delayed

import ctrl_realize as cr
from tests import rigs

from . import plants
from .methods import METHODS, Estimate, run

Shown = tuple[float, bool, float]
"""Error in samples, whether the interval covers, and its width."""


def shown(estimate: Estimate, truth: float) -> Shown:
    covers = estimate.low <= truth <= estimate.high
    return estimate.delay - truth, bool(covers), estimate.high - estimate.low


def one(
    method: str, plant: ct.TransferFunction, noise: float, coarser: int = 1, *, seed: int
) -> Shown:
    """Estimate the delay of one record."""
    record, truth = plants.record(plant, noise, seed, coarser)
    return shown(run(method, record, len(plant.poles())), truth)


def with_known_sensor(noise: float, *, seed: int) -> Shown:
    """Estimate the delay of R4 with its sensor's pole given."""
    record, truth = plants.record(plants.RIGS["R4"], noise, seed)
    fit = cr.fit_output_error(record, known=plants.SENSOR, structures=[(3, 3)]).fit
    return shown(Estimate(fit.delay, *fit.delay_interval), truth)


def rig_table(
    seeds: int, fit_seeds: int, noises: Iterable[float], methods: Iterable[str], jobs: int
) -> list[str]:
    """Tabulate bias, scatter, error over bound and coverage on the rigs.

    `fit_seeds` is the number of records for the output-error fit.
    """
    lines = [
        "| plant | noise | method | records | bias | scatter | rms error | bound | error / bound "
        "| coverage | median width |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for name, plant in plants.RIGS.items():
        for noise in noises:
            best = plants.bound(plant, noise)
            for method in methods:
                work = functools.partial(one, method, plant, noise)
                count = fit_seeds if method.startswith("output error") else seeds
                lines.append(_row(name, noise, method, best, repeated(work, count, jobs)))
            if name == "R4":
                best = plants.bound(rigs.R3, noise, sensor_known=True)
                work = functools.partial(with_known_sensor, noise)
                rows = repeated(work, fit_seeds, jobs)
                lines.append(_row(name, noise, "output error, sensor known", best, rows))
    return lines


def factorial_table(seeds: int, jobs: int) -> list[str]:
    """Tabulate a factorial experiment in the manner of Bjorklund and Ljung.

    Every combination of method, plant, noise and sample time; the logarithm of the rms error
    (in ms) is split into main effects.
    """
    methods = [m for m in METHODS if m != "output error, structure given"]
    noises, coarsenesses = (0.001, 0.01), (1, 8)
    cells = [
        (m, p, s, c)
        for m in methods
        for p in plants.FACTORIAL
        for s in noises
        for c in coarsenesses
    ]
    errors = {}
    for cell in cells:
        method, name, noise, coarser = cell
        work = functools.partial(one, method, plants.FACTORIAL[name], noise, coarser)
        found = repeated(work, seeds, jobs)[:, 0] * coarser * rigs.TS * 1e3
        # A method without an answer is charged 100 ms.
        found = np.where(np.isfinite(found), found, 100.0)
        errors[cell] = float(np.log10(max(np.sqrt(np.mean(found**2)), 1e-3)))
    grand = float(np.mean(list(errors.values())))
    total = sum((value - grand) ** 2 for value in errors.values())
    lines = ["| factor | level | rms error [ms], geometric mean |", "|---|---|---|"]
    shares = []
    titles = ("method", "plant", "noise", "samples per 1/1280 s")
    for position, title in enumerate(titles):
        levels = list(dict.fromkeys(cell[position] for cell in cells))
        means = {
            level: np.mean([errors[cell] for cell in cells if cell[position] == level])
            for level in levels
        }
        effect = sum((means[cell[position]] - grand) ** 2 for cell in cells)
        shares.append(f"{title} {100 * effect / total:.0f} %")
        for level in levels:
            label = f"1/{level}" if position == 3 else f"{level}"
            lines.append(f"| {title} | {label} | {10 ** means[level]:.3g} |")
    lines += ["", f"Part of the variance of log error by main effects: {', '.join(shares)}."]
    return lines


def measured_table(folder: Path) -> list[str]:
    """Tabulate what `fit_output_error` makes of measured step records, with its defaults."""
    lines = [
        "| record | delay [samples] | interval | first motion | structure | residual / noise |",
        "|---|---|---|---|---|---|",
    ]
    names = ("wis_canal", "dc_motor_tacho", "air_duct", "heating_system", "rlc_zero_delay")
    for path in sorted(p for name in names for p in (folder / name).glob("*.csv")):
        if path.stem == "frf":
            continue
        data = np.loadtxt(path, delimiter=",", skiprows=1)
        stamps = data[0, 0] + np.arange(len(data)) * np.ptp(data[:, 0]) / (len(data) - 1)
        fit = cr.fit_output_error(cr.Record(stamps, data[:, 1], data[:, 2])).fit
        low, high = fit.delay_interval
        level = "noise level" if fit.at_noise_level else f"{fit.normalized_rms:.2g}"
        lines.append(
            f"| {path.parent.name}/{path.stem} | {fit.delay:.1f} | {low:.1f} ... {high:.1f} "
            f"| {fit.onset / fit.dt:.1f} | {fit.order}, {fit.relative_degree} | {level} |"
        )
    return lines


def repeated(work: functools.partial, seeds: int, jobs: int) -> np.ndarray:
    """Run seed after seed, in parallel; one row each."""
    return np.array(Parallel(n_jobs=jobs)(delayed(work)(seed=k) for k in range(seeds)), float)


def _row(name: str, noise: float, method: str, best: float, rows: np.ndarray) -> str:
    error = rows[:, 0]
    if not np.isfinite(error).all():
        return (
            f"| {name} | {100 * noise:g} % | {method} | {len(rows)} | no answer | | | {best:.3g} "
            "| | | |"
        )
    rms = float(np.sqrt(np.mean(error**2)))
    has = np.isfinite(rows[:, 2]).all()
    covered = f"{100 * rows[:, 1].mean():.0f} %" if has else ""
    width = f"{np.median(rows[:, 2]):.3g}" if has else ""
    return (
        f"| {name} | {100 * noise:g} % | {method} | {len(rows)} | {error.mean():+.3g} "
        f"| {error.std(ddof=1):.3g} | {rms:.3g} | {best:.3g} | {rms / best:.3g} | {covered} "
        f"| {width} |"
    )
