"""Step records and frequency responses of measured plants, fitted together."""

from __future__ import annotations

import platform
from datetime import date

import control as ct
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


PAIRS = 60
"""Simulated pairs of a row."""
_DEAD_TIME, _DT = 0.0289, 1 / 1280
_CASES = {
    "one plant": (1.0, 0.0),
    "gain of the FRF 5 % larger": (1.05, 0.0),
    "dead time of the FRF 4 ms longer": (1.0, 0.004),
}


def _pair(seed: int, ratio: float, later: float) -> cr.identification.JointFit:
    """Fit a simulated step with 2 % noise and 20 points with 2 %: 2.2 Hz and 11 Hz."""
    rng = np.random.default_rng(seed)
    core = ct.tf([13.8], [1, 13.8]) * ct.tf([69.1], [1, 69.1])
    u = (np.arange(2000) >= 500).astype(float)
    y = cr.delayed_ss(core, dead_time=_DEAD_TIME, dt=_DT).simulate(u)
    record = cr.Record(_DT * np.arange(u.size), u, y + 0.02 * rng.standard_normal(u.size))
    hz = np.geomspace(0.3, 20, 20)
    s = 2j * np.pi * hz
    exact = ratio * np.asarray(core(s)) * np.exp(-s * (_DEAD_TIME + later))
    noise = 0.02 / np.sqrt(2) * rng.standard_normal((hz.size, 2)) @ [1, 1j]
    frf = cr.MeasuredFRF(exact + noise, hz, std=np.full(hz.size, 0.02))
    return cr.identify(record, frf=frf, structures=[(2, 2)]).fit


def simulated() -> str:
    """Make the table of simulated pairs in Markdown."""
    lines = [
        "| simulated pairs | contradiction raised | true dead time in the interval | median width "
        "of the interval: records, FRF, together [ms] |",
        "|---|---|---|---|",
    ]
    for case, (ratio, later) in _CASES.items():
        fits = [_pair(seed, ratio, later) for seed in range(PAIRS)]
        raised = sum(fit.agreement.contradicts for fit in fits)
        inside = sum(fit.interval[0] <= _DEAD_TIME <= fit.interval[1] for fit in fits)
        widths = [
            1e3 * np.median([np.diff(one) for one in intervals])
            for intervals in (
                [fit.record_fit.interval for fit in fits],
                [fit.frf_fit.interval for fit in fits],
                [fit.interval for fit in fits],
            )
        ]
        said = ", ".join(f"{width:.2f}" for width in widths)
        lines.append(f"| {case} | {raised} of {PAIRS} | {inside} of {PAIRS} | {said} |")
    return "\n".join([*lines, ""])


def table() -> str:
    """Make both tables in Markdown."""
    return f"{simulated()}\n{measured()}"


def measured() -> str:
    """Make the table of measured plants in Markdown."""
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
