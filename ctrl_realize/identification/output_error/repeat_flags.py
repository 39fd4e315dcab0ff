"""Flags of several records of one plant."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..._flags import Flag, flagged
from ..._wording import in_time
from ...data import Record
from ...numerics.arrays import FloatArray
from .repeatability import Repeatability

# Thresholds for flags alone are a matter of presentation.
BY_CHANCE = 0.01  # one false alarm in a hundred sets of records of one plant
SAME = 0.03
"""Relative difference of gains or lags up to which nothing is said: it is harmless for tuning."""
NO_COMMON_GAIN = 0.2
"""Relative difference of all gains from the common one above which the model fits no record."""


_PART, _SAMPLES = 0.05, 1.5  # of a dead time; an input that moves between samples shifts by 0.7


def time_apart(dead_time: float, dt: float) -> float:
    """Difference of dead times up to which nothing is said, however significant it is.

    A twentieth of the dead time, and at least 1.5 samples: an input that moves between two samples
    is recorded up to one of them later. In 24 simulated records with such an input parts of them
    differed by up to 0.7 samples, with p-values down to 1e-34.
    """
    return max(_PART * dead_time, _SAMPLES * dt)


def repeat_flags(result: Repeatability, dead_time: float, dt: float) -> Iterator[Flag]:
    """Say so where dead times, gains or time constants differ by more than their noise.

    Times in s.
    """
    apart, kept = time_apart(dead_time, dt), result.kept
    if result.outlying:
        yield flagged("outlying_records", names=", ".join(result.outlying))
    scatter = float(np.ptp(result.delays[kept]))
    if result.p_value < BY_CHANCE and scatter > apart:
        yield flagged(
            "records_differ",
            apart=in_time(scatter),
            chi_square=result.chi_square,
            chance=result.p_value,
        )
    statistic, chance = result.gain_test
    if chance < BY_CHANCE and result.gain_spread > SAME:
        ratios = _range(result.gains)
        if result.gain_spread > NO_COMMON_GAIN:
            followed = result.fit_percent[np.isfinite(result.fit_percent)]
            least, most = followed.min(initial=100), followed.max(initial=0)
            yield flagged("no_common_gain", ratios=ratios, least=least, most=most)
        yield flagged("gains_differ", ratios=ratios, chi_square=statistic, chance=chance)
    statistic, chance = result.lag_test
    if chance < BY_CHANCE and np.max(np.abs(np.log(result.lags))) > SAME:
        lags = _range(result.lags)
        yield flagged("lags_differ", ratios=lags, chi_square=statistic, chance=chance)
    # the samples, whose timing is random, explain no trend
    trend = abs(result.trend) * float(np.ptp(np.abs(result.amplitudes[kept])))
    if result.trend_error > 0 and abs(result.trend) > 3 * result.trend_error and trend > apart / 2:
        pause = "; with backlash or friction the pause is shorter for larger steps"
        yield flagged(
            "amplitude_trend",
            trend=result.trend,
            error=result.trend_error,
            pause=pause * (result.trend < 0),
        )


def _range(values: FloatArray) -> str:
    return f"{values.min():.3g} to {values.max():.3g}"


def same_record_flags(records: tuple[Record, ...], *, averaged: bool) -> tuple[Flag, ...]:
    """Find records whose outputs agree in every digit, which noise never lets happen.

    The noise of a mean is that of its residual, which duplicates leave as it is.
    """
    first: dict[bytes, int] = {}
    again = []
    for i, record in enumerate(records, 1):
        values = record.output.tobytes()
        if values in first:
            again.append(f"no. {i} is no. {first[values]}")
        first.setdefault(values, i)
    if not again:
        return ()
    pairs = ", ".join(again[:3]) + (f" and {len(again) - 3} more" if len(again) > 3 else "")
    return (
        flagged(
            "same_records.mean" if averaged else "same_records",
            again=len(again),
            records=len(records),
            pairs=pairs,
        ),
    )
