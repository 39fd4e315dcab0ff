"""A model's dead time and its interval, marked in a time plot."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from ..delayed import DelayedStateSpace
from ..identification.delay_scan import DelayScan
from . import style


def interval_of(system: DelayedStateSpace) -> tuple[float, float] | None:
    """Return the interval of a model's dead time in s, None where its fit knows none."""
    interval = getattr(system.fit, "interval", None)
    if interval is None:
        return None
    # The scan counts in samples, and so says its interval; the fit is continuous.
    unit = float(system.dt) if isinstance(system.fit, DelayScan) else 1.0
    low, high = (unit * float(bound) for bound in interval)
    return low, high


def mark_dead_time(axes: Axes, system: DelayedStateSpace, factor: float) -> None:
    """Draw the dead time as a line, its interval as a band; `factor` is in units per s."""
    wait = float(np.max(system.dead_time))
    estimate = getattr(system.fit, "dead_time", None)
    if isinstance(estimate, float):
        wait = estimate
    interval = interval_of(system)
    if interval is not None and interval[1] > interval[0]:
        axes.axvspan(
            factor * interval[0], factor * interval[1], color=style.BAND, alpha=0.22, linewidth=0
        )
    axes.axvline(factor * wait, color=style.MODEL, linewidth=1.5)
    text = f"dead time {style.in_time(wait)} = {wait / system.dt:.3g} samples"
    if interval is not None:
        text += f"\n{style.in_time(interval[0])} to {style.in_time(interval[1])}"
    axes.annotate(
        text, (factor * wait, 0.97), (6, 0), xycoords=("data", "axes fraction"),
        textcoords="offset points", va="top", color=style.INK,
    )  # fmt: skip
