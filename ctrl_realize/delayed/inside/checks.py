"""Checks of cores and delays, and errors for matrices that do not exist."""

from __future__ import annotations

import sys
from typing import Any

import control as ct

from ..._checks import check_type
from ..._facts import facts
from ...errors import DelayRangeError, UnsuitableSystemError
from ..deferred import DeferredMatrices
from ..parts import MAX_DELAY, check_entries

_INSTEAD = facts("delayed/advice.toml")["instead"]
"""What to call instead, by the function of python-control that was called."""


def not_rational(what: str) -> UnsuitableSystemError:
    """Make the error for a function of python-control that needs what a dead time does not have."""
    frame, name = sys._getframe(1), ""
    while frame is not None:
        if frame.f_globals.get("__name__", "").startswith("control."):
            name = frame.f_code.co_name
        frame = frame.f_back  # type: ignore[assignment]
    asks = f"{name} of python-control" if name else "this"
    return UnsuitableSystemError(
        f"{asks} needs {what}, which do not exist for a dead time in continuous time. "
        f"{_INSTEAD.get(name, _INSTEAD['others'])}"
    )


def check_core(core: Any, delays: tuple[float, ...] = ()) -> float | None:
    """Return the time base of a core, 0.0 for continuous time.

    A gain without delays may have none, as in python-control, and then adopts that of others.

    Raises
    ------
    UnsuitableSystemError
    """
    expected = "a control.StateSpace (ct.ss converts)"
    check_type(core, ct.StateSpace, "core", expected, UnsuitableSystemError)
    if isinstance(core, DeferredMatrices):
        raise UnsuitableSystemError(
            f"core is a {type(core).__name__}, which already has delays; expected a plain "
            "control.StateSpace"
        )
    gain = core.dt is None and core.nstates == 0 and not delays
    if core.dt is True or (core.dt is None and not gain):
        raise UnsuitableSystemError(
            f"the core's dt is {core.dt!r}; expected a sample time in s, or 0 for continuous time"
        )
    check_entries(core)
    return None if gain else float(core.dt)


def check_delays(delays: tuple[float, ...], core: ct.StateSpace, dt: float | None) -> None:
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
        for delay in delays:
            if delay != int(delay):
                raise DelayRangeError(
                    f"a delay is {delay:g} samples of {dt:g} s; a discrete system needs whole "
                    "samples. Define the system in continuous time and sample it: "
                    "sys.to_discrete(dt)"
                )
        if sum(delays) > MAX_DELAY:
            raise DelayRangeError(
                f"the delays are {delays} samples; at most {MAX_DELAY} are allowed. Use a longer "
                "sample time"
            )
