"""Plots of residuals, predictions, and of a delay that was seen in several ways."""

from __future__ import annotations

from typing import Any

import control as ct
import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from ..checks import whole
from ..errors import OptionError
from ..identification.channel_fit_result import ChannelFit
from ..identification.channels import ChannelRealization
from ..identification.cross_check import DelayCheck
from ..identification.from_io import ImpulseEstimate
from ..identification.prediction import Prediction
from ..identification.residuals import ResidualCheck
from ..numerics.arrays import FloatArray
from ..signals import Record
from . import style
from .impulses import impulse_plot


def residual_plot(
    check: ResidualCheck,
    *,
    output: int = 0,
    input: int = 0,
    ax: style.AxesLike = None,
    title: str | None = None,
    **kwargs: Any,
) -> ct.ControlPlot:
    """Draw measured and simulated output, and the correlations of what is left with its bounds.

    Parameters
    ----------
    check : ResidualCheck
    output, input : int, optional
        Channels to show.
    ax : sequence of three Axes, or Figure, optional
    title : str, optional
    **kwargs
        Line properties of the simulated output.

    Returns
    -------
    control.ControlPlot

    Examples
    --------
    >>> import control as ct
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> from ctrl_realize import plots
    >>> plant = cr.DelayedStateSpace(ct.ss([[0.8]], [[1.0]], [[0.2]], [[0.0]], 0.1), 5)
    >>> u, noise = np.random.default_rng(0).standard_normal((2, 500))
    >>> record = cr.Record(0.1 * np.arange(500), u, plant.simulate(u) + 0.05 * noise)
    >>> cplt = plots.residual_plot(cr.check_residuals(plant, record))
    >>> cplt.figure.axes[-1].get_xlabel()
    'lag [samples]'
    """
    row = whole(output, "output", 0, check.fit_percent.size - 1)
    column = whole(input, "input", 0, check.cross.shape[1] - 1)
    with style.context():
        axes = style.axes_for(ax, 3, size=(8.0, 7.0), heights=(2.0, 1.0, 1.0), sharex=False)
        label = f"simulated, fit {check.fit_percent[row]:.1f} %"
        above = _signals(
            axes[0], check.record, np.atleast_2d(check.simulated)[row], row, label, kwargs
        )
        lags = check.lags
        own = _stems(axes[1], lags[lags >= 0], check.autocorrelation[row], check.bound)
        cross = _stems(axes[2], lags, check.cross[row, column], check.cross_bound[row, column])
        axes[1].set_ylabel("residual with\nitself")
        axes[2].set_ylabel("residual with\ninput before")
        axes[2].set_xlabel("lag [samples]")
        return style.finished(
            axes, [above, own, cross], title=title, own_figure=ax is None, loc="above"
        )


def prediction_plot(
    prediction: Prediction,
    *,
    output: int = 0,
    ax: style.AxesLike = None,
    title: str | None = None,
    **kwargs: Any,
) -> ct.ControlPlot:
    """Draw a predicted output over the measured one.

    Parameters
    ----------
    prediction : Prediction
    output : int, optional
        Channel to show.
    ax : Axes or Figure, optional
    title : str, optional
    **kwargs
        Line properties of the prediction.

    Returns
    -------
    control.ControlPlot

    Examples
    --------
    >>> import control as ct
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> from ctrl_realize import plots
    >>> plant = cr.DelayedStateSpace(ct.ss([[0.8]], [[1.0]], [[0.2]], [[0.0]], 0.1), 5)
    >>> u, noise = np.random.default_rng(0).standard_normal((2, 300))
    >>> record = cr.Record(0.1 * np.arange(300), u, plant.simulate(u) + 0.05 * noise)
    >>> cplt = plots.prediction_plot(cr.predict(plant, record, 10))
    >>> [text.get_text() for text in cplt.figure.axes[0].get_legend().get_texts()]
    ['measured', '10 ahead, fit 86.6 %']
    """
    row = whole(output, "output", 0, prediction.fit_percent.size - 1)
    with style.context():
        axes = style.axes_for(ax)
        label = f"{prediction.steps} ahead, fit {prediction.fit_percent[row]:.1f} %"
        values = np.atleast_2d(prediction.output)[row]
        lines = _signals(axes[0], prediction.record, values, row, label, kwargs)
        return style.finished(axes, [lines], title=title, own_figure=ax is None, loc="above")


def delay_check_plot(
    check: DelayCheck, *, ax: style.AxesLike = None, title: str | None = None, **kwargs: Any
) -> ct.ControlPlot:
    """Draw the intervals of a delay that was seen in several ways, and what they agree on.

    Parameters
    ----------
    check : DelayCheck
    ax : Axes or Figure, optional
    title : str, optional
    **kwargs
        Line properties of the intervals.

    Returns
    -------
    control.ControlPlot

    Examples
    --------
    >>> import control as ct
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> from ctrl_realize import plots
    >>> plant = cr.delayed_ss(ct.tf([2.0], [0.3, 1]), dead_time=0.125, dt=0.01)
    >>> rng = np.random.default_rng(0)
    >>> u = np.repeat(rng.choice([-1.0, 1.0], 60), 15)
    >>> y = plant.simulate(u) + 0.05 * rng.standard_normal(u.size)
    >>> check = cr.check_delay(cr.Record(0.01 * np.arange(u.size), u, y), order=1)
    >>> cplt = plots.delay_check_plot(check)
    >>> cplt.figure.axes[0].get_xlabel()
    'dead time, or bound ◂ [ms]'
    """
    with style.context():
        axes = style.axes_for(ax, size=(8.0, 1.6 + 0.5 * len(check.views)))
        factor, unit = style.time_unit(max(view.high for view in check.views))
        lines: list[Line2D] = []
        for place, view in enumerate(reversed(check.views)):
            bound = view.kind == "upper bound"
            looks = {"color": style.NOISE if bound else style.MODEL, "linewidth": 3.0, **kwargs}
            if view.doubt:  # it does not count
                looks = {**looks, "alpha": 0.35}
            lines += axes[0].plot(factor * np.array([view.low, view.high]), [place, place], **looks)
            mark = "<" if bound else "o"
            points = {"color": looks["color"], "alpha": looks.get("alpha"), "markersize": 8}
            axes[0].plot(factor * view.value, place, mark, **points)
        if check.common is not None:
            low, high = (factor * edge for edge in check.common)
            axes[0].axvspan(low, high, color=style.BAND, alpha=0.3, label="all agree", linewidth=0)
        names = [
            f"{view.method}\n({view.source}{', in doubt' if view.doubt else ''})"
            for view in reversed(check.views)
        ]
        axes[0].set_yticks(range(len(names)), names)
        axes[0].set_ylim(-0.6, len(names) - 0.4)
        axes[0].set_xlabel(f"dead time, or bound ◂ [{unit}]")
        return style.finished(axes, [lines], title=title, own_figure=ax is None, loc="above")


def channel_fit_plot(fit: ChannelFit, *, record: int = 0, **kwargs: Any) -> ct.ControlPlot:
    """Draw how a fitted model follows one of its records, and the correlations of what is left.

    Parameters
    ----------
    fit : ChannelFit
    record : int, optional
        Which of the records without gaps.
    **kwargs
        Passed on to `residual_plot`.

    Returns
    -------
    control.ControlPlot

    Examples
    --------
    >>> import control as ct
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> from ctrl_realize import plots
    >>> plant = cr.DelayedStateSpace(ct.ss([[0.8]], [[1.0]], [[0.2]], [[0.0]], 0.1), 5)
    >>> u, noise = np.random.default_rng(0).standard_normal((2, 500))
    >>> record = cr.Record(0.1 * np.arange(500), u, plant.simulate(u) + 0.05 * noise)
    >>> cplt = plots.channel_fit_plot(cr.fit_channels(record, 1).fit)
    >>> cplt.figure.axes[-1].get_xlabel()
    'lag [samples]'
    """
    if not fit.checks:
        raise OptionError("all records have gaps; there is no simulation to draw them beside")
    return residual_plot(fit.checks[whole(record, "record", 0, len(fit.checks) - 1)], **kwargs)


def channels_plot(
    fit: ChannelRealization, *, ax: style.AxesLike = None, title: str | None = None, **kwargs: Any
) -> ct.ControlPlot:
    """Draw the responses of all channels, with a line where the delay of each ends.

    Parameters
    ----------
    fit : ChannelRealization
    ax : array of Axes (outputs x inputs) or Figure, optional
    title : str, optional
    **kwargs
        Passed on to `impulse_plot`.

    Returns
    -------
    control.ControlPlot

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> from ctrl_realize import plots
    >>> pulse = np.r_[0.0, 0.8 ** np.arange(80)]
    >>> late = [np.r_[np.zeros(d), pulse][:60] for d in (3, 7)]
    >>> cplt = plots.channels_plot(cr.realize_channels(np.array(late)[:, None, :], 1, dt=0.1).fit)
    >>> [axes.get_title(loc="right") for axes in cplt.figure.axes]
    ['input 0 to output 0', 'input 0 to output 1']
    """
    drawn = impulse_plot(fit.impulse, ax=ax, title=title, **kwargs)
    factor, _ = style.time_unit(1.0, drawn.axes[-1, 0])
    for place, axes in np.ndenumerate(drawn.axes):
        if fit.delays[place] >= 0:
            end = factor * fit.delays[place] * fit.impulse.dt
            axes.axvline(end, color=style.TRUTH, linestyle=":")
    return drawn


def impulse_estimate_plot(estimate: ImpulseEstimate, *args: Any, **kwargs: Any) -> ct.ControlPlot:
    """Draw an estimated impulse response in its band of two standard deviations.

    Parameters
    ----------
    estimate : ImpulseEstimate
    *args, **kwargs
        As for `impulse_plot`.

    Returns
    -------
    control.ControlPlot

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> from ctrl_realize import plots
    >>> u, noise = np.random.default_rng(0).standard_normal((2, 2000))
    >>> y = 3.0 * np.roll(u, 5) + 0.1 * noise
    >>> estimate = cr.impulse_from_io(cr.Record(0.01 * np.arange(2000), u, y), 20)
    >>> cplt = plots.impulse_estimate_plot(estimate)
    >>> cplt.figure.axes[0].get_ylabel()
    'impulse response [1/s]'
    """
    drawn = impulse_plot(estimate, *args, **kwargs)
    factor, _ = style.time_unit(1.0, drawn.axes[-1, 0])
    time = factor * estimate.time
    density = estimate.density.reshape(*drawn.axes.shape, -1)
    spread = 2 * (estimate.std / estimate.dt).reshape(density.shape)
    for place, axes in np.ndenumerate(drawn.axes):
        window, middle, wide = axes.get_xlim(), density[place], spread[place]
        axes.fill_between(
            time, middle - wide, middle + wide, color=style.BAND, alpha=0.3, linewidth=0
        )
        axes.set_xlim(window)
    return drawn


def _signals(
    axes: Axes, record: Record, values: FloatArray, row: int, label: str, looks: dict[str, Any]
) -> list[Line2D]:
    factor, unit = style.time_unit(float(np.ptp(record.time)), axes)
    time = factor * record.time
    measured = np.atleast_2d(record.output)[row]
    settings = {"color": style.MODEL, "linestyle": style.DASHES[0], "label": label, **looks}
    lines = axes.plot(time, measured, color=style.MEASURED, label="measured")
    lines += axes.plot(time, values, **settings)
    axes.set_ylabel(style.wrapped(record.output_labels[row], 16))
    axes.set_xlabel(f"time [{unit}]")
    return list(lines)


def _stems(axes: Axes, lags: FloatArray, rho: FloatArray, bound: float) -> list[Line2D]:
    axes.axhspan(-bound, bound, color=style.BAND, alpha=0.3, linewidth=0)
    axes.vlines(lags, 0, rho, color=style.MEASURED, linewidth=1.5)
    return list(axes.plot(lags, rho, "o", color=style.MEASURED, markersize=3.5))
