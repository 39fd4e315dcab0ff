"""The files that pages read: simulated plants, stored as programs store their data.

``python docs/_ext/sample_files.py`` writes them into docs/samples, where readers find them too. A
page calls `visit`, which copies them into a folder of its own.
"""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd
from scipy import signal

STORED = Path(__file__).resolve().parents[1] / "samples"


def visit() -> None:
    """Go to a new folder with a copy of all sample files."""
    folder = tempfile.mkdtemp()
    shutil.copytree(STORED, folder, dirs_exist_ok=True)
    os.chdir(folder)


def files() -> Iterator[tuple[str, str]]:
    """Yield name and text of every file."""
    yield "duct.csv", _duct()
    yield from _oven_files()
    yield from _historian_files()
    yield "tests.csv", _several_tests()
    yield "furnace.csv", _furnace()
    yield "loop.csv", _running_loop(setpoints=True)
    yield "regulation.csv", _running_loop(setpoints=False)
    yield "heattest.txt", _heattest()


def _duct() -> str:
    """Heated air duct: two lags of 0.4 s behind 0.12 s, gain 2.4 degC/V, noise of 0.02 degC."""
    rng = np.random.default_rng(7)
    t = 0.01 * np.arange(900)
    volts = np.where(t < 2, 1.0, 5.0)
    late = np.maximum(t - 2.12, 0)
    warm = 31.5 + 4 * 2.4 * (1 - (1 + late / 0.4) * np.exp(-late / 0.4))
    warm += 0.02 * rng.standard_normal(t.size)
    return _lines("time_s,heater_V,air_degC", "{:.2f},{:.1f},{:.2f}", t, volts, warm)


def _oven_files() -> Iterator[tuple[str, str]]:
    """One record in many formats: gain 3, a lag of 0.3 s behind 0.12 s, no noise."""
    t = 0.01 * np.arange(500)
    u = np.where(t < 1, 0.0, 2.0)
    y = np.where(t < 1.12, 0.0, 3 * -np.expm1(-(t - 1.12) / 0.3)) + 20
    yield "plain.csv", _lines("time_s,input,output", "{:.2f},{:.1f},{:.5f}", t, u, y)
    german = _lines("ms;V;degC", "{:.0f};{:.1f};{:.4f}", 1e3 * t, u, y).replace(".", ",")
    yield "Messung.csv", "Ofen 3\nZeit;Eingang;Ausgang\n" + german
    header = "stamp,valve_cmd,temp_in,temp_out"
    yield "log.csv", _lines(header, "{:.2f},{:.1f},21.5,{:.4f}", t, u, y)
    yield "two.csv", _lines("", "{:.1f},{:.4f}", u, y)
    stamps = [f"04.03.2026 09:00:{a:06.3f}" for a in t]
    yield "logged.csv", _lines("time,u,y", "{},{:.1f},{:.4f}", stamps, u, y)
    days = 46085.375 + t / 86400
    yield "excel.csv", _lines("time,u,y", "{:.13f},{:.1f},{:.4f}", days, u, y)
    shaky = t + 0.001 * np.random.default_rng(0).standard_normal(t.size)
    yield "shaky.csv", _lines("time_s,input,output", "{:.5f},{:.1f},{:.5f}", shaky, u, y)


def _historian_files() -> Iterator[tuple[str, str]]:
    """Valve and temperature: gain 1.5, a lag of 400 s behind 117 s, with bad values and a hole."""
    rng = np.random.default_rng(2)
    t = np.cumsum(rng.choice([9, 10, 10, 11, 12], 420)).astype(float)
    u = np.where(t < t[60], 35.0, np.where(t < t[230], 45.0, 38.0))
    moves = [(t[60], 10.0), (t[230], -7.0)]
    y = 120 + 0.03 * rng.standard_normal(t.size)
    for at, height in moves:
        y += 1.5 * height * -np.expm1(-np.maximum(t - at - 117, 0) / 400)
    start = pd.Timestamp("2025-02-21 08:15")
    when = start + pd.to_timedelta(t, unit="s")
    frame = pd.DataFrame(
        {
            "Timestamp": when.strftime("%m/%d/%Y %I:%M:%S %p"),
            "TIC101.OP": u,
            "TIC101.PV": [f"{value:.3f}" for value in y],
            "Quality": "Good",
        }
    )
    bad = rng.choice(t.size, 20, replace=False)
    frame.loc[bad, "TIC101.PV"] = np.resize(["Bad", "I/O Timeout", ""], bad.size)
    frame.loc[bad, "Quality"] = "Bad"
    yield "wide.csv", frame.drop(index=range(300, 313)).to_csv(index=False, lineterminator="\n")

    iso = when.strftime("%Y-%m-%d %H:%M:%S")
    rows = [
        ("TIC101.PV", stamp, f"{value:.3f}", "Good") for stamp, value in zip(iso, y, strict=True)
    ]
    valve = [(t[0], 35.0), *((at, u[np.searchsorted(t, at)]) for at, _ in moves)]
    for at, value in valve:
        stamp = f"{start + pd.Timedelta(at, 's'):%Y-%m-%d %H:%M:%S}"
        rows.append(("TIC101.OP", stamp, f"{value:.1f}", "Good"))
    names = ["Tag", "Timestamp", "Value", "Quality"]
    yield (
        "long.csv",
        pd.DataFrame(rows, columns=names).to_csv(index=False, lineterminator="\n"),
    )


def _several_tests() -> str:
    """Three steps of a valve: 0.3 l/h per %, a lag of 2.5 s behind 1.2 s."""
    rng = np.random.default_rng(3)
    t = 0.1 * np.arange(250)
    lines = ["test,time,valve,flow"]
    for number, height in enumerate((10, 20, -10), start=1):
        rise = -np.expm1(-np.maximum(t - 5.2, 0) / 2.5)
        flow = 12 + 0.3 * height * rise + 0.01 * rng.standard_normal(t.size)
        valve = 40 + height * (t >= 4)
        lines += [f"{number},{a:.1f},{b:d},{c:.4f}" for a, b, c in zip(t, valve, flow, strict=True)]
    return "\n".join(lines) + "\n"


def _furnace() -> str:
    """Time in minutes: 0.8 degC/%, lags of 3 min and 0.7 min behind 0.75 min, noise 0.02 degC."""
    t = np.arange(400) / 12
    late = np.maximum(t - 5.75, 0)
    rise = 1 - (3 * np.exp(-late / 3) - 0.7 * np.exp(-late / 0.7)) / 2.3
    y = 20 + 8 * rise + 0.02 * np.random.default_rng(1).standard_normal(t.size)
    valve = np.where(t < 5, 30, 40)
    return _lines("time [min];MV [%];PV [°C]", "{:.5f};{:.0f};{:.3f}", t, valve, y)


def _running_loop(setpoints: bool) -> str:
    """PI loop of 20 minutes, with three moves of the set-point or with none; see `LOOP`."""
    rng = np.random.default_rng(11)
    dt, n, dead = 0.5, 2400, 6
    plant = signal.cont2discrete(signal.tf2ss([2.0], [12.0, 9.5, 1.0]), dt)
    A, B, C = plant[0], plant[1][:, 0], plant[2][0]
    k = np.arange(n)
    setpoint = np.select([k < 300, k < 900, k < 1600], [50.0, 54.0, 47.0], 52.0)
    if not setpoints:
        setpoint[:] = 50.0
    state, drive = np.zeros(2), np.zeros(n)
    output = np.empty(n)
    disturbance = integral = 0.0
    for i in range(n):
        disturbance = 0.995 * disturbance + 0.01 * rng.standard_normal()
        output[i] = 50 + C @ state + disturbance + 0.03 * rng.standard_normal()
        error = setpoint[i] - output[i]
        integral += 0.5 * error * dt / 9
        drive[i] = 0.5 * error + integral
        state = A @ state + B * (drive[i - dead] if i >= dead else 0.0)
    header = "time_s,TIC7.SP,TIC7.PV,TIC7.OP"
    return _lines(header, "{:.1f},{:.1f},{:.3f},{:.3f}", dt * k, setpoint, output, 30 + drive)


LOOP = {"gain": 2.0, "dead_time": 3.0, "lags": (8.0, 1.5)}
"""Plant in the loop: degC per %, s."""


def _heattest() -> str:
    """Hot end that Klipper's PID_CALIBRATE heats to 200 degC and lets swing; see `HOT_END`."""
    rng = np.random.default_rng(5)
    dt, dead = 0.3, 6
    plant = signal.cont2discrete(signal.tf2ss([380.0], [120.0 * 4, 124.0, 1.0]), dt)
    A, B, C = plant[0], plant[1][:, 0], plant[2][0]
    state, drive = np.zeros(2), [0.0] * (dead + 1)
    pwm, out = [], []
    heating, switches = False, 0
    while switches < 12:
        i = len(out)
        warm = 25 + C @ state + 0.05 * rng.standard_normal()
        out.append(f"{100 + dt * i:.3f} {warm:.3f}")
        # on below 195 degC (and at first), off from 200 degC on; in effect a sample later
        turned = warm < 200 if heating else warm <= 195
        if turned is not heating:
            heating, switches = turned, switches + 1
            pwm.append(f"pwm: {100 + dt * (i + 1):.3f} {float(heating):.3f}")
        drive.append(float(heating))
        state = A @ state + B * drive[i]
    return "\n".join(pwm + out)


HOT_END = {"gain": 380.0, "dead_time": 1.8, "lags": (120.0, 4.0)}
"""Plant of `heattest.txt`: degC at full power, s."""


def _lines(header: str, form: str, *columns: object) -> str:
    rows = (form.format(*row) for row in zip(*columns, strict=True))  # type: ignore[call-overload]
    return "\n".join([*([header] if header else []), *rows]) + "\n"


if __name__ == "__main__":
    STORED.mkdir(exist_ok=True)
    for name, text in files():
        (STORED / name).write_text(text, encoding="utf-8")
