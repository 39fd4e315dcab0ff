"""Plots of an output-error fit: data, model, residual, and dead times of all structures."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import control as ct
import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from .._checks import integer
from .._wording import interval_in_time, time_within
from ..data import Record
from ..delayed import DelayedStateSpace
from ..delayed.simulation import simulate_record
from ..errors import OptionError
from ..identification.output_error.repeatability import distinct
from ..identification.output_error.result import OutputErrorFit
from ..identification.several_inputs_result import SeveralInputsFit
from ..identification.step.steps import unit_step
from ..numerics.constants import VERY_STRONG
from ..numerics.signals.correlation import fit_percent
from . import style
from .names import plain, with_unit, wrapped
from .records import draw_beside
from .shared_docs import documented
from .style import axis_time_unit

_MOST_STRUCTURES = 8
_MOST_RECORDS = 40  # drawn behind their mean
_NO_FIT = "no output-error fit; use fit_output_error or identify(record)"
MOST_BESIDE = 12
"""Most records that are drawn each beside the model."""


@documented("sequence of three Axes")
def fit_plot(
    fit: OutputErrorFit | DelayedStateSpace,
    *,
    ax: style.AxesLike = None,
    title: str | None = None,
    **kwargs: Any,
) -> ct.ControlPlot:
    """Draw the fitted record, the model, the residual, and the dead times of all structures.

    For several step records, their mean and the individual records are drawn.

    Parameters
    ----------
    fit : OutputErrorFit, or model with one as its `fit`
    **kwargs
        Line properties of the model's response.

    Raises
    ------
    OptionError
        The model was not found by an output-error fit.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> record = cr.bench.valve().step_record(16, rng=5)
    >>> sys = cr.fit_output_error(record, structures=[(3, 3)])
    >>> cplt = cr.plots.fit_plot(sys)
    >>> cplt.figure.axes[-1].get_xlabel()
    'dead time [ms]'
    """
    result = style.result_of(fit, OutputErrorFit, _NO_FIT)
    rows = evidence_height(result)
    rising = result.fitted[-1] >= result.fitted[0]
    with style.canvas(
        ax, 3, title=title, default_title=_name(result),
        size=(8.0, 4.8 + rows), heights=(2.2, 1.2, rows), sharex=False,
    ) as axes:  # fmt: skip
        lines = data_and_model(axes[0], axes[1], result, **kwargs)
        evidence = _evidence(axes[2], result)
        return style.finished(
            axes, [*lines, evidence], loc="lower right" if rising else "upper right"
        )


@documented()
def dead_time_plot(
    fit: OutputErrorFit | DelayedStateSpace,
    *,
    ax: style.AxesLike = None,
    title: str | None = None,
    **kwargs: Any,
) -> ct.ControlPlot:
    """Draw the dead times with intervals of all structures and other estimates.

    Parameters
    ----------
    fit : OutputErrorFit, or model with one as its `fit`
    **kwargs
        Line properties of the points.

    Raises
    ------
    OptionError
        The model was not found by an output-error fit.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> record = cr.bench.valve().step_record(16, rng=5)
    >>> sys = cr.fit_output_error(record, structures=[(3, 3)])
    >>> cplt = cr.plots.dead_time_plot(sys)
    >>> cplt.figure.axes[0].get_xlabel()
    'dead time [ms]'
    """
    result = style.result_of(fit, OutputErrorFit, _NO_FIT)
    size = (8.0, 1.0 + evidence_height(result))
    with style.canvas(ax, title=title, default_title=_name(result), size=size) as (axes,):
        return style.finished([axes], [_evidence(axes, result, **kwargs)], legends=())


@documented("sequence of Axes, one for each record,")
def each_record_plot(
    system: DelayedStateSpace,
    records: Sequence[Record] | None = None,
    *,
    output: int = 0,
    ax: style.AxesLike = None,
    title: str | None = None,
    **kwargs: Any,
) -> ct.ControlPlot:
    """Draw each record beside the model that is simulated with its input.

    Parameters
    ----------
    system : DelayedStateSpace
    records : sequence of Record, optional
        Without missing samples; the first 12 are drawn. Default: those of its `fit`.
    output : int, optional
        Channel to show.
    **kwargs
        Line properties of the model's response.

    Raises
    ------
    OptionError
        There are no records.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> valve = cr.bench.valve()
    >>> records = [valve.step_record(16, rng=seed) for seed in (5, 6)]
    >>> sys = cr.fit_output_error(records, structures=[(3, 3)])
    >>> cplt = cr.plots.each_record_plot(sys)
    >>> [axes.get_title(loc="left") for axes in cplt.figure.axes]
    ['valve_16mA (0), 99.7 %', 'valve_16mA (1), 99.7 %']
    """
    held = () if system.fit is None else system.fit.records
    given = [
        record
        for record in (held if records is None else records)
        if not np.isnan(record.input).any()
    ]
    shown = given[:MOST_BESIDE]
    if not shown:
        raise OptionError(
            "no records with a complete input; expected a model with its fit, or records"
        )
    row = integer(output, "output", 0, shown[0].noutputs - 1)
    names = distinct(record.name for record in shown)
    columns = 1 if len(shown) == 1 else 2
    rows = each_record_rows(len(given))
    with style.canvas(
        ax, rows, title=title, size=(8.0, 1.0 + 1.6 * rows), columns=columns, sharex=False
    ) as axes:
        lines: list[list[Line2D]] = []
        for axis, record, name in zip(axes, shown, names, strict=False):
            measured = np.atleast_2d(record.output)[row]
            model = simulate_record(system, record, "estimate", gaps=True)[row]
            seen = ~np.isnan(measured)
            lines.append(draw_beside(axis, record, row, [(model, {"label": "model", **kwargs})]))
            fit = float(fit_percent(measured[seen], model[seen]))
            axis.set_title(f"{plain(name, 30)}, {fit:.1f} %", loc="left", fontsize=10)
        for axis in axes[len(shown) :]:
            axis.set_visible(False)
            lines.append([])
        return style.finished(axes, lines, columns=columns, loc="lower right")


@documented("sequence of two Axes")
def several_inputs_plot(
    fit: SeveralInputsFit | DelayedStateSpace,
    *,
    ax: style.AxesLike = None,
    title: str | None = None,
    **kwargs: Any,
) -> ct.ControlPlot:
    """Draw output and model, and below the response to each input.

    Parameters
    ----------
    fit : SeveralInputsFit, or model with one as its `fit`
    **kwargs
        Line properties of the model's response.

    Raises
    ------
    OptionError
        The model has no fit of several inputs.

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> t = np.arange(200.0)
    >>> u = np.stack([1.0 * (t > 20), 1.0 * (t > 110)])
    >>> y = np.stack([1.0 * (t > 25), 1.0 * (t > 118)]).sum(axis=0)
    >>> y = y + 0.01 * np.random.default_rng(0).standard_normal(t.size)
    >>> sys = cr.identify(cr.Record(t, u, y), structures="FOPDT")
    >>> cplt = cr.plots.several_inputs_plot(sys)
    >>> cplt.figure.axes[-1].get_xlabel()
    'time [s]'
    """
    result = style.result_of(fit, SeveralInputsFit, "no fit of several inputs; give structures=")
    record, total = result.records[0], result.responses.sum(axis=0)
    measured = np.ravel(record.output)
    with style.canvas(ax, 2, title=title, default_title=record.name) as (upper, lower):
        factor, unit = axis_time_unit(float(np.abs(record.time[[0, -1]]).max()), lower)
        time, looks = factor * record.time, {**style.model_looks(), "label": "model", **kwargs}
        above = list(upper.plot(time, measured, color=style.MEASURED, lw=1.5, label="measured"))
        above += upper.plot(time, total + np.nanmean(measured - total), **looks)
        below: list[Line2D] = []
        for i, (name, response) in enumerate(zip(result.inputs, result.responses, strict=True)):
            own: dict[str, Any] = {"color": style.model_colour(i + 1), "label": plain(name, 30)}
            below += lower.plot(time, response, **own)
        upper.set_ylabel(with_unit(record.output_labels[0], record.output_units[0]))
        lower.set(xlabel=f"time [{unit}]", ylabel="response to")
        return style.finished([upper, lower], [above, below], legends=(0, 1), loc="above")


def each_record_rows(count: int) -> int:
    """Rows of axes of `each_record_plot` for a number of records."""
    return 1 if count == 1 else -(-min(count, MOST_BESIDE) // 2)


def _name(result: OutputErrorFit) -> str:
    return result.records[0].name if result.records else ""


def data_and_model(
    upper: Axes, lower: Axes, result: OutputErrorFit, **kwargs: Any
) -> list[list[Line2D]]:
    """Draw data and model of the records, and below what is left, with the noise."""
    factor, unit = axis_time_unit(float(np.abs(result.time[[0, -1]]).max()), lower)
    time = factor * result.time
    looks = {**style.model_looks(), "label": "model", **kwargs}
    label = f"mean of {len(result.records)} records" if _averaged(result) else "measured"
    data = list(upper.plot(time, result.measured, color=style.MEASURED, lw=1.5, label=label))
    data += upper.plot(time, result.fitted, **looks)
    if _averaged(result):
        data += _each_record(upper, result, factor)
    left = result.measured - result.fitted
    lower.axhspan(
        -2 * result.noise, 2 * result.noise, color=style.NOISE, alpha=0.3, linewidth=0,
        label="noise (2 std)",
    )  # fmt: skip
    rest = list(lower.plot(time, left, color=style.MEASURED, linewidth=0.9))
    lower.axhline(0.0, color=style.INK, linewidth=0.8)
    lower.sharex(upper)
    start = _first_motion(result)
    upper.set_xlim(time[start], time[-1])
    upper.tick_params(labelbottom=False)
    upper.set_ylabel(_output_label(result))
    lower.set(xlabel=f"time [{unit}]", ylabel="residual")
    lower.legend(loc="upper right", fontsize=10)
    return [data, rest]


def _each_record(axes: Axes, result: OutputErrorFit, factor: float) -> list[Line2D]:
    """Draw every record behind their mean, scaled to a unit step."""
    lines: list[Line2D] = []
    every = max(1, -(-len(result.records) // _MOST_RECORDS))
    ratios = np.ones(len(result.records)) if result.gains is None else result.gains.ratios
    for record, ratio in zip(result.records[::every], ratios[::every], strict=True):
        step = unit_step(record, remove_drift=False)
        time = factor * step.dt * np.arange(-step.pre_step.size, step.n_samples)
        values = np.concatenate([step.pre_step, step.output]) / ratio
        lines += axes.plot(
            time, values, color=style.MEASURED, linewidth=0.6, alpha=0.35, zorder=1,
            label=None if lines else f"{len(result.records)} records",
        )  # fmt: skip
    return lines


def _first_motion(result: OutputErrorFit) -> int:
    """Start the plot slightly before the response of the model."""
    moved = np.abs(result.fitted - result.fitted[0]) > 0.01 * float(np.ptp(result.fitted))
    first = int(np.argmax(moved)) if moved.any() else 0
    return max(0, first - max((result.time.size - first) // 8, round(1.5 * result.delay)))


def _averaged(result: OutputErrorFit) -> bool:
    """Whether steps were averaged; records with other inputs are concatenated and have no onset."""
    return len(result.records) > 1 and not np.isnan(result.onset)


def _output_label(result: OutputErrorFit) -> str:
    if _averaged(result):  # records with different steps were scaled before they were averaged
        return "unit step\nresponse"
    label = result.records[0].output_labels[0] if result.records else "y"
    return wrapped(with_unit("output" if label == "y" else label, result.output_unit), 18)


def evidence_height(result: OutputErrorFit) -> float:
    """Return the height in inches that the rows of `_evidence` need."""
    return 0.75 + 0.23 * len(_evidence_rows(result))


def _evidence_rows(
    result: OutputErrorFit,
) -> list[tuple[str, float, tuple[float, float] | None, str]]:
    """List dead times with intervals: structures not ruled out, then other estimates."""
    rows: list[tuple[str, float, tuple[float, float] | None, str]] = []
    for line in result.structures:
        if line.interval is not None and line.delta_bic <= VERY_STRONG:
            name = f"order {line.order}, degree {line.relative_degree}"
            rows.append((name, line.dead_time, line.interval, style.MODEL))
    rows = rows[:_MOST_STRUCTURES]
    rows += [(name, seen, None, style.MEASURED) for name, seen in result.delay_estimates.items()]
    return rows or [("estimate", result.dead_time, result.interval, style.MODEL)]


def _evidence(axes: Axes, result: OutputErrorFit, **kwargs: Any) -> list[Line2D]:
    """Draw one row for each structure that is not ruled out, and one for each other estimate."""
    rows = _evidence_rows(result)
    low, high = result.interval
    factor, unit = axis_time_unit(max(high, *(seen for _, seen, _, _ in rows)), axes)
    axes.axvspan(factor * low, factor * high, color=style.BAND, alpha=0.22, linewidth=0)
    axes.axvline(factor * result.dead_time, color=style.MODEL, linewidth=1.5)
    points: list[Line2D] = []
    for height, (_, seen, interval, colour) in enumerate(rows):
        if interval is not None:
            ends = [factor * bound for bound in interval]
            axes.plot(ends, [height, height], color=colour, linewidth=2.5, alpha=0.5)
        looks = {"color": colour, "marker": "o", "linestyle": "none", **kwargs}
        points += axes.plot([factor * seen], [height], **looks)
    axes.set_yticks(range(len(rows)), [plain(name, 40) for name, *_ in rows], fontsize=10)
    axes.set(ylim=(len(rows) - 0.4, -0.6), xlabel=f"dead time [{unit}]")
    axes.grid(visible=False, axis="y")
    said = f"{time_within(result.dead_time, low, high)} ({interval_in_time(low, high)})"
    axes.set_title(said, loc="left", fontsize=11)
    return points
