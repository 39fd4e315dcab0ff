"""Sensor, converter and recorder between the simulated valve and its records."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .. import paper
from ..numerics.arrays import FloatArray
from ..signals import Record
from .imperfections import band_limited_noise, converted, drive_spikes

if TYPE_CHECKING:
    from .control_valve import Valve

STROKE_MM = 2.0
AD_RANGE_V = 10.0
VOLT_PER_MA = 0.25


def recorded(
    valve: Valve,
    time: FloatArray,
    current: FloatArray,
    displacement: FloatArray,
    rng: np.random.Generator,
    name: str,
    *,
    spikes: bool = True,
) -> Record:
    """Pass signals through sensor, converter and everything that disturbs them."""
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
