"""Parameters of a fitted process model, with units and intervals."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .._parameters import Parameter, slope_unit
from ..numerics.constants import Z_95
from ..numerics.parameters.physical import ProcessParameter

Interval = tuple[float, float]


def with_intervals(
    found: Sequence[ProcessParameter],
    ratio: str,
    *,
    gain: tuple[float, float, Interval],
    dead_time: tuple[float, Interval],
    integrating: bool,
    several: bool,
) -> tuple[Parameter, ...]:
    """Add units and 95 % intervals to the parameters of a fit.

    Parameters
    ----------
    found : sequence of ProcessParameter
    ratio : str
        Unit of the output over that of the input; empty if they are not known.
    gain : tuple
        Value, standard error for the structure, and interval.
    dead_time : tuple
        Standard error for the structure, and interval.
    integrating : bool
        Whether the gain is a slope.
    several : bool
        Whether the intervals of gain and dead time are those of all structures that the data do not
        rule out.
    """
    parameters = []
    for name, value, std in found:
        if name == "gain":
            value, std, ends = gain
            unit = slope_unit(ratio, "s") if integrating and ratio else ratio
            times = -1 if integrating else 0
            finite = bool(np.isfinite(ends).all())
            low, high = ends if finite else (np.nan, np.nan)
            parameters.append(
                Parameter(name, value, std, low, high, finite and several, unit, times)
            )
        elif name == "dead_time":
            std, (low, high) = dead_time
            parameters.append(Parameter(name, value, std, low, high, several, "s", 1))
        else:
            ratio_of_times = name.rpartition("_")[0].endswith("damping")
            unit, times = ("", 0) if ratio_of_times else ("s", 1)
            reach = Z_95 * std
            parameters.append(
                Parameter(name, value, std, value - reach, value + reach, False, unit, times)
            )
    return tuple(parameters)
