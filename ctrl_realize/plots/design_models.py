"""Plots of models made for design: reduced ones, and process models of few parameters."""

from __future__ import annotations

import control as ct
import numpy as np
from matplotlib.ticker import MaxNLocator

from ..design.balanced import BalancedReduction
from ..design.process_model import ProcessModel
from . import style
from .names import plain
from .scales import time_unit


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
    with style.canvas(ax, title=title, default_title="Balanced truncation") as (axes,):
        number = np.arange(1, found.singular_values.size + 1)
        values = np.maximum(found.singular_values, 1e-300)
        kept = found.order - found.kept_unstable
        lines = axes.semilogy(number[:kept], values[:kept], "o", color=style.MODEL, label="kept")
        label = f"cut off, error ≤ {found.error_bound:.3g}"
        lines += axes.semilogy(number[kept:], values[kept:], "o", color=style.NOISE, label=label)
        axes.set(xlabel="number", ylabel="Hankel singular value")
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        return style.finished([axes], [lines])


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
    with style.canvas(ax, title=title, default_title="Process model") as (axes,):
        span = model.dead_time + 6 * (model.lag + model.second_lag) + (model.lag == 0)
        time = np.linspace(0, span, 600)
        factor, unit = time_unit(span, axes)
        lines = axes.plot(
            time * factor,
            model.step(time),
            color=style.MODEL,
            label=plain(model.formula),
        )
        axes.set(xlabel=f"time [{unit}]", ylabel="step response")
        return style.finished([axes], [lines], loc="lower right")
