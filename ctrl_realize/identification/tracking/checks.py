"""What a delay tracker can start from."""

from __future__ import annotations

import control as ct
import numpy as np

from ..._checks import positive, whole
from ...delayed import DelayedStateSpace
from ...delayed.parts import check_entries
from ...errors import DelayRangeError, OptionError, UnsuitableSystemError

LONGEST = 1e12
"""Samples of memory; beyond, the weights of single samples are lost in rounding."""


def check_candidates(min_delay: int, max_delay: int) -> tuple[int, int]:
    """Return the first and the last candidate."""
    low, high = whole(min_delay, "min_delay", 0), whole(max_delay, "max_delay", 0)
    if high <= low:
        raise DelayRangeError(f"delays {low}...{high} leave only one candidate")
    return low, high


def check_forgetting_time(forgetting_time: float, dt: float, max_delay: int) -> float:
    """Return the memory in samples; the largest candidate must lie well within it."""
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
    """Return the noise that a model leaves: as given, as its `fit` has it, or 0 where unknown."""
    if given is not None:
        return positive(given, "noise_std", "standard deviation of the output's noise")
    if not isinstance(model, DelayedStateSpace) or model.fit is None:
        return 0.0
    found = model.fit.residual_std
    return found if found is not None and np.isfinite(found) else 0.0


def check_start(core: ct.StateSpace) -> None:
    """Refuse a model that cannot be followed by simulation."""
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
