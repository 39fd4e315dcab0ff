"""Plots of design: margins, tuning rules, reductions, closed loops."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import control as ct
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import FigureBase
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

from ..checks import positive
from ..delayed import DelayedStateSpace
from ..design.balanced import BalancedReduction
from ..design.margin_result import Margins
from ..design.performance import step_responses
from ..design.pid_table import PIDComparison
from ..design.process_model import ProcessModel
from . import style

NYQUIST_SPAN = 2.5
"""Half width of the Nyquist plot, in units of the distance from 0 to -1."""
RINGING = 5.0
"""Sensitivity peak above which controllers are not told apart in the picture of the rules."""
NAME_POINTS = 10
"""Size in points of the names in that picture."""


def margins_plot(
    found: Margins, *, ax: style.AxesLike = None, title: str | None = None
) -> ct.ControlPlot:
    """Draw gain, phase and Nyquist curve of a loop with its margins marked.

    The phase is that of the curve as the count followed it: unwrapped right at any delay.

    Parameters
    ----------
    found : Margins
    ax : sequence of three Axes or Figure, optional
    title : str, optional

    Returns
    -------
    control.ControlPlot

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> from ctrl_realize import plots
    >>> plant = cr.design.ProcessModel(gain=1.0, lag=0.08, dead_time=0.029).system(0.001)
    >>> cplt = plots.margins_plot(cr.design.margins(plant, cr.design.pid(plant)))
    >>> [axes.get_title() or axes.get_ylabel() for axes in cplt.figure.axes]
    ['loop gain [dB]', 'loop phase [deg]', 'imaginary part']
    """
    omega, values = found.response
    frequency = omega / style.HERTZ
    phase = np.degrees(np.unwrap(np.angle(values)))
    with style.context():
        gain_ax, phase_ax, nyquist = _three(ax)
        drawn = [gain_ax.semilogx(frequency, style.decibel(np.abs(values)), color=style.MODEL)]
        drawn.append(phase_ax.semilogx(frequency, phase, color=style.MODEL))
        gain_ax.axhline(0, color=style.INPUT, linewidth=1)
        _mark_gain_margin(gain_ax, found)
        _mark_phase_margin(phase_ax, found, frequency, phase)
        drawn.append(_nyquist(nyquist, found, values))
        gain_ax.set(xlabel="frequency [Hz]", ylabel="loop gain [dB]")
        phase_ax.set(xlabel="frequency [Hz]", ylabel="loop phase [deg]")
        low = max(-60.0, float(style.decibel(np.abs(values)).min()))
        gain_ax.set_ylim(bottom=low)
        # Far above the crossovers the delay turns on and on; the picture is about the rest.
        ends = np.array([found.gain_crossover, found.phase_crossover, found.modulus_crossover])
        ends = ends[np.isfinite(ends) & (ends > 0)]
        top = 4 * float(ends.max()) if ends.size else float(omega[-1])
        shown = omega <= top
        low_end = max(float(omega[0]), top / 1e4)
        for axes in (gain_ax, phase_ax):
            axes.set_xlim(low_end / style.HERTZ, min(top, float(omega[-1])) / style.HERTZ)
        phase_ax.set_ylim(float(phase[shown].min()) - 20, float(phase[shown].max()) + 20)
        verdict = "stable" if found.stable else "UNSTABLE"
        return style.finished(
            [gain_ax, phase_ax, nyquist],
            drawn,
            columns=3,
            legends=(0, 1, 2),
            title=title or f"Closed loop {verdict}",
            own_figure=ax is None,
            loc="lower left",
        )


def _three(ax: style.AxesLike) -> list[Axes]:
    """Put gain above phase and the Nyquist curve beside them; axes that are given stay."""
    if ax is not None and not isinstance(ax, FigureBase):
        return style.axes_for(ax, 3)
    figure = plt.figure(figsize=(9.6, 5.4), layout="constrained") if ax is None else ax
    grid = figure.add_gridspec(2, 2)
    return [figure.add_subplot(place) for place in (grid[0, 0], grid[1, 0], grid[:, 1])]


def _mark_gain_margin(axes: Any, found: Margins) -> None:
    if np.isfinite(found.phase_crossover) and found.phase_crossover > 0:
        at = found.phase_crossover / style.HERTZ
        level = float(style.decibel(np.array([1 / found.gain_margin]))[0])
        label = f"gain margin {found.gain_margin:.3g}"
        axes.plot([at, at], [0, level], color=style.TRUTH, marker="o", label=label)


def _mark_phase_margin(axes: Any, found: Margins, frequency: Any, phase: Any) -> None:
    if not np.isfinite(found.gain_crossover):
        return
    at = found.gain_crossover / style.HERTZ
    here = float(np.interp(at, frequency, phase))
    level = here - found.phase_margin
    label = f"phase margin {found.phase_margin:.3g}°"
    if np.isfinite(found.delay_margin):
        label += f"\ndelay margin {style.in_time(found.delay_margin)}"
    axes.axhline(level, color=style.INPUT, linewidth=1)
    axes.plot([at, at], [level, here], color=style.TRUTH, marker="o", label=label)


def _nyquist(axes: Any, found: Margins, values: Any) -> Any:
    lines = axes.plot(values.real, values.imag, color=style.MODEL)
    axes.plot(values.real, -values.imag, color=style.MODEL, alpha=0.35, linewidth=1)
    axes.plot([-1], [0], marker="+", markersize=12, color=style.INK, linestyle="none")
    angle = np.linspace(0, 2 * np.pi, 200)
    axes.plot(
        -1 + found.modulus_margin * np.cos(angle),
        found.modulus_margin * np.sin(angle),
        color=style.TRUTH,
        linestyle=style.DASHES[1],
        label=f"modulus margin {found.modulus_margin:.3g}",
    )
    axes.set(
        xlim=(-NYQUIST_SPAN, NYQUIST_SPAN - 1),
        ylim=(-NYQUIST_SPAN + 0.5, NYQUIST_SPAN - 0.5),
        xlabel="real part",
        ylabel="imaginary part",
    )
    axes.set_aspect("equal", adjustable="box")
    return lines


def pid_comparison_plot(
    found: PIDComparison, *, ax: style.AxesLike = None, title: str | None = None
) -> ct.ControlPlot:
    """Draw load error against sensitivity peak, a point for each stable controller.

    Loops that hardly damp at all (peak above 5) stand at the right edge, with their peak beside
    the name.

    Parameters
    ----------
    found : PIDComparison
    ax : Axes or Figure, optional
    title : str, optional

    Returns
    -------
    control.ControlPlot

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> from ctrl_realize import plots
    >>> plant = cr.design.ProcessModel(gain=1.0, lag=0.08, dead_time=0.029).system(0.001)
    >>> cplt = plots.pid_comparison_plot(cr.design.compare_pid(plant, ["simc", "amigo"], ["PI"]))
    >>> cplt.figure.axes[0].get_xlabel(), cplt.figure.axes[0].get_ylabel()
    ('sensitivity peak Ms', 'integrated absolute load error [s]')
    """
    kinds = sorted({c.kind for c in found.controllers})
    rows = zip(found.controllers, found.margins, found.performance, strict=True)
    points = [
        (c.kind, min(m.ms, RINGING), p.load_error, _rule_label(c.rule, m.ms))
        for c, m, p in rows
        if m.stable and np.isfinite(p.load_error)
    ]

    def draw(axes: Axes) -> list[Line2D]:
        lines: list[Line2D] = []
        for number, kind in enumerate(kinds):
            of_kind = [(x, y) for name, x, y, _ in points if name == kind]
            if of_kind:
                colour = style.model_colour(number)
                lines += axes.plot(*zip(*of_kind, strict=True), "o", color=colour, label=kind)
        axes.set(xlabel="sensitivity peak Ms", ylabel="integrated absolute load error [s]")
        axes.margins(x=0.05)
        axes.set_yscale("log")
        low, high = axes.get_ylim()
        few = high < 5 * low  # too few round numbers for a logarithmic axis
        axes.yaxis.set_major_locator(MaxNLocator(5) if few else LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.yaxis.set_minor_formatter(NullFormatter())
        low, high = axes.get_xlim()
        # Room for the names, which stand to the right of their points.
        axes.set_xlim(low, high + 0.35 * (high - low))
        colours = {kind: style.model_colour(number) for number, kind in enumerate(kinds)}
        _name_points(axes, [(x, y, name, colours[kind]) for kind, x, y, name in points])
        return lines

    return style.in_one(ax, title or "Tuning rules on this plant", draw, loc="upper center")


def _rule_label(rule: str, peak: float) -> str:
    name = rule.replace("_", " ")
    return name if peak < RINGING else f"{name} (Ms = {peak:.3g})"


def _name_points(axes: Axes, points: list[tuple[float, float, str, str]]) -> None:
    """Write names beside points, each at the nearest place that points and other names leave."""
    unit = axes.figure.dpi / 72
    high, wide, gap = 1.2 * NAME_POINTS * unit, 0.62 * NAME_POINTS * unit, 6 * unit
    where = [axes.transData.transform((x, y)) for x, y, _, _ in points]
    # Left end, right end, height and half the free space: a point needs less of it than a name.
    taken = [(float(x) - gap, float(x) + gap, float(y), 0.6 * high) for x, y in where]
    edge, floor = axes.transAxes.transform((0, 0))
    shifts = [0.4 * high * k * way for k in range(30) for way in (1, -1)]
    for (x, y, name, colour), (left, at) in zip(points, where, strict=True):
        length = wide * len(name)
        right_or_left = ((left + gap, 1), (left - gap - length, -1))
        places = [(at + shift, *place) for shift in shifts for place in right_or_left]
        level, start, side = next(
            (
                place
                for place in places
                if place[0] > floor + high / 2
                and place[1] > edge
                and all(
                    place[1] + length <= a or b <= place[1] or abs(place[0] - used) >= room
                    for a, b, used, room in taken
                )
            ),
            places[0],
        )
        taken.append((start, start + length, level, high))
        line = {"arrowstyle": "-", "color": colour, "linewidth": 0.8, "shrinkB": 3}
        axes.annotate(
            name, (x, y), (6 * side, (level - at) / unit), textcoords="offset points",
            va="center", ha="left" if side > 0 else "right", fontsize=NAME_POINTS, color=colour,
            # A name that had to go far keeps a line to its point.
            arrowprops=line if abs(level - at) > high else None,
        )  # fmt: skip


def hankel_plot(
    found: BalancedReduction, *, ax: style.AxesLike = None, title: str | None = None
) -> ct.ControlPlot:
    """Draw the Hankel singular values, those that were cut off pale.

    Parameters
    ----------
    found : BalancedReduction
    ax : Axes or Figure, optional
    title : str, optional

    Returns
    -------
    control.ControlPlot

    Examples
    --------
    >>> import control as ct
    >>> import ctrl_realize as cr
    >>> from ctrl_realize import plots
    >>> lags = ct.tf([1], [0.08, 1]) * ct.tf([1], [0.02, 1]) * ct.tf([1], [0.001, 1])
    >>> small = cr.design.reduce(cr.delayed_ss(lags, dead_time=0.03, dt=0.001), 2)
    >>> cplt = plots.hankel_plot(small.fit)
    >>> cplt.figure.axes[0].get_ylabel()
    'Hankel singular value'
    """

    def draw(axes: Axes) -> list[Line2D]:
        number = np.arange(1, found.singular_values.size + 1)
        values = np.maximum(found.singular_values, 1e-300)
        kept = found.order - found.kept_unstable
        lines = axes.semilogy(number[:kept], values[:kept], "o", color=style.MODEL, label="kept")
        label = f"cut off, error ≤ {found.error_bound:.3g}"
        lines += axes.semilogy(number[kept:], values[kept:], "o", color=style.NOISE, label=label)
        axes.set(xlabel="number", ylabel="Hankel singular value")
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        return lines

    return style.in_one(ax, title or "Balanced truncation", draw)


def process_model_plot(
    model: ProcessModel, *, ax: style.AxesLike = None, title: str | None = None
) -> ct.ControlPlot:
    """Draw the step response of a process model.

    Parameters
    ----------
    model : ProcessModel
    ax : Axes or Figure, optional
    title : str, optional

    Returns
    -------
    control.ControlPlot

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> from ctrl_realize import plots
    >>> cplt = plots.process_model_plot(cr.design.ProcessModel(gain=1.0, lag=0.08, dead_time=0.029))
    >>> cplt.figure.axes[0].get_xlabel()
    'time [s]'
    """

    def draw(axes: Axes) -> list[Line2D]:
        span = model.dead_time + 6 * (model.lag + model.second_lag) + (model.lag == 0)
        time = np.linspace(0, span, 600)
        factor, unit = style.time_unit(span, axes)
        lines = axes.plot(
            time * factor,
            model.step(time),
            color=style.MODEL,
            label=style.plain(repr(model)[14:-1]),
        )
        axes.set(xlabel=f"time [{unit}]", ylabel="step response")
        return lines

    return style.in_one(ax, title or "Process model", draw, loc="lower right")


def closed_loop_plot(
    plant: DelayedStateSpace,
    controllers: Mapping[str, Any],
    *,
    span: float,
    ax: style.AxesLike = None,
    title: str | None = None,
) -> ct.ControlPlot:
    """Draw the output after a step of set-point and of load for several controllers.

    Parameters
    ----------
    plant : DelayedStateSpace
    controllers : mapping of str to system
        Name -> controller of the plant's sample time; each must make a stable loop.
    span : float
        Time to show in s.
    ax : sequence of two Axes or Figure, optional
    title : str, optional

    Returns
    -------
    control.ControlPlot

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> from ctrl_realize import plots
    >>> plant = cr.design.ProcessModel(gain=1.0, lag=0.08, dead_time=0.029).system(0.001)
    >>> loops = {rule: cr.design.pid(plant, rule) for rule in ("simc", "amigo")}
    >>> cplt = plots.closed_loop_plot(plant, loops, span=0.5)
    >>> [axes.get_ylabel() for axes in cplt.figure.axes]
    ['output, set-point step', 'output, load step']
    """
    positive(span, "span", "time in s")
    count = int(np.ceil(span / plant.dt)) + 1
    # Twice the span is computed: what wraps around shows at the end.
    length = 2 ** int(np.ceil(np.log2(2 * count)))
    with style.context():
        axes = style.axes_for(ax, 2, size=(8.0, 6.5))
        drawn: list[list[Any]] = [[], []]
        factor, unit = style.time_unit(span, axes[1])
        time = np.arange(count) * plant.dt * factor
        for number, (name, controller) in enumerate(controllers.items()):
            for where, response in enumerate(step_responses(plant, controller, length)):
                drawn[where] += axes[where].plot(
                    time,
                    response[:count],
                    color=style.model_colour(number),
                    linestyle="-" if number == 0 else style.DASHES[number % len(style.DASHES)],
                    label=style.plain(name),
                )
        axes[0].axhline(1, color=style.INPUT, linewidth=1)
        axes[1].axhline(0, color=style.INPUT, linewidth=1)
        axes[0].set_ylabel("output, set-point step")
        axes[1].set(ylabel="output, load step", xlabel=f"time [{unit}]")
        # The set-point response ends at 1: the corner below it is free.
        return style.finished(
            axes, drawn, title=title or "Closed loop", own_figure=ax is None, loc="lower right"
        )
