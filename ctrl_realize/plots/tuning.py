"""Plots of tuning rules, controllers and reduced models."""

from __future__ import annotations

import re

import control as ct
import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, MaxNLocator

from .._wording import time_unit
from ..design.models.balanced import BalancedReduction
from ..design.models.process_model import ProcessModel
from ..design.tuning.table import PIDComparison
from . import style
from .names import plain
from .shared_docs import documented
from .style import axis_time_unit

RINGING = 5.0
"""Sensitivity peak above which controllers are drawn at the edge."""
NAME_POINTS = 10
"""Size in points of the names of the rules."""


@documented()
def pid_comparison_plot(
    result: PIDComparison, *, ax: style.AxesLike = None, title: str | None = None
) -> ct.ControlPlot:
    """Draw load error against sensitivity peak, a point for each stable controller.

    Loops with very little damping (peak above 5) are drawn at the right edge, with their peak
    beside the name.

    Parameters
    ----------
    result : PIDComparison

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> plant = cr.design.ProcessModel(gain=1.0, lag=0.08, dead_time=0.029).system(0.001)
    >>> cplt = cr.plots.pid_comparison_plot(cr.design.compare_pid(plant, ["simc", "amigo"], ["PI"]))
    >>> cplt.figure.axes[0].get_xlabel(), cplt.figure.axes[0].get_ylabel()
    ('sensitivity peak Ms', 'integrated absolute load error [output s / input]')
    """
    kinds = sorted({c.kind for c in result.controllers})
    factor, time = time_unit(1.0)
    rows = zip(result.controllers, result.margins, result.performance, strict=True)
    points = [
        (c.kind, min(m.ms, RINGING), factor * p.load_error, _rule_label(c.rule, m.ms))
        for c, m, p in rows
        if m.stable and np.isfinite(p.load_error)
    ]
    colours = {kind: style.model_colour(number) for number, kind in enumerate(kinds)}
    with style.canvas(ax, title=title, default_title="Tuning rules on this plant") as (axes,):
        lines: list[Line2D] = []
        for kind, colour in colours.items():
            of_kind = [(x, y) for name, x, y, _ in points if name == kind]
            if of_kind:
                lines += axes.plot(*zip(*of_kind, strict=True), "o", color=colour, label=kind)
        gain = result.controllers[0].gain_unit if result.controllers else ""
        unit = _load_error_unit(gain, time)
        axes.set(xlabel="sensitivity peak Ms", ylabel=f"integrated absolute load error [{unit}]")
        axes.margins(x=0.05)
        axes.set_yscale("log")
        low, high = axes.get_ylim()
        few = high < 5 * low  # too few round numbers for a logarithmic axis
        style.plain_logarithms(axes.yaxis)
        axes.yaxis.set_major_locator(MaxNLocator(5) if few else LogLocator(subs=(1.0, 2.0, 5.0)))
        low, high = axes.get_xlim()
        # Room for the names, which stand to the right of their points.
        axes.set_xlim(low, high + 0.35 * (high - low))
        _name_points(axes, [(x, y, name, colours[kind]) for kind, x, y, name in points])
        return style.finished([axes], [lines], loc="upper center")


def _load_error_unit(gain_unit: str, time: str) -> str:
    """Output times `time` per input, from the unit of a controller's gain (input per output)."""
    parts = re.fullmatch(r"(\([^)]*\)|[^/(]*)/(.+)", gain_unit)
    below, above = parts.groups() if parts else ("1", "output")
    return plain(f"{above} {time} / {'input' if below == '1' else below}")


def _rule_label(rule: str, peak: float) -> str:
    name = rule.replace("_", " ")
    return name if peak < RINGING else f"{name} (Ms = {peak:.3g})"


def _name_points(axes: Axes, points: list[tuple[float, float, str, str]]) -> None:
    """Write names beside points, each at the nearest free position."""
    unit = axes.figure.dpi / 72
    high, wide, gap = 1.2 * NAME_POINTS * unit, 0.62 * NAME_POINTS * unit, 6 * unit
    where = [axes.transData.transform((x, y)) for x, y, _, _ in points]
    # Left end, right end, height and half the free space: a point needs less of it than a name.
    taken = [(float(x) - gap, float(x) + gap, float(y), 0.6 * high) for x, y in where]
    (edge, floor), (end, top) = axes.transAxes.transform([(0, 0), (1, 1)])
    offsets = sorted(
        ((gap + 3 * wide * k, 0.4 * high * n) for k in range(12) for n in range(-29, 30)),
        key=lambda offset: 0.5 * offset[0] + abs(offset[1]),
    )
    for (x, y, name, colour), (left, at) in zip(points, where, strict=True):
        length = wide * len(name)
        places = [
            (at + shift, left + far if side > 0 else left - far - length, side)
            for far, shift in offsets
            for side in (1, -1)
        ]
        level, start, side = next(
            (
                place
                for place in places
                if floor + high / 2 < place[0] < top - high / 2
                and edge < place[1] < max(end - length, left + 2 * gap)
                and all(
                    place[1] + length <= a or b <= place[1] or abs(place[0] - used) >= room
                    for a, b, used, room in taken
                )
            ),
            places[0],
        )
        taken.append((start, start + length, level, high))
        line = {"arrowstyle": "-", "color": colour, "linewidth": 0.8, "shrinkB": 3}
        far = start - left if side > 0 else start + length - left
        axes.annotate(
            name, (x, y), (far / unit, (level - at) / unit), textcoords="offset points",
            va="center", ha="left" if side > 0 else "right", fontsize=NAME_POINTS, color=colour,
            # A distant name is connected to its point by a line.
            arrowprops=line if abs(level - at) > high or abs(far) > 2 * gap else None,
        )  # fmt: skip


@documented()
def hankel_plot(
    result: BalancedReduction, *, ax: style.AxesLike = None, title: str | None = None
) -> ct.ControlPlot:
    """Draw the Hankel singular values, the truncated ones pale.

    Parameters
    ----------
    result : BalancedReduction

    Examples
    --------
    >>> import control as ct
    >>> import ctrl_realize as cr
    >>> lags = ct.tf([1], [0.08, 1]) * ct.tf([1], [0.02, 1]) * ct.tf([1], [0.001, 1])
    >>> small = cr.design.reduce(cr.delayed_ss(lags, dead_time=0.03, dt=0.001), 2)
    >>> cplt = cr.plots.hankel_plot(small.fit)
    >>> cplt.figure.axes[0].get_ylabel()
    'Hankel singular value'
    """
    with style.canvas(ax, title=title, default_title="Balanced truncation") as (axes,):
        number = np.arange(1, result.singular_values.size + 1)
        values = np.maximum(result.singular_values, 1e-300)
        kept = result.order - result.kept_unstable
        lines = axes.semilogy(number[:kept], values[:kept], "o", color=style.MODEL, label="kept")
        label = f"cut off, error ≤ {result.error_bound:.3g}"
        lines += axes.semilogy(number[kept:], values[kept:], "o", color=style.NOISE, label=label)
        axes.set(xlabel="number", ylabel="Hankel singular value")
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        return style.finished([axes], [lines])


@documented()
def process_model_plot(
    model: ProcessModel, *, ax: style.AxesLike = None, title: str | None = None
) -> ct.ControlPlot:
    """Draw the step response of a process model.

    Parameters
    ----------
    model : ProcessModel

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> model = cr.design.ProcessModel(gain=1.0, lag=0.08, dead_time=0.029)
    >>> cplt = cr.plots.process_model_plot(model)
    >>> cplt.figure.axes[0].get_xlabel()
    'time [s]'
    """
    with style.canvas(ax, title=title, default_title="Process model") as (axes,):
        span = model.dead_time + 6 * (model.lag + model.second_lag) + (model.lag == 0)
        time = np.linspace(0, span, 600)
        factor, unit = axis_time_unit(span, axes)
        lines = axes.plot(
            time * factor, model.step(time), color=style.MODEL, label=plain(model.formula)
        )
        axes.set(xlabel=f"time [{unit}]", ylabel="step response")
        return style.finished([axes], [lines], loc="lower right")
