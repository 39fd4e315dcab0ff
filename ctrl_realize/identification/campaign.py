"""Many records of one plant: a table of delays, their statistics, one final model.

The paper's way: a model for each record, the trimmed mean of the delays, and the record of least
misfit realized at that delay (section 3.2). The better way: records averaged and fitted
together, since averaging estimates keeps their common bias.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ..checks import whole
from ..delayed import DelayedStateSpace
from ..errors import DataError
from ..numerics.arrays import FloatArray
from ..numerics.statistics import TrimmedStatistics, trimmed_statistics
from ..results import Flag, Result
from ..wording import in_time
from .campaign_row import CampaignRow, RecordSource, read_source
from .identify import Method, fit_records, identify
from .realization import realize

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False)
class Campaign(Result):
    """Models of many records, and what they say together.

    ``statistics(trim)`` is over ``[row.delay for row in rows if row.system]``; `best` is the row
    of least misfit; `system` is the final model.

    Attributes
    ----------
    rows : tuple of CampaignRow
        One for each record, in the order given; a record that failed is a row with its error.
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
    options: dict[str, Any]

    @cached_property
    def good(self) -> tuple[CampaignRow, ...]:
        """The rows that have a model."""
        return tuple(row for row in self.rows if row.model is not None)

    @property
    def failed(self) -> tuple[CampaignRow, ...]:
        """The rows that have an error instead."""
        return tuple(row for row in self.rows if row.model is None)

    @property
    def dt(self) -> float:
        """Sample time in s that all records share.

        Raises
        ------
        DataError
            No record was identified, or the sample times differ.
        """
        times = {row.dt for row in self.good}
        if not times:
            raise DataError(
                f"none of the {len(self.rows)} records could be identified; "
                f"the first says: {self.rows[0].error}"
            )
        if max(times) > min(times) * (1 + 1e-6):
            raise DataError(
                f"the records have sample times from {min(times):g} s to {max(times):g} s; delays "
                "in samples and one common model need the same for all"
            )
        return float(min(times))

    @property
    def delays(self) -> FloatArray:
        """Estimated delays in samples of the records that have a model."""
        return np.array([row.delay for row in self.good])

    def statistics(self, trim: int | None = None, *, ddof: int = 1) -> TrimmedStatistics:
        """Trimmed mean and variance of the delays, in samples.

        Parameters
        ----------
        trim : int, optional
            Values to leave out at each end; the paper leaves out 3 of its 40. Default: 3, or a
            quarter where there are fewer than twelve records.
        ddof : int, optional
            Divisor of the variance is ``count - ddof``.

        Raises
        ------
        DataError
            No value is left, or the records have different sample times.
        """
        count = len(self.good)
        _ = self.dt
        drop = min(3, count // 4) if trim is None else whole(trim, "trim", 0)
        if 2 * drop >= count:
            raise DataError(f"trim={drop} leaves nothing of {count} delays")
        return trimmed_statistics(self.delays, drop, ddof=ddof)

    @property
    def best(self) -> CampaignRow:
        """The row whose model fits best; the records are scaled to a unit step first."""
        _ = self.dt
        return min(self.good, key=lambda row: row.misfit)

    @cached_property
    def system(self) -> DelayedStateSpace:
        """The final model.

        For ``"scan"`` and ``"paper"`` the best record realized at the rounded trimmed mean of the
        delays (section 3.2); for ``"output_error"`` one fit of all records together.
        """
        _ = self.dt
        if self.method == "output_error":
            pairs = zip(self.rows, self.sources, strict=True)
            good = [read_source(source) for row, source in pairs if row.model is not None]
            return fit_records(good, **self.options)
        chosen = self._identified(self.best)
        scan = chosen.fit
        final = realize(
            scan.impulse,
            scan.order,
            delay=round(self.statistics().mean),
            samples=scan.samples,
            feedthrough=scan.realization.feedthrough,
            hankel=scan.realization.hankel,
        )
        return final.replace(
            name=chosen.name, inputs=chosen.input_labels, outputs=chosen.output_labels
        )

    def _identified(self, row: CampaignRow) -> DelayedStateSpace:
        """The row's model with its whole fit, which a store keeps only in summary."""
        system = row.system
        if system is not None and hasattr(system.fit, "impulse"):
            return system
        source = self.sources[self.rows.index(row)]
        return identify(read_source(source), method=self.method, **self.options)

    def table(self) -> pd.DataFrame:
        """One row for each record, in the order given.

        Returns
        -------
        pandas.DataFrame
            Index ``record``; columns ``amplitude``, ``delay`` [samples], ``dead_time``, ``low``,
            ``high`` [s], ``order``, ``misfit``, ``flags`` and ``error``.
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
                "order": np.nan if row.order is None else row.order,
                "misfit": row.misfit,
                "flags": ", ".join(flag.code for flag in row.flags),
                "error": row.error or "",
            }
            for row in self.rows
        ]
        return pd.DataFrame(rows).set_index("record")

    def by_amplitude(self) -> pd.DataFrame:
        """Count, mean and scatter of the delays, and the gain, for each step height.

        A delay or gain that changes with the height of the step is the sign of a nonlinear plant.

        Returns
        -------
        pandas.DataFrame
            Index ``amplitude``; columns ``records``, ``delay``, ``std`` [samples], ``gain``,
            ``gain_std``.
        """
        import pandas as pd

        groups: dict[float, list[CampaignRow]] = {}
        for row in self.good:
            groups.setdefault(float(f"{row.amplitude:.2g}"), []).append(row)
        rows = []
        for amplitude in sorted(groups, key=lambda a: (np.isnan(a), a)):
            members = groups[amplitude]
            delays = np.array([row.delay for row in members])
            gains = np.array([row.gain for row in members])
            many = len(members) > 1
            rows.append(
                {
                    "amplitude": amplitude,
                    "records": len(members),
                    "delay": delays.mean(),
                    "std": delays.std(ddof=1) if many else np.nan,
                    "gain": gains.mean(),
                    # integrating plants have no gain, and inf - inf would warn
                    "gain_std": gains.std(ddof=1) if many and np.isfinite(gains).all() else np.nan,
                }
            )
        columns = ["amplitude", "records", "delay", "std", "gain", "gain_std"]
        return pd.DataFrame(rows, columns=columns).set_index("amplitude")

    @property
    def flags(self) -> tuple[Flag, ...]:
        """What one should know: records that failed or came twice, a delay that is not constant."""
        flags = []
        if self.failed:
            names = ", ".join(row.name for row in self.failed[:5])
            more = "" if len(self.failed) <= 5 else f" and {len(self.failed) - 5} more"
            flags.append(
                Flag(
                    "failed_records",
                    f"{len(self.failed)} of {len(self.rows)} records failed: {names}{more}; the "
                    "table tells why",
                )
            )
        found = (_same_records(self.good), _amplitude_trend(self.good, self.method))
        return (*flags, *(flag for flag in found if flag is not None))

    def _title(self) -> str:
        return f"Campaign of {len(self.rows)} records ({self.method})"

    def _rows(self) -> list[tuple[str, str]]:
        summary = self.statistics()
        best = self.best
        spread = [
            ("variance", f"{summary.variance:.3g} samples^2"),
            (
                "95 % interval of the mean",
                f"{summary.interval[0]:.2f}...{summary.interval[1]:.2f} samples (scatter between "
                "records only: a bias that all share is not in it)",
            ),
        ]
        if not np.isfinite(summary.variance):
            spread = [("scatter", "unknown: one record has none")]
        return [
            ("identified", f"{len(self.good)} of {len(self.rows)} records"),
            (
                "delay, trimmed mean",
                f"{summary.mean:.2f} samples = {in_time(summary.mean * self.dt, 4)} "
                f"({summary.dropped} of {len(self.good)} left out)",
            ),
            *spread,
            ("best record", f"{best.name} (misfit {best.misfit:.3g})"),
        ]

    def __repr__(self) -> str:
        failed = f", {len(self.failed)} failed" if self.failed else ""
        return f"<Campaign: {len(self.rows)} records{failed}, method {self.method!r}>"


def _same_records(rows: tuple[CampaignRow, ...]) -> Flag | None:
    """Find records whose results agree in every digit, which noise never lets happen."""
    alike: dict[tuple[float, ...], list[str]] = {}
    for row in rows:
        results = (row.delay, row.misfit, row.gain, row.amplitude, *row.interval)
        alike.setdefault(results, []).append(row.name)
    twice = [names for names in alike.values() if len(names) > 1]
    if not twice:
        return None
    extra = sum(len(names) - 1 for names in twice)
    names = ", ".join(twice[0][:4]) + (", ..." if len(twice[0]) > 4 else "")
    more = "" if len(twice) == 1 else f" (and {len(twice) - 1} more such groups)"
    return Flag(
        "same_records",
        f"{extra} of {len(rows)} records are others over again: {names} have the same results to "
        f"the last digit{more}; the scatter and its interval are too small",
    )


def _amplitude_trend(rows: tuple[CampaignRow, ...], method: str) -> Flag | None:
    """Test whether the delay depends on the height of the step, by the rank correlation."""
    from scipy.stats import pearsonr, spearmanr  # scipy.stats takes a while to import

    if rows and method != "output_error":
        # A realization of one order more takes a lag out of the delay: compared is what is alike.
        orders = Counter(row.order for row in rows)
        rows = tuple(row for row in rows if row.order == orders.most_common(1)[0][0])
    heights = np.array([abs(row.amplitude) for row in rows])
    delays = np.array([row.delay for row in rows])
    known = np.isfinite(heights) & np.isfinite(delays)
    heights, delays = heights[known], delays[known]
    if np.unique(np.round(heights, 6)).size < 2 or heights.size < 8 or np.ptp(delays) == 0:
        return None
    correlation, chance = spearmanr(heights, delays)
    if heights.size < 10:
        # So few ranks stand in order by chance (1 in 35 campaigns of four and four records, where
        # Student's distribution says 1 in 350): the delays themselves have to agree.
        chance = max(chance, pearsonr(heights, delays).pvalue)
    # 1 %: one false alarm in a hundred campaigns of a linear plant.
    if not chance < 0.01:
        return None
    way = "longer" if correlation > 0 else "shorter"
    # Noise is larger beside a smaller step: a scan's bias grows with it, a fit misses fast lags.
    doubt = ""
    if method != "output_error":
        doubt = "; or the bias of the scan, which grows with the noise: method='output_error' tells"
    elif len({row.order for row in rows if np.isfinite(row.delay)}) > 1:
        doubt = "; or a lag that only large steps show above the noise, as the orders differ"
    return Flag(
        "amplitude_trend",
        f"the delay is {way} for larger steps (rank correlation {correlation:.2f}, chance "
        f"{chance:.1g}): friction, a slew limit or another nonlinearity, for which one linear "
        f"model cannot hold at all amplitudes{doubt}",
    )
