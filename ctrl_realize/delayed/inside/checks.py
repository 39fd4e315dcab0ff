"""Checks of cores and delays, and errors for matrices that do not exist."""

from __future__ import annotations

import sys
from typing import Any

import control as ct

from ...errors import DelayRangeError, UnsuitableSystemError
from ..deferred import DeferredMatrices
from ..operands import whole_samples
from ..parts import MAX_DELAY, check_entries


def who_asks() -> str:
    """Name the function of python-control that was called and needs the matrices."""
    frame, name = sys._getframe(1), ""
    while frame is not None:
        if frame.f_globals.get("__name__", "").startswith("control."):
            name = frame.f_code.co_name
        frame = frame.f_back  # type: ignore[assignment]
    return f"{name} of python-control" if name else "this"


def check_core(core: Any) -> float:
    """Return the time base of a core, 0.0 for continuous time.

    Raises
    ------
    UnsuitableSystemError
    """
    if not isinstance(core, ct.StateSpace):
        raise UnsuitableSystemError(
            f"core is a {type(core).__name__}; expected a control.StateSpace (ct.ss converts)"
        )
    if isinstance(core, DeferredMatrices):
        raise UnsuitableSystemError(
            f"core is a {type(core).__name__}, which already has delays; expected a plain "
            "control.StateSpace"
        )
    if core.dt is None or core.dt is True:
        raise UnsuitableSystemError(
            f"the core's dt is {core.dt!r}; expected a sample time in s, or 0 for continuous time"
        )
    check_entries(core)
    return float(core.dt)


def check_delays(delays: tuple[float, ...], core: ct.StateSpace, dt: float) -> None:
    """Check delays: not negative, whole samples, and no more than the core has signals.

    Raises
    ------
    UnsuitableSystemError, DelayRangeError
    """
    if len(delays) > min(core.ninputs, core.noutputs):
        raise UnsuitableSystemError(
            f"{len(delays)} delays need as many inputs and outputs of the core, which has "
            f"{core.ninputs} inputs and {core.noutputs} outputs"
        )
    if any(delay < 0 for delay in delays):
        raise DelayRangeError(f"internal_delays={delays}; expected delays >= 0")
    if dt:
        whole_samples(delays, dt)
        if sum(delays) > MAX_DELAY:
            raise DelayRangeError(
                f"the delays are {delays} samples; at most {MAX_DELAY} are allowed. Use a longer "
                "sample time"
            )
