"""Flags of several records of one plant."""

from __future__ import annotations

import numpy as np

from ..._wording import in_time
from ...data import Record
from ...numerics.arrays import FloatArray
from ...results import Flag
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


def repeat_flags(result: Repeatability, dead_time: float, dt: float) -> tuple[Flag, ...]:
    """List the flags of several records of one plant; times in s."""
    flags = []
    kept = np.array([name not in result.outlying for name in result.names])
    apart = time_apart(dead_time, dt)
    if result.outlying:
        flags.append(
            Flag(
                "outlying_records",
                "outlying records, excluded from the mean: " + ", ".join(result.outlying),
            )
        )
    if result.p_value < BY_CHANCE and np.ptp(result.delays[kept]) > apart:
        flags.append(
            Flag(
                "records_differ",
                "the dead times of the records differ by more than their noise explains, by up to "
                f"{in_time(float(np.ptp(result.delays[kept])))} "
                f"(chi-square {result.chi_square:.3g}, p = {result.p_value:.2g}): trigger "
                "jitter, friction or a changing plant; the interval is widened accordingly",
            )
        )
    flags += _response_flags(result)
    # the samples, whose timing is random, explain no trend
    trend = abs(result.trend) * float(np.ptp(np.abs(result.amplitudes[kept])))
    if result.trend_error > 0 and abs(result.trend) > 3 * result.trend_error and trend > apart / 2:
        pause = "; with backlash or friction the pause is shorter for larger steps" * (
            result.trend < 0
        )
        flags.append(
            Flag(
                "amplitude_trend",
                f"the dead time changes with the step amplitude ({result.trend:.2g} +- "
                f"{result.trend_error:.2g} s per unit): the plant is nonlinear{pause}",
            )
        )
    return tuple(flags)


"""Report that gains or time constants differ by more than their noise."""


def _response_flags(result: Repeatability) -> list[Flag]:
    """Say so where gains or time constants differ by more than their noise."""
    flags = []
    statistic, chance = result.gain_test
    if chance < BY_CHANCE and result.gain_spread > NO_COMMON_GAIN:
        followed = result.fit_percent[np.isfinite(result.fit_percent)]
        flags.append(
            Flag(
                "no_common_gain",
                f"no single gain fits all records: their gains are {_range(result.gains)} "
                f"times that of the model, with fits of {followed.min(initial=100):.3g} to "
                f"{followed.max(initial=0):.3g} %; gains='own' fits one for each record, with "
                "common dynamics",
            )
        )
    if chance < BY_CHANCE and result.gain_spread > SAME:
        flags.append(
            Flag(
                "gains_differ",
                "the gains of the records differ by more than their noise explains, "
                f"{_range(result.gains)} times the common gain (chi-square {statistic:.3g}, p "
                f"= {chance:.2g}): the plant is nonlinear, or has changed between the records; "
                "gains='own' fits one for each",
            )
        )
    statistic, chance = result.lag_test
    if chance < BY_CHANCE and np.max(np.abs(np.log(result.lags))) > SAME:
        flags.append(
            Flag(
                "lags_differ",
                "the time constants of the records differ by more than their noise explains, "
                f"{_range(result.lags)} times the common ones (chi-square {statistic:.3g}, p "
                f"= {chance:.2g}): the plant is nonlinear, or has changed between the records",
            )
        )
    return flags


def _range(values: FloatArray) -> str:
    return f"{values.min():.3g} to {values.max():.3g}"


"""Find records whose outputs agree in every digit, which noise excludes."""


def same_record_flags(records: tuple[Record, ...]) -> tuple[Flag, ...]:
    """Find records whose outputs agree in every digit, which noise never lets happen."""
    first: dict[bytes, int] = {}
    again = []
    for i, record in enumerate(records, 1):
        values = record.output.tobytes()
        if values in first:
            again.append(f"no. {i} is no. {first[values]}")
        first.setdefault(values, i)
    if not again:
        return ()
    more = f" and {len(again) - 3} more" if len(again) > 3 else ""
    return (
        Flag(
            "same_records",
            f"{len(again)} of {len(records)} records are duplicates "
            f"({', '.join(again[:3])}{more}): the standard error assumes independent noise "
            "and is too small",
        ),
    )
