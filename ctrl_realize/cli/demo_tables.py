"""Tables of the demo: simulated and printed delays, and the results."""

from __future__ import annotations

import numpy as np

from .. import paper
from ..actuators import Backlash
from ..delayed import fit_of
from ..identification.output_error.result import OutputErrorFit
from ..identification.realization.result import Realization
from ..numerics.arrays import FloatArray
from .demo_run import DemoResult
from .terminal import table

OUTCOME = ("", "printed", "paper's method", "output-error fit of one record", "truth (simulated)")


def simulated_table(result: DemoResult) -> FloatArray:
    """Return the delays in samples as in the paper's Table 1, record x step size."""
    delays = np.array([row.delay for row in result.campaign.rows])
    return delays.reshape(len(paper.SETUP.step_sizes_ma), -1).T


def table_1_rows(result: DemoResult) -> list[list[str]]:
    """List Table 1, simulated and printed."""
    ours = simulated_table(result)
    return [
        [str(number), *(f"{value:g}" for value in mine), *(f"{value:g}" for value in theirs)]
        for number, (mine, theirs) in enumerate(zip(ours, paper.TABLE_1, strict=True), start=1)
    ]


def table_1_columns(between: str = "") -> list[str]:
    """Name the columns of Table 1."""
    sizes = [f"{size:g} mA" for size in paper.SETUP.step_sizes_ma]
    return ["No.", *sizes, *(f"{between}{size}" for size in sizes)]


def table_1(result: DemoResult) -> str:
    """Format Table 1 for the terminal."""
    return table(table_1_columns("| "), table_1_rows(result), numbers=range(9))


def outcome_rows(result: DemoResult) -> list[tuple[str, ...]]:
    """List the results: printed, by the paper's method, by the output-error fit, and the truth."""
    mine, theirs = result.campaign.statistics(paper.SETTINGS.trim), paper.table_1_statistics()
    fit, truth = fit_of(result.fitted, OutputErrorFit), result.valve.truth
    left = fit_of(result.printed, Realization).impulse.filter
    lag = 0.0 if left is None else left.group_delay
    low, high = (bound / fit.dt for bound in fit.interval)
    errors = {
        name: f"{100 * one.rms_relative_error:.2g} %" for name, one in result.comparisons.items()
    }
    band = result.comparisons["fitted"].band_hz
    scatter = result.valve.dead_time_scatter / result.valve.dt
    return [
        (
            "delay [samples]",
            f"{theirs.mean:.2f} -> {paper.DELAY}",
            f"{mine.mean:.2f} -> {round(mine.mean)}",
            f"{fit.delay:.2f}",
            f"{truth.delay:.4g}",
        ),
        (
            "variance",
            f"{theirs.variance:.2f}",
            f"{mine.variance:.2f}",
            "",
            f"{scatter**2:.3g} (all values)",
        ),
        (
            "95 % interval",
            f"{theirs.interval[0]:.1f} to {theirs.interval[1]:.1f}",
            f"{mine.interval[0]:.1f} to {mine.interval[1]:.1f}",
            f"{low:.2f} to {high:.2f}",
            "",
        ),
        ("without the filter's delay", "", f"{mine.mean - lag:.2f}", "", ""),
        (
            "total delay [ms]",
            "",
            "",
            f"{1e3 * fit.total_delay:.4g}",
            f"{1e3 * truth.total_delay:.4g}",
        ),
        (f"FRF error, {band[0]:.2g}-{band[1]:.3g} Hz", "", errors["printed"], errors["fitted"], ""),
        ("  filter divided out", "", errors["unfiltered"], "", ""),
    ]


def outcome_table(result: DemoResult) -> str:
    """Format the results for the terminal."""
    return table(OUTCOME, outcome_rows(result), numbers=range(1, 5))


def static_rows(result: DemoResult) -> list[tuple[str, str]]:
    """List the results of the static test: printed, evaluated with intervals, and the truth."""
    band = sum(100 * part.width for part in result.valve.actuator if isinstance(part, Backlash))
    rows = []
    for key, printed, truth in (
        ("linearity", "linear", "0"),
        ("hysteresis", "negligible", "0"),
        ("dead_band", "", f"{band / 100:g}"),
    ):
        metric = result.static.metric(key)
        found = metric.interval
        said = [
            f"{found.value:.4f} % ({found.low:.4f} to {found.high:.4f} %)",
            f"truth {truth} %",
            *([f"printed: {printed}"] if printed else []),
        ]
        rows.append((metric.definition.name, "; ".join(said)))
    return rows
