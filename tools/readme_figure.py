#!/usr/bin/env python3
"""Draw the picture at the top of the README: the three lines on the simulated valve."""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import ctrl_realize as cr

TARGET = Path(__file__).resolve().parents[1] / "docs" / "images" / "result.png"
DATA, MODEL, SHADE = "#0072b2", "#d55e00", "#f2cf7a"


def main() -> None:
    record = cr.read_record(cr.datasets.path("simulated_valve"))
    system = cr.identify(record)
    frf = cr.read_frf(cr.datasets.path("simulated_valve", "frf"))
    fit = system.fit

    plt.rcParams.update({"font.size": 15, "axes.spines.top": False, "axes.spines.right": False})
    figure, axes = plt.subplot_mosaic(
        [["step", "gain"], ["step", "phase"]], figsize=(15, 6.2), layout="constrained"
    )
    step = cr.unit_step(record)
    shown = step.time < 0.6
    axes["step"].plot(1e3 * step.time[shown], step.output[shown], color=DATA, lw=2, label="data")
    model = system.step(step.n_samples)
    axes["step"].plot(
        1e3 * step.time[shown], model[shown], color=MODEL, lw=2.5, ls="--", label="model"
    )
    low, high = fit.interval
    axes["step"].axvspan(1e3 * low, 1e3 * high, color=SHADE, lw=0)
    axes["step"].axvline(1e3 * fit.dead_time, color=MODEL, lw=1.5)
    truth = 1e3 * cr.datasets.load("simulated_valve").info.dead_time_band[0]
    axes["step"].axvline(
        truth, color="k", lw=1.5, ls=":", label=f"truth (simulated valve): {truth:.1f} ms"
    )
    axes["step"].set(
        xlabel="time after the step [ms]",
        ylabel="unit step response [mm/mA]",
        title=f"dead time {1e3 * fit.dead_time:.1f} ms (95 %: {1e3 * low:.1f} to "
        f"{1e3 * high:.1f} ms)",
    )
    axes["step"].legend(loc="center right", frameon=False)

    omega = 2 * np.pi * frf.frequency_hz
    response = np.ravel(system(np.exp(1j * omega * system.dt)))
    good = frf.coherence >= 0.95
    for name, of in (
        ("gain", lambda g: 20 * np.log10(np.abs(g))),
        ("phase", lambda g: np.degrees(np.unwrap(np.angle(g)))),
    ):
        axes[name].semilogx(
            frf.frequency_hz[good],
            of(frf.complex[good]),
            color=DATA,
            lw=4,
            label="stepped sine, coherence above 0.95",
        )
        axes[name].semilogx(
            frf.frequency_hz, of(response), color=MODEL, lw=2.5, ls="--", label="model of the step"
        )
    axes["gain"].set(ylabel="gain [dB]", title="the model beside a stepped-sine FRF")
    axes["phase"].set(xlabel="frequency [Hz]", ylabel="phase [deg]")
    axes["gain"].legend(loc="lower left", frameon=False)
    for name in ("gain", "phase"):
        axes[name].xaxis.set_major_formatter("{x:g}")
    TARGET.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(TARGET, dpi=90)


if __name__ == "__main__":
    main()
