"""Many records of one plant: a table of delays, their statistics, one final model.

The paper's way: a model for each record, the trimmed mean of the delays, and the record of least
misfit realized at that delay (section 3.2). The better way: records averaged and fitted
together, since averaging estimates keeps their common bias.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from joblib import Parallel, delayed

from ..checks import one_of, whole
from ..delayed import DelayedStateSpace
from ..errors import CtrlRealizeError, DataError, OptionError
from ..numerics.arrays import FloatArray
from ..numerics.statistics import TrimmedStatistics, trimmed_statistics
from ..results import Flag, Result
from ..signals import Record
from .identify import METHODS, Method, identify
from .realization import realize
from .steps import detect_step

if TYPE_CHECKING:
    import pandas as pd

RecordSource = Record | Callable[[], Record]


@dataclass(frozen=True, eq=False)
class CampaignRow:
    """What one record gave: a model, or the error that stopped it.

    Exactly one of `system` and `error` is None.

    Attributes
    ----------
    name : str
    amplitude : float
        Height of the input step; NaN where there is none.
    system : DelayedStateSpace or None
    error : str or None
        What stopped this record, in one line.
    warnings : tuple of str
        What was warned of on the way.
    """

    name: str
    amplitude: float = float("nan")
    system: DelayedStateSpace | None = None
    error: str | None = None
    warnings: tuple[str, ...] = ()

    @property
    def delay(self) -> float:
        """Estimated delay in samples; NaN for a failed record."""
        return float("nan") if self.system is None else float(self.system.fit.delay)

    @property
    def dead_time(self) -> float:
        """Estimated dead time in s; NaN for a failed record."""
        return float("nan") if self.system is None else self.delay * float(self.system.dt)

    @property
    def interval(self) -> tuple[float, float]:
        """Interval of the dead time in s; NaN for a failed record."""
        if self.system is None:
            return (float("nan"), float("nan"))
        low, high = self.system.fit.dead_time_interval
        return (float(low), float(high))

    @property
    def misfit(self) -> float:
        """Misfit of the model, scaled to a unit step, so that records can be compared."""
        return float("nan") if self.system is None else float(self.system.fit.misfit)

    def __repr__(self) -> str:
        what = self.error if self.system is None else f"delay {self.delay:.4g} samples"
        return f"<CampaignRow {self.name!r}: {what}>"


@dataclass(frozen=True, eq=False)
class Campaign(Result):
    """Models of many records, and what they say together.

    ``statistics(trim)`` is over ``[row.delay for row in rows if row.system]``; `best` is the row
    of least misfit; `system` is the final model.

    Attributes
    ----------
    rows : tuple of CampaignRow
        One for each record, in the order given; a record that failed is a row with its error.
    method : str
        How the records were identified.
    """

    rows: tuple[CampaignRow, ...]
    method: str
    loss: str = field(default="huber", repr=False)

    @cached_property
    def good(self) -> tuple[CampaignRow, ...]:
        """The rows that have a model."""
        return tuple(row for row in self.rows if row.system is not None)

    @property
    def failed(self) -> tuple[CampaignRow, ...]:
        """The rows that have an error instead."""
        return tuple(row for row in self.rows if row.system is None)

    @property
    def dt(self) -> float:
        """Sample time in s that all records share.

        Raises
        ------
        DataError
            No record was identified, or the sample times differ.
        """
        times = {float(row.system.dt) for row in self.good if row.system is not None}
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
        return min(times)

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
            records = [record for row in self.good for record in _records_of(row)]
            from .delay_fit import fit_delay

            return fit_delay(records, loss=self.loss)
        chosen = self.best.system
        assert chosen is not None
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
                "order": np.nan if row.system is None else row.system.delay_free.nstates,
                "misfit": row.misfit,
                "flags": ""
                if row.system is None
                else ", ".join(flag.code for flag in row.system.fit.flags),
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
            gains = np.array([_gain(row) for row in members])
            many = len(members) > 1
            rows.append(
                {
                    "amplitude": amplitude,
                    "records": len(members),
                    "delay": delays.mean(),
                    "std": delays.std(ddof=1) if many else np.nan,
                    "gain": gains.mean(),
                    "gain_std": gains.std(ddof=1) if many else np.nan,
                }
            )
        return pd.DataFrame(rows).set_index("amplitude")

    @property
    def flags(self) -> tuple[Flag, ...]:
        """What one should know: failed records, and delays that depend on the step height."""
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
        trend = _amplitude_trend(self.good)
        if trend is not None:
            flags.append(trend)
        return tuple(flags)

    def _title(self) -> str:
        return f"Campaign of {len(self.rows)} records ({self.method})"

    def _rows(self) -> list[tuple[str, str]]:
        summary = self.statistics()
        best = self.best
        return [
            ("identified", f"{len(self.good)} of {len(self.rows)} records"),
            (
                "delay, trimmed mean",
                f"{summary.mean:.2f} samples = {1e3 * summary.mean * self.dt:.4g} ms "
                f"({summary.dropped} of {len(self.good)} left out)",
            ),
            ("variance", f"{summary.variance:.3g} samples^2"),
            (
                "95 % interval of the mean",
                f"{summary.interval[0]:.2f}...{summary.interval[1]:.2f} samples (scatter between "
                "records only: a bias that all share is not in it)",
            ),
            ("best record", f"{best.name} (misfit {best.misfit:.3g})"),
        ]

    def __repr__(self) -> str:
        failed = f", {len(self.failed)} failed" if self.failed else ""
        return f"<Campaign: {len(self.rows)} records{failed}, method {self.method!r}>"


def identify_campaign(
    records: Iterable[RecordSource],
    *,
    n_jobs: int = 1,
    method: Method = "output_error",
    progress: bool | None = None,
    **options: Any,
) -> Campaign:
    """Identify every record of a campaign; one bad record never stops the rest.

    Parameters
    ----------
    records : iterable of Record, or of functions that return one
        A function, such as ``functools.partial(cr.read_record, path)``, is called where the
        record is identified, so that files are read by the workers, one at a time, and a file
        that cannot be read is a row with its error.
    n_jobs : int, optional
        Processes to use (joblib; -1 for all cores). The result does not depend on it. Inside
        ``joblib.parallel_config(backend="dask")`` the work goes to a Dask cluster.
    method : {"output_error", "scan", "paper"}, optional
    progress : bool, optional
        Show a progress bar; default: where somebody can see it.
    **options
        Further arguments of `identify`, the same for all records.

    Returns
    -------
    Campaign

    Raises
    ------
    DataError
        `records` is empty.
    OptionError
        An argument that `identify` does not take.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> valve = cr.bench.valve()
    >>> records = [valve.step_record(16.0, seed) for seed in range(3)]
    >>> campaign = cr.identify_campaign(records, method="paper")
    >>> campaign
    <Campaign: 3 records, method 'paper'>
    >>> bool(30 < campaign.statistics().mean < 70)
    True
    """
    one_of(method, "method", METHODS)
    _check_options(options)
    if isinstance(n_jobs, bool) or not isinstance(n_jobs, int) or n_jobs == 0:
        raise OptionError(f"n_jobs={n_jobs!r}; needed is a number of processes, or -1 for all")
    sources = list(records)
    if not sources:
        raise DataError("there are no records to identify")
    for position, source in enumerate(sources):
        if not isinstance(source, Record) and not callable(source):
            raise DataError(
                f"records[{position}] is a {type(source).__name__}; needed is a Record, or a "
                "function that returns one (functools.partial(read_record, path))"
            )
    tasks = (
        delayed(_identify_one)(source, position, method, options)
        for position, source in enumerate(sources)
    )
    rows = Parallel(n_jobs=n_jobs, return_as="generator")(tasks)
    return Campaign(
        tuple(_with_bar(rows, len(sources), progress)), method, options.get("loss", "huber")
    )


def _identify_one(
    source: RecordSource, position: int, method: Method, options: dict[str, Any]
) -> CampaignRow:
    name = _source_name(source, position)
    amplitude = float("nan")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            record = source if isinstance(source, Record) else source()
            name = record.name or name
            amplitude = _amplitude(record)
            system = identify(record, method=method, **options)
        except (CtrlRealizeError, OSError, ArithmeticError, np.linalg.LinAlgError) as error:
            return CampaignRow(name, amplitude, error=_one_line(error), warnings=_messages(caught))
    return CampaignRow(name, amplitude, system, warnings=_messages(caught))


def _source_name(source: RecordSource, position: int) -> str:
    if isinstance(source, Record):
        return source.name or f"record {position}"
    arguments = getattr(source, "args", ())
    return str(arguments[0]) if arguments else f"record {position}"


def _amplitude(record: Record) -> float:
    try:
        return detect_step(record).amplitude
    except CtrlRealizeError:
        return float("nan")


def _one_line(error: Exception) -> str:
    return f"{type(error).__name__}: {' '.join(str(error).split())}"


def _messages(caught: list[warnings.WarningMessage]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(str(entry.message) for entry in caught))


def _records_of(row: CampaignRow) -> tuple[Record, ...]:
    assert row.system is not None
    return tuple(row.system.fit.records)


def _gain(row: CampaignRow) -> float:
    assert row.system is not None
    return float(np.real(row.system.dcgain()))


def _amplitude_trend(rows: tuple[CampaignRow, ...]) -> Flag | None:
    """Test whether the delay depends on the height of the step, by the rank correlation."""
    from scipy.stats import spearmanr

    heights = np.array([abs(row.amplitude) for row in rows])
    delays = np.array([row.delay for row in rows])
    known = np.isfinite(heights) & np.isfinite(delays)
    heights, delays = heights[known], delays[known]
    if np.unique(np.round(heights, 6)).size < 2 or heights.size < 8 or np.ptp(delays) == 0:
        return None
    correlation, chance = spearmanr(heights, delays)
    # 1 %: one false alarm in a hundred campaigns of a linear plant.
    if not chance < 0.01:
        return None
    way = "longer" if correlation > 0 else "shorter"
    return Flag(
        "amplitude_trend",
        f"the delay is {way} for larger steps (rank correlation {correlation:.2f}, chance "
        f"{chance:.1g}): friction, a slew limit or another nonlinearity; one linear model cannot "
        "hold for all amplitudes",
    )


def _check_options(options: dict[str, Any]) -> None:
    from inspect import signature

    known = set(signature(identify).parameters) - {"record", "method"}
    strange = sorted(set(options) - known)
    if strange:
        raise OptionError(f"{', '.join(strange)}: identify takes {', '.join(sorted(known))}")


def _with_bar(
    rows: Iterable[CampaignRow], total: int, progress: bool | None
) -> Iterator[CampaignRow]:
    with warnings.catch_warnings():
        # In a notebook without ipywidgets tqdm warns, and falls back to text by itself.
        warnings.filterwarnings("ignore", message="IProgress not found")
        from tqdm.auto import tqdm
    # disable=None: no bar where the output is not a terminal.
    disable = None if progress is None else not progress
    yield from tqdm(rows, total=total, desc="identify", unit="record", disable=disable)
