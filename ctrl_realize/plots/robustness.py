"""Plots of robustness: to the dead time, and to the uncertainty of the identification."""

from __future__ import annotations

from functools import partial
from typing import Any

import control as ct
import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from ..design.loops.delay_robustness_result import DelayRobustness
from ..design.loops.robust_stability import RobustnessCheck, UncertaintyBound
from ..identification.plausible import PlausibleModels
from ..numerics.arrays import FloatArray
from ..numerics.constants import SMALLEST
from . import style
from .shared_docs import documented
from .style import HERTZ, axis_time_unit, decibel, frequency_axis

_LAGS_SHOWN = 6.0  # longest lags that are shown of a step response
_FEWEST_SHOWN, _MOST_SHOWN = 50, 2000  # samples
_TURN_SHOWN = 400.0  # deg of phase


@documented()
def delay_robustness_plot(
    result: DelayRobustness, *, ax: style.AxesLike = None, title: str | None = None
) -> ct.ControlPlot:
    """Draw the modulus margin against the plant's dead time, with the interval shaded.

    Parameters
    ----------
    result : DelayRobustness

    Examples
    --------
    >>> import control as ct
    >>> import ctrl_realize as cr
    >>> plant = cr.delayed_ss(ct.tf([1], [0.08, 1]), dead_time=0.1, dt=0.01)
    >>> predictor = cr.design.smith_predictor(plant, ct.tf([2.0, -1.8], [1, -1], 0.01))
    >>> result = cr.design.delay_robustness(plant, predictor, (0.08, 0.12))
    >>> cplt = cr.plots.delay_robustness_plot(result)
    >>> cplt.figure.axes[0].get_xlabel(), cplt.figure.axes[0].get_ylabel()
    ('dead time of the plant [ms]', 'modulus margin')
    """
    with style.canvas(ax, title=title, default_title="Robustness to the dead time") as (axes,):
        times = result.dead_times
        factor, unit = axis_time_unit(float(times.max()), axes)
        low, high = result.dead_time_interval
        axes.axvspan(low * factor, high * factor, color=style.BAND, alpha=0.2, label="interval")
        axes.axvline(result.nominal_dead_time * factor, color=style.INPUT, linewidth=1)
        looks: dict[str, Any] = {"color": style.MODEL, "marker": "o", "label": "min |1 + L|"}
        lines = axes.plot(times * factor, result.modulus_margin, **looks)
        bad = ~result.stable_at
        if bad.any():
            axes.plot(
                times[bad] * factor, np.zeros(bad.sum()), "x", color=style.INK, label="unstable"
            )
        axes.set(xlabel=f"dead time of the plant [{unit}]", ylabel="modulus margin")
        axes.set_ylim(bottom=0)
        return style.finished([axes], [lines], loc="lower right")


@documented("sequence of three Axes")
def plausible_plot(
    models: PlausibleModels, *, ax: style.AxesLike = None, title: str | None = None
) -> ct.ControlPlot:
    """Draw the band of models that the data do not rule out: step response, gain and phase.

    Parameters
    ----------
    models : PlausibleModels

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> record = cr.bench.valve().step_record(16, rng=5)
    >>> models = cr.identify(record, structures=[(3, 3)]).fit.plausible_models
    >>> cplt = cr.plots.plausible_plot(models)
    >>> [axes.get_ylabel() for axes in cplt.figure.axes]
    ['step response', 'gain [dB]', 'phase [deg]']
    """
    slowest = [np.max(1 / np.maximum(-one.poles.real, SMALLEST)) for one in models.models]
    waits = [one.dead_time for one in models.models]
    settled = np.median(waits) + _LAGS_SHOWN * np.median(slowest)
    count = int(np.clip(settled / models.dt, _FEWEST_SHOWN, _MOST_SHOWN))
    longest = count * models.dt
    steps = np.stack([system.step(count) for system in models.systems])
    omega = np.geomspace(0.3 / longest, np.pi / models.dt, 400)
    responses = models.frequency_response(omega)
    phase = np.degrees(np.unwrap(np.angle(responses)))
    # a loop is decided where the phase turns once
    shown = np.median(phase - phase[:, :1], axis=0) > -_TURN_SHOWN
    rows = (steps, decibel(np.abs(responses[:, shown])), phase[:, shown])
    with style.canvas(
        ax, 3, title=title, default_title="Models that the data do not rule out", size=(8.0, 8.0),
        sharex=False,
    ) as axes:  # fmt: skip
        factor, unit = axis_time_unit(longest, axes[0])
        across = (factor * models.dt * np.arange(count), *[omega[shown] / (2 * np.pi)] * 2)
        lines = []
        for one, x, values in zip(axes, across, rows, strict=True):
            one.fill_between(
                x, values.min(axis=0), values.max(axis=0), color=style.BAND, alpha=0.35
            )
            middle = np.median(values, axis=0)
            lines.append(one.plot(x, middle, color=style.MODEL, label="median and extremes"))
        axes[0].set(xlabel=f"time [{unit}]", ylabel="step response")
        axes[1].set_ylabel("gain [dB]")
        axes[2].set_ylabel("phase [deg]")
        for one in axes[1:]:
            frequency_axis(one)
        return style.finished(axes, lines, loc="best")


@documented()
def uncertainty_plot(
    result: UncertaintyBound, *, ax: style.AxesLike = None, title: str | None = None
) -> ct.ControlPlot:
    """Draw the multiplicative uncertainty and its two parts.

    Parameters
    ----------
    result : UncertaintyBound

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> plant = cr.design.ProcessModel(gain=1.0, lag=0.08, dead_time=0.03).system(0.001)
    >>> bound = cr.design.uncertainty_bound([1.3 * plant], plant, dead_time_interval=(0.025, 0.035))
    >>> cplt = cr.plots.uncertainty_plot(bound)
    >>> [text.get_text() for text in cplt.figure.axes[0].get_legend().get_texts()]
    ['bound', 'spread of the systems', 'uncertain dead time']
    """
    with style.canvas(ax, title=title, default_title="Multiplicative uncertainty") as (axes,):
        hertz = result.omega / HERTZ
        curve = partial(_positive_loglog, axes, hertz)
        lines = curve(result.bound, color=style.MODEL, label="bound")
        lines += curve(result.spread, color=style.MEASURED, label="spread of the systems")
        lines += curve(result.delay_part, color=style.BAND, label="uncertain dead time")
        axes.axhline(1, color=style.INPUT, linewidth=1)
        axes.set(xlabel="frequency [Hz]", ylabel="relative error")
        return style.finished([axes], [lines], loc="upper left")


@documented()
def robustness_plot(
    result: RobustnessCheck, *, ax: style.AxesLike = None, title: str | None = None
) -> ct.ControlPlot:
    """Draw ``|T|`` and the inverse of the uncertainty bound.

    Parameters
    ----------
    result : RobustnessCheck

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> plant = cr.design.ProcessModel(gain=1.0, lag=0.08, dead_time=0.03).system(0.001)
    >>> bound = cr.design.uncertainty_bound([1.3 * plant], plant, dead_time_interval=(0.025, 0.035))
    >>> cplt = cr.plots.robustness_plot(bound.check(cr.design.pid(plant)))
    >>> [text.get_text() for text in cplt.figure.axes[0].get_legend().get_texts()]
    ['|T|', '1 / uncertainty', 'margin 2.59']
    """
    word = "Robustly stable" if result.robust else "Robust stability not guaranteed"
    with style.canvas(ax, title=title, default_title=word) as (axes,):
        bound = result.uncertainty
        hertz = bound.omega / HERTZ
        lines = _positive_loglog(axes, hertz, result.complementary, color=style.MODEL, label="|T|")
        with np.errstate(divide="ignore"):
            ceiling = 1 / bound.bound
        dashed = {"color": style.BAND, "linestyle": style.DASHES[0]}
        lines += _positive_loglog(axes, hertz, ceiling, label="1 / uncertainty", **dashed)
        at = result.omega_critical / HERTZ
        axes.axvline(at, color=style.INPUT, linewidth=1, label=f"margin {result.margin:.3g}")
        axes.set(xlabel="frequency [Hz]", ylabel="magnitude")
        axes.set_ylim(bottom=max(1e-4, float(result.complementary.min())))
        # Far below the critical frequency both curves are flat.
        axes.set_xlim(max(float(hertz[0]), at / 300), float(hertz[-1]))
        return style.finished([axes], [lines])


def _positive_loglog(axes: Axes, x: FloatArray, y: FloatArray, **looks: Any) -> list[Line2D]:
    """Draw the positive values; a logarithmic axis accepts no others, and no empty curve."""
    keep = (y > 0) & np.isfinite(y)
    return list(axes.loglog(x[keep], y[keep], **looks)) if keep.any() else []
