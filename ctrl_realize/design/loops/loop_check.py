"""Check of the closed loop before a design function returns a controller.

The loop is closed with the model itself, not with a reduced one, and over the interval of dead
times from the identification.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..._wording import in_time, interval_in_time
from ...delayed import DelayedStateSpace
from ...errors import ModelWarning, UnsuitableSystemError, warn_caller
from ...numerics.arrays import ComplexArray
from ...results import Flag, Result
from ..siso import interval_of_dead_time
from .delay_robustness import over_interval
from .delay_robustness_result import DelayRobustness
from .loop import open_loop
from .margin_result import Margins
from .margins import loop_margins

TRIED = 2
"""Delays of the interval whose margins are computed: its ends. Stability between them follows from
the crossovers, see `DelayRobustness`."""


@dataclass(frozen=True, eq=False, repr=False)
class LoopCheck(Result):
    """Check of the closed loop with the design model.

    ``stable`` is ``margins.stable``; `robustness`, if there is an interval of dead times, has the
    nominal delay and the ends of the interval among its `delays`.

    Attributes
    ----------
    margins : Margins
        Of the controller with the design model, with exact dead time.
    robustness : DelayRobustness or None
        Over ``system.fit.dead_time_interval``; None if the system has no interval.
    flags : tuple of Flag
        ``"unstable_within_interval"`` if some dead time within the interval makes the loop
        unstable.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> plant = cr.design.ProcessModel(gain=1.0, lag=0.08, dead_time=0.029).system(0.001)
    >>> check = cr.design.pid(plant).check
    >>> check.stable, round(check.margins.ms, 2), check.robustness
    (True, 1.59, None)
    """

    margins: Margins
    robustness: DelayRobustness | None = None
    flags: tuple[Flag, ...] = ()

    @property
    def stable(self) -> bool:
        """The loop with the model itself is stable."""
        return self.margins.stable

    @property
    def stable_within_interval(self) -> bool | None:
        """Stable for all dead times of the interval; None if there is no interval."""
        return None if self.robustness is None else self.robustness.stable

    def rows(self) -> list[tuple[str, str]]:
        """List the results, for the report of a controller."""
        found = self.margins
        if not found.stable:
            return [("on the design model", "UNSTABLE")]
        rows = [
            (
                "on the design model",
                f"stable, Ms {found.ms:.3g}, phase margin {found.phase_margin:.3g} deg, "
                f"delay margin {in_time(found.delay_margin, 3)}",
            )
        ]
        if self.robustness is not None:
            word = "stable" if self.robustness.stable else "UNSTABLE somewhere"
            interval = interval_in_time(*self.robustness.dead_time_interval)
            rows.append(("over the interval", f"{word}, dead time {interval}"))
        return rows

    def _title(self) -> str:
        return "Closed loop on the design model"

    def _rows(self) -> list[tuple[str, str]]:
        return self.rows()

    def __repr__(self) -> str:
        word = "stable" if self.stable else "unstable"
        inside = ""
        if self.robustness is not None:
            inside = (
                f", {'stable' if self.robustness.stable else 'unstable'} over the dead-time "
                "interval"
            )
        return f"<LoopCheck {word} on the design model{inside}>"


def loop_check(plant: Any, controller: Any, dead_time: float = 0.0) -> LoopCheck:
    """Check the closed loop with the model, and over its interval of dead times if it has one.

    Parameters
    ----------
    plant : DelayedStateSpace, or a continuous system
    controller : system of the same time base
    dead_time : float, optional
        In s, of a continuous plant.
    """
    loop = open_loop(plant, controller, dead_time)
    found = loop_margins(loop)
    interval = interval_of_dead_time(plant, None) if isinstance(plant, DelayedStateSpace) else None
    if interval is None or not found.stable:
        return LoopCheck(found)
    robust = over_interval(plant, loop, found, interval, TRIED)
    flags = () if robust.stable else (_unstable_inside(robust),)
    return LoopCheck(found, robust, flags=flags)


def _unstable_inside(found: DelayRobustness) -> Flag:
    low, high = found.dead_time_interval
    return Flag(
        "unstable_within_interval",
        f"the loop is unstable for some dead time in {low:.4g}...{high:.4g} s, the interval "
        f"from the identification (stable from {found.stable_from:.4g} to "
        f"{found.stable_to:.4g} s)",
    )


def warn_of(check: LoopCheck, advice: str) -> None:
    """Warn if the loop is unstable within the interval; `advice` says what to try."""
    for flag in check.flags:
        warn_caller(f"{flag}; {advice}", ModelWarning)


def refuse_unstable(check: LoopCheck, what: str, advice: str) -> None:
    """Refuse a controller whose loop with the design model is unstable.

    Raises
    ------
    UnsuitableSystemError
    """
    if not check.stable:
        _refuse(check.margins.unstable_poles, what, advice)


def refuse_poles(poles: ComplexArray, what: str, advice: str) -> None:
    """Refuse a loop of several channels by its poles; see `refuse_unstable`."""
    if np.any(np.abs(poles) >= 1):
        _refuse(int(np.sum(np.abs(poles) > 1)), what, advice)


def _refuse(count: int, what: str, advice: str) -> None:
    state = f"has {count} unstable pole(s)" if count else "is on the stability boundary"
    raise UnsuitableSystemError(
        f"{what} does not stabilize the model that it was designed for: the closed loop "
        f"{state}. {advice}"
    )
