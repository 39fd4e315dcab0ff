"""Which hold a measured response has in it."""

from __future__ import annotations

from typing import Any

from ..checks import one_of
from ..errors import OptionError

SAME = 1e-6
"""Relative difference up to which two sample times are one."""


def sampled_every(frf: Any) -> float | None:
    """Sample time of the records that a response was estimated from, in s; None if not known."""
    return getattr(frf, "sample_time", None)


def held_every(frf: Any, hold: str | None, dt: float | None) -> float | None:
    """Sample time in s of the hold that a response has in it; None for none.

    Parameters
    ----------
    frf : control.FrequencyResponseData
    hold : {"auto", "zoh", None}
    dt : float or None
        Sample time of the hold where `frf` does not tell it.
    """
    if hold is None:
        return None
    one_of(hold, "hold", ("auto", "zoh"))
    known = sampled_every(frf)
    if known is None and hold == "zoh" and dt is None:
        raise OptionError("hold='zoh' needs dt, the sample time of the held input in s")
    return dt if known is None and hold == "zoh" else known


def same_time(one: float, other: float) -> bool:
    """Tell whether two sample times are one."""
    return abs(one - other) <= SAME * other
