"""From the current to the displacement that the sensor shows: drive, actuator, sensor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.interpolate import CubicSpline

from .. import paper
from ..actuators import Actuator, Series
from ..numerics.arrays import FloatArray
from .instruments import MM_PER_MA, STROKE_MM
from .linear import Core, response_to_held_input, response_to_started_sine

_OVERSAMPLING = 8
"""Steps within a sample for the simulation of friction."""
SINE_MEAN_MA = 12.0
_SINE_OVERSAMPLING = 4
"""The same for sines, of which a sample is at most a twentieth of a period."""


@dataclass(frozen=True, eq=False)
class Motion:
    """Dynamics of a valve: linear, or with an actuator at the stem or before everything.

    Attributes
    ----------
    whole, before, after : (A, B, C, D)
        From current to shown displacement, to the stem, and from the stem on.
    actuator : tuple of Actuator
        Its unit is a percent of the stroke.
    place : {"stem", "input"}
        Where it acts.
    """

    whole: Core
    before: Core
    after: Core
    actuator: tuple[Actuator, ...]
    place: Literal["stem", "input"]

    def of_held(self, current: FloatArray, dt: float, dead_time: float) -> FloatArray:
        """Simulate a current that is held over each sample, in mm above zero current."""
        if not self.actuator:
            return response_to_held_input(self.whole, current, dt, dead_time)
        if self.place == "input":
            acting = self._through(MM_PER_MA * current, dt) / MM_PER_MA
            return response_to_held_input(self.whole, acting, dt, dead_time)
        fine = dt / _OVERSAMPLING
        often = np.repeat(current, _OVERSAMPLING)
        stem = response_to_held_input(self.before, often, fine, dead_time)
        return _passed(self.after, self._through(stem, fine), fine)[::_OVERSAMPLING]

    def of_sine(
        self, omega: float, amplitude: float, time: FloatArray, dead_times: Sequence[float]
    ) -> list[FloatArray]:
        """Simulate a sine about the mean current for several dead times, in mm about the mean."""
        if not self.actuator:
            return [
                amplitude * response_to_started_sine(self.whole, omega, time, dead_time)
                for dead_time in dead_times
            ]
        middle = MM_PER_MA * SINE_MEAN_MA
        fine = float(time[1]) / _SINE_OVERSAMPLING
        often = fine * np.arange(time.size * _SINE_OVERSAMPLING, dtype=np.float64)
        if self.place == "input":
            sine = middle + MM_PER_MA * amplitude * np.sin(omega * often)
            shown = _passed(self.whole, self._through(sine, fine) / MM_PER_MA, fine)
        else:
            stem = amplitude * response_to_started_sine(self.before, omega, often, 0.0)
            shown = _passed(self.after, self._through(middle + stem, fine), fine)
        # Nothing depends on when the motion begins, so that one simulation does for all.
        curve = CubicSpline(often, shown - middle)
        return [np.asarray(curve(np.maximum(time - one, 0.0))) for one in dead_times]

    def _through(self, stem: FloatArray, dt: float) -> FloatArray:
        """Pass a displacement through the actuator."""
        closed, percent = MM_PER_MA * paper.SETUP.current_range[0], STROKE_MM / 100
        moved = Series(self.actuator).simulate((stem - closed) / percent, dt)
        return closed + percent * moved


def _passed(core: Core, signal: FloatArray, dt: float) -> FloatArray:
    """Pass a sampled continuous signal through a linear system."""
    # Mean of neighbours: a held input with the same area as linear interpolation.
    lines = np.append(0.5 * (signal[1:] + signal[:-1]), signal[-1])
    lines[0] = signal[0]
    return response_to_held_input(core, lines, dt, 0.0)
