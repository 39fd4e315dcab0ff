"""Records for the tests of the app: simulated, as arrays and as a file that needs care."""

import datetime

import numpy as np

import ctrl_realize as cr

START = datetime.datetime(2025, 2, 1, 8, 15)
RECORD = {"gain": 0.6, "dead_time": 1.2, "lag": 2.0, "noise": 0.05}


def step_record(count: int = 300, dt: float = 0.1, seed: int = 1, **changes: float) -> cr.Record:
    """One lag with dead time, a step of 10 at 3 s, in degC and %."""
    plant = RECORD | changes
    time = dt * np.arange(count)
    since = np.maximum(time - 3 - plant["dead_time"], 0)
    moved = 10 * plant["gain"] * -np.expm1(-since / plant["lag"])
    noise = plant["noise"] * np.random.default_rng(seed).standard_normal(count)
    signal = np.where(time < 3, 20.0, 30.0)
    units = {"u": "%", "y": "degC"}
    return cr.Record(time, signal, 50 + moved + noise, name="heater", units=units)


def messy_csv() -> bytes:
    """The same from a logger: a comment, German dates and decimals, other columns, bad cells."""
    record = step_record()
    heads = "Zeitstempel;Sollwert;Ventil OP [%];Temperatur PV [degC];Bild"
    rows = ["# exported by logger 7;;;;", heads]
    for k, (u, y) in enumerate(zip(record.input, record.output, strict=True)):
        when = (START + datetime.timedelta(seconds=4 * k)).strftime("%d.%m.%Y %H:%M:%S")
        value = "Bad" if k in (60, 151, 152) else f"{y:.3f}".replace(".", ",")
        rows.append(f"{when};55,0;{u:.1f}".replace(".0", ",0") + f";{value};a{k}")
    return "\r\n".join(rows).encode("latin-1")
