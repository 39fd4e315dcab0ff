"""Plants, noises and tests whose achieved errors are counted."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
from scipy.signal import lfilter

import ctrl_realize as cr
from ctrl_realize.experiment.result import ExperimentPlan
from ctrl_realize.identification.bound import Bound
from ctrl_realize.numerics.engine.plausible_models import PlausibleModel

Way = Literal["given", "chosen"]
"""How a record is identified: with the structure given, or with nothing given."""

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
    **{Case(plant, 0.9, True, "given"): 200 for plant in PLANTS},
    **{Case(plant, 0.0, False, "given"): 100 for plant in PLANTS},
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
    return plan.record(Bound(plan.model, plan.dt).response(plan.chosen.input) + noise)


def dead_time(case: Case, record: cr.Record) -> float:
    """Estimate of one record by `identify`; NaN if the record is refused."""
    order = PLANTS[case.plant].poles.size
    given = "P0DI" if case.plant == "integrating" else [(order, order)]
    try:
        return cr.identify(record, structures=given if case.way == "given" else None).fit.dead_time
    except cr.CtrlRealizeError:
        return float("nan")
