"""Plots of time signals: records, step responses and their onset, planned inputs."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import control as ct
import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from .._checks import check_type
from .._parameters import gain_unit
from .._wording import time_unit
from ..data import Record, StepResponse
from ..data.given import as_record
from ..delayed import DelayedStateSpace
from ..design.siso import delayed_system
from ..errors import DataError
from ..experiment.result import ExperimentPlan
from ..identification.step.steps import unit_step
from ..numerics.arrays import FloatArray
from . import style
from .delays import mark_dead_time
from .names import plain, with_unit, wrapped
from .shared_docs import documented
from .style import axis_time_unit

_FEW_SAMPLES = 60
"""Number of samples up to which they are drawn as points, too."""

_SHOWN_BEFORE = 0.35
"""Time shown before a step, as a fraction of that after it."""

UNIT_STEP = "unit step response\n[output / input]"


@documented("sequence of two Axes")
def record_plot(
    record: Record, *, ax: style.AxesLike = None, title: str | None = None, **kwargs: Any
) -> ct.ControlPlot:
    """Draw a record: outputs above, with their set points dashed, inputs below (figure 3).

    Parameters
    ----------
    record : Record
    **kwargs
        Line properties of the outputs.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> cplt = cr.plots.record_plot(cr.bench.valve().step_record(16, rng=5))
    >>> cplt.axes.shape
    (2, 1)
    """
    as_record(record)
    with style.canvas(
        ax, 2, title=title, default_title=record.name, size=(8.0, 5.2), heights=(2.2, 1.0)
    ) as (upper, lower):
        factor, unit = axis_time_unit(float(np.abs(record.time[[0, -1]]).max()), lower)
        time = factor * record.time
        if record.reference is not None:
            for wanted in np.atleast_2d(record.reference):
                upper.plot(time, wanted, color=style.INPUT, lw=1.0, ls="--", drawstyle="steps-post")
        measured = draw_signals(upper, time, record.output, record.output_labels, **kwargs)
        driven = draw_signals(lower, time, record.input, record.input_labels, color=style.INPUT)
        upper.set_ylabel(_axis_label(record.output_labels, record.output_units, "output"))
        lower.set_ylabel(_axis_label(record.input_labels, record.input_units, "input", 16))
        lower.set_xlabel(f"time [{unit}]")
        several = [row for row, n in enumerate((record.noutputs, record.ninputs)) if n > 1]
        return style.finished([upper, lower], [measured, driven], legends=several)


@documented()
def step_plot(
    step: Record | StepResponse | Sequence[Record | StepResponse],
    system: DelayedStateSpace | None = None,
    *,
    ax: style.AxesLike = None,
    title: str | None = None,
    **kwargs: Any,
) -> ct.ControlPlot:
    """Draw responses to a unit step, with that of a model.

    Parameters
    ----------
    step : Record or StepResponse, or sequence of them
        Records are converted by `unit_step`.
    system : DelayedStateSpace, optional
        Model, drawn dashed.
    **kwargs
        Line properties of the measured responses.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> record = cr.bench.valve().step_record(16, rng=5)
    >>> cplt = cr.plots.step_plot(record, cr.identify(record, method="scan"))
    >>> [text.get_text() for text in cplt.figure.axes[0].get_legend().get_texts()]
    ['measured', 'model']
    """
    steps = _steps(step)
    longest = max(float(one.time[-1]) for one in steps)
    rising = steps[0].output[-1] > 0
    with style.canvas(ax, title=title, default_title=steps[0].name) as (axes,):
        factor, unit = axis_time_unit(longest, axes)
        lines = _measured_steps(axes, steps, factor, **kwargs)
        if system is not None:
            lines += _model_step(axes, system, longest, factor)
        axes.set(xlabel=f"time after the step [{unit}]", ylabel=_step_label(steps[0]))
        return style.finished([axes], [lines], loc="lower right" if rising else "upper right")


@documented()
def onset_plot(
    step: Record | StepResponse | Sequence[Record | StepResponse],
    system: DelayedStateSpace | None = None,
    *,
    ax: style.AxesLike = None,
    span: float | None = None,
    title: str | None = None,
    **kwargs: Any,
) -> ct.ControlPlot:
    """Draw the start of step responses, with the dead time of a model (figure 4).

    Parameters
    ----------
    step : Record or StepResponse, or sequence of them
        Records are converted by `unit_step`.
    system : DelayedStateSpace, optional
        Model, drawn with its response, dead time and interval.
    span : float, optional
        Time after the step to show, in s. Default: three dead times, and enough to show the rise of
        the response.
    **kwargs
        Line properties of the measured responses.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> record = cr.bench.valve().step_record(16, rng=5)
    >>> cplt = cr.plots.onset_plot(record, cr.identify(record, method="scan"))
    >>> [text.get_text() for text in cplt.figure.axes[0].get_legend().get_texts()]
    ['measured', 'model']
    """
    steps = _steps(step)
    shown = _onset_span(steps[0], system) if span is None else float(span)
    before = _SHOWN_BEFORE * shown
    near = [_until(one, shown) for one in steps]
    name = f"{steps[0].name}: onset" if steps[0].name else "onset"
    with style.canvas(ax, title=title, default_title=name) as (axes,):
        factor, unit = axis_time_unit(shown, axes)
        lines = _measured_steps(axes, near, factor, before=before, **kwargs)
        axes.axvline(0.0, color=style.INPUT, linewidth=1.5, linestyle=":")
        axes.annotate(
            "step", (0.0, 0.94), (-5, 0), xycoords=("data", "axes fraction"),
            textcoords="offset points", ha="right", color=style.INPUT,
        )  # fmt: skip
        if system is not None:
            lines += _model_step(axes, system, shown, factor)
            mark_dead_time(axes, system, factor)
        axes.set_xlim(-before * factor, shown * factor)
        axes.set(xlabel=f"time after the step [{unit}]", ylabel=_step_label(steps[0]))
        return style.finished([axes], [lines], loc="center left")


def draw_beside(
    axes: Axes, record: Record, row: int, curves: Sequence[tuple[FloatArray, dict[str, Any]]]
) -> list[Line2D]:
    """Draw a measured output, and curves over the same time with their line properties."""
    factor, unit = axis_time_unit(float(np.ptp(record.time)), axes)
    time, measured = factor * record.time, np.atleast_2d(record.output)[row]
    seen = ~np.isnan(measured)
    lines = axes.plot(time[seen], measured[seen], color=style.MEASURED, label="measured")
    for values, looks in curves:
        lines += axes.plot(time, values, **{**style.model_looks(), **looks})
    label = wrapped(with_unit(record.output_labels[row], record.output_units[row]), 16)
    axes.set(xlabel=f"time [{unit}]", ylabel=label)
    return list(lines)


def draw_signals(
    axes: Axes,
    time: FloatArray,
    signals: FloatArray,
    labels: Sequence[str],
    *,
    first: str = style.MEASURED,
    **kwargs: Any,
) -> list[Line2D]:
    """Draw signals over one time, each in its colour, that of the first as given."""
    rows = np.atleast_2d(signals)
    lines: list[Line2D] = []
    for index, (row, label) in enumerate(zip(rows, labels, strict=True)):
        seen = ~np.isnan(row)
        # Single samples between missing ones would be lines without length.
        points = {} if seen.all() else {"marker": ".", "markersize": 3}
        looks = {
            **points,
            "color": style.OTHERS[(index - 1) % len(style.OTHERS)] if index else first,
            "linewidth": 1.5,
            "label": plain(label),
            **(kwargs if len(rows) == 1 else {k: v for k, v in kwargs.items() if k != "color"}),
        }
        lines += axes.plot(time[seen], row[seen], **looks)
    return lines


def _steps(given: Any) -> list[StepResponse]:
    several = isinstance(given, Iterable) and not isinstance(given, ct.InputOutputSystem)
    items = list(given) if several else [given]
    if not items:
        raise DataError("no step responses to plot")
    for item in items:
        expected = "a Record or StepResponse, followed by the model"
        check_type(item, Record | StepResponse, "step", expected)
    return [unit_step(item) if isinstance(item, Record) else item for item in items]


def _measured_steps(
    axes: Axes, steps: Sequence[StepResponse], factor: float, before: float = 0.0, **kwargs: Any
) -> list[Line2D]:
    looks: dict[str, Any] = {"color": style.MEASURED, "linewidth": 1.5, "alpha": 1.0}
    if len(steps) > 1:
        looks |= {"linewidth": 0.8, "alpha": 0.6}
    if sum(step.n_samples for step in steps) <= _FEW_SAMPLES:
        looks |= {"marker": "o", "markersize": 3.5}
    looks.update(kwargs)
    lines: list[Line2D] = []
    for index, step in enumerate(steps):
        early = min(step.pre_step.size, int(before / step.dt))
        time = step.dt * np.arange(-early, step.n_samples)
        values = np.concatenate([step.pre_step[step.pre_step.size - early :], step.output])
        label = "measured" if len(steps) == 1 else f"measured, {len(steps)} records"
        lines += axes.plot(factor * time, values, label=label if index == 0 else None, **looks)
    return lines


def _model_step(axes: Axes, system: DelayedStateSpace, until: float, factor: float) -> list[Line2D]:
    plant = delayed_system(system, "the response of a step record")
    count = max(int(np.ceil(until / plant.dt)) + 1, 2)
    response = np.ravel(plant.step(count))
    time = factor * plant.dt * np.arange(count)
    return list(axes.plot(time, response, label="model", **style.model_looks()))


def _until(step: StepResponse, end: float) -> StepResponse:
    count = min(int(np.ceil(end / step.dt)) + 1, step.n_samples)
    return replace(step, time=step.time[:count], output=step.output[:count])


def _onset_span(step: StepResponse, system: DelayedStateSpace | None) -> float:
    """Show three dead times, or up to a quarter of the final value for a slower response."""
    final = float(np.nanmedian(step.output[-max(step.n_samples // 20, 1) :]))
    reached = np.flatnonzero(np.abs(step.output) >= 0.25 * abs(final))
    rise = step.dt * (int(reached[0]) if reached.size else step.n_samples // 4)
    dead_time = 0.0 if system is None else float(np.max(system.dead_time))
    return float(min(max(3 * dead_time, 1.3 * rise, 12 * step.dt), step.time[-1]))


def _step_label(step: StepResponse) -> str:
    record = step.record
    ratio = "" if record is None else gain_unit(record.output_units[0], record.input_units[0])
    return f"unit step response\n[{ratio}]" if ratio else UNIT_STEP


def _axis_label(labels: Sequence[str], units: Sequence[str], kind: str, width: int = 26) -> str:
    if len(labels) > 1:
        return f"{kind}s"
    default = {"output": "y", "input": "u"}[kind]
    return wrapped(with_unit(kind if labels[0] == default else labels[0], units[0]), width)


@documented("sequence of two Axes")
def experiment_plot(
    plan: ExperimentPlan, *, ax: style.AxesLike = None, title: str | None = None, **kwargs: Any
) -> ct.ControlPlot:
    """Draw the standard error against the length of a test, and the input that is planned.

    Above: the error of the best kind of signal and of one step, all candidates at the length that
    is planned, and today's error, if there are records. Below: the input.

    Parameters
    ----------
    plan : ExperimentPlan
    **kwargs
        Line properties of the curve of the best kind.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> flow = cr.design.ProcessModel(gain=1.2, lag=3.0, dead_time=2.0)
    >>> plan = cr.experiment.plan(flow, time=60, amplitude=5, rate=5, noise=0.1)
    >>> cplt = cr.plots.experiment_plot(plan)
    >>> [text.get_text() for text in cplt.figure.axes[0].get_legend().get_texts()]
    ['3-2-1-1', 'one step', 'other candidates']
    """
    curve, of_time = plan.curve, plan.want == "dead_time"
    shape: dict[str, Any] = {"size": (8.0, 6.4), "heights": (2.0, 1.0), "sharex": False}
    with style.canvas(ax, 2, title=title, default_title=plan._title(), **shape) as (upper, lower):
        factor, unit = axis_time_unit(float(curve.time[-1]), upper)
        scale, name = time_unit(plan.std) if of_time else (1.0, "deg" * (plan.want == "phase"))
        best, step = plan.candidates[0], plan.step
        looks = {**style.model_looks(0), "marker": "o", "label": best.kind, **kwargs}
        lines = list(upper.loglog(factor * curve.time, scale * curve.best, **looks))
        plain_looks = {**style.model_looks(1), "marker": "s", "label": step.kind}
        lines += upper.loglog(factor * curve.time, scale * curve.step, **plain_looks)
        others = [one.std for one in plan.candidates if one not in (best, step)]
        at = np.full(len(others), factor * plan.duration)
        dots: dict[str, Any] = {"color": style.NOISE, "markersize": 14}
        lines += upper.plot(at, scale * np.array(others), "_", label="other candidates", **dots)
        if curve.first is not None:
            today = [factor * curve.first[0]], [scale * curve.first[1]]
            lines += upper.plot(*today, "D", color=style.MEASURED, label="today")
        upper.set(xlabel=f"length of the test [{unit}]", ylabel=with_unit("standard error", name))
        for axis in (upper.xaxis, upper.yaxis):
            style.plain_logarithms(axis)
        factor, unit = axis_time_unit(plan.duration, lower)
        drive = lower.step(factor * plan.time, plan.command, where="post", color=style.INPUT)
        lower.set(xlabel=f"time [{unit}]", ylabel=f"input: {plan.kind}")
        return style.finished((upper, lower), [lines, drive], loc="best")
