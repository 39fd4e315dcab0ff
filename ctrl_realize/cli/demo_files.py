"""The files of the demo: figures, models, tables, report."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from .. import paper, plots
from ..delayed import fit_of
from ..identification.output_error.result import OutputErrorFit
from ..identification.realization.delay_scan_result import DelayScan
from ..io import save_model
from ..io.text.csv_files import write_csv
from ..plots.fits import evidence_height
from ..report import Column, Row, Sketch, Table, pairs, verdict_of
from ..report.build import write_report
from ..report.provenance import record_sha256
from ..report.tables import comparison_tables, fit_tables
from .demo_run import SHOWN, DemoResult
from .demo_tables import (
    OUTCOME,
    outcome_rows,
    simulated_table,
    static_rows,
    table_1_columns,
    table_1_rows,
)
from .inputs import typed_call

_TITLE = "A control valve with dead time, identified"


def write_demo_files(folder: Path, result: DemoResult, *, with_report: bool) -> list[str]:
    """Write all files; return their names."""
    note = "simulated valve, not measured"
    settings = {"seed": result.seed, "simulated": True}
    save_model(folder / "model.json", result.fitted, settings=settings, note=note)
    save_model(folder / "model_paper.json", result.printed, settings=settings, note=note)
    _write_tables(folder, result)
    names = ["model.json", "model_paper.json", "table_1.csv"]
    names += ["frf_simulated.csv", "record_simulated.csv"]
    if with_report:
        _write_report(folder, result)
        names = ["report.html", *names, "figures/"]
    return names


def _write_tables(folder: Path, result: DemoResult) -> None:
    sizes = [f"{size:g}_mA" for size in paper.SETUP.step_sizes_ma]
    delays = pd.DataFrame(simulated_table(result), columns=[f"simulated_{s}" for s in sizes])
    printed = pd.DataFrame(paper.TABLE_1, columns=[f"printed_{s}" for s in sizes])
    both = pd.concat([delays, printed], axis=1)
    both.index = pd.RangeIndex(1, len(both) + 1, name="number")
    write_csv(folder / "table_1.csv", both, index=True)
    frf = result.frf
    columns = {
        "frequency_hz": frf.frequency_hz,
        "real": frf.frdata[0, 0].real,
        "imag": frf.frdata[0, 0].imag,
        "coherence": frf.coherence,
        "std": frf.std,
    }
    write_csv(folder / "frf_simulated.csv", pd.DataFrame(columns), index=False)
    record = result.records[SHOWN]
    signals = {"time_s": record.time, "input": record.input, "output": record.output}
    write_csv(folder / "record_simulated.csv", pd.DataFrame(signals), index=False)


def demo_sketches(result: DemoResult) -> list[Sketch]:
    """List the paper's Figs. 2-8 for simulated data, and further ones."""
    record = result.records[SHOWN]
    row = result.campaign.rows[SHOWN].system
    assert row is not None
    scan = fit_of(row, DelayScan)
    truth = result.valve.truth.frf(result.frf.frequency_hz)
    final = [result.frf, result.fitted, result.printed]
    return [
        Sketch(
            "fit",
            f"One record, {record.name}, and its model",
            "The output-error fit of the raw record. Below: the dead times that the data allow.",
            lambda figure: plots.fit_plot(result.fitted, ax=figure),
            (6.2, 3.6 + evidence_height(fit_of(result.fitted, OutputErrorFit))),
        ),
        Sketch(
            "fig8_final_model",
            "Fig. 8: stepped sine and models",
            "The model of the paper contains the lag of its causal filter; the fit of the "
            "raw records does not.",
            lambda figure: plots.frf_plot(final, ax=figure),
            (6.2, 5.6),
        ),
        Sketch(
            "fig8_error",
            "Error of the fitted model",
            "Against the stepped sine; the band of good coherence is shaded.",
            lambda figure: plots.comparison_plot(result.comparisons["fitted"], ax=figure),
            (6.2, 4.6),
        ),
        Sketch(
            "table1_delays",
            "Table 1 as a picture",
            "The paper's method on every record. The scatter is that of the dead time from record "
            "to record; the distance from the truth is the lag of the causal filter and of the "
            "sensor, the same for all records, and no averaging removes it.",
            lambda figure: plots.campaign_plot(
                result.campaign, truth=result.valve.truth.delay, trim=3, ax=figure
            ),
            (6.2, 4.2),
        ),
        Sketch(
            "fig2_frf",
            "Fig. 2: frequency response of the valve",
            "Stepped sine, 500 points to 50 Hz, mean of 5; dotted: truth. Beyond the trusted band "
            "the sine is below noise and backlash.",
            lambda figure: plots.frf_plot(
                [result.frf, truth], dead_time=result.valve.truth.dead_time, ax=figure
            ),
            (6.2, 5.4),
        ),
        Sketch(
            "fig3_record",
            f"Fig. 3: record {record.name}",
            "Displacement above, current below; the spikes come from the drive.",
            lambda figure: plots.record_plot(record, ax=figure),
        ),
        Sketch(
            "fig4_onset",
            "Fig. 4: the first moments after the step",
            "The same record, with the dead time of the fitted model.",
            lambda figure: plots.onset_plot(record, result.fitted, ax=figure),
        ),
        Sketch(
            "fig5_singular_values",
            "Fig. 5: first 30 singular values of the Hankel matrix",
            "With the level of pure noise, from the baseline before the step.",
            lambda figure: plots.singular_value_plot(
                scan, count=paper.SETTINGS.singular_values_shown, ax=figure
            ),
        ),
        Sketch(
            "fig6_iae",
            "Fig. 6: IAE against the delay",
            "One realization for each delay.",
            lambda figure: plots.delay_plot(scan, ax=figure),
        ),
        Sketch(
            "fig7_impulse",
            "Fig. 7: impulse response and realization",
            "Differentiated and filtered data, and the model at the best delay.",
            lambda figure: plots.impulse_plot(scan.impulse, row, ax=figure),
        ),
    ]


def _write_report(folder: Path, result: DemoResult) -> None:
    write_report(
        folder / "report.html",
        title=_TITLE,
        subtitle=(
            "Forty simulated steps and a simulated stepped sine of a valve on which the method of "
            "van Helvoirt et al. (IFAC 2005) gives their Table 1, and an output-error fit. The "
            f"true dead time is {1e3 * result.valve.truth.dead_time:.4g} ms = "
            f"{result.valve.truth.delay:.4g} samples in the mean."
        ),
        verdict=verdict_of(result.fitted, result.comparisons["fitted"].flags),
        sketches=demo_sketches(result),
        tables=[
            _outcome(result),
            _table_1(result),
            *fit_tables(result.fitted.fit, "How the final model was found"),
            *comparison_tables(result.comparisons["fitted"], "Final model and stepped sine"),
            pairs("The paper's settings", _settings()),
            pairs("The static test of section 2.2, in % of the span", static_rows(result)),
            pairs("The simulated valve", _valve(result)),
            _data(result),
        ],
        calls=[
            ("In a terminal", typed_call("demo", ["--output", "demo", "--seed", str(result.seed)])),
            ("In Python", _python(result)),
        ],
        simulated=True,
        figures=folder / "figures",
    )


def _outcome(result: DemoResult) -> Table:
    columns = tuple(Column(name, "number" if name else "text") for name in OUTCOME)
    return Table(
        "Results",
        tuple(Row(row) for row in outcome_rows(result)),
        columns,
        note=(
            "Paper: measured on the real valve, whose dynamics are not fully known. "
            "Everything else is simulated, on one of the valves that would give such records. The "
            "fit of a record finds the dead time of that record, which differs from the mean by "
            "the scatter."
        ),
    )


def _table_1(result: DemoResult) -> Table:
    columns = tuple(Column(name, "number") for name in table_1_columns("printed "))
    return Table(
        "Table 1: delays in samples",
        tuple(Row(tuple(row)) for row in table_1_rows(result)),
        columns,
        note=(
            "Left: the method of the paper on the simulated valve. Right: as printed in the paper."
        ),
    )


def _settings() -> list[tuple[str, str]]:
    chosen = paper.SETTINGS
    return [
        ("difference", "five-point central"),
        (
            "filter",
            f"causal Butterworth, order {chosen.filter_order}, {chosen.cutoff_hz:g} Hz",
        ),
        ("order", str(chosen.order)),
        ("samples", str(chosen.samples)),
        ("delays", f"0 to {chosen.max_delay} samples"),
        ("sample time", f"{chosen.sample_time:.6g} s"),
        ("removed at each end in Table 1", str(chosen.trim)),
    ]


def _valve(result: DemoResult) -> list[tuple[str, str]]:
    valve = result.valve
    return [
        *valve.truth._rows(),
        ("scatter of the dead time", f"{valve.dead_time_scatter / valve.dt:.2g} samples"),
        ("noise", f"{100 * valve.noise:.2g} % of the stroke"),
        ("actuator", ", ".join(f"{part} (in % of the stroke)" for part in valve.actuator)),
        ("seed", str(result.seed)),
    ]


def _data(result: DemoResult) -> Table:
    columns = (Column("data (simulated)"), Column("SHA-256", "mono"))
    rows = tuple(Row((record.name, record_sha256(record))) for record in result.records)
    return Table(
        "Data",
        rows,
        columns,
        note="Checksums of time, input and output as little-endian float64.",
    )


def _python(result: DemoResult) -> str:
    return (
        "import numpy as np\n"
        "import ctrl_realize as cr\n"
        f"rng = np.random.default_rng({result.seed})\n"
        "valve = cr.bench.paper_valve()\n"
        "records = valve.step_campaign(rng)\n"
        "frf = cr.stepped_sine_frf(valve.stepped_sine(rng))\n"
        'campaign = cr.identify_campaign(records, method="paper")\n'
        f"sys = cr.fit_output_error(records[{SHOWN}])\n"
        "print(cr.compare_frf(sys, frf).report())\n"
        "print(cr.valves.valve_report(\n"
        "    valve.static_test(rng), command_range=(4, 20),\n"
        "    travel_range=valve.travel_range, fit=False,\n"
        ").report())"
    )
