"""Fifty records that mislead, and what a program has to be told of each; and some that do not.

Simulated: a plant of gain 2, a lag of 15 s and one of 3 s behind 5 s, every second, unless a trap
says otherwise.
"""

import datetime
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from tests.io.plant_files import response, steps

GAIN, DEAD_TIME, LAGS = 2.0, 5.0, (15.0, 3.0)


@dataclass(frozen=True)
class Trap:
    """A file, options, and what is right: an answer that has to be there, and what must not be.

    ``refused`` is a part of the error; ``flags`` are those of which one has to be raised; ``told``
    is a part of a warning; ``not_yes`` are questions that must not be answered by yes, ``yes``
    those that must.
    """

    name: str
    write: Callable[[Path], None]
    options: tuple[str, ...] = ()
    refused: str = ""
    flags: tuple[str, ...] = ()
    told: str = ""
    not_yes: tuple[str, ...] = ()
    yes: tuple[str, ...] = ()
    truth: dict[str, float] = field(default_factory=dict)


def signals(n=200, at=30, height=10.0, noise=0.02, seed=0, gain=GAIN, dead=DEAD_TIME, lags=LAGS):
    t = np.arange(float(n))
    u = 40 + steps(t, [(at, height)])
    rng = np.random.default_rng(seed)
    y = 20 + response(t, u - 40, gain, dead, lags) + noise * rng.standard_normal(n)
    return t, u, y


def csv(t, u, y, header="time [s],u [%],y [degC]", form="{:g},{:.6g},{:.5f}"):
    def write(path):
        rows = [form.format(*row) for row in zip(t, u, y, strict=True)]
        path.write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")

    return write


def changed(change, **options):
    """The usual record with one thing changed."""
    t, u, y = signals(**options)
    return csv(*change(t, u.copy(), y.copy()))


def loop(moves, noise=0.02, n=400, kp=1.0, ti=15.0, seed=1, disturbance=0.0):
    """A record under PI control; the set point is not stored."""
    t = np.arange(float(n))
    rng = np.random.default_rng(seed)
    slow, fast = np.exp(-1 / LAGS[0]), np.exp(-1 / LAGS[1])
    u, y, x1, x2, integral = np.zeros(n), np.zeros(n), 0.0, 0.0, 0.0
    load = np.cumsum(disturbance * rng.standard_normal(n))
    set_point = steps(t, moves) if moves else np.zeros(n)
    for k in range(n):
        y[k] = x2 + load[k] + noise * rng.standard_normal()
        error = set_point[k] - y[k]
        integral += kp / ti * error
        u[k] = kp * error + integral
        late = u[k - 5] if k >= 5 else 0.0
        x1 = slow * x1 + GAIN * (1 - slow) * late
        x2 = fast * x2 + (1 - fast) * x1
    return csv(t, 40 + u, 20 + y)


def add(pulse):
    return lambda t, u, y: (t, u, y + pulse(t))


def quantised(q):
    return lambda t, u, y: (t, u, np.round(y / q) * q)


def of_stamps(t, u, y):
    start = datetime.datetime(2025, 2, 3, 8)
    clock = [(start + datetime.timedelta(seconds=float(s))).strftime("%d/%m/%Y %H:%M") for s in t]
    return csv(clock, u, y, "time,u,y", "{},{:.6g},{:.5f}")


def text(content):
    return lambda path: path.write_text(content, encoding="utf-8")


def noise(size, seed=3, scale=0.02):
    return scale * np.random.default_rng(seed).standard_normal(size)


def coloured(t, pole=0.95, scale=0.3):
    y, e = np.zeros(t.size), noise(t.size, 5, scale)
    for k in range(1, t.size):
        y[k] = pole * y[k - 1] + e[k]
    return y


def backlash(u, width):
    stem = np.array(u, dtype=float)
    for k in range(1, u.size):
        stem[k] = min(max(stem[k - 1], u[k] - width / 2), u[k] + width / 2)
    return stem


def integrated(t, u):
    late = np.r_[np.zeros(5), u[:-5] - u[0]]
    return 20 + 0.02 * np.cumsum(late) + noise(t.size)


def two_inputs(path):
    """A second valve moves, too, and stands in the file."""
    t, u, y = signals()
    v = 10 + steps(t, [(60, 5.0), (110, -5.0)])
    y = y + response(t, v - 10, 3.0, 2.0, (8.0,))
    rows = [f"{a:g},{b:g},{c:g},{d:.4f}" for a, b, c, d in zip(t, u, v, y, strict=True)]
    path.write_text("\n".join(["time [s],u,v,y", *rows]) + "\n")


T, U, Y = signals()
CLEAN = csv(T, U, Y)
ANY = ("dead_time", "gain", "tuning")
SLOW = 60.0 * T


def step_with(**options):
    return csv(*signals(**options))


TRAPS = [
    # what is no trap: a program has to be allowed to go on
    Trap("a clean step", CLEAN, yes=ANY),
    Trap("a step down", step_with(height=-10.0), yes=ANY),
    Trap("a negative gain", step_with(gain=-2.0), yes=ANY),
    Trap("steps up and down", csv(T, 40 + (s := steps(T, [(30, 10.0), (110, -5.0)])),
         20 + response(T, s, GAIN, DEAD_TIME, LAGS) + noise(T.size)), yes=ANY),
    Trap("one per cent of noise", step_with(noise=0.2), yes=("gain", "tuning")),
    Trap("minutes", csv(SLOW / 60, U, Y, "time [min],u,y"), yes=ANY, truth={"dead_time": 300.0}),
    Trap("milliseconds", csv(1e3 * T, U, Y, "time [ms],u,y"), yes=ANY, truth={"dead_time": 5.0}),
    Trap("decimal commas", lambda path: path.write_text("Zeit [s];u;y\n" + "".join(
        f"{a:g};{b:g};{c:.4f}\n" for a, b, c in zip(T, U, Y, strict=True)).replace(".", ",")),
        yes=ANY),
    # nothing to learn from
    Trap("constant input", csv(T, 40 + 0 * U, Y), refused="no step in the input"),
    Trap("constant output", csv(T, U, 20 + 0 * Y), refused="does not leave its baseline"),
    Trap("no response", csv(T, U, 20 + noise(T.size, scale=1.0)), refused="baseline"),
    Trap("another plant's output", csv(T, 40 + np.random.default_rng(8).choice([0, 10], T.size),
         20 + coloured(T)), refused="explains nothing"),
    Trap("begins with its step", csv(T[30:] - 30, U[30:], Y[30:]), refused="--rest U0 Y0"),
    Trap("five samples", csv(T[28:33], U[28:33], Y[28:33]), refused="samples"),
    Trap("empty file", text(""), refused="empty"),
    Trap("only a header", text("time,u,y\n"), refused="numeric"),
    # files that may be misread
    Trap("no unit of time", csv(T, U, Y, "time,u,y"), told="assumed"),
    Trap("milliseconds without unit", csv(1000 * T, U, Y, "time,u,y"), told="assumed"),
    Trap("no time", csv(T, U, Y, "a,u,y"), refused="which column is time"),
    Trap("three signals without names", csv(T, U, Y, "time [s],a,b"), told="moves in steps"),
    Trap("two that follow", lambda path: path.write_text("time [s],a,b,c\n" + "".join(
        f"{a:g},{b:g},{c:.4f},{c / 2:.4f}\n" for a, b, c in zip(T, U, Y, strict=True))),
        refused="cannot tell which column"),
    Trap("day or month", lambda path: of_stamps(60 * T[:180], U[:180], Y[:180])(path), yes=ANY),
    Trap("two decimal signs", csv(T, U, Y, form='{:g},{:g},"{:,.3f}"'), yes=ANY),
    Trap("a word among the numbers", lambda path: (CLEAN(path), path.write_text(
        path.read_text().replace("\n60,50,", "\n60,50,x"))), refused="is not a number"),
    Trap("swapped columns", csv(T[:150], Y[:150], U[:150]), flags=("swapped",), not_yes=ANY),
    Trap("swapped columns without names", csv(T, Y, U, "time [s],a,b"), told="moves in steps"),
    Trap("two inputs, one named", two_inputs, flags=("structured_misfit", "load_disturbance"),
         not_yes=("gain", "tuning")),
    Trap("time runs backwards", csv(np.r_[T[:100], T[50:150]], U, Y), refused="jumps back"),
    Trap("time stands still", csv(np.round(T / 5), U, Y), refused="coarser"),
    Trap("a gap in which the input moved", csv(np.r_[T[:25], T[45:]], np.r_[U[:25], U[45:]],
         np.r_[Y[:25], Y[45:]]), refused="the input moved meanwhile"),
    Trap("a gap in the response", csv(np.r_[T[:60], T[75:]], np.r_[U[:60], U[75:]],
         np.r_[Y[:60], Y[75:]]), told="irregular", yes=("gain",)),
    Trap("codes for missing values", csv(T, U, np.where(T % 50 == 49, -9999.0, Y)),
         flags=("outliers",), yes=("gain",)),
    # the record does not tell
    Trap("ends while rising", csv(T[:50], U[:50], Y[:50]),
         flags=("gain_not_resolved", "not_settled"), not_yes=("gain",)),
    Trap("ends soon after the onset", csv(T[:40], U[:40], Y[:40]), not_yes=("gain",)),
    Trap("loud noise", step_with(noise=6.0), not_yes=("dead_time",)),
    Trap("slow noise", csv(T, U, Y + coloured(T, 0.97, 0.6)), not_yes=("gain",)),
    Trap("coarse samples", csv(T[::10], U[::10], Y[::10]), not_yes=("dead_time",)),
    Trap("rounded output", csv(T, U, np.round(Y / 4) * 4), flags=("coarse_quantisation",),
         not_yes=("dead_time",)),
    Trap("starts with the input", step_with(at=1), not_yes=(), flags=("no_rest", "earlier_input")),
    # something else moved the output
    Trap("a load after the step", csv(T, U, Y + 8.0 * (T > 100)),
         flags=("load_disturbance", "structured_misfit"), not_yes=("gain",)),
    Trap("a load soon after the step",
         csv(T, U, Y + 6 * -np.expm1(-np.maximum(T - 45, 0) / 15)), not_yes=("gain",)),
    Trap("a load that grows", csv(T, U, Y + 0.05 * np.maximum(T - 60, 0)), not_yes=("gain",)),
    Trap("drift", csv(T, U, Y + 0.03 * T), flags=("drift", "not_at_rest"), not_yes=("gain",)),
    Trap("not at rest", csv(T, U, Y + 8 * np.exp(-T / 20)), flags=("not_at_rest",)),
    Trap("an oscillation of its own", csv(T, U, Y + 3 * np.sin(2 * np.pi * T / 40)),
         not_yes=("tuning",)),
    Trap("outliers", csv(T, U, np.where(T % 40 == 39, Y + 30, Y)),
         flags=("outliers",), yes=("gain",)),
    Trap("a sensor that stuck", csv(T, U, np.where((T > 45) & (T < 90), Y[45], Y)),
         flags=("stuck_output",), not_yes=("gain",)),
    Trap("a response that a limit ends", csv(T, U, np.minimum(Y, 36)),
         flags=("output_at_limit", "may_be_at_limit")),
    # not a stable linear plant in open loop
    Trap("a loop without moves", loop([], disturbance=0.05), refused="explains nothing"),
    Trap("a loop with moves up and down", loop([(50, 5.0), (150, -3.0), (250, 4.0)]),
         flags=("feedback",)),
    Trap("a loop with one move", loop([(50, 5.0)]), flags=("feedback",)),
    Trap("an integrating plant", csv(T, U, integrated(T, U)), flags=("integrating",)),
    Trap("a run-away plant", csv(T[:90], U[:90], 20 + np.expm1(np.maximum(T[:90] - 35, 0) / 15)
         + noise(90)), flags=("unstable", "integrating", "structured_misfit"), not_yes=("gain",)),
    Trap("backlash in the valve", csv(T, 40 + (b := steps(T, [(20, 4.0), (80, 8.0), (140, 4.0)])),
         20 + response(T, backlash(b, 2.0), GAIN, DEAD_TIME, LAGS) + noise(T.size)),
         not_yes=("gain",)),
]  # fmt: skip
