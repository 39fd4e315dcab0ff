"""One function for each way; `GIVEN` says what it was told beforehand."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import control as ct
import numpy as np
from scipy.optimize import curve_fit

import ctrl_realize as cr

from .tasks import BAND_HZ, MAX_DELAY, ORDER, Answer, Task, of_matrices, of_polynomials

RUNNERS: dict[str, Callable[[Task], Answer]] = {}
GIVEN: dict[str, str] = {}
PACKAGE: dict[str, str] = {}


def runner(name: str, package: str, given: str) -> Callable[..., Callable[[Task], Answer]]:
    def register(function: Callable[[Task], Answer]) -> Callable[[Task], Answer]:
        RUNNERS[name], GIVEN[name], PACKAGE[name] = function, given, package
        return function

    return register


def pulses(task: Task) -> np.ndarray:
    """Backward difference of the step response, from the step on: what realizations take."""
    edge = int(np.argmax(task.u > 0.5))
    return np.diff(task.y[edge:], prepend=0.0)


def response_of(system: ct.LTI, task: Task) -> np.ndarray:
    return system(np.exp(2j * np.pi * BAND_HZ * task.dt))


@runner("ctrl_realize: identify", "ctrl-realize", "nothing")
def ours(task: Task) -> Answer:
    system = cr.identify(task.record)
    return Answer(system.fit.delay, response_of(system, task))


@runner("ctrl_realize: identify, order 3, degree 3", "ctrl-realize", "order, relative degree")
def ours_given(task: Task) -> Answer:
    system = cr.identify(task.record, structures=[(3, 3)])
    return Answer(system.fit.delay, response_of(system, task))


@runner("ctrl_realize: scan", "ctrl-realize", "order")
def ours_scan(task: Task) -> Answer:
    system = cr.identify(task.record, method="scan", order=ORDER, max_delay=MAX_DELAY)
    return Answer(system.delay, response_of(system, task))


@runner("ctrl_realize: paper", "ctrl-realize", "order (the paper's settings)")
def ours_paper(task: Task) -> Answer:
    system = cr.identify(task.record, method="paper")
    return Answer(system.delay, response_of(system, task))


@runner("python-control: ERA", "control", "order")
def control_era(task: Task) -> Answer:
    g = pulses(task)
    system, _ = ct.eigensys_realization(g[None, None, :], ORDER, m=500, n=500, dt=True)
    return Answer(None, of_matrices(system.A, system.B, system.C, system.D))


@runner("python-control: ERA, delay given", "control", "order, delay")
def control_era_delay(task: Task) -> Answer:
    g = pulses(task)[37:]
    system, _ = ct.eigensys_realization(g[None, None, :], ORDER, m=500, n=500, dt=True)
    shift = np.exp(-2j * np.pi * BAND_HZ * task.dt * 37)
    return Answer(None, of_matrices(system.A, system.B, system.C, system.D) * shift)


@runner("pyMOR: ERA", "pymor", "order")
def pymor_era(task: Task) -> Answer:
    from pymor.core.logger import set_log_levels
    from pymor.reductors.era import ERAReductor

    set_log_levels({"pymor": "ERROR"})
    g = pulses(task)
    reductor = ERAReductor(g[1:], task.dt, feedthrough=np.array([[g[0]]]))
    model = reductor.reduce(r=ORDER)
    A, B, C, D, E = model.to_matrices()
    assert E is None
    return Answer(None, of_matrices(A, B, C, np.zeros((1, 1)) if D is None else D))


@runner("SciPy: curve_fit, first order and dead time", "scipy", "order 1")
def scipy_first_order(task: Task) -> Answer:
    t = task.dt * (np.arange(task.y.size) - np.argmax(task.u > 0.5))

    def model(t: np.ndarray, gain: float, tau: float, lag: float) -> np.ndarray:
        return gain * -np.expm1(-np.clip(t - tau, 0, None) / abs(lag))

    (gain, tau, lag), _ = curve_fit(model, t, task.y, p0=(1.0, 0.03, 0.07))
    s = 2j * np.pi * BAND_HZ
    return Answer(tau / task.dt, gain * np.exp(-s * tau) / (1 + abs(lag) * s))


@runner("SciPy: curve_fit, second order and dead time", "scipy", "order 2")
def scipy_second_order(task: Task) -> Answer:
    t = task.dt * (np.arange(task.y.size) - np.argmax(task.u > 0.5))

    def model(t: np.ndarray, gain: float, tau: float, a: float, b: float) -> np.ndarray:
        after = np.clip(t - tau, 0, None)
        return gain * (1 - (a * np.exp(-after / a) - b * np.exp(-after / b)) / (a - b))

    bounds = ([0.1, 0.0, 0.03, 0.001], [10.0, 0.1, 1.0, 0.0299])
    (gain, tau, a, b), _ = curve_fit(model, t, task.y, p0=(1.0, 0.03, 0.07, 0.02), bounds=bounds)
    s = 2j * np.pi * BAND_HZ
    return Answer(tau / task.dt, gain * np.exp(-s * tau) / ((1 + a * s) * (1 + b * s)))


def best_delay(
    task: Task, fit: Callable[[int], tuple[np.ndarray, np.ndarray]], delays: Iterable[int]
) -> Answer:
    """Take the delay whose model simulates the record best: what one does around such a tool."""
    from scipy.signal import lfilter

    best: tuple[float, int, np.ndarray, np.ndarray] | None = None
    for d in delays:
        try:
            b, f = fit(d)
            with np.errstate(all="ignore"):
                error = float(np.sum((task.y - lfilter(b, f, task.u)) ** 2))
        except Exception:  # a peer's own failure at one delay leaves the others
            continue
        if np.isfinite(error) and (best is None or error < best[0]):
            best = (error, d, b, f)
    if best is None:
        raise RuntimeError("no delay gave a model")
    return Answer(best[1], of_polynomials(best[2], best[3]))


@runner("pysib: OE(3, 3) for each delay 25...50", "pysib", "order, delay within 25")
def pysib_oe(task: Task) -> Answer:
    import pysib

    def fit(d: int) -> tuple[np.ndarray, np.ndarray]:
        _, model = pysib.oe(task.u, task.y, ORDER, ORDER, d + 1)
        return np.ravel(model["B"]), np.ravel(model["F"])

    return best_delay(task, fit, range(25, 51))


@runner("pysib: ARX(3, 3) for each delay 0...100", "pysib", "order")
def pysib_arx(task: Task) -> Answer:
    import pysib

    def fit(d: int) -> tuple[np.ndarray, np.ndarray]:
        _, model = pysib.arx(task.u, task.y, ORDER, ORDER, d + 1)
        return np.ravel(model["B"]), np.ravel(model["A"])

    return best_delay(task, fit, range(MAX_DELAY + 1))


@runner("llsi: OE(3, 3, 38), delay given", "llsi", "order, delay")
def llsi_oe(task: Task) -> Answer:
    import llsi

    model = llsi.oe(llsi.iddata(task.y, task.u, task.dt), [ORDER, ORDER, 38])
    b, a = np.ravel(model.b), np.ravel(model.a)
    lead = int(getattr(model, "nk", 0))
    return Answer(None, of_polynomials(np.r_[np.zeros(lead), b], a))


@runner("nfoursid: N4SID, order 3", "nfoursid", "order")
def nfoursid_n4sid(task: Task) -> Answer:
    import pandas as pd
    from nfoursid.nfoursid import NFourSID

    frame = pd.DataFrame({"u": task.u, "y": task.y})
    method = NFourSID(frame, output_columns=["y"], input_columns=["u"], num_block_rows=50)
    method.subspace_identification()
    model, _ = method.system_identification(rank=ORDER)
    return Answer(None, of_matrices(model.a, model.b, model.c, model.d))


@runner("SIPPY: N4SID, order 3", "sippy-unipi", "order")
def sippy_n4sid(task: Task) -> Answer:
    from sippy_unipi import system_identification

    model = system_identification(
        task.y, task.u, "N4SID", SS_fixed_order=ORDER, SS_f=50, SS_p=50, tsample=task.dt
    )
    return Answer(None, of_matrices(model.A, model.B, model.C, model.D))


@runner("SIPPY: ARX(3, 3) for each delay 0...100", "sippy-unipi", "order")
def sippy_arx(task: Task) -> Answer:
    from sippy_unipi import system_identification

    def fit(d: int) -> tuple[np.ndarray, np.ndarray]:
        model = system_identification(
            task.y, task.u, "ARX", ARX_orders=[ORDER, ORDER, d], tsample=task.dt
        )
        b, f = np.ravel(model.G.num[0][0]), np.ravel(model.G.den[0][0])
        return np.r_[np.zeros(f.size - b.size), b], f

    return best_delay(task, fit, range(MAX_DELAY + 1))
