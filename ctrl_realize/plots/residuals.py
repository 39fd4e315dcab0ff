"""Plots of simulated and measured outputs, and of the residual."""

from __future__ import annotations

from typing import Any

import control as ct
import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from .._checks import integer
from ..errors import OptionError
from ..identification.state_space_fit.result import StateSpaceFit
from ..identification.validation.comparison import ModelComparison
from ..identification.validation.prediction import Prediction
from ..identification.validation.residuals_result import ResidualAnalysis
from ..numerics.arrays import FloatArray
from . import style
from .names import plain
from .records import draw_beside
from .shared_docs import documented
from .style import axis_time_unit


@documented("sequence of three Axes")
def residual_plot(
    check: ResidualAnalysis,
    *,
    output: int = 0,
    input: int = 0,
    ax: style.AxesLike = None,
    title: str | None = None,
    **kwargs: Any,
) -> ct.ControlPlot:
    """Draw measured and simulated output, and the correlations of the residual with their bounds.

    Parameters
    ----------
    check : ResidualAnalysis
    output, input : int, optional
        Channels to show.
    **kwargs
        Line properties of the simulated output.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> record = cr.bench.valve().step_record(16, rng=5)
    >>> model = cr.identify(record, method="scan")
    >>> cplt = cr.plots.residual_plot(cr.validation.analyse_residuals(model, record))
    >>> cplt.figure.axes[-1].get_xlabel()
    'lag [samples]'
    """
    row = integer(output, "output", 0, check.fit_percent.size - 1)
    column = integer(input, "input", 0, check.cross.shape[1] - 1)
    label = f"simulated, fit {check.fit_percent[row]:.1f} %"
    simulated = np.atleast_2d(check.simulated)[row]
    lags = check.lags
    with style.canvas(
        ax, 3, title=title, size=(8.0, 7.0), heights=(2.0, 1.0, 1.0), sharex=False
    ) as axes:
        above = draw_beside(axes[0], check.record, row, [(simulated, {"label": label, **kwargs})])
        own = _stems(axes[1], lags[lags >= 0], check.autocorrelation[row], check.bound)
        cross = _stems(axes[2], lags, check.cross[row, column], check.cross_bound[row, column])
        _label_correlations(*axes[1:])
        return style.finished(axes, [above, own, cross], loc="above")


@documented("sequence of four Axes")
def model_comparison_plot(
    comparison: ModelComparison,
    *,
    output: int = 0,
    input: int = 0,
    ax: style.AxesLike = None,
    title: str | None = None,
    **kwargs: Any,
) -> ct.ControlPlot:
    """Draw the outputs of several models on one record, their residuals, and correlations.

    The bands are those of the correlations of white noise that does not depend on the input.

    Parameters
    ----------
    comparison : ModelComparison
    output, input : int, optional
        Channels to show.
    **kwargs
        Line properties of the models.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> record = cr.bench.valve().step_record(16, rng=5)
    >>> model = cr.fit_output_error(record, structures=[(2, 2)])
    >>> cplt = cr.plots.model_comparison_plot(cr.compare({"two lags": model}, record))
    >>> [text.get_text() for text in cplt.figure.axes[0].get_legend().get_texts()]
    ['measured', 'two lags, 99.6 %']
    """
    first, record = comparison.checks[0], comparison.record
    row = integer(output, "output", 0, first.fit_percent.size - 1)
    column = integer(input, "input", 0, first.cross.shape[1] - 1)
    with style.canvas(
        ax, 4, title=title,
        size=(8.0, 8.4), heights=(2.2, 1.0, 1.0, 1.0), sharex=False,
    ) as axes:  # fmt: skip
        factor, unit = axis_time_unit(float(np.ptp(record.time)), axes[1])
        curves: list[tuple[FloatArray, dict[str, Any]]] = []
        lines: list[list[Line2D]] = [[], [], [], []]
        bound = max(float(check.cross_bound[row, column]) for check in comparison.checks)
        for axis, size in ((axes[2], first.bound), (axes[3], bound)):
            axis.axhspan(-size, size, color=style.BAND, alpha=0.3, linewidth=0)
        for number, (name, check) in enumerate(
            zip(comparison.names, comparison.checks, strict=True)
        ):
            looks = {**style.model_looks(number), **kwargs}
            label = f"{plain(name, 24)}, {check.fit_percent[row]:.1f} %"
            simulated, left = (
                np.atleast_2d(values)[row] for values in (check.simulated, check.residual)
            )
            curves.append((simulated, {"label": label, **looks}))
            thin = {**looks, "linestyle": "-", "linewidth": 0.9}
            lines[1] += axes[1].plot(factor * record.time, left, **thin)
            dots = {**looks, "marker": "o", "markersize": 3.0, "linewidth": 1.0}
            after = check.lags[check.lags >= 0]
            lines[2] += axes[2].plot(after, check.autocorrelation[row], **dots)
            lines[3] += axes[3].plot(check.lags, check.cross[row, column], **dots)
        lines[0] = draw_beside(axes[0], record, row, curves)
        axes[1].sharex(axes[0])
        axes[0].set_xlabel("")
        axes[0].tick_params(labelbottom=False)
        axes[1].set(xlabel=f"time [{unit}]", ylabel="residual")
        _label_correlations(*axes[2:])
        return style.finished(axes, lines, loc="above")


@documented()
def state_space_fit_plot(fit: StateSpaceFit, *, record: int = 0, **kwargs: Any) -> ct.ControlPlot:
    """Draw the fit of a model to one of its records, and the correlations of the residual.

    Parameters
    ----------
    fit : StateSpaceFit
    record : int, optional
        Number of the record, among those without gaps.
    **kwargs
        Passed on to `residual_plot`.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> record = cr.bench.valve().step_record(16, rng=5)
    >>> cplt = cr.plots.state_space_fit_plot(cr.fit_state_space(record, 1).fit)
    >>> cplt.figure.axes[-1].get_xlabel()
    'lag [samples]'
    """
    if not fit.checks:
        raise OptionError("all records have gaps; there is no simulation to plot")
    return residual_plot(fit.checks[integer(record, "record", 0, len(fit.checks) - 1)], **kwargs)


@documented()
def prediction_plot(
    prediction: Prediction,
    *,
    output: int = 0,
    ax: style.AxesLike = None,
    title: str | None = None,
    **kwargs: Any,
) -> ct.ControlPlot:
    """Draw predicted and measured output.

    Parameters
    ----------
    prediction : Prediction
    output : int, optional
        Channel to show.
    **kwargs
        Line properties of the prediction.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> record = cr.bench.valve().step_record(16, rng=5)
    >>> model = cr.identify(record, method="scan")
    >>> cplt = cr.plots.prediction_plot(cr.validation.predict(model, record, 10))
    >>> [text.get_text() for text in cplt.figure.axes[0].get_legend().get_texts()]
    ['measured', '10 ahead, fit 99.8 %']
    """
    row = integer(output, "output", 0, prediction.fit_percent.size - 1)
    label = f"{prediction.horizon} ahead, fit {prediction.fit_percent[row]:.1f} %"
    values = np.atleast_2d(prediction.output)[row]
    with style.canvas(ax, title=title) as (axes,):
        curves = [(values, {"label": label, **kwargs})]
        lines = draw_beside(axes, prediction.record, row, curves)
        return style.finished([axes], [lines], loc="above")


def _label_correlations(own: Axes, cross: Axes) -> None:
    own.set_ylabel("residual with\nitself")
    cross.set(xlabel="lag [samples]", ylabel="residual with\ninput before")


def _stems(axes: Axes, lags: FloatArray, rho: FloatArray, bound: float) -> list[Line2D]:
    """Draw correlations as vertical lines, with their bound."""
    axes.axhspan(-bound, bound, color=style.BAND, alpha=0.3, linewidth=0)
    axes.vlines(lags, 0, rho, color=style.MEASURED, linewidth=1.5)
    return list(axes.plot(lags, rho, "o", color=style.MEASURED, markersize=3.5))
