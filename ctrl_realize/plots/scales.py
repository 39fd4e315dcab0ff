"""Units and ticks of the axes: time, frequency, decibels, phase."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, LogLocator, MultipleLocator, NullFormatter
from numpy.typing import ArrayLike

from .. import wording
from ..numerics.arrays import FloatArray

HERTZ = 2 * np.pi
"""rad/s in one Hz."""


def time_unit(largest: float, axes: Axes) -> tuple[float, str]:
    """Choose s, ms or µs for times up to `largest` s; returns (units per second, name).

    Axes whose label already names a unit of time keep it.
    """
    for name, factor in wording.UNITS.items():
        if axes.get_xlabel().endswith(f"[{name}]"):
            return factor, name
    return wording.time_unit(largest)


def decibel(magnitude: ArrayLike) -> FloatArray:
    """Return 20 log10 of a magnitude; zeros give no point."""
    values = np.abs(np.asarray(magnitude))
    with np.errstate(divide="ignore"):
        level = 20 * np.log10(values)
    return np.where(np.isfinite(level), level, np.nan)


def frequency_axis(axes: Axes, *, label: bool = True) -> None:
    """Make the x axis a logarithmic one in Hz with plain numbers."""
    axes.set_xscale("log")
    low, high = axes.get_xlim()
    # Less than two decades hold too few powers of ten to read a frequency off.
    few = high / max(low, 1e-300) < 100
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if few else (1.0,)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    if label:
        axes.set_xlabel("frequency [Hz]")


def phase_ticks(axes: Axes) -> None:
    """Put ticks of a phase in degrees at multiples of 45, 90, 180, ... ."""
    low, high = axes.get_ylim()
    step = next((s for s in (45, 90, 180, 360, 720, 1440) if (high - low) / s <= 6), None)
    if step is not None and high - low > 90:
        axes.yaxis.set_major_locator(MultipleLocator(step))
