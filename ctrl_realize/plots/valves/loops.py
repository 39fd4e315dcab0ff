"""Plots of oscillating loops."""

from __future__ import annotations

from typing import Any, Literal

import control as ct
import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from ...numerics.oscillation.half_cycles import POINTS, HalfCycles
from ...valves.loops.result import LoopDiagnosis
from .. import style
from ..shared_docs import documented
from .panels import Panel, draw_panels

_CYCLES = 10
"""Of the trends that are shown: more cannot be distinguished."""
_MOST_SHAPES = 40


def _shown(diagnosis: LoopDiagnosis) -> slice:
    """Samples of some cycles from the middle of the record."""
    size = diagnosis.signals.op.size
    if not np.isfinite(diagnosis.period) or diagnosis.cycles is None:
        return slice(0, size)
    many = min(int(_CYCLES * diagnosis.cycles.period) + 1, size)
    start = (size - many) // 2
    return slice(start, start + many)


def _draw_trend(axes: Axes, diagnosis: LoopDiagnosis, looks: dict[str, Any]) -> list[Line2D]:
    signals, part = diagnosis.signals, _shown(diagnosis)
    time = signals.dt * np.arange(signals.op.size)[part]
    unit, name = style.axis_time_unit(float(time[-1]), axes)
    lines = []
    for label, signal, colour in (
        ("OP", signals.op, style.INPUT),
        ("PV", signals.pv, style.MEASURED),
        ("SP", signals.sp, style.OTHERS[0]),
    ):
        if signal is not None:
            alike = signals.pv if label == "SP" else signal
            own = {"color": colour, "linewidth": 1.2, "label": label, **looks}
            shown = (signal[part] - alike.mean()) / (float(alike.std()) or 1.0)
            lines += axes.plot(time * unit, shown, **own)
    axes.set(xlabel=f"time [{name}]", ylabel="deviation / standard deviation")
    return lines


def _draw_phase(axes: Axes, diagnosis: LoopDiagnosis, looks: dict[str, Any]) -> list[Line2D]:
    signals, part = diagnosis.signals, _shown(diagnosis)
    op, pv = signals.op[part], signals.pv[part]
    lines = axes.plot(op, pv, **{"color": style.MEASURED, "linewidth": 0.8, **looks})
    if diagnosis.ellipse is not None:
        found, angle = diagnosis.ellipse, np.linspace(0, 2 * np.pi, 181)
        lines += axes.plot(
            op.mean() + found.output * np.cos(angle),
            pv.mean() + found.value * np.cos(angle - found.phase),
            color=style.MODEL, linewidth=1.6, linestyle=style.DASHES[0],
            label=f"ellipse, width {found.width:.3g}",
        )  # fmt: skip
    axes.set(xlabel="controller output OP", ylabel="process value PV")
    return list(lines)


def _draw_correlation(axes: Axes, diagnosis: LoopDiagnosis, looks: dict[str, Any]) -> list[Line2D]:
    found = diagnosis.cross_correlation
    if found is None:
        style.no_curve(axes, "no oscillation")
        return []
    dt = diagnosis.signals.dt
    unit, name = style.axis_time_unit(float(found.lags[-1]) * dt, axes)
    own = {"color": style.MEASURED, "linewidth": 1.5, **looks}
    lines = axes.plot(found.lags * dt * unit, found.values, **own)
    axes.axhline(0, color=style.NOISE, linewidth=0.8)
    axes.axvline(0, color=style.NOISE, linewidth=0.8)
    axes.set(xlabel=f"lag [{name}]", ylabel="cross-correlation")
    return list(lines)


def _draw_shapes(axes: Axes, diagnosis: LoopDiagnosis, looks: dict[str, Any]) -> list[Line2D]:
    integrating = diagnosis.process == "integrating"
    name = "PV" if integrating else "OP"
    found: HalfCycles | None = diagnosis.pv_shapes if integrating else diagnosis.op_shapes
    axes.set(xlabel="part of the half cycle", ylabel=f"half cycles of {name}")
    if found is None:
        style.no_curve(axes, "no half cycles")
        return []
    inside = np.linspace(0, 1, POINTS)
    few = found.shapes[:: max(len(found.shapes) // _MOST_SHAPES, 1)]
    own = {"color": style.MEASURED, "linewidth": 0.7, "alpha": 0.4, **looks}
    lines = axes.plot(inside, few.T, **own)
    mean = found.shapes.mean(axis=0)
    lines += axes.plot(inside, mean, color=style.INK, linewidth=2.0, label="mean")
    sine = np.sin(np.pi * inside)
    top = inside[int(np.argmax(mean))]
    tent = np.minimum(inside / max(top, 0.05), (1 - inside) / max(1 - top, 0.05))
    for label, shape, colour, dash in (
        ("sine", sine, style.TRUTH, style.DASHES[1]),
        ("triangle", tent, style.MODEL, style.DASHES[0]),
    ):
        fitted = shape * (shape @ mean) / (shape @ shape)
        lines += axes.plot(inside, fitted, color=colour, linestyle=dash, label=label)
    return list(lines)


_PANELS = {
    "trend": Panel(_draw_trend, "", "upper right", (11.0, 4.2)),
    "phase": Panel(_draw_phase, "PV over OP", "upper right"),
    "correlation": Panel(_draw_correlation, "cross-correlation of OP and PV"),
    "shapes": Panel(_draw_shapes, "half cycles", "upper right"),
}


@documented("Axes, sequence of Axes")
def loop_diagnosis_plot(
    diagnosis: LoopDiagnosis,
    *,
    panel: Literal["trend", "phase", "correlation", "shapes"] | None = None,
    ax: style.AxesLike = None,
    title: str | None = None,
    **kwargs: Any,
) -> ct.ControlPlot:
    """Draw an oscillating loop: trends, PV over OP, cross-correlation, half cycles.

    Parameters
    ----------
    diagnosis : LoopDiagnosis
    panel : {"trend", "phase", "correlation", "shapes"}, optional
        One panel alone. ``"trend"``: controller output and process value over time, both scaled to
        their standard deviation, at most ten cycles from the middle of the record. ``"phase"``: the
        process value over the controller output, and the ellipse of their fundamentals.
        ``"correlation"``: the cross-correlation function of the two. ``"shapes"``: the half cycles
        of the controller output, or of the process value if the process is integrating, on one
        another, with their mean, a sine and a triangle.
    **kwargs
        Line properties of the measured curves.

    Raises
    ------
    OptionError
        There is no such panel.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> loop = cr.bench.valve_loop(cr.actuators.Stiction(5, 2), noise=0.1).simulate(1200.0, rng=1)
    >>> diagnosis = cr.valves.diagnose_loop(loop.record)
    >>> diagnosis.plot().axes.shape
    (2, 2)
    >>> for panel in ("trend", "shapes"):
    ...     axes = diagnosis.plot(panel=panel).figure.axes[0]
    ...     print([text.get_text() for text in axes.get_legend().get_texts()])
    ['OP', 'PV']
    ['mean', 'sine', 'triangle']
    >>> for panel in ("phase", "correlation"):
    ...     print(diagnosis.plot(panel=panel).figure.axes[0].get_xlabel())
    controller output OP
    lag [s]
    """
    return draw_panels(
        _PANELS, diagnosis, panel, kwargs, ax=ax, title=title, name=diagnosis.verdict
    )
