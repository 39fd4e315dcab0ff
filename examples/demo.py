#!/usr/bin/env python3
"""Reproduce the paper from start to end, on the simulated valve.

    python examples/demo.py --output demo --seed 7

Forty steps and a stepped sine of 500 x 5 points are simulated on a valve with a known dead time of
16.1 samples, on which the paper's method finds the 37 samples of the paper. It gives Table 1,
Figs. 2-8 and its final model; the output-error fit of one record gives a better one. The folder
then contains report.html, the models, the tables and figures/.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import control as ct
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

import ctrl_realize as cr
from ctrl_realize import paper, plots, report

SIZES = [f"{size:g}_mA" for size in paper.SETUP.step_sizes_ma]
SHOWN = (
    paper.SETUP.step_sizes_ma.index(paper.SHOWN_RECORD[0]) * paper.SETUP.records_per_size
    + paper.SHOWN_RECORD[1]
    - 1
)
"""Position of the record in the paper's Figs. 3 to 7."""


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description="The paper, on a simulated valve.")
    parser.add_argument("-o", "--output", type=Path, default=Path("demo-output"))
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=1, help="processes; -1: all cores")
    given = parser.parse_args(arguments)
    if given.seed < 0:
        parser.error(f"--seed {given.seed}; expected 0 or more")
    (given.output / "figures").mkdir(parents=True, exist_ok=True)
    run(given.output, given.seed, given.jobs)


def run(folder: Path, seed: int, jobs: int) -> None:
    """Simulate, identify, and write everything into the folder."""
    rng = np.random.default_rng(seed)
    valve = cr.bench.paper_valve()
    records = valve.step_campaign(rng)
    frf = cr.stepped_sine_frf(valve.stepped_sine(rng), name="stepped sine (simulated)")
    campaign = cr.identify_campaign(records, method="paper", n_jobs=jobs, progress=False)
    printed = campaign.system.replace(name="as the paper makes it")
    fitted = cr.fit_output_error(records[SHOWN]).replace(name="output-error fit")
    static = cr.valves.valve_report(
        valve.static_test(rng), command_range=paper.SETUP.current_range,
        travel_range=valve.travel_range, fit=False,
    )  # fmt: skip
    comparisons = {
        "printed": cr.compare_frf(printed, frf),
        "unfiltered": cr.compare_frf(without_filter(printed, frf), frf, hold=None),
        "fitted": cr.compare_frf(fitted, frf),
    }
    table_1 = delays(campaign)

    print("All data are simulated; none are measured.\n")
    print("Table 1, delays in samples: simulated valve, and as printed in the paper")
    print(table_1.to_string(), "\n")
    print(outcome(valve, campaign, fitted, comparisons).to_string(), "\n")
    print(static.report(), "\n")
    print(f"Output-error fit of {records[SHOWN].name}")
    print(fitted.fit.report(), "\n")
    print(comparisons["fitted"].report())

    settings = {"seed": seed, "simulated": True}
    note = "simulated valve, not measured"
    cr.save_model(folder / "model.json", fitted, settings=settings, note=note)
    cr.save_model(folder / "model_paper.json", printed, settings=settings, note=note)
    table_1.to_csv(folder / "table_1.csv")
    write_signals(folder, frf, records[SHOWN])
    draw_paper(folder / "figures", valve, frf, records[SHOWN], campaign, fitted, printed)
    report.write_identification(
        folder / "report.html", fitted, records[SHOWN], frf=frf, comparison=comparisons["fitted"],
        settings=settings, simulated=True, figures=folder / "figures",
        calls=[("In a terminal", f"python examples/demo.py --output demo --seed {seed}")],
    )  # fmt: skip
    report.write_campaign(
        folder / "report_paper.html", campaign, records=records, frf=frf, settings=settings,
        title="The paper's method on every record", truth=valve.truth.delay, simulated=True,
    )  # fmt: skip
    print(f"\nwritten to {folder}: {', '.join(sorted(path.name for path in folder.iterdir()))}")


def without_filter(system: cr.DelayedStateSpace, frf: cr.MeasuredFRF) -> ct.FrequencyResponseData:
    """Divide the filter in the data out of a model's frequency response."""
    omega = 2 * np.pi * frf.frequency_hz
    response = system(np.exp(1j * omega * system.dt))
    return ct.frd(
        response / system.fit.impulse.filter.response(omega), omega, smooth=True,
        name="filter divided out",
    )  # fmt: skip


def delays(campaign: cr.Campaign) -> pd.DataFrame:
    """Delays in samples as in the paper's Table 1, simulated and printed."""
    found = np.array([row.delay for row in campaign.rows]).reshape(len(SIZES), -1).T
    simulated = pd.DataFrame(found, columns=[f"simulated_{size}" for size in SIZES])
    printed = pd.DataFrame(paper.TABLE_1, columns=[f"printed_{size}" for size in SIZES])
    table = pd.concat([simulated, printed], axis=1)
    table.index = pd.RangeIndex(1, len(table) + 1, name="number")
    return table


def outcome(
    valve: cr.bench.Valve,
    campaign: cr.Campaign,
    fitted: cr.DelayedStateSpace,
    comparisons: dict[str, cr.FRFComparison],
) -> pd.DataFrame:
    """Results: printed, by the paper's method, by the output-error fit, and the truth."""
    theirs, ours = paper.table_1_statistics(), campaign.statistics(paper.SETTINGS.trim)
    fit, truth = fitted.fit, valve.truth
    lag = campaign.system.fit.impulse.filter.group_delay
    low, high = (end / fit.dt for end in fit.interval)
    error = {
        name: f"{100 * comparison.rms_relative_error:.2g} %"
        for name, comparison in comparisons.items()
    }
    scatter = valve.dead_time_scatter / valve.dt
    rows = {
        "delay [samples]": (f"{theirs.mean:.2f} -> {paper.DELAY}",
                            f"{ours.mean:.2f} -> {round(ours.mean)}",
                            f"{fit.delay:.2f}", f"{truth.delay:.4g}"),
        "variance": (f"{theirs.variance:.2f}", f"{ours.variance:.2f}", "",
                     f"{scatter**2:.3g} (all values)"),
        "95 % interval": (f"{theirs.interval[0]:.1f} to {theirs.interval[1]:.1f}",
                          f"{ours.interval[0]:.1f} to {ours.interval[1]:.1f}",
                          f"{low:.2f} to {high:.2f}", ""),
        "without the filter's delay": ("", f"{ours.mean - lag:.2f}", "", ""),
        "total delay [ms]": ("", "", f"{1e3 * fit.total_delay:.4g}",
                             f"{1e3 * truth.total_delay:.4g}"),
        "error of the FRF": ("", error["printed"], error["fitted"], ""),
        "  filter divided out": ("", error["unfiltered"], "", ""),
    }  # fmt: skip
    columns = ["printed", "paper's method", "output-error fit of one record", "truth (simulated)"]
    return pd.DataFrame.from_dict(rows, orient="index", columns=columns)


def write_signals(folder: Path, frf: cr.MeasuredFRF, record: cr.Record) -> None:
    """Write the data of the final comparison."""
    columns = {
        "frequency_hz": frf.frequency_hz, "real": frf.frdata[0, 0].real,
        "imag": frf.frdata[0, 0].imag, "coherence": frf.coherence, "std": frf.std,
    }  # fmt: skip
    pd.DataFrame(columns).to_csv(folder / "frf_simulated.csv", index=False)
    signals = {"time_s": record.time, "input": record.input, "output": record.output}
    pd.DataFrame(signals).to_csv(folder / "record_simulated.csv", index=False)


def draw_paper(
    folder: Path,
    valve: cr.bench.Valve,
    frf: cr.MeasuredFRF,
    record: cr.Record,
    campaign: cr.Campaign,
    fitted: cr.DelayedStateSpace,
    printed: cr.DelayedStateSpace,
) -> None:
    """Draw Table 1 and Figs. 2-8 of the paper, from simulated data."""
    system = campaign.rows[SHOWN].system
    scan = system.fit
    truth = valve.truth.frf(frf.frequency_hz)
    count = paper.SETTINGS.singular_values_shown
    drawn = {
        "table1_delays": plots.campaign_plot(campaign, truth=valve.truth.delay, trim=3),
        "fig2_frf": plots.frf_plot([frf, truth], dead_time=valve.truth.dead_time),
        "fig3_record": plots.record_plot(record),
        "fig4_onset": plots.onset_plot(record, fitted),
        "fig5_singular_values": plots.singular_value_plot(scan, count=count),
        "fig6_iae": plots.delay_plot(scan),
        "fig7_impulse": plots.impulse_plot(scan.impulse, system),
        "fig8_final_model": plots.frf_plot([frf, fitted, printed]),
    }
    for name, plot in drawn.items():
        plot.figure.savefig(folder / f"{name}.png", dpi=150)
        plt.close(plot.figure)


if __name__ == "__main__":
    main()
