"""Sensor, converter and recorder of the simulated valve."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .. import paper
from ..data import Record
from ..errors import DataError
from ..numerics.arrays import FloatArray
from .imperfections import band_limited_noise, converted, drive_spikes

STROKE_MM = 2.0
AD_RANGE_V = 10.0
VOLT_PER_MA = 0.25
MM_PER_MA = STROKE_MM / (paper.SETUP.current_range[1] - paper.SETUP.current_range[0])


def held_input(values: ArrayLike, name: str, limits: tuple[float, float], unit: str) -> FloatArray:
    """Check an input that is held over each sample, (N,)."""
    held = np.asarray(values)
    if held.ndim != 1 or held.size < 3 or held.dtype.kind not in "biuf":
        raise DataError(
            f"{name} has shape {held.shape} and type {held.dtype}; expected N >= 3 real numbers"
        )
    held = held.astype(np.float64)
    low, high = limits
    bad = np.flatnonzero(~((held >= low) & (held <= high)))
    if bad.size:
        raise DataError(
            f"{name} is {held[bad[0]]:g} {unit} at sample {bad[0]}; expected {low:g}-{high:g} "
            f"{unit} everywhere"
        )
    return held


def recorded(
    valve: Any,
    time: FloatArray,
    current: FloatArray,
    displacement: FloatArray,
    rng: np.random.Generator,
    name: str,
    *,
    spikes: bool = True,
) -> Record:
    """Pass signals through sensor, converter and all disturbances of a `Valve`."""
    n = time.size
    limited = valve.anti_aliasing is not None
    shown = displacement + band_limited_noise(n, valve.noise * STROKE_MM, rng, limited=limited)
    shown = shown + valve.drift * STROKE_MM * time
    if valve.hum:
        phase = rng.uniform(0, 2 * np.pi)
        shown = shown + valve.hum * STROKE_MM * np.sin(2 * np.pi * 50.0 * time + phase)
    range_mm, per_volt = paper.SETUP.lvdt_range_mm, paper.SETUP.lvdt_sensitivity_mm_per_v
    shown = np.clip(shown, 0.0, range_mm)
    full_range = paper.SETUP.current_range[1] - paper.SETUP.current_range[0]
    asked = current + band_limited_noise(n, valve.input_noise * full_range, rng, limited=limited)
    if spikes and valve.spikes:
        asked = asked + drive_spikes(n, valve.spikes, 0.4 * full_range, rng)
    return Record(
        time,
        converted(asked * VOLT_PER_MA, valve.bits, AD_RANGE_V) / VOLT_PER_MA,
        converted(shown / per_volt, valve.bits, AD_RANGE_V) * per_volt,
        name=name,
        input_labels=["current (simulated) [mA]"],
        output_labels=["displacement (simulated) [mm]"],
    )
