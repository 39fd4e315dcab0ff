"""Files as instruments, controllers and historians write them, with known truth.

Simulated: each is a step test, or a random one, of a plant of its own. `MADE` has the samples that
a reader has to find, and what has to be said besides the name of the file.
"""

import datetime
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import scipy.io

from tests.io.plant_files import response, stamps, steps


@dataclass(frozen=True)
class Truth:
    """What stands in a file: stamps in s from the first, input and output; NaN where none does."""

    t: np.ndarray
    u: np.ndarray
    y: np.ndarray
    gain: float
    dead_time: float


@dataclass(frozen=True)
class MadeFile:
    name: str
    write: Callable[[Path], Truth]
    asked: dict[str, Any] = field(default_factory=dict)
    """What has to be said; nothing for most."""
    told: str = ""
    """What the reader says of its guesses."""


def plant(seed, dt, count, levels, gain, dead, lags, rest=0.0, noise=0.001, digits=4):
    t = np.round(dt * np.arange(count), 9)
    u = steps(t, levels)
    rng = np.random.default_rng(seed)
    y = rest + response(t, u, gain, dead, lags) + noise * gain * rng.standard_normal(count)
    return t, u, np.round(y, digits)


def write(path, lines, encoding="utf-8", end="\n"):
    path.write_bytes((end.join(lines) + end).encode(encoding))


def comma(value):
    return str(value).replace(".", ",")


def influx(path):
    t, u, y = plant(1, 1.0, 200, [(0, 40.0), (30, 50.0)], 35 / 10, 6.5, (20,), 180)
    lines = [
        "#group,false,false,true,true,false,false,true,true,true",
        "#datatype,string,long,dateTime:RFC3339,dateTime:RFC3339,dateTime:RFC3339,double,string,"
        "string,string",
        "#default,_result,,,,,,,,",
        ",result,table,_start,_stop,_time,_value,_field,_measurement,host",
    ]
    span = "2025-02-01T08:00:00Z,2025-02-01T09:00:00Z"
    for number, (name, signal) in enumerate((("op", u), ("pv", y))):
        for at, value in zip(stamps(t, "%Y-%m-%dT%H:%M:%SZ"), signal, strict=True):
            lines.append(f",,{number},{span},{at},{value},{name},oven,plc1")
    write(path, lines, end="\r\n")
    return Truth(t, u, y, 3.5, 6.5)


def influx_fields(path):
    """A pivoted table, as made by ``pivot`` of Flux."""
    t, u, y = plant(2, 0.5, 240, [(0, 10.0), (20, 14.0)], 2.0, 3.0, (8, 2), 50)
    lines = [",result,table,_start,_stop,_time,co,pv"]
    span = "2025-02-01T08:00:00Z,2025-02-01T09:00:00Z"
    for at, a, b in zip(stamps(t, "%Y-%m-%dT%H:%M:%S.%fZ"), u, y, strict=True):
        lines.append(f",_result,0,{span},{at},{a},{b}")
    write(path, lines)
    return Truth(t, u, y, 2.0, 3.0)


def grafana(path):
    """Downloaded as it is shown, with the units in the cells."""
    t, u, y = plant(3, 10.0, 300, [(0, 40.0), (600, 45.0)], 1.5, 90, (300,), 61, digits=2)
    lines = ['"Time","TIC101.OP","TIC101.PV"']
    lines += [f'"{s}","{a:g}%","{b} °C"' for s, a, b in zip(stamps(t), u, y, strict=True)]
    write(path, lines)
    return Truth(t, u, y, 1.5, 90)


def ignition(path):
    """Bad samples are zeros; each signal has its quality."""
    t, u, y = plant(4, 10.0, 300, [(0, 40.0), (600, 50.0)], 2.2, 90, (240,), 20, digits=3)
    bad = np.random.default_rng(4).choice(np.arange(100, 300), 20, replace=False)
    quality = np.full(t.size, 192)
    quality[bad] = 500
    shown = np.where(quality == 500, 0.0, y)
    lines = ["t_stamp,TIC101/OP,TIC101/OP.quality,TIC101/PV,TIC101/PV.quality"]
    lines += [
        f"{s},{a},192,{b},{c}" for s, a, b, c in zip(stamps(t), u, shown, quality, strict=True)
    ]
    write(path, lines)
    return Truth(t, u, np.where(quality == 500, np.nan, y), 2.2, 90)


def datalink(path):
    """Sampled data of AVEVA PI DataLink; states in place of values."""
    t, u, y = plant(5, 5.0, 300, [(0, 30.0), (300, 36.0)], 3.1, 11, (60, 20), 140, digits=3)
    cells = [f"{b}" for b in y]
    for k, word in (
        (120, "No Data"),
        (121, "Bad Input"),
        (200, "I/O Timeout"),
        (244, "Pt Created"),
    ):
        cells[k], y[k] = word, np.nan
    lines = ["Timestamp\tFIC204.MV\tFIC204.PV"]
    clock = stamps(t, "%d-%b-%y %H:%M:%S")
    lines += [f"{s}\t{a}\t{b}" for s, a, b in zip(clock, u, cells, strict=True)]
    write(path, lines)
    return Truth(t, u, y, 3.1, 11)


def studio5000(path):
    t, u, y = plant(6, 0.1, 400, [(0, 20.0), (5, 30.0)], 0.9, 3.2, (4,), 12)
    lines = [
        "Controller Name:,Mixer", "Trend Name:,Level loop", "Trend Tags:,2",
        "Sample Period:,100 Millisecond(s)", "Description:,", "Start Time:,02/01/2025 10:15:30",
        "Header:,Date,Time,Program:Main.LIC.CV,Program:Main.LIC.PV",
    ]  # fmt: skip
    clock = stamps(t, "%m/%d/%Y,%H:%M:%S;%f")
    lines += [f"Data:,{s[:-3]},{a},{b}" for s, a, b in zip(clock, u, y, strict=True)]
    write(path, lines, end="\r\n")
    return Truth(t, u, y, 0.9, 3.2)


def factorytalk(path):
    """A data log of FactoryTalk View: one row for each tag and time."""
    t, u, y = plant(7, 2.0, 200, [(0, 20.0), (40, 25.0)], 1.3, 12, (30,), 70)
    lines = ["Date;Time;Millitm;TagName;Val;Status;Marker"]
    for k, s in enumerate(stamps(t, "%m/%d/%Y;%H:%M:%S")):
        for name, signal in (("TIC\\OUT_CV", u), ("TIC\\TEMP_PV", y)):
            lines.append(f"{s};0;{name};{signal[k]};;{'B' if k == 0 else ''}")
    write(path, lines)
    return Truth(t, u, y, 1.3, 12)


def tia(path):
    """A trace of TIA Portal, German."""
    t, u, y = plant(8, 0.1, 500, [(0, 15.0), (6, 20.0)], 1.8, 1.7, (6, 1.2), 40)
    lines = ['"Zeit [ms]";"Ventil.Stellwert";"Regler.Istwert"']
    lines += [f"{1e3 * s:.0f};{comma(a)};{comma(b)}" for s, a, b in zip(t, u, y, strict=True)]
    write(path, lines, "utf-8-sig", "\r\n")
    return Truth(t, u, y, 1.8, 1.7)


def wincc(path):
    """A data log of a panel: the day number in Time_ms is a million times too large."""
    t, u, y = plant(9, 1.0, 200, [(0, 50.0), (30, 60.0)], 0.7, 14, (20,), 30, digits=3)
    day = (datetime.datetime(2025, 2, 1, 8, 15) - datetime.datetime(1899, 12, 30)).days
    lines = ['"VarName";"TimeString";"VarValue";"Validity";"Time_ms"']
    for k, s in enumerate(stamps(t, "%d.%m.%Y %H:%M:%S")):
        number = comma(round(1e6 * (day + (8.25 * 3600 + t[k]) / 86400), 4))
        for name, signal in (("Heizung_LMN", u), ("Temperatur_PV", y)):
            lines.append(f'"{name}";"{s}";{comma(signal[k])};1;{number}')
    write(path, lines, "utf-16")
    return Truth(t, u, y, 0.7, 14)


def twincat(path):
    t, u, y = plant(10, 0.001, 600, [(0, 1.0), (0.05, 2.0)], 12, 0.0225, (0.06, 0.012), 3)
    head = [
        "Name;Drive", "File;Drive.tcscopex", "Starttime of export;133828893000000000;08:15:00.000",
        "Endtime of export;133828893006000000;08:15:00.600", "",
        "Name;fVoltage;Name;fSpeed", "SymbolComment;;SymbolComment;",
        "Data-Type;REAL64;Data-Type;REAL64", "SampleTime[ms];1;SampleTime[ms];1",
        "SymbolName;MAIN.fVoltage;SymbolName;MAIN.fSpeed",
        "NetId;5.1.2.3.1.1;NetId;5.1.2.3.1.1", "",
    ]  # fmt: skip
    lines = [f"{1e3 * s:g};{a};{1e3 * s:g};{b}" for s, a, b in zip(t, u, y, strict=True)]
    write(path, [*head, *lines])
    return Truth(t, u, y, 12, 0.0225)


def lvm(path):
    t, u, y = plant(11, 0.02, 400, [(0, 1.0), (1, 3.0)], 1.6, 0.84, (1.1,), 2)
    lines = [
        "LabVIEW Measurement\t", "Writer_Version\t2", "Separator\tTab", "Decimal_Separator\t,",
        "Multi_Headings\tYes", "X_Columns\tMulti", "Date\t2025/02/01", "Time\t08:15:00,000",
        "***End_of_Header***\t", "\t\t\t\t",
        "Channels\t2\t\t\t", f"Samples\t{t.size}\t\t{t.size}\t",
        "Date\t2025/02/01\t\t2025/02/01\t", "Y_Unit_Label\tVolts\t\tVolts\t",
        "X_Dimension\tTime\t\tTime\t", "X0\t0,0000E+0\t\t0,0000E+0\t",
        "Delta_X\t0,020000\t\t0,020000\t", "***End_of_Header***\t\t\t\t",
        "X_Value\tVoltage_0\tX_Value\tVoltage_1\tComment",
    ]  # fmt: skip
    lines += [
        f"{comma(f'{s:.6f}')}\t{comma(f'{a:.6f}')}\t{comma(f'{s:.6f}')}\t{comma(f'{b:.6f}')}"
        for s, a, b in zip(t, u, y, strict=True)
    ]
    write(path, lines, end="\r\n")
    return Truth(t, u, y, 1.6, 0.84)


def scope(seed):
    """A generator's step on the first channel, with the noise of its converter."""
    t, u, y = plant(seed, 1e-5, 1200, [(0, 0.0), (2e-3, 2.0)], 2.0, 6e-4, (1e-3,), 0.1, 0.004)
    noisy = u + 0.004 * np.random.default_rng(seed + 100).standard_normal(t.size)
    return t, np.round(noisy, 4), y


def keysight(path):
    t, u, y = scope(12)
    lines = ["x-axis,1,2", "second,Volt,Volt"]
    lines += [f"{s - 2e-3:+.6E},{a:+.5E},{b:+.5E}" for s, a, b in zip(t, u, y, strict=True)]
    write(path, lines)
    return Truth(t, u, y, 2.0, 6e-4)


def tektronix(path):
    t, u, y = scope(13)
    lines = [
        "Model,MDO3024", "Firmware Version,1.26", "", "Waveform Type,ANALOG,ANALOG",
        "Point Format,Y,Y", "Horizontal Units,s,s", "Horizontal Scale,0.002,0.002",
        "Horizontal Delay,0,0", "Sample Interval,1e-05,1e-05", "Record Length,1200,1200",
        "Gating,0.0% to 100.0%,0.0% to 100.0%", "Probe Attenuation,1,1", "Vertical Units,V,V",
        "Vertical Offset,0,0", "Vertical Scale,0.5,0.5", "Vertical Position,0,0", "", "", "",
        "Label,,", "TIME,CH1,CH2",
    ]  # fmt: skip
    lines += [f"{s - 2e-3:.6e},{a},{b}" for s, a, b in zip(t, u, y, strict=True)]
    write(path, lines)
    return Truth(t, u, y, 2.0, 6e-4)


def rigol(path):
    """Numbers of samples, and the time base in the lines above."""
    t, u, y = scope(14)
    lines = ["X,CH1,CH2,Start,Increment,", "Sequence,Volt,Volt,-2.000000e-03,1.000000e-05"]
    lines += [f"{k},{a:.4e},{b:.4e},," for k, (a, b) in enumerate(zip(u, y, strict=True))]
    write(path, lines)
    return Truth(t, u, y, 2.0, 6e-4)


def picoscope(path):
    t, u, y = scope(15)
    lines = ["Time,Channel A,Channel B", "(ms),(V),(V)", ""]
    lines += [f"{1e3 * s - 2:.5f},{a:.4f},{b:.4f}" for s, a, b in zip(t, u, y, strict=True)]
    write(path, lines, end="\r\n")
    return Truth(t, u, y, 2.0, 6e-4)


def picoscope_mat(path):
    t, u, y = scope(16)
    scipy.io.savemat(
        path,
        {
            "A": u[:, None], "B": y[:, None], "Tstart": -2e-3, "Tinterval": 1e-5,
            "ExtraSamples": 0.0, "RequestedLength": 1200.0, "Length": 1200.0, "Version": "7.1",
        },
    )  # fmt: skip
    return Truth(t, u, y, 2.0, 6e-4)


def serial_log(path):
    """A monitor of a serial port that puts the time of day before what a board prints."""
    t, u, y = plant(17, 0.5, 300, [(0, 20.0), (15, 40.0)], 0.3, 8, (25,), 23.5, digits=2)
    lines = ["08:14:59.500 -> boot v1.2"]
    clock = [s[:-3] for s in stamps(t, "%H:%M:%S.%f")]
    lines += [f"{s} -> T:{b} U:{a:g}" for s, a, b in zip(clock, u, y, strict=True)]
    write(path, lines)
    return Truth(t, u, y, 0.3, 8)


def serial_alone(path):
    """Without stamps: the sample time has to be said."""
    t, u, y = plant(18, 0.5, 300, [(0, 20.0), (15, 40.0)], 0.3, 8, (25,), 23.5, digits=2)
    write(path, [f"T:{b} U:{a:g}" for a, b in zip(u, y, strict=True)])
    return Truth(t, u, y, 0.3, 8)


def timetable(path):
    """``writetimetable`` of MATLAB, with durations."""
    t, u, y = plant(19, 0.01, 500, [(0, 1.0), (0.5, 2.0)], 2.5, 0.2, (0.4, 0.1), 1)
    lines = ["Time,u,y"]
    lines += [f"{s:g} sec,{a:g},{b}" for s, a, b in zip(t, u, y, strict=True)]
    write(path, lines)
    return Truth(t, u, y, 2.5, 0.2)


def iddata(path):
    """``data = struct(iddata)``: signals of one experiment in columns, and Ts."""
    t, u, y = plant(20, 0.05, 400, [(0, 0.0), (1, 1.0)], 2.0, 0.4, (0.8,), 0)
    scipy.io.savemat(
        path,
        {"data": {"OutputData": y[:, None], "InputData": u[:, None], "Ts": 0.05, "Tstart": 0.0,
                  "TimeUnit": "seconds", "OutputName": "y1", "InputName": "u1"}},
    )  # fmt: skip
    return Truth(t, u, y, 2.0, 0.4)


def simulink(path):
    """A scope that logs structures with time."""
    t, u, y = plant(21, 0.01, 500, [(0, 1.0), (1, 2.0)], 3.0, 0.3, (0.5, 0.2), 0.5)
    signal = np.zeros((1, 2), dtype=[("values", "O"), ("dimensions", "O"), ("label", "O")])
    for k, (values, label) in enumerate(((u, "valve"), (y, "level"))):
        signal[0, k] = (values[:, None], 1.0, label)
    scipy.io.savemat(path, {"ScopeData": {"time": t[:, None], "signals": signal}})
    return Truth(t, u, y, 3.0, 0.3)


def plotjuggler(path):
    """The union of the stamps of two topics; each has a value at its own."""
    t, u, y = plant(22, 0.02, 600, [(0, 0.0), (1, 1.0)], 0.6, 0.12, (0.4,), 0.2)
    lines = ["__time,/cmd/u,/joint/y"]
    rows = [(1738397700.0 + s, f"{a:g}", "") for s, a in zip(t[::5], u[::5], strict=True)]
    rows += [(1738397700.007 + s, "", f"{b}") for s, b in zip(t, y, strict=True)]
    lines += [f"{s:.6f},{a},{b}" for s, a, b in sorted(rows)]
    write(path, lines)
    return Truth(t, u, y, 0.6, 0.12)


def epoch(path):
    t, u, y = plant(23, 0.5, 300, [(0, 1.0), (20, 3.0)], 5, 5, (12,), 80)
    lines = ["timestamp,command,response"]
    lines += [f"{1738397700000 + 1e3 * s:.0f},{a},{b}" for s, a, b in zip(t, u, y, strict=True)]
    write(path, lines)
    return Truth(t, u, y, 5, 5)


def thousands(path):
    t, u, y = plant(24, 30.0, 300, [(0, 1200.0), (1200, 1400.0)], 12.5, 210, (600,), 900, digits=1)
    lines = ["Time,Valve command,Steam flow PV"]
    lines += [f'{s},"{a:,.1f}","{b:,.1f}"' for s, a, b in zip(stamps(t), u, y, strict=True)]
    write(path, lines)
    return Truth(t, u, y, 12.5, 210)


def summer_time(path):
    """A furnace in the night in which the clock is put back; a minute apart."""
    t, u, y = plant(25, 60.0, 360, [(0, 40.0), (3600, 45.0)], 5, 540, (1800,), 700, digits=1)
    start = datetime.datetime(2025, 10, 26, 0, 0)
    clock = []
    for s in t:
        shown = start + datetime.timedelta(seconds=float(s))
        if s >= 3 * 3600:
            shown -= datetime.timedelta(hours=1)
        clock.append(shown.strftime("%d.%m.%Y %H:%M:%S"))
    lines = ["Zeitstempel;Stellgröße [%];Istwert [°C]"]
    lines += [f"{s};{comma(a)};{comma(b)}" for s, a, b in zip(clock, u, y, strict=True)]
    write(path, lines, "latin-1", "\r\n")
    return Truth(t, u, y, 5, 540)


def encoder(path):
    """A counter of 12 bits behind a motor that is driven up and down."""
    t = np.round(0.002 * np.arange(1500), 9)
    rng = np.random.default_rng(26)
    u = np.repeat(rng.choice([-3.0, 5.0], 60), 25)
    speed = response(t, u, 900, 0.006, (0.08,))
    whole = np.round(500 + np.cumsum(speed) * 0.002)
    lines = ["time_s,u,y"]
    lines += [f"{s:.3f},{a:g},{b:.0f}" for s, a, b in zip(t, u, whole % 4096, strict=True)]
    write(path, lines)
    return Truth(t, u, whole, 900, 0.006)


def utf16(path):
    t, u, y = plant(27, 30.0, 300, [(0, 60.0), (1500, 65.0)], -1.4, 22, (400,), 300, digits=2)
    lines = ["Zeit\tPumpe Ausgang\tTemperatur Istwert", "s\t%\t°C"]
    lines += [f"{comma(s)}\t{comma(a)}\t{comma(b)}" for s, a, b in zip(t, u, y, strict=True)]
    write(path, lines, "utf-16", "\r\n")
    return Truth(t, u, y, -1.4, 22)


def logger(path):
    """A data logger with two channels that no header explains, dates and decimal commas."""
    t, u, y = plant(28, 5.0, 400, [(0, 40.0), (300, 60.0)], 0.8, 45, (180, 40), 61, digits=3)
    lines = ["Messprotokoll Linie 3", "", "Datum;Uhrzeit;K1;K2;Bemerkung"]
    for k, s in enumerate(stamps(t, "%d.%m.%Y;%H:%M:%S")):
        note = "Ventil auf" if k == 60 else ""
        lines.append(f"{s};{comma(u[k])};{comma(y[k])};{note}")
    write(path, lines, "latin-1", "\r\n")
    return Truth(t, u, y, 0.8, 45)


def influx_blocks(path):
    """A table for each field, each with its annotations and header."""
    t, u, y = plant(29, 1.0, 200, [(0, 40.0), (30, 50.0)], 3.5, 6.5, (20,), 180)
    head = [
        "#group,false,false,false,false,true,true",
        "#datatype,string,long,dateTime:RFC3339,double,string,string",
        "#default,_result,,,,,", ",result,table,_time,_value,_field,_measurement",
    ]  # fmt: skip
    lines = []
    for number, (name, signal) in enumerate((("op", u), ("pv", y))):
        lines += head
        for at, value in zip(stamps(t, "%Y-%m-%dT%H:%M:%SZ"), signal, strict=True):
            lines.append(f",,{number},{at},{value},{name},oven")
        lines.append("")
    write(path, lines, end="\r\n")
    return Truth(t, u, y, 3.5, 6.5)


def ignition_tall(path):
    t, u, y = plant(30, 1.0, 200, [(0, 40.0), (30, 50.0)], 3.5, 6.5, (20,), 180)
    lines = ["path,value,quality,t_stamp"]
    for k, at in enumerate(stamps(t)):
        lines += [f"tic101/op,{u[k]},192,{at}", f"tic101/pv,{y[k]},192,{at}"]
    write(path, lines)
    return Truth(t, u, y, 3.5, 6.5)


def twincat_filetime(path):
    """With full time stamps, in 0.1 us since 1601."""
    t, u, y = plant(31, 0.01, 300, [(0, 1.0), (0.5, 2.0)], 12, 0.12, (0.3,), 3)
    lines = ["Name;Drive", "", "Name;fVoltage;Name;fSpeed", "SampleTime[ms];10;SampleTime[ms];10",
             "SymbolName;MAIN.fVoltage;SymbolName;MAIN.fSpeed", ""]  # fmt: skip
    clock = [133828893000000000 + round(1e7 * s) for s in t]
    lines += [f"{s};{a};{s};{b}" for s, a, b in zip(clock, u, y, strict=True)]
    write(path, lines)
    return Truth(t, u, y, 12, 0.12)


def json_lines(path):
    t, u, y = plant(32, 1.0, 200, [(0, 40.0), (30, 50.0)], 3.5, 6.5, (20,), 180)
    clock = stamps(t, "%Y-%m-%dT%H:%M:%S.%fZ")
    write(
        path,
        [f'{{"time": "{s}", "u": {a}, "y": {b}}}' for s, a, b in zip(clock, u, y, strict=True)],
    )
    return Truth(t, u, y, 3.5, 6.5)


def picolog(path):
    """A column of time without a name."""
    t, u, y = plant(33, 1.0, 200, [(0, 40.0), (30, 50.0)], 0.9, 6.5, (20,), 180)
    lines = [",Heater (%),Oven Ave. (C)"]
    lines += [f"{s},{a},{b}" for s, a, b in zip(stamps(t, "%H:%M:%S"), u, y, strict=True)]
    write(path, lines)
    return Truth(t, u, y, 0.9, 6.5)


def faceplate(path):
    """What a loop calls its output is the input of the plant."""
    t, u, y = plant(34, 1.0, 200, [(0, 40.0), (30, 50.0)], 0.9, 6.5, (20,), 180)
    lines = ["Time [s],Setpoint,Actual,Output"]
    lines += [f"{s},190,{b},{a}" for s, a, b in zip(t, u, y, strict=True)]
    write(path, lines)
    return Truth(t, u, y, 0.9, 6.5)


GUESSED = "moves in steps"
MADE = [
    MadeFile("influx.csv", influx),
    MadeFile("influx_fields.csv", influx_fields),
    MadeFile("grafana.csv", grafana),
    MadeFile("ignition.csv", ignition, told="quality is bad"),
    MadeFile("datalink.txt", datalink, told="4 samples have missing values"),
    MadeFile("studio5000.csv", studio5000),
    MadeFile("factorytalk.csv", factorytalk),
    MadeFile("tia.csv", tia),
    MadeFile("wincc.csv", wincc),
    MadeFile("twincat.csv", twincat, told=GUESSED),
    MadeFile("twochannels.lvm", lvm, told=GUESSED),
    MadeFile("keysight.csv", keysight, told=GUESSED),
    MadeFile("tektronix.csv", tektronix, told=GUESSED),
    MadeFile("rigol.csv", rigol, told=GUESSED),
    MadeFile("picoscope.csv", picoscope, told=GUESSED),
    MadeFile("picoscope.mat", picoscope_mat, told=GUESSED),
    MadeFile("serial.log", serial_log),
    MadeFile("serial_alone.log", serial_alone, {"dt": 0.5}),
    MadeFile("timetable.csv", timetable),
    MadeFile("iddata.mat", iddata),
    MadeFile("simulink.mat", simulink, told=GUESSED),
    MadeFile("plotjuggler.csv", plotjuggler, told="their own stamps"),
    MadeFile("epoch.csv", epoch, told="since 1970"),
    MadeFile("thousands.csv", thousands),
    MadeFile("summer_time.csv", summer_time, told="summer time"),
    MadeFile("encoder.csv", encoder, told="starts again"),
    MadeFile("utf16.txt", utf16),
    MadeFile("logger.csv", logger, told=GUESSED),
    MadeFile("influx_blocks.csv", influx_blocks),
    MadeFile("ignition_tall.csv", ignition_tall),
    MadeFile("filetime.csv", twincat_filetime, told=GUESSED),
    MadeFile("lines.json", json_lines),
    MadeFile("picolog.csv", picolog, told=GUESSED),
    MadeFile("faceplate.csv", faceplate),
]
