"""Many records of one plant: a table of delays, their statistics, one final model.

In the paper: a model for each record, the trimmed mean of the delays, and the record with the
smallest residual realized at that delay (section 3.2). More accurate: one fit of all records
together, since the mean of estimates keeps their common bias.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ..._checks import integer
from ..._wording import in_time
from ...delayed import DelayedStateSpace, fit_of
from ...delayed.parts import signals_of
from ...errors import DataError
from ...numerics.arrays import FloatArray
from ...numerics.statistics import TrimmedStatistics, trimmed_statistics
from ...results import Flag, Result
from ..methods import Method, fit_records, identify
from ..realization.delay_scan_result import DelayScan
from ..realization.realize import realize
from .flags import campaign_flags
from .rows import CampaignRow, RecordSource, read_source

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False)
class Campaign(Result):
    """Models of many records, with their statistics.

    ``statistics(trim)`` is over ``[row.delay for row in good]``; `best` is the row
    with the smallest residual; `system` is the final model.

    Attributes
    ----------
    rows : tuple of CampaignRow
        One for each record, in the order given; a record that failed has a row with its error.
    sources : tuple
        The records, or the functions that read them.
    method : str
        How the records were identified.
    options : dict
        Further arguments of `identify`.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> valve = cr.bench.valve()
    >>> records = [valve.step_record(16.0, seed) for seed in range(4)]
    >>> campaign = cr.identify_campaign(records, method="scan")
    >>> print(campaign.delays, campaign.statistics(trim=1).mean)
    [44. 45. 46. 45.] 45.0
    """

    rows: tuple[CampaignRow, ...]
    sources: tuple[RecordSource, ...] = field(repr=False)
    method: Method
    options: Mapping[str, Any]

    @cached_property
    def good(self) -> tuple[CampaignRow, ...]:
        """The rows with a model."""
        return tuple(row for row in self.rows if row.error is None)

    @property
    def failed(self) -> tuple[CampaignRow, ...]:
        """The rows with an error."""
        return tuple(row for row in self.rows if row.error is not None)

    @property
    def dt(self) -> float:
        """Common sample time of all records in s.

        Raises
        ------
        DataError
            No record was identified, or the sample times differ.
        """
        times = {row.dt for row in self.good}
        if not times:
            raise DataError(
                f"none of the {len(self.rows)} records could be identified; the error of the "
                f"first: {self.rows[0].error}"
            )
        if max(times) > min(times) * (1 + 1e-6):
            raise DataError(
                f"the records have sample times from {min(times):g} s to {max(times):g} s; delays "
                "in samples and one common model need the same for all"
            )
        return float(min(times))

    @property
    def delays(self) -> FloatArray:
        """Delays of all records with a model, in samples."""
        return np.array([row.delay for row in self.good])

    def statistics(self, trim: int | None = None) -> TrimmedStatistics:
        """Trimmed mean and variance of the delays, in samples.

        Parameters
        ----------
        trim : int, optional
            Number of values left out at each end; the paper leaves out 3 of 40. Default: 3, or a
            quarter for fewer than twelve records.

        Raises
        ------
        DataError
            No value remains, or the records have different sample times.
        """
        count = len(self.good)
        _ = self.dt
        drop = min(3, count // 4) if trim is None else integer(trim, "trim", 0)
        if 2 * drop >= count:
            raise DataError(f"trim={drop} removes all {count} delays")
        return trimmed_statistics(self.delays, drop)

    @property
    def best(self) -> CampaignRow:
        """The row with the best fit; the records are scaled to a unit step first.

        Of those with less than half of the median gain none is the best: there is little to fit.
        """
        _ = self.dt
        least = 0.5 * np.median([abs(row.gain) for row in self.good])
        return min((r for r in self.good if not abs(r.gain) < least), key=lambda row: row.residual)

    @cached_property
    def system(self) -> DelayedStateSpace:
        """The final model.

        For ``"scan"`` and ``"paper"`` the best record realized at the rounded trimmed mean of the
        delays (section 3.2); for ``"output_error"`` one fit of all records together.
        """
        _ = self.dt
        if self.method == "output_error":
            pairs = zip(self.rows, self.sources, strict=True)
            good = [read_source(source) for row, source in pairs if row.error is None]
            return fit_records(good, **self.options)
        chosen = self._identified(self.best)
        scan = fit_of(chosen, DelayScan)
        final = realize(
            scan.impulse,
            scan.order,
            delay=round(self.statistics().mean),
            samples=scan.samples,
            feedthrough=scan.realization.feedthrough,
            hankel=scan.realization.hankel,
        )
        return final.replace(name=chosen.name, **signals_of(chosen))

    def _identified(self, row: CampaignRow) -> DelayedStateSpace:
        """The model of a row with its complete fit, of which a store keeps only a summary."""
        system = row.system
        if system is not None and isinstance(system.fit, DelayScan):
            return system
        source = self.sources[self.rows.index(row)]
        return identify(read_source(source), method=self.method, **self.options)

    def table(self) -> pd.DataFrame:
        """Table of all records, in the order given.

        Returns
        -------
        pandas.DataFrame
            Index ``record``; columns ``amplitude``, ``delay`` [samples], ``dead_time``, ``low``,
            ``high`` [s], ``gain``, ``gain_std``, ``order``, ``residual``, ``flags`` and ``error``.
        """
        import pandas as pd

        rows = [
            {
                "record": row.name,
                "amplitude": row.amplitude,
                "delay": row.delay,
                "dead_time": row.dead_time,
                "low": row.interval[0],
                "high": row.interval[1],
                "gain": row.gain,
                "gain_std": row.gain_std,
                "order": np.nan if row.order is None else row.order,
                "residual": row.residual,
                "flags": ", ".join(flag.code for flag in row.flags),
                "error": row.error or "",
            }
            for row in self.rows
        ]
        return pd.DataFrame(rows).set_index("record")

    def by_amplitude(self) -> pd.DataFrame:
        """Count, mean and scatter of the delays, and the gain, for each step height.

        A delay or gain that depends on the height of the step indicates a nonlinear plant.

        Returns
        -------
        pandas.DataFrame
            Index ``amplitude``; columns ``records``, ``delay``, ``std`` [samples], ``gain``,
            ``gain_std``.

        Raises
        ------
        DataError
            The records have different sample times.
        """
        import pandas as pd

        if self.good:
            _ = self.dt
        frame = pd.DataFrame(
            {
                "amplitude": [float(f"{row.amplitude:.2g}") for row in self.good],
                "delay": self.delays,
                "gain": [row.gain for row in self.good],
            }
        )
        groups = frame.groupby("amplitude", dropna=False)
        return groups.agg(
            records=("delay", "size"), delay=("delay", "mean"), std=("delay", "std"),
            gain=("gain", "mean"), gain_std=("gain", "std"),
        )  # fmt: skip

    @property
    def flags(self) -> tuple[Flag, ...]:
        """Warnings about failed or duplicate records, and about delays or gains that differ."""
        return tuple(campaign_flags(self.rows, self.good, self.failed, self.method))

    def _title(self) -> str:
        many = len(self.rows)
        return f"Campaign of {many} record{'s' if many != 1 else ''} ({self.method})"

    def _rows(self) -> list[tuple[str, str]]:
        identified = "identified", f"{len(self.good)} of {len(self.rows)} records"
        try:
            summary, best = self.statistics(), self.best
        except DataError as error:
            return [identified, ("delay", f"no mean: {error}")]
        spread = [
            ("variance", f"{summary.variance:.3g} samples^2"),
            (
                "95 % interval of the mean",
                f"{summary.interval[0]:.2f}...{summary.interval[1]:.2f} samples (scatter "
                "between records only; a bias common to all records is not included)",
            ),
        ]
        if not np.isfinite(summary.variance):
            spread = [("scatter", "unknown: a single record has no scatter")]
        return [
            identified,
            (
                "delay, trimmed mean",
                f"{summary.mean:.2f} samples = {in_time(summary.mean * self.dt, 4)} "
                f"({summary.dropped} of {len(self.good)} removed)",
            ),
            *spread,
            ("best record", f"{best.name} (residual {best.residual:.3g})"),
        ]

    def __repr__(self) -> str:
        failed = f", {len(self.failed)} failed" if self.failed else ""
        return f"<Campaign: {len(self.rows)} records{failed}, method {self.method!r}>"
