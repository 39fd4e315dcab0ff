"""Models of measured frequency responses beside what is known of the plants from elsewhere."""

from __future__ import annotations

import platform
from collections.abc import Callable
from datetime import date

import numpy as np

import ctrl_realize as cr

from .measured import DATA

Row = tuple[str, str, str, str]
"""Record, what is known, what was found, what to know about it."""


def _record(name: str) -> tuple[cr.Record, float, int | None]:
    with np.load(DATA / name) as arrays:
        dt = float(arrays["dt"])
        period = int(arrays["period"]) if "period" in arrays else None
        time = dt * np.arange(arrays["u"].size)
        return cr.Record(time, arrays["u"], arrays["y"]), dt, period


def _hz(pole: complex) -> float:
    return float(abs(pole)) / (2 * np.pi)


def motor_bench() -> Row:
    """Twenty periods of a multisine."""
    record, dt, period = _record("motor_bench_multisine.npz")
    frf = cr.spectral_frf(record, period=period)
    near = frf.between_hz(30, 120)
    still = near.frequency_hz[np.argmin(np.abs(near.complex))]
    fit = cr.fit_frf(frf, dt=dt, hold="zoh").fit
    low, high = (end / dt for end in fit.interval)
    return (
        "motor_bench_multisine",
        "resonance 77 Hz, anti-resonance 53 Hz, about one sample",
        f"{_hz(fit.poles[-1]):.1f} Hz, {still:.0f} Hz, {fit.dead_time / dt:.2f} samples "
        f"({low:.2f} to {high:.2f})",
        "a fast fifth pole would do for part of the dead time",
    )


def two_masses() -> Row:
    """White noise through two masses on a spring."""
    record, dt, _ = _record("tue_load_500k.npz")
    frf = cr.spectral_frf(record).trusted(0.85)
    fit = cr.fit_frf(frf, dt=dt, hold="zoh").fit
    resonance = float(np.abs(fit.poles).max())
    omega = 2 * np.pi * frf.between_hz(20, 50).frequency_hz
    masses = 1 / (1 - (omega / resonance) ** 2)
    phase = np.angle(np.asarray(frf.between_hz(20, 50).complex) / masses)
    without = -float(np.median(phase / omega)) / dt - 0.5
    low, high = (end / dt for end in fit.interval)
    return (
        "tue_load_500k",
        "resonance 58 Hz, 1.5 to 2 samples",
        f"{resonance / (2 * np.pi):.1f} Hz, {fit.dead_time / dt:.1f} samples ({low:.1f} to "
        f"{high:.1f})",
        f"the phase of two masses without friction alone leaves {without:.1f} samples behind the "
        "hold: 1.5 to 2 are not in these data",
    )


def stage() -> Row:
    """Stepped sines of a precision stage, its authors' poles."""
    fit = cr.fit_frf(cr.read_frf(DATA / "stage" / "frf_output_1.csv"), 8, dt=1e-4).fit
    known = (-131.1 + 1868.1j, -22.70 + 559.8j, -5.447 + 191.4j)
    apart = [float(np.abs(fit.poles - pole).min() / abs(pole)) for pole in known]
    slow = int(np.argmin(np.abs(fit.poles)))
    return (
        "stage, output 1",
        "pairs at 298, 89.2 and 30.5 Hz, a pole at -2.101 rad/s",
        "pairs within "
        + ", ".join(f"{100 * part:.1f}" for part in apart)
        + f" %; pole at {fit.poles[slow].real:.2f} rad/s",
        f"the slow pole rests on points that scatter by 15 to 27 %: it is known to "
        f"{100 * fit.pole_std[slow] / abs(fit.poles[slow]):.0f} %",
    )


PUT_BACK = 20e-9
"""Delay in s that is given back to the hydrophone, which answers before its input."""


def hydrophone() -> Row:
    """Calibration of a hydrophone, from whose phase too long a path was taken out."""
    frf = cr.read_frf(DATA / "hydrophone" / "frf.csv")
    later = frf.complex * np.exp(-2j * np.pi * frf.frequency_hz * PUT_BACK)
    settings = {"relative_degree": 1, "band_hz": (1e6, 60e6)}
    early = cr.fit_frf(frf, 4, **settings).fit
    fit = cr.fit_frf(cr.MeasuredFRF(later, frf.frequency_hz), 4, **settings).fit
    codes = ", ".join(f"`{flag.code}`" for flag in early.flags)
    return (
        "hydrophone, 1 to 60 MHz",
        "-",
        f"answers {1e9 * (PUT_BACK - fit.dead_time):.1f} ns before its input; with "
        f"{1e9 * PUT_BACK:.0f} ns put back order 4 leaves {100 * fit.weighted_rms:.1f} % of "
        "the response",
        f"as it is no dead time fits, which is said ({codes})",
    )


ROWS: tuple[Callable[[], Row], ...] = (motor_bench, two_masses, stage, hydrophone)


def table() -> str:
    """Make the table in Markdown."""
    lines = ["| record | known from elsewhere | found | to know |", "|---|---|---|---|"]
    lines += ["| " + " | ".join(row()) + " |" for row in ROWS]
    lines += [
        "",
        f"Made on {date.today()} by `python -m benchmarks.records responses` with Python "
        f"{platform.python_version()}, ctrl-realize {cr.__version__}, numpy {np.__version__}. What "
        "is known is what the authors of the records state, or what an earlier look at them gave.",
        "",
    ]
    return "\n".join(lines)
