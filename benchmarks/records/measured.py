"""Simulate the half of a measured record that a model has not seen, beside the models of rivals."""

from __future__ import annotations

import contextlib
import io
import platform
import sys
import warnings
from collections.abc import Callable, Iterable, Sequence
from datetime import date
from importlib import metadata
from pathlib import Path

import control as ct
import numpy as np
from scipy.signal import lfilter

import ctrl_realize as cr

from ..peers.__main__ import silence

DATA = Path(__file__).resolve().parents[3] / "shared" / "data"
SETS: dict[str, tuple[str, Sequence[int], Sequence[int]]] = {
    "hairdryer": ("hairdryer/record.csv", (1,), (2,)),
    "gas_furnace": ("gas_furnace/record.csv", (1,), (2,)),
    "exchanger": ("exchanger/record.csv", (1,), (2,)),
    "robot_arm": ("robot_arm/record.csv", (1,), (2,)),
    "cd_player_mimo": ("cd_player_mimo/record.csv", (1, 2), (3, 4)),
    "heater": ("sbhs_heater/prbs_irregular.csv", (1,), (2,)),
    "valve_flow": ("valve_loops/sugar_actuator_first_half.csv", (1,), (3,)),
    "ball_and_beam": ("ball_and_beam/record.csv", (1,), (2,)),
}
"""File, and columns of the inputs and outputs."""
ORDERS = (2, 3, 4, 6, 8, 12, 16, 20)
LOW_ORDERS = (1, 2, 3, 4)
DELAYS = range(5)
"""Delays of the polynomial models; the one that simulates its own half best counts."""
ROWS = 20
"""Block rows of the subspace methods."""

Model = Callable[[cr.Record, int], ct.StateSpace]


def halves(plant: str) -> tuple[cr.Record, cr.Record]:
    """Cut a record in the middle."""
    file, inputs, outputs = SETS[plant]
    columns = np.loadtxt(DATA / file, delimiter=",", skiprows=1).T
    time, u, y = columns[0], columns[list(inputs)], columns[list(outputs)]
    if np.ptp(np.diff(time)) > 1.0:  # irregular stamps: the input is held, the output interpolated
        even = np.arange(0.0, time[-1])
        u = u[:, np.searchsorted(time, even, side="right") - 1]
        y, time = np.array([np.interp(even, time, row) for row in y]), even
    whole = cr.Record(time, u.squeeze(), y.squeeze(), name=plant)
    middle = whole.time[whole.n_samples // 2]
    return whole.between(whole.time[0], middle), whole.between(middle, np.inf)


def centred(record: cr.Record) -> tuple[np.ndarray, np.ndarray]:
    """Input and output without their means, shape (signals, N)."""
    u, y = (np.atleast_2d(x) for x in (record.input, record.output))
    return u - u.mean(axis=1, keepdims=True), y - y.mean(axis=1, keepdims=True)


class UnfitRecordError(Exception):
    """A way that takes no records of this kind."""


def scanned(record: cr.Record, _: int) -> ct.StateSpace:
    """Impulse response, and the order and delay that its standard deviations ask for."""
    if record.noutputs > 1:
        raise UnfitRecordError
    impulse = cr.impulse_from_io(record)
    return cr.scan_orders(impulse, 8, max_delay=10).system()


def lags(**options: str) -> Model:
    """Lags with dead time, whether they are adequate or not."""

    def fit(record: cr.Record, _: int) -> ct.StateSpace:
        if record.noutputs > 1:
            raise UnfitRecordError
        return cr.fit_output_error(record, **options)

    return fit


def nfoursid(record: cr.Record, order: int) -> ct.StateSpace:
    """N4SID of the package nfoursid."""
    import pandas as pd
    from nfoursid.nfoursid import NFourSID

    u, y = centred(record)
    inputs, outputs = ([f"{s}{i}" for i in range(len(x))] for s, x in (("u", u), ("y", y)))
    frame = pd.DataFrame(np.vstack([u, y]).T, columns=inputs + outputs)
    method = NFourSID(frame, outputs, inputs, num_block_rows=ROWS)
    method.subspace_identification()
    found, _ = method.system_identification(rank=order)
    return ct.ss(found.a, found.b, found.c, found.d, record.dt)


def sippy(method: str) -> Model:
    """A subspace method of SIPPY."""

    def fit(record: cr.Record, order: int) -> ct.StateSpace:
        from sippy_unipi import system_identification

        u, y = centred(record)
        with contextlib.redirect_stdout(io.StringIO()):
            found = system_identification(
                y, u, method, SS_fixed_order=order, SS_f=ROWS, SS_p=ROWS,
                SS_D_required=True, tsample=record.dt,
            )  # fmt: skip
        return ct.ss(found.A, found.B, found.C, found.D, record.dt)

    return fit


def pysib(kind: str) -> Model:
    """An ARX or output-error model of the package pysib, as many zeros as poles."""

    def fit(record: cr.Record, order: int) -> ct.StateSpace:
        import pysib

        if record.noutputs > 1:
            raise UnfitRecordError
        u, y = (signal[0] for signal in centred(record))
        found = []
        for delay in DELAYS:
            _, model = getattr(pysib, kind)(u, y, order, order, delay + 1)
            b, a = np.ravel(model["B"]), np.ravel(model["A" if kind == "arx" else "F"])
            wide = max(b.size, a.size)
            b, a = np.r_[b, np.zeros(wide - b.size)], np.r_[a, np.zeros(wide - a.size)]
            error = float(np.sum((y - lfilter(b, a, u)) ** 2))
            found.append((error if np.isfinite(error) else np.inf, delay, ct.tf(b, a, record.dt)))
        return ct.ss(min(found, key=lambda each: each[:2])[2])

    return fit


WAYS: dict[str, tuple[Model, Iterable[int]]] = {
    "ctrl_realize: identify": (lambda record, _: cr.identify(record), (0,)),
    "ctrl_realize: fit_output_error": (lags(), (0,)),
    "the same, focus='prediction'": (lags(focus="prediction"), (0,)),
    "the same, noise='white'": (lags(noise="white"), (0,)),
    "ctrl_realize: fit_state_space": (lambda record, _: cr.fit_state_space(record), (0,)),
    "ctrl_realize: impulse_from_io, scan_orders": (scanned, (0,)),
    "nfoursid: N4SID": (nfoursid, ORDERS),
    "SIPPY: N4SID": (sippy("N4SID"), ORDERS),
    "SIPPY: CVA": (sippy("CVA"), ORDERS),
    "SIPPY: PARSIM-K": (sippy("PARSIM-K"), ORDERS),
    "pysib: ARX": (pysib("arx"), LOW_ORDERS),
    "pysib: OE": (pysib("oe"), LOW_ORDERS),
}


def predicted(way: Model, order: int, first: cr.Record, second: cr.Record) -> float | str:
    """Mean fit in percent of the outputs that were not seen, or why there is none."""
    try:
        with warnings.catch_warnings(), silence(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            model = way(first, order)
            return float(cr.validation.analyse_residuals(model, second).fit_percent.mean())
    except ImportError:
        return "not installed"
    except UnfitRecordError:
        return "-"
    except cr.errors.DataError:
        return "refused"
    except cr.errors.UnsuitableSystemError:
        return "unstable"
    except Exception as error:
        return type(error).__name__


def cell(name: str, plant: str) -> str:
    """First half to second, and second to first; of several orders the best and the middle."""
    way, orders = WAYS[name]
    first, second = halves(plant)
    shown = []
    for fitted, unseen in ((first, second), (second, first)):
        found = [predicted(way, order, fitted, unseen) for order in orders]
        good = [max(fit, 0.0) for fit in found if isinstance(fit, float)]
        if not good:
            shown.append(str(found[0]))
            continue
        middle = np.median(good + [0.0] * (len(found) - len(good)))
        shown.append(f"{max(good):.1f}" + (f" ({middle:.1f})" if len(found) > 1 else ""))
    return " / ".join(shown if shown[0][0].isdigit() else dict.fromkeys(shown)) + (
        " %" if shown[-1][0].isdigit() else ""
    )


def table() -> str:
    """Make the table in Markdown."""
    lines = [
        f"| way | told beforehand | {' | '.join(SETS)} |",
        "|---" * (2 + len(SETS)) + "|",
    ]
    for name, (_, orders) in WAYS.items():
        told = "order" if len(tuple(orders)) > 1 else "nothing"
        lines.append(f"| {name} | {told} | {' | '.join(cell(name, p) for p in SETS)} |")
        print(lines[-1], file=sys.stderr, flush=True)
    packages = "ctrl-realize", "control", "numpy", "scipy", "nfoursid", "sippy-unipi", "pysib"
    versions = ", ".join(
        f"{package} {metadata.version(package)}" for package in packages if _installed(package)
    )
    lines += [
        "",
        "Each cell: fit (NRMSE, mean of the outputs) of the second half of the record by a model "
        "of the first / of the first half by a model of the second. Where an order is told, the "
        f"best of the orders {', '.join(map(str, ORDERS))} (pysib: 1 to 4, with the delay from 0 "
        f"to {DELAYS[-1]} that simulates its own half best) in hindsight, and in brackets the "
        "median over them; models that are unstable simulate nothing and count as 0 %. The second "
        "half of the heater's record has ten edges and is fitted as a sequence of steps. "
        f"{ROWS} block rows. Made on {date.today()} by `python -m benchmarks.records measured` "
        f"with Python {platform.python_version()}, {versions}.",
        "",
    ]
    return "\n".join(lines)


def _installed(package: str) -> bool:
    try:
        metadata.version(package)
    except metadata.PackageNotFoundError:
        return False
    return True
