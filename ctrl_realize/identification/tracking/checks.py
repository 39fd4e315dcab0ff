"""Checks of the model, the options and the samples of a delay tracker."""

from __future__ import annotations

from dataclasses import replace

import control as ct
import numpy as np

from ..._checks import integer, positive
from ...data import Record
from ...data.given import check_complete
from ...delayed import DelayedStateSpace
from ...delayed.parts import check_entries
from ...errors import DataError, DelayRangeError, OptionError, UnsuitableSystemError
from ...numerics.constants import LARGEST
from ..output_error.result import OutputErrorFit
from ..output_error.summary import fitted_model

LONGEST = 1e12
"""Upper limit of the forgetting time in samples; beyond it, single samples are lost in rounding."""


def check_candidates(min_delay: int, max_delay: int) -> tuple[int, int]:
    """Return the first and the last candidate delay."""
    low, high = integer(min_delay, "min_delay", 0), integer(max_delay, "max_delay", 0)
    if high <= low:
        raise DelayRangeError(f"delays {low}...{high} leave only one candidate")
    return low, high


def check_forgetting_time(forgetting_time: float, dt: float, max_delay: int) -> float:
    """Return the forgetting time in samples; the largest candidate must be well below it."""
    span = positive(forgetting_time, "forgetting_time", "time in s") / dt
    if span > LONGEST:
        raise OptionError(
            f"forgetting_time={forgetting_time:g} s is {span:.4g} samples; expected at most "
            f"{LONGEST:g}"
        )
    if span <= max_delay:
        raise DelayRangeError(
            f"forgetting_time={forgetting_time:g} s is {span:.4g} samples, and delays up to "
            f"{max_delay} samples are to be seen; expected a longer forgetting_time"
        )
    return span


def model_noise(model: ct.StateSpace, given: float | None) -> float:
    """Return the residual level of a model: as given, as its `fit` has it, or 0 if unknown."""
    if given is not None:
        return positive(given, "noise_std", "standard deviation of the output's noise")
    if not isinstance(model, DelayedStateSpace) or model.fit is None:
        return 0.0
    found = model.fit.residual_std
    return found if found is not None and np.isfinite(found) else 0.0


def starting_core(model: ct.StateSpace) -> ct.StateSpace:
    """Return a model without its delay, if it can be simulated.

    The core of a model whose dead time is no whole number of samples is early by part of a sample,
    and the delays that are tracked would be late by that.
    """
    core = model.delay_free if isinstance(model, DelayedStateSpace) else model
    if isinstance(model, DelayedStateSpace) and isinstance(model.fit, OutputErrorFit):
        without = replace(model.fit, estimate=replace(model.fit.estimate, dead_time=0.0))
        core = fitted_model(without).delay_free
    if not isinstance(core, ct.StateSpace) or not core.issiso():
        raise UnsuitableSystemError("the initial model must have one input and one output")
    if not core.isdtime(strict=True) or core.dt is True:
        raise UnsuitableSystemError("the initial model must be discrete, with a sample time")
    check_entries(core)
    worst = np.abs(core.poles()).max(initial=0.0)
    if worst > 1 + 1e-9:
        raise UnsuitableSystemError(
            f"the initial model is unstable (a pole at |z| = {worst:.6g}); expected a stable "
            "one, whose output can be simulated"
        )
    if not np.any(core.C) and not np.any(core.D):
        raise OptionError("the initial model is zero")
    return core


def check_sample(u: float, y: float, count: int) -> tuple[float, float]:
    """Return input and output of sample `count`; they must be plausible finite numbers."""
    try:
        if np.ndim(u) or np.ndim(y):
            raise TypeError
        u, y = float(u), float(y)
    except (TypeError, ValueError):
        raise DataError(
            f"sample {count} is u={u!r}, y={y!r}; expected one number each (for a whole record "
            "see track)"
        ) from None
    if not (np.isfinite(u) and np.isfinite(y)):
        raise DataError(f"sample {count} is u={u}, y={y}; expected finite numbers")
    if max(abs(u), abs(y)) > LARGEST:
        raise DataError(
            f"sample {count} is u={u:g}, y={y:g}; beyond {LARGEST:g}, where squares overflow, is "
            "not a plausible measurement"
        )
    return u, y


def check_record(record: Record, dt: float) -> None:
    """Refuse a record that does not suit a tracker with sample time `dt`."""
    check_complete(record, "DelayTracker.track")
    if not record.issiso():
        raise DataError(f"{record!r} has several channels; expected one input and one output")
    if not np.isclose(record.dt, dt, rtol=1e-3, atol=0):
        raise DataError(f"the record has the sample time {record.dt:g} s, the model {dt:g} s")
