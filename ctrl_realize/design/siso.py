"""Checks of the systems and dead times that design functions take."""

from __future__ import annotations

from typing import Any

import control as ct
import numpy as np

from .._checks import band
from ..data.shown_units import unit_among
from ..delayed import DelayedStateSpace, DelaySystem
from ..delayed.operands import Linear, check_proper, in_state_space
from ..delayed.parts import check_entries, check_single
from ..errors import OptionError, UnsuitableSystemError

FEW_STATES = 200
"""Number of states up to which internal delays are converted to states."""


def delayed_system(system: Any, purpose: str, *, siso: bool = True) -> DelayedStateSpace:
    """Return a discrete system as a `DelayedStateSpace`.

    Raises
    ------
    UnsuitableSystemError
        Not a linear system, a continuous one, or several channels if one is needed.
    """
    if not isinstance(system, Linear):
        advice = "; its system(dt) is one" if callable(getattr(system, "system", None)) else ""
        raise UnsuitableSystemError(
            f"{purpose} needs a linear system, a StateSpace or TransferFunction; got a "
            f"{type(system).__name__}{advice}"
        )
    if siso:
        check_single(system, purpose)
    if isinstance(system, DelayedStateSpace):
        return system
    if isinstance(system, DelaySystem) and (not system.dt or system.nstates > FEW_STATES):
        raise UnsuitableSystemError(
            f"{purpose} needs a discrete system with its delays at inputs and outputs; "
            f"{system.name!r} has {'internal delays' if system.dt else 'continuous time'}"
            + ("" if system.dt else ": sample it with sys.to_discrete(dt)")
        )
    if system.dt is None or system.dt is True or not system.dt > 0:
        raise UnsuitableSystemError(
            f"{purpose} needs a discrete system with a sample time; {system.name!r} has "
            f"dt={system.dt!r}. Sample it with design.to_discrete(system, dead_time, dt)"
        )
    names = {"name": system.name, "time_unit": unit_among(system)}
    return DelayedStateSpace(proper_ss(system, purpose), 0, **names)


def with_dead_time(system: Any, purpose: str, dt: float | None = None) -> Any:
    """Return one input and output as a system with delays, of which it may have none.

    A number, and a gain without a time base, have the time base `dt`.

    Raises
    ------
    UnsuitableSystemError
        Not a linear system, not a proper one, or several channels.
    """
    if isinstance(system, (int, float, np.number)):
        system = ct.StateSpace([], [], [], [[float(system)]], dt)
    if not isinstance(system, (DelayedStateSpace, DelaySystem)):
        plain = proper_ss(system, purpose)
        core = plain if dt is None else ct.StateSpace(plain, dt=dt)
        system = DelaySystem(core, name=plain.name)
    check_single(system, purpose)
    return system


def is_continuous(system: Any) -> bool:
    """Whether a linear system is one in continuous time."""
    return isinstance(system, Linear) and system.dt is not None and not system.dt


def core_and_dead_time(system: Any, purpose: str) -> tuple[ct.StateSpace, float]:
    """Split a continuous plant of one input and output into its core and its dead time in s.

    Raises
    ------
    UnsuitableSystemError
        Several channels, or a dead time in a loop or one of several paths.
    """
    check_single(system, purpose)
    if not isinstance(system, DelaySystem):
        return proper_ss(system, purpose), 0.0
    rest, dead_time = system.delay_apart()
    if rest.internal_delays:
        raise UnsuitableSystemError(
            f"{system.name!r} has internal delays {system.internal_delays} s; {purpose} needs a "
            "plant with its dead time at the input or output. Approximate the others: "
            "sys.pade(order)"
        )
    return rest.core, dead_time


def proper_ss(system: Any, purpose: str) -> ct.StateSpace:
    """Convert to state space; an improper transfer function is refused with advice."""
    if isinstance(system, ct.StateSpace):
        check_entries(system)
        return system
    if isinstance(system, ct.TransferFunction):
        check_entries(system)
        check_proper(system, purpose)
        return in_state_space(system)
    raise UnsuitableSystemError(f"{purpose} needs a linear system; got a {type(system).__name__}")


def same_rate(controller: Any, dt: float, purpose: str) -> ct.StateSpace:
    """Return a discrete single-channel controller with sample time `dt` in state space."""
    if isinstance(controller, (int, float)):
        check_entries(controller)
        return ct.ss([], [], [], float(controller), dt)
    system = proper_ss(controller, purpose)
    check_single(system, f"a controller for {purpose}")
    if system.dt is None:
        return ct.StateSpace(system, dt) if system.nstates else ct.ss([], [], [], system.D, dt)
    if system.dt is True or not np.isclose(system.dt, dt, rtol=1e-6, atol=0.0):
        kind = "continuous" if system.dt == 0 else f"sampled with dt={system.dt!r}"
        raise UnsuitableSystemError(
            f"the controller {system.name!r} is {kind}, the plant has dt={dt:g} s; expected "
            "the same sample time (a PID has .discretised(dt))"
        )
    return system


def interval_of_dead_time(
    system: ct.StateSpace, given: tuple[float, float] | None
) -> tuple[float, float] | None:
    """Return the given interval, or that of the identification; None without both.

    Raises
    ------
    OptionError
        Not an interval of dead times.
    """
    fit = getattr(system, "fit", None)
    fitted = None if fit is None else fit.dead_time_interval
    interval = fitted if given is None else given
    if interval is None:
        return None
    low, high = band(interval, "dead_time_interval", "dead times in s")
    if not 0 <= low <= high:
        raise OptionError(f"dead_time_interval=({low:g}, {high:g}); expected 0 <= low <= high in s")
    return low, high
