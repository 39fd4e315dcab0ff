"""The estimators that are compared: one of each kind."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

import ctrl_realize as cr


@dataclass(frozen=True)
class Estimate:
    """Delay in samples and, where the method has one, its 95 % interval."""

    delay: float
    low: float = float("nan")
    high: float = float("nan")


Method = Callable[[cr.Record, int], Estimate]


def output_error(record: cr.Record, order: int) -> Estimate:
    """fit_output_error as it comes: the structure is chosen from the data."""
    fit = cr.fit_output_error(record).fit
    return Estimate(fit.delay, *fit.delay_interval)


def structure_given(record: cr.Record, order: int) -> Estimate:
    """fit_output_error with the structure of the plant."""
    fit = cr.fit_output_error(record, structures=[(order, order)]).fit
    return Estimate(fit.delay, *fit.delay_interval)


def scan(record: cr.Record, order: int) -> Estimate:
    """Realization scan, zero-phase filter, order chosen from the noise."""
    fit = cr.identify(record, method="scan").fit
    return Estimate(fit.dead_time / record.dt)


def paper(record: cr.Record, order: int) -> Estimate:
    """Realization scan with the paper's settings; its causal filter included."""
    return Estimate(cr.identify(record, method="paper").fit.dead_time / record.dt)


def first_motion(record: cr.Record, order: int) -> Estimate:
    """Threshold: first sample beyond five standard deviations of the noise."""
    step = cr.unit_step(record)
    level = 5 * float(np.std(step.pre_step)) if step.pre_step.size > 20 else 0.02
    beyond = np.flatnonzero(np.abs(step.output) > level)
    return Estimate(float(beyond[0]) if beyond.size else float("nan"))


def areas(record: cr.Record, order: int) -> Estimate:
    """First-order plus dead time from the areas under the step response."""
    step = cr.unit_step(record)
    final = float(np.median(step.output[-max(step.n_samples // 10, 3) :]))
    shape = step.output / final
    total = float(np.sum(1 - shape))  # dead time plus lag, in samples
    early = float(np.sum(shape[: max(round(total), 1)]))
    lag = np.e * early
    return Estimate(max(total - lag, 0.0))


METHODS: dict[str, Method] = {
    "output error": output_error,
    "output error, structure given": structure_given,
    "realization scan": scan,
    "paper's settings": paper,
    "first motion (5 sigma)": first_motion,
    "areas, first order": areas,
}


def run(name: str, record: cr.Record, order: int) -> Estimate:
    """Apply a method; what it cannot do counts as no estimate."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", cr.CtrlRealizeWarning)
        try:
            return METHODS[name](record, order)
        except cr.CtrlRealizeError:
            return Estimate(float("nan"))
