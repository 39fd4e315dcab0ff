"""Plots of dead times: estimates, their distribution, and their history."""

from __future__ import annotations

from typing import Any

import control as ct
import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from .._wording import in_time, interval_in_time, number_within, time_unit, time_within
from ..delayed import DelayedStateSpace
from ..identification.tracking.results import TrackHistory
from ..identification.validation.delay_estimates_result import DelayComparison
from . import style
from .shared_docs import documented
from .style import axis_time_unit


def estimate_of(system: DelayedStateSpace) -> float:
    """Return the dead time in s: that of the fit, which need not be a whole number of samples."""
    fitted = None if system.fit is None else system.fit.dead_time
    return float(np.max(system.dead_time)) if fitted is None else fitted


def interval_of(system: DelayedStateSpace) -> tuple[float, float] | None:
    """Return the interval of a model's dead time in s; None if its fit has none."""
    interval = None if system.fit is None else system.fit.dead_time_interval
    return interval if interval is not None and np.isfinite(interval).all() else None


def mark_dead_time(axes: Axes, system: DelayedStateSpace, factor: float) -> None:
    """Draw the dead time as a line and its interval as a band; `factor` is the unit in 1/s."""
    dead_time = estimate_of(system)
    interval = interval_of(system)
    text = f"dead time\n{in_time(dead_time)} = {dead_time / system.dt:.3g} samples"
    if interval is not None:
        samples = number_within(*(bound / system.dt for bound in (dead_time, *interval)))
        text = f"dead time\n{time_within(dead_time, *interval)} = {samples} samples"
        text += f"\n{interval_in_time(*interval)}"
        if interval[1] > interval[0]:
            low, high = (factor * bound for bound in interval)
            axes.axvspan(low, high, color=style.BAND, alpha=0.22, linewidth=0)
    axes.axvline(factor * dead_time, color=style.MODEL, linewidth=1.5)
    axes.annotate(
        text, (factor * dead_time, 0.97), (6, 0), xycoords=("data", "axes fraction"),
        textcoords="offset points", va="top", color=style.INK,
        bbox={"facecolor": style.PAPER, "edgecolor": "none", "alpha": 0.75, "pad": 1.5},
    )  # fmt: skip


@documented()
def delay_comparison_plot(
    check: DelayComparison, *, ax: style.AxesLike = None, title: str | None = None, **kwargs: Any
) -> ct.ControlPlot:
    """Draw the delay estimates of several methods with their intervals, and the common interval.

    Parameters
    ----------
    check : DelayComparison
    **kwargs
        Line properties of the intervals.

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> f = np.geomspace(0.02, 5, 60)
    >>> s = 2j * np.pi * f
    >>> noise = 0.01 * np.random.default_rng(0).standard_normal(f.size)
    >>> frf = cr.MeasuredFRF(2 * np.exp(-0.125 * s) / (0.3 * s + 1) + noise, f)
    >>> check = cr.validation.compare_delay_estimates(frf=frf, order=1)
    >>> cplt = cr.plots.delay_comparison_plot(check)
    >>> cplt.figure.axes[0].get_xlabel()
    'dead time, or bound ◂ [ms]'
    """
    size = (8.0, 1.6 + 0.5 * len(check.estimates))
    factor, unit = time_unit(max(estimate.high for estimate in check.estimates))
    with style.canvas(ax, title=title, size=size) as (axes,):
        lines: list[Line2D] = []
        for place, estimate in enumerate(reversed(check.estimates)):
            bound = estimate.kind == "upper bound"
            looks = {"color": style.NOISE if bound else style.MODEL, "linewidth": 3.0, **kwargs}
            if estimate.doubt:  # it does not count
                looks = {**looks, "alpha": 0.35}
            lines += axes.plot(
                factor * np.array([estimate.low, estimate.high]), [place, place], **looks
            )
            mark = "<" if bound else "o"
            points = {"color": looks["color"], "alpha": looks.get("alpha"), "markersize": 8}
            axes.plot(factor * estimate.value, place, mark, **points)
        if check.common is not None:
            low, high = (factor * edge for edge in check.common)
            axes.axvspan(low, high, color=style.BAND, alpha=0.3, label="all agree", linewidth=0)
        names = [
            f"{estimate.method}\n({estimate.source}{', in doubt' if estimate.doubt else ''})"
            for estimate in reversed(check.estimates)
        ]
        axes.set_yticks(range(len(names)), names)
        axes.set(ylim=(-0.6, len(names) - 0.4), xlabel=f"dead time, or bound ◂ [{unit}]")
        return style.finished([axes], [lines], loc="above")


@documented("sequence of two Axes")
def track_plot(
    track: TrackHistory, *, ax: style.AxesLike = None, title: str | None = None, **kwargs: Any
) -> ct.ControlPlot:
    """Draw the history of a tracked dead time and gain; with gaps where it is not resolved.

    Parameters
    ----------
    track : TrackHistory
    **kwargs
        Line properties of the dead time.

    Examples
    --------
    >>> import control as ct
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> core = ct.ss([[0.9]], [[1.0]], [[0.1]], [[0.0]], 0.01)
    >>> u = np.repeat(np.random.default_rng(0).choice([-1.0, 1.0], 40), 25)
    >>> record = cr.Record(0.01 * np.arange(u.size), u, cr.DelayedStateSpace(core, 7).simulate(u))
    >>> tracker = cr.DelayTracker(cr.DelayedStateSpace(core, 4), max_delay=20, forgetting_time=3.0)
    >>> cplt = cr.plots.track_plot(tracker.track(record))
    >>> cplt.figure.axes[0].get_ylabel()
    'dead time [ms]'
    """
    resolved = np.asarray(track.resolved, dtype=bool)
    with style.canvas(ax, 2, title=title, size=(8.0, 5.2), heights=(2.0, 1.0)) as axes:
        factor, unit = axis_time_unit(float(np.max(np.abs(track.time))), axes[1])
        time = factor * track.time
        scale, name = time_unit(float(np.nanmax(track.high)))
        looks = {"color": style.MODEL, "label": "dead time", **kwargs}
        axes[0].fill_between(
            time, scale * track.low, scale * track.high, where=resolved,
            color=style.BAND, alpha=0.3, linewidth=0, label="95 % interval",
        )  # fmt: skip
        upper = list(
            axes[0].plot(time, np.where(resolved, scale * track.dead_time, np.nan), **looks)
        )
        gain = np.where(resolved, track.gain_ratio, np.nan)
        lower = list(axes[1].plot(time, gain, color=style.MEASURED))
        axes[0].set_ylabel(f"dead time [{name}]")
        axes[1].set(ylabel="gain over\nthe model's", xlabel=f"time [{unit}]")
        return style.finished(axes, [upper, lower], loc="above")
