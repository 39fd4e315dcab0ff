"""Differences between records of one plant."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from ..._wording import in_time
from ...numerics.arrays import FloatArray

if TYPE_CHECKING:
    import pandas as pd

_MOST_NAMED = 8
"""Largest number of records listed in a card; the table lists all."""


def distinct(names: Iterable[str]) -> tuple[str, ...]:
    """Names of records, with numbers where they are missing or the same."""
    given = [name or f"record {i}" for i, name in enumerate(names)]
    return tuple(
        name if given.count(name) == 1 else f"{name} ({i})" for i, name in enumerate(given)
    )


def _nothing() -> FloatArray:
    return np.empty(0)


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
    chi_square: float
    p_value: float
    trend: float
    trend_error: float
    outlying: tuple[str, ...]
    gain_errors: FloatArray = field(default_factory=_nothing)
    lags: FloatArray = field(default_factory=_nothing)
    lag_errors: FloatArray = field(default_factory=_nothing)
    fit_percent: FloatArray = field(default_factory=_nothing)
    gain_test: tuple[float, float] = (0.0, 1.0)
    lag_test: tuple[float, float] = (0.0, 1.0)
    gains_alone: FloatArray = field(default_factory=_nothing)
    gain_alone_errors: FloatArray = field(default_factory=_nothing)

    @property
    def gain_spread(self) -> float:
        """Largest relative difference of a record's gain from the common one."""
        kept = [name not in self.outlying for name in self.names]
        return float(np.max(np.abs(self.gains[kept] - 1.0), initial=0.0))

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

        unknown = np.full(len(self.names), np.nan)
        columns = {
            "amplitude": self.amplitudes,
            "dead_time": self.delays,
            "dead_time_error": self.errors,
            "gain": self.gains,
            "gain_error": self.gain_errors,
            "lags": self.lags,
            "lags_error": self.lag_errors,
            "fit_percent": self.fit_percent,
        }
        table = pd.DataFrame({name: v if v.size else unknown for name, v in columns.items()})
        table["outlying"] = [name in self.outlying for name in self.names]
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
            if ratios.size and statistic > 0:
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
