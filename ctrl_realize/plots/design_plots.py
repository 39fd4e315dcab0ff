"""Plots of design: margins, tuning rules, reductions, closed loops."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import control as ct
import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

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
    """
    omega, values = found.response
    frequency = omega / style.HERTZ
    phase = np.degrees(np.unwrap(np.angle(values)))
    with style.context():
        gain_ax, phase_ax, nyquist = style.axes_for(
            ax, 1, columns=3, size=(13.0, 4.2), sharex=False
        )
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
        )


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

    Parameters
    ----------
    found : PIDComparison
    ax : Axes or Figure, optional
    title : str, optional

    Returns
    -------
    control.ControlPlot
    """

    def draw(axes: Axes) -> list[Line2D]:
        lines = []
        kinds = sorted({c.kind for c in found.controllers})
        for number, kind in enumerate(kinds):
            points = [
                (m.ms, p.load_error, c.rule)
                for c, m, p in zip(found.controllers, found.margins, found.performance, strict=True)
                if c.kind == kind and m.stable and np.isfinite(p.load_error)
            ]
            if not points:
                continue
            x, y, rules = zip(*points, strict=True)
            colour = style.model_colour(number)
            lines += axes.plot(x, y, "o", color=colour, label=kind)
            for point in zip(x, y, rules, strict=True):
                axes.annotate(
                    point[2].replace("_", " "),
                    point[:2],
                    xytext=(5, 3),
                    textcoords="offset points",
                    fontsize=9,
                    color=colour,
                )
        axes.set(xlabel="sensitivity peak Ms", ylabel="integrated absolute load error [s]")
        axes.margins(x=0.15)
        axes.set_ylim(bottom=0)
        return lines

    return style.in_one(ax, title or "Tuning rules on this plant", draw)


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

    return style.in_one(ax, title or "Process model", draw)


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
