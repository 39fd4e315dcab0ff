"""Plots of a model and a measured frequency response."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import control as ct
import numpy as np
from matplotlib.axes import Axes

from .._checks import check_type, numbers
from ..delayed import DelayedStateSpace
from ..errors import DataError, UnsuitableSystemError
from ..frequency.comparison import FRFComparison
from ..frequency.points import check_single_channel, measured_points
from ..frequency.trusted_band import trusted_points
from ..numerics.arrays import BoolArray, ComplexArray, FloatArray
from ..numerics.rational.phase import unwrap_with_dead_time
from . import style
from .shared_docs import documented
from .style import frequency_axis

TRUSTED_COHERENCE = 0.95
"""Points with a lower coherence are drawn pale."""
_POINTS = 600
"""Number of frequencies at which a model is drawn."""
FITTED = "fit, order"
"""Beginning of the name of a fitted response."""


@dataclass(frozen=True, eq=False)
class Curve:
    """One frequency response, prepared for drawing."""

    label: str
    frequency_hz: FloatArray
    response: ComplexArray
    phase_deg: FloatArray
    coherence: FloatArray | None
    good: BoolArray
    measured: bool


def curves_of(
    items: Sequence[Any], frequency_hz: Sequence[float] | None, dead_time: float | None
) -> list[Curve]:
    """Evaluate systems and FRFs with consistent phases; `dead_time` is removed for unwrapping."""
    for item in items:
        check_type(item, ct.LTI, "a system", "one of python-control", UnsuitableSystemError)
        check_single_channel(item, str(item.name))
    if not items:
        raise DataError("no frequency response to plot")
    data = [item for item in items if isinstance(item, ct.FrequencyResponseData)]
    grid = _grid(items, data) if frequency_hz is None else numbers(frequency_hz, "frequency_hz")
    delays = [
        float(np.max(item.dead_time)) for item in items if isinstance(item, DelayedStateSpace)
    ]
    delay = dead_time if dead_time is not None else delays[0] if delays else 0.0
    curves = [_curve(item, grid, delay) for item in items]
    # python-control's default names
    nameless = [k for k, one in enumerate(curves) if re.fullmatch(r"sys\[\d+\]", one.label)]
    if len(nameless) == 1:
        curves[nameless[0]] = replace(curves[nameless[0]], label="model")
    return _aligned(curves)


def _grid(items: Sequence[Any], data: Sequence[Any]) -> FloatArray:
    """Range of the measurements; without any, three decades up to the upper end of the models."""
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


def _curve(item: Any, grid: FloatArray, delay: float) -> Curve:
    if isinstance(item, ct.FrequencyResponseData):
        points = measured_points(item)
        frequency, response, coherence = points.frequency_hz, points.response, points.coherence
    else:
        step = float(item.dt) if item.isdtime(strict=True) else 0.0
        frequency = grid if step == 0 else grid[grid <= 0.5 / step]
        s = 2j * np.pi * frequency
        response = np.ravel(item(np.exp(s * step) if step else s))
        coherence = None
    good = _coherent(coherence, frequency.size)
    phase = np.degrees(_phase(response, 2 * np.pi * frequency, delay, good))
    # A fitted curve is a model, even if only its response is known.
    measured = isinstance(item, ct.FrequencyResponseData) and not item.name.startswith(FITTED)
    return Curve(item.name or "measured", frequency, response, phase, coherence, good, measured)


def _coherent(coherence: FloatArray | None, size: int) -> BoolArray:
    """Mark coherent points; all of them if none is, or if the coherence is not known."""
    good = np.zeros(size, dtype=np.bool_) if coherence is None else coherence >= TRUSTED_COHERENCE
    return good if good.any() else ~good


def _phase(response: ComplexArray, omega: FloatArray, delay: float, good: BoolArray) -> FloatArray:
    """Unwrap the phase of coherent points; others get the turn that is nearest to these.

    Noise has no phase that could be unwrapped, and must not turn that of points beyond it.
    """
    known = unwrap_with_dead_time(omega[good], response[good], delay)
    near = np.interp(omega, omega[good], known + omega[good] * delay) - omega * delay
    angle = np.angle(response)
    phase = angle + 2 * np.pi * np.round((near - angle) / (2 * np.pi))
    phase[good] = known
    return np.asarray(phase)


def trusted_band(items: Sequence[Any]) -> tuple[float, float] | None:
    """Ends of the trusted band of the first measurement with a coherence, as of `compare_frf`."""
    for item in items:
        if isinstance(item, ct.FrequencyResponseData):
            points = measured_points(item)
            if not _coherent(points.coherence, points.frequency_hz.size).all():
                try:
                    trusted, _ = trusted_points(points, TRUSTED_COHERENCE, None)
                except DataError:  # single points only
                    return None
                inside = points.frequency_hz[trusted]
                return float(inside[0]), float(inside[-1])
    return None


def _aligned(curves: list[Curve]) -> list[Curve]:
    """Shift phases by whole turns to match that of the first model where it is good."""
    reference = next((curve for curve in curves if not curve.measured), curves[0])
    moved = []
    for curve in curves:
        first = int(np.argmax(curve.good))
        at = curve.frequency_hz[first]
        there = float(np.interp(at, reference.frequency_hz, reference.phase_deg))
        turns = round((float(curve.phase_deg[first]) - there) / 360)
        moved.append(replace(curve, phase_deg=curve.phase_deg - 360 * turns))
    return moved


def mark_band(axes: Axes, band_hz: tuple[float, float]) -> None:
    """Shade the trusted band."""
    axes.axvspan(*band_hz, color=style.TRUTH, alpha=0.10, linewidth=0, label="trusted band")


@documented("sequence of two Axes")
def comparison_plot(
    comparison: FRFComparison, *, ax: style.AxesLike = None, title: str | None = None, **kwargs: Any
) -> ct.ControlPlot:
    """Draw the gain and phase errors of a model, and the trusted band.

    Parameters
    ----------
    comparison : FRFComparison
    **kwargs
        Line properties of both curves.

    Examples
    --------
    >>> import control as ct
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> model = cr.delayed_ss(ct.tf([1], [0.08, 1]), dead_time=0.03, dt=0.001)
    >>> f = np.geomspace(0.1, 10, 40)
    >>> s = 2j * np.pi * f
    >>> frf = cr.MeasuredFRF(1.02 * np.exp(-0.03 * s) / (0.08 * s + 1), f)
    >>> cplt = cr.plots.comparison_plot(cr.compare_frf(model, frf))
    >>> [axes.get_ylabel() for axes in cplt.figure.axes]
    ['gain error [dB]', 'phase error [deg]']
    """
    errors = (comparison.gain_error_db, comparison.phase_error_deg)
    units = 20 / np.log(10), 180 / np.pi  # dB and degrees of a small relative error
    looks = {"color": style.MODEL, "linewidth": 1.5, "label": "model - measured", **kwargs}
    with style.canvas(ax, 2, title=title, default_title=comparison.name, size=(8.0, 5.2)) as axes:
        lines = []
        for one, error, unit in zip(axes, errors, units, strict=True):
            mark_band(one, comparison.band_hz)
            if comparison.std is not None:
                # Of a complex error, half the power is in the gain and half in the phase.
                std = unit * comparison.std / np.abs(comparison.measured) / np.sqrt(2)
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
            frequency_axis(one, label=one is axes[-1])
        return style.finished(axes, lines, loc="upper left")
