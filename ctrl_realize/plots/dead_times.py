"""A model's dead time and its interval, marked in a time plot."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from ..delayed import DelayedStateSpace
from ..wording import in_time, interval_in_time, number_within, time_within
from . import style


def estimate_of(system: DelayedStateSpace) -> float:
    """Return the dead time in s: that of the fit, which may be no whole number of samples."""
    wait = getattr(system.fit, "dead_time", None)
    return float(wait) if isinstance(wait, float) else float(np.max(system.dead_time))


def interval_of(system: DelayedStateSpace) -> tuple[float, float] | None:
    """Return the interval of a model's dead time in s, None where its fit knows none."""
    interval = getattr(system.fit, "dead_time_interval", None)
    if interval is None:
        return None
    low, high = (float(bound) for bound in interval)
    return (low, high) if np.isfinite(low) and np.isfinite(high) else None


def mark_dead_time(axes: Axes, system: DelayedStateSpace, factor: float) -> None:
    """Draw the dead time as a line, its interval as a band; `factor` is in units per s."""
    wait = estimate_of(system)
    interval = interval_of(system)
    text = f"dead time\n{in_time(wait)} = {wait / system.dt:.3g} samples"
    if interval is not None:
        samples = number_within(*(bound / system.dt for bound in (wait, *interval)))
        text = f"dead time\n{time_within(wait, *interval)} = {samples} samples"
        text += f"\n{interval_in_time(*interval)}"
        if interval[1] > interval[0]:
            low, high = (factor * bound for bound in interval)
            axes.axvspan(low, high, color=style.BAND, alpha=0.22, linewidth=0)
    axes.axvline(factor * wait, color=style.MODEL, linewidth=1.5)
    axes.annotate(
        text, (factor * wait, 0.97), (6, 0), xycoords=("data", "axes fraction"),
        textcoords="offset points", va="top", color=style.INK,
        bbox={"facecolor": style.PAPER, "edgecolor": "none", "alpha": 0.75, "pad": 1.5},
    )  # fmt: skip
