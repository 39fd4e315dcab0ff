"""Step records and frequency responses of measured plants, fitted together."""

from __future__ import annotations

import platform
from datetime import date

import numpy as np

import ctrl_realize as cr

from .measured import DATA

PLANTS = {
    "two_cart_drive": "0.9 to 3.4 ms",
    "sbhs_heater": "1 to 4.5 s",
    "hdd_arm": "0.8 to 3.2 ms",
    "dc_motor_tacho": "2.3 to 3.1 ms",
    "rlc_zero_delay": "0",
}
"""Plants that have both, and the dead time that is known of them."""
_OTHER_INPUTS = ("frf", "prbs_irregular")


def both(name: str) -> tuple[list[cr.Record], cr.MeasuredFRF]:
    """Read the step records and the frequency response of a plant."""
    paths = sorted((DATA / name).glob("*.csv"))
    records = [cr.read_record(path) for path in paths if path.stem not in _OTHER_INPUTS]
    return records, cr.read_frf(DATA / name / "frf.csv")


def _within(fit: cr.results.ModelFit) -> str:
    unit, factor = ("s", 1.0) if fit.dt > 0.1 else ("ms", 1e3)
    low, high = (factor * end for end in fit.interval)
    return f"{factor * fit.dead_time:.3g} ({low:.3g} to {high:.3g}) {unit}"


def _verdict(fit: cr.identification.JointFit) -> str:
    agreed, hz = fit.agreement, fit.frf_fit.frequency_hz
    said = (
        f"{int(agreed.outside.sum())} of {hz.size} points outside of their 95 % circle, "
        f"residual of the records {fit.residual / fit.record_fit.residual:.2f} times its own"
    )
    if not agreed.contradicts:
        return f"agree (p = {agreed.p_value:.2g}): {said}"
    outside = hz[agreed.outside]
    (ratio, by_gain), (_, by_delay) = agreed.gain_ratio, agreed.later
    why = "the dynamics differ" if max(by_gain, by_delay) < 0.01 else "gain or dead time differ"
    return (
        f"contradict each other (p = {agreed.p_value:.1g}): {said}, within {outside[0]:.3g} to "
        f"{outside[-1]:.3g} Hz; {why} (best ratio of gains {ratio:.3g})"
    )


def table() -> str:
    """Make the table in Markdown."""
    lines = [
        "| plant | known dead time | records alone | FRF alone | together | verdict |",
        "|---|---|---|---|---|---|",
    ]
    for name, known in PLANTS.items():
        records, frf = both(name)
        fit = cr.identify(records, frf=frf).fit
        cells = [_within(one) for one in (fit.record_fit, fit.frf_fit, fit)]
        lines.append(f"| {name} | {known} | {' | '.join(cells)} | {_verdict(fit)} |")
    lines += [
        "",
        f"Made on {date.today()} by `python -m benchmarks.records joint` with Python "
        f"{platform.python_version()}, ctrl-realize {cr.__version__}, numpy {np.__version__}. The "
        "known dead times are an earlier look at the data, not exact. None of the frequency "
        "responses has a standard deviation: the scatter about their own fits is their noise.",
        "",
    ]
    return "\n".join(lines)
