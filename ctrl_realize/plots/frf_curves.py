"""Frequency responses, measured and of models, made ready to draw together."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import control as ct
import numpy as np

from ..checks import numbers
from ..errors import DataError, UnsuitableSystemError
from ..frequency.measured_points import check_single_channel, measured_points
from ..numerics.arrays import BoolArray, ComplexArray, FloatArray
from ..numerics.spectra import unwrapped_phase

TRUSTED_COHERENCE = 0.95
"""Points of less coherence are drawn pale."""
_POINTS = 600
"""Frequencies at which a model is drawn."""
FITTED = "fit, order"
"""How the name of a fitted response begins."""


@dataclass(frozen=True, eq=False)
class Curve:
    """One frequency response, ready to draw."""

    label: str
    frequency_hz: FloatArray
    response: ComplexArray
    phase_deg: FloatArray
    coherence: FloatArray | None
    measured: bool

    @property
    def good(self) -> BoolArray:
        """Which points are coherent; all of them where none is, or where nobody knows."""
        if self.coherence is None:
            return np.ones(self.frequency_hz.size, dtype=np.bool_)
        good = self.coherence >= TRUSTED_COHERENCE
        return good if good.any() else np.ones_like(good)


def curves_of(
    items: Sequence[Any], frequency_hz: Sequence[float] | None, dead_time: float | None
) -> list[Curve]:
    """Evaluate systems and FRFs, with phases that agree; `dead_time` is taken out to unwrap."""
    for item in items:
        if not isinstance(item, ct.LTI):
            raise UnsuitableSystemError(
                f"got a {type(item).__name__}; needed are systems of python-control or FRFs"
            )
        check_single_channel(item, str(item.name))
    if not items:
        raise DataError("no frequency response to draw")
    data = [item for item in items if isinstance(item, ct.FrequencyResponseData)]
    grid = _grid(items, data) if frequency_hz is None else numbers(frequency_hz, "frequency_hz")
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


def _curve(item: Any, grid: FloatArray, delay: float) -> Curve:
    if isinstance(item, ct.FrequencyResponseData):
        points = measured_points(item)
        frequency, response, coherence = points.frequency_hz, points.response, points.coherence
    else:
        step = float(item.dt) if item.isdtime(strict=True) else 0.0
        frequency = grid if step == 0 else grid[grid <= 0.5 / step]
        response = np.asarray(item(_points(frequency, step))).reshape(-1)
        coherence = None
    phase = np.degrees(unwrapped_phase(response, 2 * np.pi * frequency, delay))
    # A fitted curve is a model, though only its response may be known.
    measured = isinstance(item, ct.FrequencyResponseData) and not item.name.startswith(FITTED)
    return Curve(item.name or "measured", frequency, response, phase, coherence, measured)


def _points(frequency_hz: FloatArray, step: float) -> ComplexArray:
    s = 2j * np.pi * frequency_hz
    return np.asarray(np.exp(s * step) if step else s, dtype=np.complex128)


def _aligned(curves: list[Curve]) -> list[Curve]:
    """Move phases by whole turns, so that they agree with the first model's where it is good."""
    reference = next((curve for curve in curves if not curve.measured), curves[0])
    moved = []
    for curve in curves:
        first = int(np.argmax(curve.good))
        at = curve.frequency_hz[first]
        there = float(np.interp(at, reference.frequency_hz, reference.phase_deg))
        turns = round((float(curve.phase_deg[first]) - there) / 360)
        moved.append(replace(curve, phase_deg=curve.phase_deg - 360 * turns))
    return moved
