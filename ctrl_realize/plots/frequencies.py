"""Plots of frequency responses: measured ones with coherence, models, and joint fits."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import control as ct
import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from ..bench.truth import PlantTruth
from ..data import MeasuredFRF
from ..delayed import DelayedStateSpace
from ..frequency.frf_fit import FRFFit
from ..identification.joint.result import JointFit
from ..numerics.arrays import FloatArray
from . import style
from .fits import data_and_model
from .frf_comparison import FITTED, TRUSTED_COHERENCE, Curve, curves_of, mark_band, trusted_band
from .names import plain
from .shared_docs import documented
from .style import decibel, frequency_axis, phase_ticks

_FEW_POINTS = 60
"""Number of measured points up to which they are drawn as dots, too."""
_FINE = 400  # points of the curve of a joint model


@documented("sequence of two Axes, or of three with a coherence,")
def frf_plot(
    sysdata: Any,
    *,
    ax: style.AxesLike = None,
    frequency_hz: Sequence[float] | None = None,
    dead_time: float | None = None,
    title: str | None = None,
    **kwargs: Any,
) -> ct.ControlPlot:
    """Draw measured frequency responses and models (figures 2 and 8).

    Gain in dB and phase in degrees, at all frequencies that were measured. If a measurement has a
    coherence, it is drawn as well: points with a coherence below 0.95 are pale, and the trusted
    band, as of `compare_frf`, is shaded. Phases are unwrapped after removing the dead time of the
    model, so they are correct at any delay; those of pale points are shown in the turn nearest to
    the others.

    Parameters
    ----------
    sysdata : system or FRF, or sequence of them
        Frequency responses with one input and one output: `MeasuredFRF` or other frequency response
        data, discrete or continuous systems.
    frequency_hz : array_like, optional
        Frequencies for the models in Hz. Default: the range of the measurements.
    dead_time : float, optional
        Delay in s whose phase is removed before unwrapping. Default: that of the first model that
        has one.
    **kwargs
        Line properties of all curves.

    Raises
    ------
    UnsuitableSystemError
        Not a system, or one with several inputs or outputs.

    Examples
    --------
    >>> import control as ct
    >>> import ctrl_realize as cr
    >>> model = cr.delayed_ss(ct.tf([1], [0.08, 1]), dead_time=0.0289, dt=7.8125e-4)
    >>> cplt = cr.plots.frf_plot(model)
    >>> [axes.get_ylabel() for axes in cplt.axes[:, 0]]
    ['gain [dB]', 'phase [deg]']
    """
    items = list(sysdata) if isinstance(sysdata, list | tuple) else [sysdata]
    curves = curves_of(items, frequency_hz, dead_time)
    coherent = any(curve.coherence is not None for curve in curves)
    rows = 3 if coherent else 2
    size, heights = (8.0, 6.6 if coherent else 5.6), (2.0, 2.0, 0.8)[:rows]
    with style.canvas(ax, rows, title=title, size=size, heights=heights) as axes:
        lines: list[list[Line2D]] = [[] for _ in axes]
        models = 0
        for curve in curves:
            looks = {**_looks(curve, models), **kwargs}
            models += not curve.measured
            for row, values in enumerate((decibel(curve.response), curve.phase_deg)):
                lines[row] += _draw(axes[row], curve, values, looks)
            if curve.coherence is not None:
                lines[2] += axes[2].plot(
                    curve.frequency_hz, curve.coherence, color=looks["color"], linewidth=1.2
                )
        band = trusted_band(items)
        axes[0].set_ylabel("gain [dB]")
        axes[1].set_ylabel("phase [deg]")
        phase_ticks(axes[1])
        if coherent:
            axes[2].axhline(TRUSTED_COHERENCE, color=style.NOISE, linewidth=1.0, linestyle=":")
            axes[2].set(ylabel="coherence", ylim=(-0.02, 1.05))
        for one in axes:
            if band is not None:
                mark_band(one, band)
            frequency_axis(one, label=one is axes[-1])
        return style.finished(axes, lines, loc="lower left")


@documented("sequence of two Axes")
def frf_fit_plot(fit: FRFFit, *, ax: style.AxesLike = None, **kwargs: Any) -> ct.ControlPlot:
    """Draw a fitted and the measured frequency response.

    Parameters
    ----------
    fit : FRFFit
    **kwargs
        Passed on to `frf_plot`.

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> f = np.geomspace(0.1, 20, 80)
    >>> s = 2j * np.pi * f
    >>> frf = cr.MeasuredFRF(2 * np.exp(-0.0289 * s) / (0.08 * s + 1) ** 2, f)
    >>> cplt = cr.plots.frf_fit_plot(cr.fit_frf(frf, 2, dt=0.001).fit)
    >>> [text.get_text() for text in cplt.figure.axes[0].get_legend().get_texts()]
    ['measured', 'fit, order 2']
    """
    model = fit.response(2 * np.pi * fit.frequency_hz)
    measured = MeasuredFRF(fit.measured, fit.frequency_hz, name=fit.name or "measured")
    fitted = MeasuredFRF(model, fit.frequency_hz, name=f"{FITTED} {fit.order}")
    return frf_plot([measured, fitted], ax=ax, dead_time=fit.dead_time, **kwargs)


@documented("sequence of four Axes")
def joint_fit_plot(
    fit: JointFit | DelayedStateSpace,
    *,
    ax: style.AxesLike = None,
    title: str | None = None,
    **kwargs: Any,
) -> ct.ControlPlot:
    """Draw records and frequency response with the model that was fitted to both.

    The records and their residual above, gain and phase below, with the 95 % bands of the points.

    Parameters
    ----------
    fit : JointFit, or model with one as its `fit`
    **kwargs
        Line properties of the model's response to the records.

    Raises
    ------
    OptionError
        The model was not fitted to records and a frequency response.

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> bench = cr.bench.valve()
    >>> frf = bench.truth.frf(np.geomspace(0.1, 10.0, 20))
    >>> sys = cr.identify(bench.step_record(16, rng=5), frf=frf, order=1)
    >>> cplt = cr.plots.joint_fit_plot(sys)
    >>> cplt.figure.axes[-1].get_ylabel()
    'phase [deg]'
    """
    result = style.result_of(fit, JointFit, "no joint fit; use identify(record, frf=frf)")
    points = result.frf_fit
    hz = points.frequency_hz
    grid = np.geomspace(hz[0], hz[-1], _FINE)
    measured = MeasuredFRF(points.measured, hz, name=points.name or "measured")
    model = MeasuredFRF(result.response(2 * np.pi * grid), grid, name=f"{FITTED} {result.order}")
    name = result.records[0].name if result.records else ""
    with style.canvas(
        ax, 4, title=title, default_title=name, size=(8.0, 9.0),
        heights=(2.0, 1.0, 1.6, 1.6), sharex=False,
    ) as axes:  # fmt: skip
        lines = data_and_model(axes[0], axes[1], result, **kwargs)
        below = frf_plot([measured, model], ax=axes[2:], dead_time=result.dead_time)
        part = result.agreement.radius / np.abs(points.measured)
        _band(axes[2], hz, 20 * np.log10(1 + part), -20 * np.log10(np.maximum(1 - part, 1e-3)))
        angle = np.degrees(np.arcsin(np.minimum(part, 1.0)))
        _band(axes[3], hz, angle, angle)
        lines += [list(row) for row in below.lines.ravel()]
        return style.finished(axes, lines, loc="lower right")


@documented("sequence of two Axes")
def truth_plot(truth: PlantTruth, *, ax: style.AxesLike = None, **kwargs: Any) -> ct.ControlPlot:
    """Draw the frequency response of a simulated plant, without noise.

    Parameters
    ----------
    truth : PlantTruth
    **kwargs
        Passed on to `frf_plot`.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> cplt = cr.plots.truth_plot(cr.bench.valve().truth)
    >>> [axes.get_ylabel() for axes in cplt.figure.axes]
    ['gain [dB]', 'phase [deg]']
    """
    # a decade below the total delay, and far enough above it to show the dead time
    corner_hz = 1 / (2 * np.pi * truth.total_delay)
    frf = truth.frf(corner_hz * np.geomspace(0.1, 40.0, 500))
    return frf_plot(frf, ax=ax, dead_time=truth.dead_time, **kwargs)


def _band(axes: Axes, hz: FloatArray, above: FloatArray, below: FloatArray) -> None:
    """Draw bars about the measured points, which are the first line."""
    middle = np.asarray(axes.get_lines()[0].get_ydata(), dtype=np.float64)
    axes.vlines(hz, middle - below, middle + above, color=style.NOISE, linewidth=2.0, zorder=1)


def _looks(curve: Curve, models: int) -> dict[str, Any]:
    if curve.label.startswith("truth"):
        return {"color": style.TRUTH, "linewidth": 1.5, "linestyle": ":"}
    if curve.measured:
        return {"color": style.MEASURED, "linewidth": 2.2}
    return style.model_looks(models)


def _draw(axes: Axes, curve: Curve, values: FloatArray, looks: dict[str, Any]) -> list[Line2D]:
    """Draw the good points with the properties `looks`, and the others pale behind them."""
    if not curve.good.all():
        axes.plot(curve.frequency_hz, values, **{**looks, "alpha": 0.35, "linewidth": 0.8})
        values = np.where(curve.good, values, np.nan)
    few = curve.measured and values.size <= _FEW_POINTS
    dots: dict[str, Any] = {"marker": "o", "markersize": 4} if few else {}
    label = plain(curve.label, 50)
    return list(axes.plot(curve.frequency_hz, values, label=label, **looks, **dots))
