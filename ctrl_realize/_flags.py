"""Flags of results, in the words of one table, `flags.toml`."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

from ._facts import facts
from ._wording import in_time

if TYPE_CHECKING:
    from .numerics.families.flow import DispersedFlow


@dataclass(frozen=True)
class Flag:
    """Warning about a result.

    Attributes
    ----------
    code : str
        Short fixed name for programs: ``"delay_at_bound"``.
    message : str
        What was found, with its numbers, and what to try.

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> pulse = np.r_[np.zeros(38), 0.1 * 0.9 ** np.arange(300)]
    >>> for flag in cr.estimate_delay(pulse, 1, max_delay=37, dt=0.01).fit.flags:
    ...     print(f"{flag.code}: {flag}")
    delay_at_bound: the best delay is max_delay=37; try a larger one
    """

    code: str
    message: str

    def __str__(self) -> str:
        return self.message


def flagged(key: str, /, **values: object) -> Flag:
    """Make a flag from the words of the table, with `values` in them.

    Parameters
    ----------
    key : str
        Code of the flag, or ``"code.case"`` for the words of one case.
    **values
        What stands in braces in the words.

    Examples
    --------
    >>> from ctrl_realize._flags import flagged
    >>> flagged("few_cycles", count=5.0, fewest=8)
    Flag(code='few_cycles', message='5.0 cycles of the oscillation; record at least 8')
    """
    code, _, case = key.partition(".")
    return Flag(code, facts("flags.toml")[code][case or "words"].format(**values))


def flow_flag(flow: DispersedFlow, *, followed: bool, unit: float = 1.0) -> Flag:
    """Report axial dispersion, whose times are in units of ``1 / unit`` s.

    `followed`: the dead time is that of it; otherwise it fits better than lags, not clearly.
    """
    lag = f" and a lag of {in_time(flow.lag / unit)}" if flow.lag else ""
    return flagged(
        "dispersed_flow.chosen" if followed else "dispersed_flow",
        mean=in_time(flow.mean / unit),
        peclet=flow.peclet,
        behind=lag,
        dead_time=in_time(flow.dead_time / unit),
    )


@cache
def marked(mark: str) -> frozenset[str]:
    """Codes that have a mark in the table.

    Examples
    --------
    >>> from ctrl_realize._flags import marked
    >>> sorted(marked("wrong_dead_time"))
    ['delay_at_bound', 'no_delay_resolved', 'order_in_noise', 'phase_leads']
    """
    table = facts("flags.toml")
    return frozenset(code for code, row in table.items() if mark in row.get("marks", ()))


def in_doubt(flag: Flag) -> bool:
    """Whether a flag goes with wrong answers to a question of a verdict; otherwise it is a note.

    Examples
    --------
    >>> from ctrl_realize._flags import flagged, in_doubt
    >>> in_doubt(flagged("few_cycles", count=5.0, fewest=8))
    False
    """
    marks = (
        f"{how}_{what}" for how in ("doubts", "no") for what in ("dead_time", "gain", "tuning")
    )
    return any(flag.code in marked(mark) for mark in marks)
