"""Differences between records of one plant."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from ..._wording import in_time
from ...numerics.arrays import BoolArray, FloatArray
from ...numerics.constants import Z_95
from ...numerics.output_error.result import OutputErrorEstimate
from ...numerics.signals.noise import mad_sigma
from ...numerics.validation.own_response import OwnResponse, disagreeing, homogeneity

if TYPE_CHECKING:
    import pandas as pd

_MOST_NAMED = 8
"""Largest number of records listed in a card; the table lists all."""
APART = 5.0  # robust standard deviations from the others
SAME_AMPLITUDE = 0.03  # relative, below which steps count as equally high
RESPONDS = 5.0
"""Standard errors that a gain must be away from zero to be one, as for an output that leaves its
rest. A record below that does not respond."""
_LATER = 1.0
"""Samples by which dead times may differ in any case: the trigger falls between two samples."""
_SLOWER = 0.1
"""Part by which time constants may differ in any case. The likelihood of real records resolves less
than a percent, at which no two of them have the same."""


def distinct(names: Iterable[str]) -> tuple[str, ...]:
    """Names of records, with numbers where they are missing or the same."""
    found = [name or f"record {i}" for i, name in enumerate(names)]
    while len(set(found)) < len(found):  # a number may give a name that there is already
        found = [one if found.count(one) == 1 else f"{one} ({i})" for i, one in enumerate(found)]
    return tuple(found)


@dataclass(frozen=True, eq=False)
class Repeatability:
    """Differences between records of one plant, beyond the noise in each.

    ``chi_square`` is the sum over the records of ((delay - weighted mean) / standard error)^2 and
    `p_value` the probability of a larger value if records differ by noise alone; `gain_test` and
    `lag_test` are the same for gains and (logarithms of) time constants.

    Attributes
    ----------
    names : tuple of str
        Of the records.
    amplitudes : ndarray, shape (R,)
        Height of each step, or the range of each input.
    delays, errors : ndarray, shape (R,)
        Delay of each record relative to the common model, and its standard error due to noise, in
        s.
    gains, gain_errors : ndarray, shape (R,)
        Gain of each record relative to the common one, and its standard error.
    lags, lag_errors : ndarray, shape (R,)
        Time constants of each record relative to the common ones, with delay and gain free, and the
        relative standard error of that ratio.
    fit_percent : ndarray, shape (R,)
        Fit of the common model to each record, after correction of level and drift: ``100 (1 - |y -
        model| / |y - mean y|)``.
    trend, trend_error : float
        Slope of the delays over the amplitudes, in s per unit of input.
    outlying : tuple of str
        Outlying records, which are not in the mean.
    gains_alone, gain_alone_errors : ndarray, shape (R,)
        As `gains`, with the dead time common as well.
    """

    names: tuple[str, ...]
    amplitudes: FloatArray
    delays: FloatArray
    errors: FloatArray
    gains: FloatArray
    gain_errors: FloatArray
    lags: FloatArray
    lag_errors: FloatArray
    fit_percent: FloatArray
    gains_alone: FloatArray
    gain_alone_errors: FloatArray
    chi_square: float
    p_value: float
    gain_test: tuple[float, float]
    lag_test: tuple[float, float]
    trend: float
    trend_error: float
    outlying: tuple[str, ...]

    @property
    def kept(self) -> BoolArray:
        """Whether each record is in the fit, shape (R,)."""
        return np.array([name not in self.outlying for name in self.names])

    @property
    def gain_spread(self) -> float:
        """Largest relative difference of a record's gain from the common one."""
        return float(np.max(np.abs(self.gains[self.kept] - 1.0), initial=0.0))

    def table(self) -> pd.DataFrame:
        """One row for each record: its delay, gain and lags, and the fit of the common model.

        Returns
        -------
        pandas.DataFrame
            Index ``record``; columns ``amplitude``, ``dead_time``, ``dead_time_error`` [s],
            ``gain``, ``gain_error``, ``lags``, ``lags_error`` (over the common ones),
            ``fit_percent`` and ``outlying``.
        """
        import pandas as pd

        table = pd.DataFrame(
            {
                "amplitude": self.amplitudes,
                "dead_time": self.delays,
                "dead_time_error": self.errors,
                "gain": self.gains,
                "gain_error": self.gain_errors,
                "lags": self.lags,
                "lags_error": self.lag_errors,
                "fit_percent": self.fit_percent,
                "outlying": ~self.kept,
            }
        )
        return table.set_index(pd.Index(self.names, name="record"))

    def rows(self) -> list[tuple[str, str]]:
        """List the numbers for a report."""
        scatter = float(self.delays.std(ddof=1)) if self.delays.size > 1 else 0.0
        rows = [
            ("records", f"{len(self.names)}, {len(self.outlying)} of them excluded"),
            ("scatter of delays", f"{in_time(scatter)} between records"),
            (
                "chi-square",
                f"{self.chi_square:.3g}, {len(self.names) - 1} degrees of freedom "
                f"(p = {self.p_value:.2g})",
            ),
        ]
        for what, ratios, (statistic, chance) in (
            ("gains", self.gains, self.gain_test),
            ("time constants", self.lags, self.lag_test),
        ):
            if statistic > 0:
                rows.append(
                    (
                        what,
                        f"{ratios.min():.3g} to {ratios.max():.3g} times the common value "
                        f"(chi-square {statistic:.3g}, p = {chance:.2g})",
                    )
                )
        followed = list(zip(self.names, self.fit_percent, self.gains, strict=False))
        rows += [
            (f"record {name}", f"{fit:.1f} % fit, gain {gain:.3g} times the common one")
            for name, fit, gain in followed[:_MOST_NAMED]
        ]
        if self.trend_error > 0:
            rows.append(
                ("trend with amplitude", f"{self.trend:.2g} +- {self.trend_error:.2g} s per unit")
            )
        return rows


Fitted = TypeVar("Fitted")


def fit_alike(
    fit: Callable[[tuple[int, ...]], tuple[Fitted, OutputErrorEstimate, Sequence[OwnResponse]]],
    unlike: Callable[[Repeatability], Iterable[int]],
    names: Iterable[str],
    amplitudes: Sequence[float],
    used: tuple[int, ...],
) -> tuple[Fitted, OutputErrorEstimate, Repeatability]:
    """Fit records with one model, and again without those that are unlike the others.

    The interval is widened by the standard error of the mean of the delays, if records differ by
    more than their noise.

    Parameters
    ----------
    fit : callable
        Fit of the records at some positions, with the response of every record, fitted or not,
        relative to the model.
    unlike : callable
        Positions of records that are to be left out.
    names : iterable of str
        Of all records.
    amplitudes : sequence of float
        Height of each step, or range of each input.
    used : tuple of int
        Positions of the records that are fitted first.
    """
    named = distinct(names)
    while True:
        found, estimate, own = fit(used)
        repeats = _compared(named, np.array(amplitudes), own, used, estimate.dead_time)
        apart = {*unlike(repeats)}
        if not apart:
            break
        used = tuple(i for i in used if i not in apart)
    if repeats.p_value < 0.01:
        between = float(repeats.delays[list(used)].std(ddof=1) / np.sqrt(len(used)))
        estimate = replace(
            estimate,
            low=max(estimate.low - Z_95 * between, 0.0),
            high=estimate.high + Z_95 * between,
            std=float(np.hypot(estimate.std, between)),
        )
    return found, estimate, repeats


def _compared(
    names: tuple[str, ...],
    amplitudes: FloatArray,
    own: Sequence[OwnResponse],
    used: tuple[int, ...],
    delay: float,
) -> Repeatability:
    """Test whether records, of which some were used, differ by more than the noise in each."""
    table, kept = np.array(own).T, list(used)
    shifts, errors, gains, gain_errors, lags, lag_errors, followed, alone, alone_errors = table
    chi_square, p_value = homogeneity(shifts[kept], errors[kept])
    trend, trend_error = _trend(np.abs(amplitudes[kept]), shifts[kept], errors[kept])
    return Repeatability(
        names=names,
        amplitudes=amplitudes,
        delays=delay + shifts,
        errors=errors,
        gains=gains,
        gain_errors=gain_errors,
        lags=lags,
        lag_errors=lag_errors,
        fit_percent=followed,
        gains_alone=alone,
        gain_alone_errors=alone_errors,
        chi_square=chi_square,
        p_value=p_value,
        gain_test=homogeneity(alone[kept], alone_errors[kept]),
        lag_test=homogeneity(np.log(lags[kept]), lag_errors[kept]),
        trend=trend,
        trend_error=trend_error,
        outlying=tuple(name for i, name in enumerate(names) if i not in used),
    )


def delay_outliers(found: Repeatability) -> list[int]:
    """Positions of records with an outlying delay."""
    return _far(found, found.delays, found.errors)


def gain_outliers(found: Repeatability) -> list[int]:
    """Positions of records with an outlying gain: another plant, or no response."""
    return _far(found, found.gains_alone, found.gain_alone_errors)


def _far(found: Repeatability, values: FloatArray, errors: FloatArray) -> list[int]:
    scale = np.maximum(mad_sigma(values[found.kept]), errors)
    away = np.abs(values - float(np.median(values[found.kept])))
    return np.flatnonzero(found.kept & (away > APART * scale)).tolist()


def unlike_records(found: Repeatability, dt: float) -> list[int]:
    """Positions of records, among those used, whose response is not a multiple of the others'.

    They do not respond, or their dead time or time constants disagree with those of the others.
    """
    answers = np.abs(found.gains_alone) > RESPONDS * found.gain_alone_errors
    rest = np.flatnonzero(found.kept & answers)
    if rest.size == 0:
        return []
    late = disagreeing(found.delays[rest], found.errors[rest], _LATER * dt)
    slow = disagreeing(np.log(found.lags[rest]), found.lag_errors[rest], np.log1p(_SLOWER))
    return [*np.flatnonzero(found.kept & ~answers).tolist(), *rest[late], *rest[slow]]


def _trend(amplitudes: FloatArray, shifts: FloatArray, errors: FloatArray) -> tuple[float, float]:
    """Slope of the delays over the amplitudes and its standard error; zeros if there is none.

    Scatter beyond the errors is estimated about the line: about the mean, the trend itself would
    increase its error, and ten records or fewer could never show one.
    """
    weight = errors**-2
    centre = float(np.sum(weight * amplitudes) / np.sum(weight))
    spread = float(np.sum(weight * (amplitudes - centre) ** 2))
    if np.ptp(amplitudes) <= SAME_AMPLITUDE * float(np.max(amplitudes)) or amplitudes.size < 3:
        return 0.0, 0.0
    mean = float(np.sum(weight * shifts) / np.sum(weight))
    slope = float(np.sum(weight * (amplitudes - centre) * shifts)) / spread
    left = shifts - mean - slope * (amplitudes - centre)
    inflation = max(float(np.sum(weight * left**2)) / (amplitudes.size - 2), 1.0)
    return slope, float(np.sqrt(inflation / spread))
