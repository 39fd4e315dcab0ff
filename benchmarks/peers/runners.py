"""One function for each way; `GIVEN` says what it was told beforehand."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import control as ct
import numpy as np
from scipy.optimize import curve_fit
from scipy.signal import lfilter

import ctrl_realize as cr

from .answers import Answer, of_matrices, of_polynomials, of_step
from .regularised import from_regularised
from .srivc import from_srivc
from .starts import STARTS, from_many_starts
from .tasks import ORDER, Task

RUNNERS: dict[str, Callable[[Task], Answer]] = {}
GIVEN: dict[str, str] = {}
PACKAGE: dict[str, str] = {}

WORTH_A_WORD = 0.5
"""Per cent of a response by which another fit is better, from which on it is told."""

BLOCKS = 500
"""Block rows and columns of a Hankel matrix of pulses: twice as many pulses are used at most."""


def runner(name: str, package: str, given: str) -> Callable[..., Callable[[Task], Answer]]:
    def register(function: Callable[[Task], Answer]) -> Callable[[Task], Answer]:
        RUNNERS[name], GIVEN[name], PACKAGE[name] = function, given, package
        return function

    return register


def of_system(delay: float, system: Any, task: Task) -> Answer:
    """Make an answer of one of our own models, which know the record's units."""
    return Answer(
        delay,
        lambda hz: task.gain * system(np.exp(2j * np.pi * hz * task.dt)),
        lambda u: task.gain * np.asarray(system.simulate(u)),
        reasons(system.fit),
    )


def reasons(fit: Any) -> tuple[str, ...]:
    """List what a fit reports of how closely its model follows the record."""
    if isinstance(fit, cr.identification.StateSpaceFit):
        return (f"{fit.fit_percent[0]:.1f} % with the initial state that was estimated along",)
    if not isinstance(fit, cr.identification.OutputErrorFit):
        return ()
    followed = fit.estimate.followed
    words = []
    if followed.complete - followed.simulated > WORTH_A_WORD:
        words.append(f"{followed.complete:.1f} % with the drift or free response at the start")
    if followed.by_closest - followed.complete > WORTH_A_WORD:
        order, degree = followed.closest.order, followed.closest.relative_degree
        words.append(f"order {order}, relative degree {degree}: {followed.by_closest:.1f} %")
    if fit.estimate.residual.noise_lags:
        words.append("the residual is coloured, and slow errors weigh less")
    words.append("residual at noise level" if fit.at_noise_level else "no structure is adequate")
    return tuple(words)


@runner("ctrl_realize: identify", "ctrl-realize", "nothing")
def ours(task: Task) -> Answer:
    system = cr.identify(task.record)
    return of_system(system.fit.delay, system, task)


@runner("ctrl_realize: identify, order 3, degree 3", "ctrl-realize", "order, relative degree")
def ours_given(task: Task) -> Answer:
    system = cr.identify(task.record, structures=[(3, 3)])
    return of_system(system.fit.delay, system, task)


@runner("ctrl_realize: scan", "ctrl-realize", "order")
def ours_scan(task: Task) -> Answer:
    system = cr.identify(task.record, method="scan", order=ORDER, max_delay=task.max_delay)
    return of_system(system.delay, system, task)


@runner("ctrl_realize: paper", "ctrl-realize", "order (the paper's settings)")
def ours_paper(task: Task) -> Answer:
    system = cr.identify(task.record, method="paper")
    return of_system(system.delay, system, task)


def pulses(task: Task) -> np.ndarray:
    """Backward difference of the step response, from the step on: what realizations take."""
    return np.diff(task.y[task.edge :], prepend=0.0)[: 2 * BLOCKS]


def era(g: np.ndarray, task: Task, shift: int) -> Answer:
    blocks = min(BLOCKS, (g.size - 1) // 2)
    system, _ = ct.eigensys_realization(g[None, None, :], ORDER, m=blocks, n=blocks, dt=True)
    return of_matrices(system.A, system.B, system.C, system.D, task.dt, shift)


@runner("python-control: ERA", "control", "order")
def control_era(task: Task) -> Answer:
    return era(pulses(task), task, 0)


@runner("python-control: ERA, delay given", "control", "order, delay")
def control_era_delay(task: Task) -> Answer:
    return era(pulses(task)[task.known :], task, task.known)


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
    return of_matrices(A, B, C, np.zeros((1, 1)) if D is None else D, task.dt)


def rise(task: Task) -> tuple[np.ndarray, float]:
    """Time from the step on, and when 63 % of the way is done: what a lag is guessed from."""
    t = task.dt * (np.arange(task.y.size) - task.edge)
    return t, float(t[np.argmax((task.y > 0.63) & (t > 0))])


@runner("SciPy: curve_fit, first order and dead time", "scipy", "order 1")
def scipy_first_order(task: Task) -> Answer:
    t, until = rise(task)

    def model(t: np.ndarray, gain: float, tau: float, lag: float) -> np.ndarray:
        return gain * -np.expm1(-np.clip(t - tau, 0, None) / lag)

    bounds = ([-10.0, 0.0, 1e-3 * until], [10.0, until, 1e3 * until])
    (gain, tau, lag), _ = curve_fit(
        model, t, task.y, p0=(1.0, 0.3 * until, 0.7 * until), bounds=bounds
    )
    return of_step(
        tau / task.dt,
        lambda t: model(t, gain, tau, lag),
        lambda s: gain * np.exp(-s * tau) / (1 + lag * s),
        task.dt,
    )


@runner("SciPy: curve_fit, second order and dead time", "scipy", "order 2")
def scipy_second_order(task: Task) -> Answer:
    t, until = rise(task)

    def model(t: np.ndarray, gain: float, tau: float, a: float, ratio: float) -> np.ndarray:
        after, b = np.clip(t - tau, 0, None), ratio * a
        return gain * (1 - (a * np.exp(-after / a) - b * np.exp(-after / b)) / (a - b))

    # The second lag is the shorter one, so that the two do not change places.
    bounds = ([-10.0, 0.0, 1e-3 * until, 1e-3], [10.0, until, 1e3 * until, 0.999])
    (gain, tau, a, ratio), _ = curve_fit(
        model, t, task.y, p0=(1.0, 0.3 * until, 0.5 * until, 0.3), bounds=bounds
    )
    return of_step(
        tau / task.dt,
        lambda t: model(t, gain, tau, a, ratio),
        lambda s: gain * np.exp(-s * tau) / ((1 + a * s) * (1 + ratio * a * s)),
        task.dt,
    )


@runner(f"SciPy: least_squares from {STARTS} starts", "scipy", "order of `identify`, any zeros")
def scipy_many_starts(task: Task) -> Answer:
    return from_many_starts(task, cr.identify(task.record).fit.order)


@runner("SRIVC (a prototype of ours), order 3", "scipy", "order")
def srivc(task: Task) -> Answer:
    return from_srivc(task)


@runner("regularised FIR (TC, of ours), dead time by likelihood", "scipy", "nothing")
def regularised_fir(task: Task) -> Answer:
    return from_regularised(task)


def best_delay(
    task: Task, fit: Callable[[int], tuple[np.ndarray, np.ndarray]], delays: Iterable[int]
) -> Answer:
    """Take the delay whose model simulates the record best: what one does around such a tool."""
    best: tuple[float, int, np.ndarray, np.ndarray] | None = None
    for d in delays:
        try:
            b, f = fit(d)
            with np.errstate(all="ignore"):
                error = float(np.sum((task.y - lfilter(b, f, task.u)) ** 2))
        except TimeoutError:
            raise
        except Exception:  # a peer's own failure at one delay leaves the others
            continue
        if np.isfinite(error) and (best is None or error < best[0]):
            best = (error, d, b, f)
    if best is None:
        raise RuntimeError("no delay gave a model")
    return of_polynomials(best[1], best[2], best[3], task.dt)


@runner("pysib: OE(3, 3) for 26 delays", "pysib", "order, delay roughly")
def pysib_oe(task: Task) -> Answer:
    import pysib

    def fit(d: int) -> tuple[np.ndarray, np.ndarray]:
        _, model = pysib.oe(task.u, task.y, ORDER, ORDER, d + 1)
        return np.ravel(model["B"]), np.ravel(model["F"])

    return best_delay(task, fit, task.rough)


@runner("pysib: ARX(3, 3) for each delay", "pysib", "order")
def pysib_arx(task: Task) -> Answer:
    import pysib

    def fit(d: int) -> tuple[np.ndarray, np.ndarray]:
        _, model = pysib.arx(task.u, task.y, ORDER, ORDER, d + 1)
        return np.ravel(model["B"]), np.ravel(model["A"])

    return best_delay(task, fit, range(task.max_delay + 1))


@runner("llsi: OE(3, 3), delay given", "llsi", "order, delay")
def llsi_oe(task: Task) -> Answer:
    import llsi

    model = llsi.oe(llsi.iddata(task.y, task.u, task.dt), [ORDER, ORDER, task.known + 1])
    b, a = np.ravel(model.b), np.ravel(model.a)
    lead = int(getattr(model, "nk", 0))
    return of_polynomials(None, np.r_[np.zeros(lead), b], a, task.dt)


@runner("nfoursid: N4SID, order 3", "nfoursid", "order")
def nfoursid_n4sid(task: Task) -> Answer:
    import pandas as pd
    from nfoursid.nfoursid import NFourSID

    frame = pd.DataFrame({"u": task.u, "y": task.y})
    rows = min(50, task.u.size // 8)
    method = NFourSID(frame, output_columns=["y"], input_columns=["u"], num_block_rows=rows)
    method.subspace_identification()
    model, _ = method.system_identification(rank=ORDER)
    return of_matrices(model.a, model.b, model.c, model.d, task.dt)


@runner("SIPPY: N4SID, order 3", "sippy-unipi", "order")
def sippy_n4sid(task: Task) -> Answer:
    from sippy_unipi import system_identification

    rows = min(50, task.u.size // 8)
    model = system_identification(
        task.y, task.u, "N4SID", SS_fixed_order=ORDER, SS_f=rows, SS_p=rows, tsample=task.dt
    )
    return of_matrices(model.A, model.B, model.C, model.D, task.dt)


@runner("SIPPY: ARX(3, 3) for each delay", "sippy-unipi", "order")
def sippy_arx(task: Task) -> Answer:
    from sippy_unipi import system_identification

    def fit(d: int) -> tuple[np.ndarray, np.ndarray]:
        model = system_identification(
            task.y, task.u, "ARX", ARX_orders=[ORDER, ORDER, d], tsample=task.dt
        )
        b, f = np.ravel(model.G.num[0][0]), np.ravel(model.G.den[0][0])
        return np.r_[np.zeros(f.size - b.size), b], f

    return best_delay(task, fit, range(task.max_delay + 1))


@runner("SIPPY: ARX(3, 3), delay by AIC", "sippy-unipi", "order")
def sippy_aic(task: Task) -> Answer:
    from sippy_unipi import system_identification

    orders, delays = [ORDER, ORDER], [0, task.max_delay]
    model = system_identification(
        task.y, task.u, "ARX", IC="AIC", na_ord=orders, nb_ord=orders, delays=delays,
        tsample=task.dt,
    )  # fmt: skip
    b, f = np.ravel(model.G.num[0][0]), np.ravel(model.G.den[0][0])
    return of_polynomials(model.theta, np.r_[np.zeros(f.size - b.size), b], f, task.dt)
