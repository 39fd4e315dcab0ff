"""Plots of valve tests."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any, Literal

import control as ct
import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from scipy.ndimage import median_filter

from ..._checks import one_of
from ...valves.definitions import DEFINITIONS
from ...valves.plan import ValveTestPlan
from ...valves.result import ValveReport
from ...valves.steps import STEP_METRICS
from .. import style
from ..shared_docs import documented
from .panels import Panel, draw_panels

_SPIKE = 9
"""Samples of a median, which leaves steps as they are."""
_MOST_STEPS = 60
_MOST_POINTS = 4000
_WAYS = {"opening": (style.MEASURED, "o", "-"), "closing": (style.MODEL, "s", "--")}


def _draw_steps(axes: Axes, report: ValveReport, looks: dict[str, Any]) -> list[Line2D]:
    sizes = sorted({round(one.size, 2) for one in report.groups})
    steps = [one for one in report.steps if one.moved and one.settled and one.response.size]
    times = [one.values["settling_time"] for one in steps]
    times += [1.3 * one.values["t86"] for one in steps]
    known = [one for one in times if np.isfinite(one)]
    lengths = (one.response.size * one.dt for one in steps)
    longest = 1.2 * max(known) if known else max(lengths, default=1.0)
    unit, name = style.axis_time_unit(longest, axes)
    colours = _colours(len(sizes))
    lines: list[Line2D] = []
    named: set[float] = set()
    few = steps[:: max(len(steps) // _MOST_STEPS, 1)]
    for step in sorted(few, key=lambda one: abs(one.size)):
        nearest = min(range(len(sizes)), key=lambda k: abs(sizes[k] - abs(step.size)))
        count = min(step.response.size, int(longest / step.dt) + 2)
        every = max(count // 800, 1)
        label = "" if sizes[nearest] in named else f"{sizes[nearest]:.3g} %"
        named.add(sizes[nearest])
        own = {
            "color": colours[nearest], "linestyle": "-" if step.size > 0 else "--",
            "linewidth": 1.0, "alpha": 0.8, **({"label": label} if label else {}), **looks,
        }  # fmt: skip
        time = np.arange(0, count, every) * step.dt
        lines += axes.plot(time * unit, step.response[:count:every], **own)
    for level in (0.632, 0.865):
        axes.axhline(level, color=style.NOISE, linewidth=0.8, linestyle=":")
    axes.set(xlabel=f"time after the step [{name}]", ylabel="response / change")
    axes.set(xlim=(0, longest * unit if longest > 0 else 1.0), ylim=(-0.3, 1.5))
    if not lines:
        style.no_curve(axes, "no step with a complete response")
    return lines


def _draw_sizes(
    axes: Axes, report: ValveReport, looks: dict[str, Any], metric: str = "t86"
) -> list[Line2D]:
    known = [one for one in report.groups if one.estimates[metric].is_known]
    definition = DEFINITIONS.get(metric, DEFINITIONS["slew_rate_opening"])
    unit, factor = definition.unit, 1.0
    if unit == "s" and known:
        factor, unit = style.axis_time_unit(max(one.estimates[metric].high for one in known), axes)
    lines: list[Line2D] = []
    every = [one.estimates[metric] for one in known]
    ends = [end * factor for one in every for end in (one.low, one.value, one.high)]
    ends = [0.0, *filter(np.isfinite, ends)]
    low, high = min(ends), max(ends)
    edge = high + 0.08 * (high - low)
    for way, (colour, marker, line) in _WAYS.items():
        own = [one for one in known if one.direction == way]
        if not own:
            continue
        size = [one.size for one in own]
        found = [one.estimates[metric] for one in own]
        for x, each in zip(size, found, strict=True):
            # an interval that is open upwards ends at the edge of the axes
            top = min(each.high * factor, edge)
            axes.plot([x, x], [each.low * factor, top], color=colour, alpha=0.5)
        styled = {"color": colour, "marker": marker, "linestyle": line, "linewidth": 1.2, **looks}
        lines += axes.plot(size, [one.value * factor for one in found], label=way, **styled)
    if known:
        axes.set_xscale("log")
        ticks = sorted({float(f"{one.size:.2g}") for one in known})
        axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
        axes.minorticks_off()
        axes.set_ylim(low - (0.08 * (high - low) if low < 0 else 0.0), edge)
    else:
        style.no_curve(axes, "unknown for all sizes")
    name = "slew rate" if metric == "slew_rate" else definition.name
    axes.set(xlabel="step size [% of span]", ylabel=f"{name} [{unit}]")
    return lines


def _draw_loop(axes: Axes, report: ValveReport, looks: dict[str, Any]) -> list[Line2D]:
    lines: list[Line2D] = []
    ranges = report.ranges
    few = report.records[:: max(len(report.records) // 20, 1)]
    for k, record in enumerate(few):
        # short spikes of the command, as switching leaves them, are not what the valve was asked
        u, y = median_filter(np.ravel(record.input), _SPIKE), np.ravel(record.output)
        # corners of the loop are between neighbouring samples: samples are only left out evenly
        every = max(u.size // _MOST_POINTS, 1)
        own = {"color": _colours(max(len(few), 2))[k] if len(few) > 1 else style.MEASURED,
               "linewidth": 0.8, **looks}  # fmt: skip
        if 1 < len(few) <= 6 and record.name:
            own.setdefault("label", record.name)
        command = 100 * (u[::every] - ranges.command[0]) / ranges.command_span
        travel = 100 * (y[::every] - ranges.travel[0]) / ranges.travel_span
        lines += axes.plot(command, travel, **own)
    axes.set(xlabel="command [% of span]", ylabel="position [% of travel]")
    return lines


def _draw_signature(axes: Axes, report: ValveReport, looks: dict[str, Any]) -> list[Line2D]:
    lines: list[Line2D] = []
    curve = report.curve
    for way, (colour, marker, line) in _WAYS.items():
        if curve is not None and np.isfinite(getattr(curve, way)).sum() > 1:
            own = {"color": colour, "linestyle": line, "marker": marker, "markersize": 3.5,
                   "linewidth": 1.2, "label": way, **looks}  # fmt: skip
            lines += axes.plot(curve.command, getattr(curve, way) - curve.command, **own)
    if not lines:
        style.no_curve(axes, "needs a slow ramp, or several levels in one record")
    axes.set(xlabel="command [% of span]", ylabel="position - command [%]")
    return lines


def _colours(count: int) -> Sequence[Any]:
    """Colours of ordered sizes: Okabe and Ito's first, then again."""
    base = (style.OTHERS[3], style.MEASURED, style.TRUTH, style.BAND, style.MODEL, style.OTHERS[0])
    return [base[k % len(base)] for k in range(max(count, 1))]


_PANELS = {
    "steps": Panel(_draw_steps, "responses to steps", "lower right"),
    "sizes": Panel(_draw_sizes, "step size"),
    "loop": Panel(_draw_loop, "position over command"),
    "signature": Panel(_draw_signature, "signature"),
}


@documented("Axes, sequence of Axes")
def valve_plot(
    report: ValveReport,
    *,
    panel: Literal["steps", "sizes", "loop", "signature"] | None = None,
    metric: str = "t86",
    ax: style.AxesLike = None,
    title: str | None = None,
    **kwargs: Any,
) -> ct.ControlPlot:
    """Draw a valve test: responses, a metric against step size, loops, signature.

    Parameters
    ----------
    report : ValveReport
    panel : {"steps", "sizes", "loop", "signature"}, optional
        One panel alone. ``"steps"``: the responses to all steps on one another, each scaled to 0
        before and 1 after, one colour for each step size; closing steps are dashed, and steps that
        did not move the valve have no curve. ``"sizes"``: `metric` against step size and direction,
        with its 95 % interval. ``"loop"``: the position over the command, for all records.
        ``"signature"``: position minus command at rest, opening and closing; the distance of the
        two curves is the hysteresis with the dead band, their bend the linearity.
    metric : str, default "t86"
        One of ``"dead_time"``, ``"t63"``, ``"t86"``, ``"t98"``, ``"settling_time"``,
        ``"overshoot"``, ``"gain"``, ``"slew_rate"``.
    **kwargs
        Line properties of the measured curves.

    Raises
    ------
    OptionError
        There is no such panel, or single steps do not have this metric.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> records = cr.bench.valve().step_campaign(1, amplitudes=(16.0, 4.0), repeats=3)
    >>> report = cr.valves.valve_report(records, command_range=(4, 20), fit=False)
    >>> [text.get_text() for text in report.plot(panel="steps").figure.axes[0].get_legend().texts]
    ['25 %', '100 %']
    >>> report.plot(panel="sizes", metric="gain").figure.axes[0].get_ylabel()
    'travel gain [%/%]'
    >>> report.plot(panel="loop").figure.axes[0].get_xlabel()
    'command [% of span]'
    >>> report.plot(panel="signature").figure.axes[0].get_ylabel()
    'position - command [%]'
    >>> report.plot().axes.shape
    (2, 2)
    """
    sized = partial(_draw_sizes, metric=one_of(metric, "metric", STEP_METRICS))
    panels = _PANELS | {"sizes": _PANELS["sizes"]._replace(draw=sized)}
    return draw_panels(panels, report, panel, kwargs, ax=ax, title=title, name="valve test")


@documented()
def valve_plan_plot(
    plan: ValveTestPlan, *, ax: style.AxesLike = None, title: str | None = None, **kwargs: Any
) -> ct.ControlPlot:
    """Draw the command of a test plan, and name its parts.

    Parameters
    ----------
    plan : ValveTestPlan
    **kwargs
        Line properties.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> plan = cr.valves.valve_test_plan(dead_time=0.3, time_constant=0.5)
    >>> cr.plots.valve_plan_plot(plan).figure.axes[0].get_ylabel()
    'command'
    """
    with style.canvas(ax, title=title, default_title=repr(plan)[1:-1], size=(11.0, 4.2)) as axes:
        unit, name = style.axis_time_unit(plan.duration, axes[0])
        looks = {"color": style.INPUT, "linewidth": 1.2, **kwargs}
        lines = list(axes[0].plot(plan.time * unit, plan.command, **looks))
        bottom, top = axes[0].get_ylim()
        # the names stand above the command, where it has no values
        axes[0].set_yticks([one for one in axes[0].get_yticks() if bottom <= one <= top])
        axes[0].set_ylim(bottom, top + 0.5 * (top - bottom))
        for k, (word, start, stop) in enumerate(plan.sections):
            if k % 2:
                axes[0].axvspan(
                    start * unit, stop * unit, color=style.NOISE, alpha=0.15, linewidth=0
                )
            narrow = stop - start < 0.09 * plan.duration
            axes[0].text(
                0.5 * (start + stop) * unit, top + (0.26 if narrow else 0.4) * (top - bottom), word,
                ha="center", va="center" if narrow else "top", fontsize=9,
                rotation=90 if narrow else 0,
            )  # fmt: skip
        axes[0].set(xlabel=f"time [{name}]", ylabel="command")
        axes[0].set_xlim(-0.012 * plan.duration * unit, plan.duration * unit)
        return style.finished(axes, [lines])
