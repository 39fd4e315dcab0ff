"""Responses of a model with delay against python-control on the augmented matrices."""

from __future__ import annotations

from collections.abc import Iterator

import control as ct
import numpy as np

import ctrl_realize as cr

from .measure import Line, cpu_seconds, import_seconds, seconds
from .rigs import TS, record, valve


def lines() -> Iterator[Line]:
    """Time frequency responses, step responses and the import."""
    points = np.exp(1j * TS * np.geomspace(0.1, np.pi / TS, 500))
    many = np.exp(1j * TS * np.geomspace(0.1, np.pi / TS, 100_000))
    for delay, must, aim in ((37, "100", "190"), (300, "3000", "11000")):
        model = cr.delayed_ss(valve(), delay, dt=TS)
        plain = ct.ss(model.A, model.B, model.C, model.D, TS)
        slow = cpu_seconds(lambda plain=plain: plain(points), runs=3, least=3.0)
        fast = cpu_seconds(lambda model=model: model(points))
        yield Line(
            f"frequency response, 500 points, d = {delay}", seconds(fast), seconds(slow),
            slow / fast, must, aim, "python-control, augmented matrices",
        )  # fmt: skip
        fast = cpu_seconds(lambda model=model: model(many))
        yield Line(
            f"frequency response, 100 000 points, d = {delay}", seconds(fast),
            seconds(200 * slow), 200 * slow / fast, "", "", "python-control, 500 points scaled",
        )  # fmt: skip
    model = cr.delayed_ss(valve(), 37, dt=TS)
    plain = ct.ss(model.A, model.B, model.C, model.D, TS)
    time = TS * np.arange(4000)
    slow = cpu_seconds(lambda: ct.step_response(plain, time), runs=9)
    fast = cpu_seconds(lambda: model.step(4000))
    yield Line(
        "step response, 4000 samples, d = 37", seconds(fast), seconds(slow), slow / fast,
        "100", "390", "python-control, augmented matrices",
    )  # fmt: skip
    fast = cpu_seconds(lambda: model.step(1_000_000))
    yield Line(
        "step response, 1 000 000 samples, d = 37", seconds(fast), seconds(250 * slow),
        250 * slow / fast, "", "", "python-control, 4000 samples scaled",
    )  # fmt: skip
    short = record(1, 2e-3).between(2.69, 5.04)
    yield Line(
        f"output-error fit of a record of {short.n_samples} samples, all structures",
        seconds(cpu_seconds(lambda: cr.fit_output_error(short), runs=3)),
        "", None, "0.5 s", "0.15 s",
        "no peer fits the dead time in one go",
    )  # fmt: skip
    base = import_seconds("import control")
    whole = import_seconds("import control, ctrl_realize; ctrl_realize.identify")
    yield Line(
        f"import control and ctrl_realize, up to identify: {100 * (whole / base - 1):+.0f} %",
        seconds(whole), seconds(base), None, "+10 %", "",
        "import control, fresh processes, least of five",
    )  # fmt: skip
