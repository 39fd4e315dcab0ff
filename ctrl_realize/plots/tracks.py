"""Plot of a tracked delay."""

from __future__ import annotations

from typing import Any

import control as ct
import numpy as np

from .. import _wording
from ..identification.tracking.results import TrackHistory
from . import style
from .style import axis_time_unit


def track_plot(
    track: TrackHistory, *, ax: style.AxesLike = None, title: str | None = None, **kwargs: Any
) -> ct.ControlPlot:
    """Draw the course of a tracked dead time and gain; where nothing is claimed, a gap.

    Parameters
    ----------
    track : TrackHistory
    ax : sequence of two Axes, or Figure, optional
    title : str, optional
    **kwargs
        Line properties of the dead time.

    Returns
    -------
    control.ControlPlot

    Examples
    --------
    >>> import control as ct
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> from ctrl_realize import plots
    >>> core = ct.ss([[0.9]], [[1.0]], [[0.1]], [[0.0]], 0.01)
    >>> u = np.repeat(np.random.default_rng(0).choice([-1.0, 1.0], 40), 25)
    >>> record = cr.Record(0.01 * np.arange(u.size), u, cr.DelayedStateSpace(core, 7).simulate(u))
    >>> tracker = cr.DelayTracker(cr.DelayedStateSpace(core, 4), max_delay=20, forgetting_time=3.0)
    >>> cplt = plots.track_plot(tracker.track(record))
    >>> cplt.figure.axes[0].get_ylabel()
    'dead time [ms]'
    """
    told = np.asarray(track.resolved, dtype=bool)
    with style.canvas(ax, 2, title=title, size=(8.0, 5.2), heights=(2.0, 1.0)) as axes:
        factor, unit = axis_time_unit(float(np.max(np.abs(track.time))), axes[1])
        time = factor * track.time
        scale, name = _wording.time_unit(float(np.nanmax(track.high)))
        looks = {"color": style.MODEL, "label": "dead time", **kwargs}
        axes[0].fill_between(
            time, scale * track.low, scale * track.high, where=told,
            color=style.BAND, alpha=0.3, linewidth=0, label="95 % interval",
        )  # fmt: skip
        upper = list(axes[0].plot(time, np.where(told, scale * track.dead_time, np.nan), **looks))
        gain = np.where(told, track.gain_ratio, np.nan)
        lower = list(axes[1].plot(time, gain, color=style.MEASURED))
        axes[0].set_ylabel(f"dead time [{name}]")
        axes[1].set_ylabel("gain over\nthe model's")
        axes[1].set_xlabel(f"time [{unit}]")
        return style.finished(axes, [upper, lower], loc="above")
