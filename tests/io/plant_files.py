"""Files as plants and laboratories give them, made from plants whose truth is known."""

import datetime
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

START = datetime.datetime(2025, 2, 1, 8, 15)


@dataclass(frozen=True)
class PlantFile:
    """A file, its truth in seconds and units of the file, and how its page says it is read."""

    name: str
    write: Callable[[Path], None]
    gain: float
    dead_time: float
    within: float
    """Largest error of the dead time, in s: three standard errors or a few samples."""
    reading: dict[str, Any] = field(default_factory=dict)
    many: bool = False
    """Whether the file holds several tests."""


def response(t, u, gain, dead_time, lags):
    """Exact response of lags with dead time to an input that is held between its samples."""
    moves = [(t[0], 0.0)] + [(t[k], u[k] - u[k - 1]) for k in range(1, len(u)) if u[k] != u[k - 1]]
    y = np.zeros(len(t))
    for at, height in moves:
        s = np.maximum(np.asarray(t) - at - dead_time, 0.0)
        if len(lags) == 1:
            y += height * gain * -np.expm1(-s / lags[0])
        else:
            one, two = lags
            y += (
                height
                * gain
                * (1 - (one * np.exp(-s / one) - two * np.exp(-s / two)) / (one - two))
            )
    return y


def steps(t, levels):
    """Input that holds each level from its time on."""
    u = np.zeros(len(t))
    for at, level in levels:
        u[np.asarray(t) >= at - 1e-9] = level
    return u


def stamps(t, form="%Y-%m-%d %H:%M:%S"):
    return [(START + datetime.timedelta(seconds=float(s))).strftime(form) for s in t]


def german_logger(path):
    t = 5.0 * np.arange(400)
    u = steps(t, [(0, 40), (300, 60)])
    rng = np.random.default_rng(1)
    y = 61.0 + response(t, u, 0.8, 45, (180, 40)) + 0.02 * rng.standard_normal(t.size)
    room = 21 + 0.1 * rng.standard_normal(t.size)
    lines = ["Trocknungsanlage 3", "Schrieb Nr. 17; Müller", "", "Zeit;Stellgröße [%];"
             "Ablufttemperatur [°C];Raum [°C];Bemerkung"]  # fmt: skip
    for k, stamp in enumerate(stamps(t, "%d.%m.%Y %H:%M:%S")):
        numbers = f"{u[k]:.1f};{y[k]:.3f};{room[k]:.1f}".replace(".", ",")
        lines.append(f"{stamp};{numbers};{'Stellgröße verändert' if k == 60 else ''}")
    path.write_bytes(("\r\n".join(lines) + "\r\n").encode("latin-1"))


def historian_signals():
    """Samples at uneven times, with the input as it was held."""
    rng = np.random.default_rng(2)
    t = np.round(np.cumsum(rng.choice([9.0, 10.0, 10.0, 11.0, 12.0], 420)), 0)
    u = steps(t, [(0, 35), (t[60] + 1, 45), (t[230] + 1, 38)])
    y = 120 + response(t, u, 1.5, 117, (400,)) + 0.03 * rng.standard_normal(t.size)
    return t, u, y, rng


def historian_wide(path):
    t, u, y, rng = historian_signals()
    bad = rng.choice(t.size, 20, replace=False)
    words = ["Bad", "I/O Timeout", "NaN", ""]
    lines = ["Timestamp,TIC101.OP,TIC101.PV,Quality"]
    for k, stamp in enumerate(stamps(t)):
        cell = words[k % 4] if k in bad else f"{y[k]:.3f}"
        lines.append(f"{stamp},{u[k]:.2f},{cell},{'Bad' if k in bad else 'Good'}")
        if k == 100:
            lines.append(lines[-1])  # a stamp that comes twice
    del lines[301:313]  # the collector stood still
    path.write_text("\n".join(lines) + "\n")


def historian_long(path):
    t, u, y, rng = historian_signals()
    bad = set(rng.choice(t.size, 20, replace=False).tolist())
    rows = []
    for k, stamp in enumerate(stamps(t)):
        # the valve is stored when it moves, and once an hour
        if k == 0 or u[k] != u[k - 1] or k % 300 == 0:
            rows.append(("TIC101.OP", stamp, f"{u[k]:.2f}", "Good"))
        value = "0.000" if k in bad else f"{y[k]:.3f}"
        rows.append(("TIC101.PV", stamp, value, "Bad" if k in bad else "Good"))
    rows.sort(key=lambda row: row[0])
    text = "\n".join(",".join(row) for row in rows)
    path.write_text("Tag,Timestamp,Value,Quality\n" + text + "\n")


def four_tests(path):
    rng = np.random.default_rng(3)
    lines = ["test,time,valve,flow"]
    t = 0.1 * np.arange(250)
    for number, level in enumerate((10.0, 20.0, -10.0, 15.0), start=1):
        u = 40 + steps(t, [(4.0, level)])
        y = 12 + response(t, u, 0.3, 1.2, (2.5,)) + 0.01 * rng.standard_normal(t.size)
        lines += [f"{number},{a:.1f},{b:.1f},{c:.4f}" for a, b, c in zip(t, u, y, strict=True)]
    path.write_text("\n".join(lines) + "\n")


def loop_under_pid(path):
    dt, n, dead = 0.5, 500, 6
    rng = np.random.default_rng(4)
    pole = np.exp(-dt / 10)
    sp = np.where(np.arange(n) < 40, 50.0, np.where(np.arange(n) < 260, 55.0, 48.0))
    u, x, y, integral = np.full(n, 30.0), np.zeros(n + 1), np.zeros(n), 0.0
    for k in range(n):
        delayed = u[k - dead] - 30 if k >= dead else 0.0
        y[k] = 50 + x[k] + 0.02 * rng.standard_normal()
        integral += 0.8 / 10 * dt * (sp[k] - y[k])
        u[k] = round(30 + 0.8 * (sp[k] - y[k]) + integral, 4)
        x[k + 1] = pole * x[k] + 2.0 * (1 - pole) * delayed
    rows = [f"{dt * k:.1f},{sp[k]},{y[k]:.4f},{u[k]:.4f}" for k in range(n)]
    path.write_text("Time,SP,PV,OP\n" + "\n".join(rows) + "\n")


def begins_with_its_step(path):
    t = 0.02 * np.arange(300)
    rng = np.random.default_rng(6)
    y = 20.3 + 5.0 * response(t + 1e-9, np.r_[0.0, np.ones(299)], 1.0, 0.58, (0.8,))
    y += 0.02 * rng.standard_normal(t.size)
    rows = [f"{a:.2f},5,{c:.4f}" for a, c in zip(t, y, strict=True)]
    path.write_text("time,input,output\n" + "\n".join(rows) + "\n")


def arduino(path):
    rng = np.random.default_rng(8)
    t = 1532.0 + np.round(20 * np.arange(400) + rng.uniform(-2.5, 2.5, 400))
    u = steps(t, [(0, 0), (3000, 128)])
    y = 22 + response(t, u, 0.1, 314, (900,)) + 0.02 * rng.standard_normal(t.size)
    rows = [f"{a:.0f},{b:.0f},{c:.3f}" for a, b, c in zip(t, u, y, strict=True)]
    path.write_text("Heater test v1.2 ready\nmillis,pwm,temp\n" + "\n".join(rows) + "\n")


def labview(path):
    t = 0.004 * np.arange(500)
    rng = np.random.default_rng(9)
    u = steps(t, [(0, 1.0), (0.4, 3.0)])
    y = response(t, u, 1.2, 0.08, (0.15, 0.05)) + 0.003 * rng.standard_normal(t.size)
    head = (
        "LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\tTab\n"
        "Decimal_Separator\t.\nMulti_Headings\tNo\nX_Columns\tOne\nTime_Pref\tRelative\n"
        "Operator\tlab\nDate\t2025/02/01\nTime\t08:15:00.000\n***End_of_Header***\t\n\t\n"
        "Channels\t2\t\t\t\nSamples\t500\t500\t\t\nDate\t2025/02/01\t2025/02/01\t\t\n"
        "Time\t08:15:00\t08:15:00\t\t\nY_Unit_Label\tVolts\tVolts\t\t\n"
        "X_Dimension\tTime\tTime\t\t\nX0\t0.0000000000000000E+0\t0.0000000000000000E+0\t\t\n"
        "Delta_X\t0.004000\t0.004000\t\t\n***End_of_Header***\t\t\t\t\n"
        "X_Value\tCommand\tPosition\tComment\n"
    )
    rows = [f"{a:.6f}\t{b:.6f}\t{c:.6f}\t" for a, b, c in zip(t, u, y, strict=True)]
    rows[0] += "first run"
    path.write_text(head + "\n".join(rows) + "\n")


_HOLD = {"missing": "hold"}
FILES = [
    PlantFile("german.csv", german_logger, 0.8, 45, 12, {"output": "Ablufttemperatur"}),
    PlantFile("historian_wide.csv", historian_wide, 1.5, 117, 10, _HOLD),
    PlantFile("historian_long.csv", historian_long, 1.5, 117, 10, _HOLD),
    PlantFile(
        "four_tests.csv", four_tests, 0.3, 1.2, 0.06,
        {"by": "test", "input": "valve", "output": "flow"}, many=True,
    ),
    PlantFile("loop.csv", loop_under_pid, 2.0, 3.0, 0.5),
    PlantFile("step_at_start.csv", begins_with_its_step, 1.0, 0.6, 0.03, {"rest": (0.0, 20.3)}),
    PlantFile("arduino.csv", arduino, 0.1, 0.314, 0.03, {"resample": True}),
    PlantFile("labview.lvm", labview, 1.2, 0.08, 0.01, {"input": "Command", "output": "Position"}),
]  # fmt: skip
