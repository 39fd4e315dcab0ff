#!/usr/bin/env python3
"""Draw the figure of the paper from data that come with the package: ``python paper/figure.py``."""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

import ctrl_realize as cr

TARGET = Path(__file__).with_name("figure.png")
DATA, MODEL, SHADE = "#0072b2", "#d55e00", "#f2cf7a"


def draw(
    axes: Axes, record: cr.Record, name: str, until: float, factor: float, sign: str, symbol: str
) -> None:
    """Unit step response and model of a record up to a time in s, shown in ``1 / factor`` s."""
    model = cr.identify(record)
    step = cr.unit_step(record)
    low, high = model.fit.interval
    shown = step.time <= until
    time = factor * step.time[shown]
    axes.axvspan(factor * low, factor * high, color=SHADE, lw=0, label="interval")
    axes.plot(time, step.output[shown], symbol, color=DATA, ms=3, lw=1, label="record")
    response = model.step(step.n_samples)[shown]
    axes.plot(time, response, "--", color=MODEL, lw=1.8, label="model")
    axes.axvline(factor * model.fit.dead_time, color=MODEL, lw=1, label="dead time")
    axes.set(title=name, xlabel=f"time after the step [{sign}]", ylabel="unit step response")
    axes.margins(x=0)


def main() -> None:
    plt.rcParams.update({"font.size": 9, "axes.spines.top": False, "axes.spines.right": False})
    figure, (left, right) = plt.subplots(1, 2, figsize=(7.2, 2.7), layout="constrained")
    valve = cr.datasets.load("simulated_valve")
    draw(left, valve.records[0], "control valve, simulated", 0.08, 1e3, "ms", "-")
    truth = valve.info.dead_time_band[0]
    left.axvline(1e3 * truth, color="k", ls=":", label="truth")
    heater = cr.datasets.load("tclab").records[0]
    draw(right, heater, "heater, measured", 120.0, 1.0, "s", ".")
    right.legend(*left.get_legend_handles_labels(), frameon=False, fontsize=8, loc="lower right")
    for axes in (left, right):
        axes.set_ylim(bottom=min(0.0, float(np.min(axes.lines[0].get_ydata()))))
    figure.savefig(TARGET, dpi=200)


if __name__ == "__main__":
    main()
