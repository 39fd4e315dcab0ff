"""Plots of frequency responses: measured with their coherence, models on top, the difference."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import control as ct
import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from ..errors import DataError, UnsuitableSystemError
from ..frequency.comparison import FRFComparison
from ..numerics.arrays import ComplexArray, FloatArray
from ..numerics.spectra import unwrapped_phase
from . import style

TRUSTED_COHERENCE = 0.95
_POINTS = 600
FITTED = "fit, order"
"""How the name of a fitted response begins."""


@dataclass(frozen=True, eq=False)
class _Curve:
    """One frequency response, ready to draw."""

    label: str
    frequency_hz: FloatArray
    response: ComplexArray
    phase_deg: FloatArray
    coherence: FloatArray | None
    measured: bool

    @property
    def good(self) -> np.ndarray[Any, np.dtype[np.bool_]]:
        if self.coherence is None:
            return np.ones(self.frequency_hz.size, dtype=np.bool_)
        good = self.coherence >= TRUSTED_COHERENCE
        return good if good.any() else np.ones_like(good)


def frf_plot(
    sysdata: Any,
    *,
    ax: style.AxesLike = None,
    frequency_hz: Sequence[float] | None = None,
    dead_time: float | None = None,
    title: str | None = None,
    **kwargs: Any,
) -> ct.ControlPlot:
    """Draw measured frequency responses and models on top of them (figures 2 and 8).

    Gain in dB and phase in degrees; where a measurement has a coherence, that too, and points
    with a coherence below 0.95 are drawn pale. Phases are unwrapped with the dead time of the
    model taken out first, so they are right at any delay.

    Parameters
    ----------
    sysdata : system or FRF, or sequence of them
        Anything python-control takes for a frequency response, one input and one output:
        `MeasuredFRF` or other frequency response data, discrete or continuous systems.
    ax : sequence of Axes or Figure, optional
        Two axes, or three where there is a coherence.
    frequency_hz : array_like, optional
        Frequencies for the models in Hz. Default: the span of the measurements.
    dead_time : float, optional
        Delay in s whose phase is taken out before unwrapping. Default: that of the first model
        that has one.
    title : str, optional
    **kwargs
        Line properties of all curves.

    Returns
    -------
    control.ControlPlot

    Raises
    ------
    UnsuitableSystemError
        Something that is no system, or one with several inputs or outputs.

    Examples
    --------
    >>> import control as ct
    >>> import ctrl_realize as cr
    >>> from ctrl_realize import plots
    >>> model = cr.delayed_ss(ct.tf([1], [0.08, 1]), dead_time=0.0289, dt=7.8125e-4)
    >>> cplt = plots.frf_plot(model)
    >>> [axes.get_ylabel() for axes in cplt.axes[:, 0]]
    ['gain [dB]', 'phase [deg]']
    """
    items = list(sysdata) if isinstance(sysdata, list | tuple) else [sysdata]
    curves = _curves(items, frequency_hz, dead_time)
    coherent = any(curve.coherence is not None for curve in curves)
    with style.context():
        rows = 3 if coherent else 2
        axes = style.axes_for(
            ax, rows, size=(8.0, 6.6 if coherent else 5.6), heights=(2.0, 2.0, 0.8)[:rows]
        )
        lines: list[list[Line2D]] = [[] for _ in axes]
        models = 0
        for curve in curves:
            looks = {**_looks(curve, models), **kwargs}
            models += not curve.measured
            for row, values in enumerate((style.decibel(curve.response), curve.phase_deg)):
                lines[row] += _draw(axes[row], curve, values, looks)
            if curve.coherence is not None:
                lines[2] += axes[2].plot(
                    curve.frequency_hz, curve.coherence, color=looks["color"], linewidth=1.2
                )
        _focus(axes[0], [(c, style.decibel(c.response)) for c in curves])
        _focus(axes[1], [(c, c.phase_deg) for c in curves])
        axes[0].set_ylabel("gain [dB]")
        axes[1].set_ylabel("phase [deg]")
        style.phase_ticks(axes[1])
        if coherent:
            axes[2].axhline(TRUSTED_COHERENCE, color=style.NOISE, linewidth=1.0, linestyle=":")
            axes[2].set_ylabel("coherence")
            axes[2].set_ylim(-0.02, 1.05)
        for one in axes:
            style.frequency_axis(one, label=one is axes[-1])
        return style.finished(axes, lines, title=title, own_figure=ax is None, loc="lower left")


def comparison_plot(
    comparison: FRFComparison,
    *,
    ax: style.AxesLike = None,
    title: str | None = None,
    **kwargs: Any,
) -> ct.ControlPlot:
    """Draw how far a model's gain and phase are from the measured ones, and the trusted band.

    Parameters
    ----------
    comparison : FRFComparison
    ax : sequence of two Axes, or Figure, optional
    title : str, optional
        Default: the names of model and measurement, in a new figure.
    **kwargs
        Line properties of both curves.

    Returns
    -------
    control.ControlPlot

    Examples
    --------
    >>> import control as ct
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> from ctrl_realize import plots
    >>> model = cr.delayed_ss(ct.tf([1], [0.08, 1]), dead_time=0.03, dt=0.001)
    >>> f = np.geomspace(0.1, 10, 40)
    >>> s = 2j * np.pi * f
    >>> frf = cr.MeasuredFRF(1.02 * np.exp(-0.03 * s) / (0.08 * s + 1), f)
    >>> cplt = plots.comparison_plot(cr.compare_frf(model, frf))
    >>> [axes.get_ylabel() for axes in cplt.figure.axes]
    ['gain error [dB]', 'phase error [deg]']
    """
    errors = (comparison.gain_error_db, comparison.phase_error_deg)
    spread: tuple[FloatArray | None, FloatArray | None] = (None, None)
    if comparison.std is not None:
        relative = comparison.std / np.abs(comparison.measured)
        # Of a complex error, half the power is in the gain and half in the phase.
        spread = (
            20 / np.log(10) * relative / np.sqrt(2),
            np.degrees(relative / np.sqrt(2)),
        )
    looks = {"color": style.MODEL, "linewidth": 1.5, "label": "model - measured", **kwargs}
    with style.context():
        axes = style.axes_for(ax, 2, size=(8.0, 5.2))
        lines = []
        for one, error, std in zip(axes, errors, spread, strict=True):
            one.axvspan(*comparison.band_hz, color=style.TRUTH, alpha=0.10, linewidth=0,
                        label="trusted band")  # fmt: skip
            if std is not None:
                one.fill_between(
                    comparison.frequency_hz, -2 * std, 2 * std, color=style.NOISE, alpha=0.35,
                    linewidth=0, label="noise of the FRF (2 std)",
                )  # fmt: skip
            one.axhline(0.0, color=style.INK, linewidth=1.0)
            trusted = np.where(comparison.trusted, error, np.nan)
            one.plot(comparison.frequency_hz, error, **{**looks, "alpha": 0.3, "label": None})
            lines.append(list(one.plot(comparison.frequency_hz, trusted, **looks)))
            inside = np.abs(error[comparison.trusted])
            limit = 1.6 * max(float(inside.max()), 1e-9)
            one.set_ylim(-limit, limit)
        axes[0].set_ylabel("gain error [dB]")
        axes[1].set_ylabel("phase error [deg]")
        for one in axes:
            style.frequency_axis(one, label=one is axes[-1])
        return style.finished(
            axes,
            lines,
            title=comparison.name if title is None else title,
            own_figure=ax is None,
            loc="upper left",
        )


def _curves(
    items: Sequence[Any], frequency_hz: Sequence[float] | None, dead_time: float | None
) -> list[_Curve]:
    for item in items:
        if not isinstance(item, ct.LTI):
            raise UnsuitableSystemError(
                f"got a {type(item).__name__}; needed are systems of python-control or FRFs"
            )
        if (item.noutputs, item.ninputs) != (1, 1):
            raise UnsuitableSystemError(
                f"{item.name} has {item.ninputs} inputs and {item.noutputs} outputs; draw one "
                "channel at a time, as system[i, j]"
            )
    if not items:
        raise DataError("no frequency response to draw")
    data = [item for item in items if isinstance(item, ct.FrequencyResponseData)]
    grid = _grid(items, data) if frequency_hz is None else np.asarray(frequency_hz, dtype=float)
    delays = [float(np.max(item.dead_time)) for item in items if hasattr(item, "dead_time")]
    delay = dead_time if dead_time is not None else delays[0] if delays else 0.0
    curves = [_curve(item, grid, delay) for item in items]
    nameless = [curve for curve in curves if re.fullmatch(r"sys\[\d+\]", curve.label)]
    if len(nameless) == 1:  # python-control's own name says nothing
        place = curves.index(nameless[0])
        curves[place] = replace(nameless[0], label="model")
    return _aligned(curves)


def _grid(items: Sequence[Any], data: Sequence[Any]) -> FloatArray:
    """Span the measurements; without any, three decades up to where the models end."""
    if data:
        ends = np.concatenate([np.asarray(one.omega) for one in data]) / (2 * np.pi)
        positive = ends[ends > 0]
        return np.geomspace(positive.min(), positive.max(), _POINTS)
    sampled = [item for item in items if item.isdtime(strict=True) and item.dt is not True]
    if sampled:
        top = min(0.5 / float(item.dt) for item in sampled)
        return np.geomspace(1e-4 * top, top, _POINTS)
    poles = np.concatenate([np.abs(item.poles()) for item in items])
    middle = float(np.median(poles[poles > 0])) / (2 * np.pi) if np.any(poles > 0) else 1.0
    return np.geomspace(middle / 100, middle * 30, _POINTS)


def _curve(item: Any, grid: FloatArray, delay: float) -> _Curve:
    if isinstance(item, ct.FrequencyResponseData):
        order = np.argsort(item.omega, kind="stable")
        frequency = np.asarray(item.omega, dtype=float)[order] / (2 * np.pi)
        response = np.asarray(item.frdata[0, 0], dtype=complex)[order]
        coherence = getattr(item, "coherence", None)
        coherence = None if coherence is None else np.reshape(coherence, -1)[order]
    else:
        step = float(item.dt) if item.isdtime(strict=True) else 0.0
        frequency = grid if step == 0 else grid[grid <= 0.5 / step]
        response = np.asarray(item(_points(frequency, step))).reshape(-1)
        coherence = None
    phase = np.degrees(unwrapped_phase(response, 2 * np.pi * frequency, delay))
    # A fitted curve is a model, though only its response may be known.
    measured = isinstance(item, ct.FrequencyResponseData) and not item.name.startswith(FITTED)
    return _Curve(item.name or "measured", frequency, response, phase, coherence, measured)


def _points(frequency_hz: FloatArray, step: float) -> ComplexArray:
    s = 2j * np.pi * frequency_hz
    return np.asarray(np.exp(s * step) if step else s, dtype=np.complex128)


def _aligned(curves: list[_Curve]) -> list[_Curve]:
    """Move phases by whole turns, so that they agree with the first model's where it is good."""
    reference = next((curve for curve in curves if not curve.measured), curves[0])
    moved = []
    for curve in curves:
        first = int(np.argmax(curve.good))
        there = float(
            np.interp(curve.frequency_hz[first], reference.frequency_hz, reference.phase_deg)
        )
        turns = round((float(curve.phase_deg[first]) - there) / 360)
        moved.append(
            _Curve(
                curve.label,
                curve.frequency_hz,
                curve.response,
                curve.phase_deg - 360 * turns,
                curve.coherence,
                curve.measured,
            )
        )
    return moved


def _looks(curve: _Curve, models: int) -> dict[str, Any]:
    if curve.label.startswith("truth"):
        return {"color": style.TRUTH, "linewidth": 1.5, "linestyle": ":"}
    if curve.measured:
        return {"color": style.MEASURED, "linewidth": 2.2}
    dashes = style.DASHES[models % len(style.DASHES)]
    return {"color": style.model_colour(models), "linestyle": dashes}


def _draw(axes: Axes, curve: _Curve, values: FloatArray, looks: dict[str, Any]) -> list[Line2D]:
    dots: dict[str, Any] = (
        {"marker": "o", "markersize": 4} if curve.measured and values.size <= 60 else {}
    )
    if bool(curve.good.all()):
        return list(
            axes.plot(
                curve.frequency_hz, values, label=style.plain(curve.label, 50), **looks, **dots
            )
        )
    pale = {**looks, "alpha": 0.35, "linewidth": 0.8}
    axes.plot(curve.frequency_hz, values, **pale)
    good = np.where(curve.good, values, np.nan)
    return list(
        axes.plot(curve.frequency_hz, good, label=style.plain(curve.label, 50), **looks, **dots)
    )


def _focus(axes: Axes, drawn: Sequence[tuple[_Curve, FloatArray]]) -> None:
    """Choose the y axis by what can be trusted; noise may leave it."""
    if all(curve.coherence is None for curve, _ in drawn):
        return
    shown = np.concatenate([values[curve.good] for curve, values in drawn if curve.measured])
    shown = shown[np.isfinite(shown)]
    low, high = float(shown.min()), float(shown.max())
    room = max(0.35 * (high - low), 1.0)
    axes.set_ylim(low - room, high + 0.3 * room)
