"""Plants, noises and tests whose achieved errors are counted."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
from scipy.linalg import toeplitz
from scipy.signal import lfilter

import ctrl_realize as cr
from ctrl_realize.experiment.result import ExperimentPlan
from ctrl_realize.identification.bound import Bound
from ctrl_realize.numerics.arrays import FloatArray
from ctrl_realize.numerics.engine.plausible_models import PlausibleModel
from ctrl_realize.numerics.engine.problem import KnownFactor, Structure
from ctrl_realize.numerics.output_error.any_input.data import cut
from ctrl_realize.numerics.output_error.any_input.stretch import fit_stretch
from ctrl_realize.numerics.output_error.other_structures import Requested

Way = Literal["given", "filtered", "chosen"]
"""How a record is identified: with the structure given, the same after a filter that makes the
noise white, or with nothing given."""

DEAD_TIME, TIME, RATE, NOISE = 3.03, 120.0, 2.0, 0.02


def _plant(gain: float, lags: list[float], *, integrates: bool = False) -> PlausibleModel:
    poles = np.array([-1 / lag for lag in lags] + [0.0] * integrates, dtype=np.complex128)
    return PlausibleModel(DEAD_TIME, poles, np.array([gain / np.prod(lags)]))


PLANTS: dict[str, PlausibleModel] = {
    "first order": _plant(2.0, [10.0]),
    "second order": _plant(2.0, [10.0, 3.0]),
    "third order": _plant(2.0, [10.0, 3.0, 1.5]),
    "integrating": _plant(0.2, [], integrates=True),
}
"""Models, dead time 3.03 s."""


class Case(NamedTuple):
    """Plant, pole of the noise, planned test (`best`) or the simplest one, fit, noise."""

    plant: str
    pole: float
    best: bool
    way: Way
    noise: float = NOISE


CASES: dict[Case, int] = {
    **{Case(plant, 0.0, True, "given"): 200 for plant in PLANTS},
    Case("third order", 0.0, True, "given", NOISE / 4): 200,
    **{Case(plant, 0.9, True, "filtered"): 200 for plant in PLANTS},
    **{Case(plant, 0.0, False, "given"): 100 for plant in PLANTS},
    **{Case(plant, 0.9, True, "given"): 100 for plant in PLANTS},
    **{Case(plant, pole, True, "chosen"): 20 for plant in PLANTS for pole in (0.0, 0.9)},
}
"""And how many seeds each has at most: time."""


def planned(case: Case) -> ExperimentPlan:
    """Plan of a case."""
    plan = cr.experiment.plan(
        PLANTS[case.plant],
        time=TIME,
        amplitude=1.0,
        rate=RATE,
        noise=case.noise,
        noise_pole=case.pole,
    )
    return plan if case.best else plan.using(plan.step.kind)


def simulated(case: Case, plan: ExperimentPlan, seed: int) -> cr.Record:
    """Record of a test, simulated."""
    driving = np.random.default_rng(seed).standard_normal(plan.time.size + 500)
    whitening = [1.0, *-plan.noise.coefficients]
    noise = plan.noise.std * lfilter([1.0], whitening, driving)[500:]
    output = Bound(plan.model, plan.dt).response(plan.chosen.input) + noise
    if case.way != "filtered":
        return plan.record(output)
    clean = [lfilter(whitening, [1.0], x)[1:] for x in (plan.command, output)]
    return cr.Record(plan.time[1:], *clean)


def dead_time(case: Case, record: cr.Record) -> float:
    """Estimate of one record; NaN if the record is refused.

    Of any input with lags it is that of `identify(record, structures=...)` without the interval,
    which takes ten times as long.
    """
    order = PLANTS[case.plant].poles.size
    if case.way == "chosen" or case.plant == "integrating" or not case.best:
        given: str | list[tuple[int, int]] = "P0DI"
        if case.plant != "integrating":
            given = [(order, order)]
        try:
            fit = cr.identify(record, structures=None if case.way == "chosen" else given).fit
        except cr.CtrlRealizeError:
            return float("nan")
        return fit.dead_time
    structures = (Structure(order, order),)
    data = cut([np.ravel(record.output)], [np.ravel(record.input)], 1 / RATE, 1, KnownFactor())
    part = fit_stretch(data, structures, Requested(structures, whiten=False))
    return part.fit.best.dead_time


def of_least_squares(plan: ExperimentPlan) -> float:
    """Standard error of the dead time by plain least squares, which does not know the colour."""
    bound = Bound(plan.model, plan.dt)
    slopes, own = bound.slopes(plan.chosen.input)
    inverse = np.linalg.pinv(np.concatenate([slopes, own], axis=1))[0]
    pulse = np.r_[1.0, np.zeros(plan.time.size - 1)]
    pole = float(np.sum(plan.noise.coefficients))  # AR(1), or white
    answer: FloatArray = lfilter([1.0], [1.0, -pole], pulse)
    covariance = toeplitz(answer) / (1 - pole**2)
    return float(plan.noise.std * np.sqrt(inverse @ covariance @ inverse))
