"""What it gains to know that a plant has no fast lag: stated, or as a second line of the card."""

from __future__ import annotations

import platform
import warnings
from datetime import date

import numpy as np

import ctrl_realize as cr

from ..verdicts.cases import KINDS, Case, case

SEEDS = range(100, 106)
"""Constants were chosen with seeds below 100."""
_LEFT_OUT = ("load", "clipped")
_STATED = 0.5  # of the fastest lag

Row = dict[str, float]


def held(interval: tuple[float, float], dead_time: float) -> bool:
    """Whether an interval contains the truth, but for rounding."""
    return interval[0] - 1e-9 <= dead_time <= interval[1] + 1e-9


def measured(one: Case) -> Row:
    """Intervals of a record: as it is, with a second line, and with a stated fastest lag."""
    true, fastest = one.plant.dead_time, min(abs(lag) for lag in one.plant.lags)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        fit = cr.fit_output_error(one.record).fit
        told = cr.fit_output_error(one.record, fastest_lag=_STATED * fastest).fit
    width = max(float(np.diff(fit.interval)[0]), 1e-12)
    row = {
        "held": held(fit.interval, true),
        "stated": held(told.interval, true),
        "stated width": float(np.diff(told.interval)[0]) / width,
        "line": False,
        "true": False,
    }
    if (found := fit.interval_without_short_lags) is not None:
        lag, second = found
        row |= {"line": True, "width": float(np.diff(second)[0]) / width}
        row |= {"true": fastest >= lag, "line held": held(second, true)}
    return row


def _line(name: str, rows: list[Row]) -> str:
    second = [row for row in rows if row["line"]]
    true = [row for row in second if row["true"]]
    narrower = f"{np.median([row['width'] for row in second]):.2f}" if second else ""
    cells = [
        name,
        f"{sum(row['held'] for row in rows)} of {len(rows)}",
        str(len(second)),
        f"{sum(row['line held'] for row in true)} of {len(true)}",
        narrower,
        f"{sum(row['stated'] for row in rows)} of {len(rows)}",
        f"{np.median([row['stated width'] for row in rows]):.2f}",
    ]
    return f"| {' | '.join(cells)} |"


def table() -> str:
    """Make the table in Markdown."""
    kinds = [kind for kind in KINDS if kind not in _LEFT_OUT]
    rows = {kind: [measured(case(kind, seed)) for seed in SEEDS] for kind in kinds}
    every = [row for some in rows.values() for row in some]
    lines = [
        "| kind | interval holds | has a second line | condition true: second line holds | its "
        "width over the interval's | stated: interval holds | its width over the interval's |",
        "|" + "---|" * 7,
        *(_line(kind, some) for kind, some in rows.items()),
        _line("all", every),
        "",
        f"Simulated records of the kinds of the table of the verdicts, seeds {SEEDS[0]} to "
        f"{SEEDS[-1]}; stated: `fastest_lag` is half of the fastest lag of the plant. Made on "
        f"{date.today()} by `python -m benchmarks.records statements` with Python "
        f"{platform.python_version()}, ctrl-realize {cr.__version__}, numpy {np.__version__}.",
        "",
    ]
    return "\n".join(lines)
