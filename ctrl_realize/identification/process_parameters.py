"""Parameters of a fitted process model, with units and intervals."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .._parameters import Parameter, slope_unit
from .._wording import in_time
from ..numerics.arrays import ComplexArray, FloatArray
from ..numerics.constants import Z_95
from ..numerics.engine.modal import lag_sum
from ..numerics.engine.profile import JUMP
from ..numerics.families.physical import ProcessParameter

Interval = tuple[float, float]

_SMALL_LAG, _SMALL_PART = 0.1, 0.05
"""A lag whose interval includes 0 is not written in a formula up to so many samples, and up to this
part of the upper end of the interval and of the total delay."""
_OPEN = 0.5  # of a sample, least length of the interval of a dead time that is told in samples
_HALF = 0.7  # of the sum of lags: time at which a response passes its half


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
    for name, value, std, ends in found:
        if name == "gain":
            value, std, span = gain
            unit = slope_unit(ratio, "s") if integrating and ratio else ratio
            times = -1 if integrating else 0
            known = not np.isinf(span).all()  # one end, at least
            low, high = span if known else (np.nan, np.nan)
            parameters.append(
                Parameter(name, value, std, low, high, known and several, unit, times)
            )
        elif name == "dead_time":
            std, (low, high) = dead_time
            parameters.append(Parameter(name, value, std, low, high, several, "s", 1))
        else:
            ratio_of_times = name.rpartition("_")[0].endswith("damping")
            unit, times = ("", 0) if ratio_of_times else ("s", 1)
            low, high = ends or (value - Z_95 * std, value + Z_95 * std)
            low = low if name.startswith(("lead", "zero")) else max(low, 0.0)
            parameters.append(Parameter(name, value, std, low, high, False, unit, times))
    return tuple(parameters)


def jump(
    poles: ComplexArray, numerator: FloatArray, dead_time: float, interval: Interval, dt: float
) -> int | None:
    """Samples after which a response jumps; None if it takes longer than from sample to sample.

    An output that has all of its response to a held input at the next sample is the same for all
    dead times between the two samples. Where known dynamics follow it is not, and the interval is
    shorter.
    """
    at_once = numerator.size == 1 and np.abs(poles).min() * dt > JUMP
    if not at_once or interval[1] - interval[0] < _OPEN * dt:
        return None
    return int(np.ceil((dead_time + _HALF * lag_sum(poles, numerator)) / dt))


def told(
    parameters: Sequence[Parameter], dt: float, samples: int | None
) -> tuple[list[Parameter], list[Parameter]]:
    """Parameters to be written in a formula, and lags that are not.

    These are not distinguished from zero, and too small to matter. The dead time of a jump after so
    many `samples` is theirs.
    """
    small = _SMALL_LAG * dt if samples is None else dt
    lags = [one for one in parameters if one.name.startswith("lag_")]
    # Of lags that are alike none is known, and all matter.
    total = sum(one.value for one in parameters if one in lags or one.name == "dead_time")
    unsure = [one for one in lags if one.low <= 0]
    out = [one for one in unsure if one.value <= max(small, _SMALL_PART * min(one.high, total))]
    shown = [one for one in parameters if one not in out]
    if samples is not None and len(shown) == 2:
        shown[1] = Parameter("dead_time", samples * dt, unit="s", times=1)
    return shown, out


def not_seen_in_words(lags: Sequence[Parameter]) -> str:
    """Say which lags are not in the formula, and how large they may be."""
    said = [f"{one.label} (at most {in_time(one.high, 2)})" for one in lags]
    return f"{', '.join(said)}: not distinguished from 0 and not in the transfer function"
