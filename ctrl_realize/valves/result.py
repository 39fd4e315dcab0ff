"""Report of a valve test."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

import numpy as np

from .._checks import one_of
from ..data import Record
from ..errors import OptionError
from ..results import Flag, Result
from .definitions import DEFINITIONS
from .groups import SizeAndDirection, cut_out
from .metrics import Metric, words_of
from .part import TestPart
from .statics import StaticCurve
from .steps import STEP_METRICS, Ranges, StepMetrics
from .words import in_words, named_metric, where_in_words

if TYPE_CHECKING:
    import pandas as pd

Level = Literal["good", "caution", "poor"]


@dataclass(frozen=True, eq=False)
class ValveReport(Result):
    """Metrics of a valve test, made by `valve_report`.

    Times are in s, travel in % of `ranges`, and each number has a 95 % interval. What the records
    cannot tell is unknown (NaN), and `missing_tests` names the test that it needs.

    Attributes
    ----------
    metrics : tuple of Metric
        One for each of `DEFINITIONS`; of those that depend on the step, the worst, without full
        strokes if there are other steps: those are among `groups` and have metrics of their own.
        After them those with a limit for a step size.
    groups : tuple of SizeAndDirection
        Metrics against step size and direction.
    steps : tuple of StepMetrics
        Every step of the command.
    parts : tuple of tuple of TestPart
        Parts of each record.
    curve : StaticCurve or None
        Position against command at rest.
    ranges : Ranges
        Command and travel of the closed and the open valve.
    records : tuple of Record
    choices : tuple of str
    flags : tuple of Flag

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> records = cr.bench.valve().step_campaign(1, amplitudes=(16.0, 4.0), repeats=3)
    >>> report = cr.valves.valve_report(records, command_range=(4, 20), fit=False)
    >>> report
    <ValveReport of 6 records: 6 steps, 10 of 18 metrics known>
    >>> print(report.table()[["size", "direction", "count", "t86"]].round(2))
        size direction  count   t86
    0   25.0   opening      3  0.21
    1  100.0   opening      3  0.21
    """

    metrics: tuple[Metric, ...]
    groups: tuple[SizeAndDirection, ...]
    steps: tuple[StepMetrics, ...] = field(repr=False)
    parts: tuple[tuple[TestPart, ...], ...] = field(repr=False)
    curve: StaticCurve | None = field(repr=False)
    ranges: Ranges
    records: tuple[Record, ...] = field(repr=False)
    choices: tuple[str, ...] = ()
    flags: tuple[Flag, ...] = ()

    def __repr__(self) -> str:
        known = sum(one.interval.is_known for one in self.metrics[: len(DEFINITIONS)])
        many = len(self.records)
        return (
            f"<ValveReport of {many} record{'s' if many > 1 else ''}: {len(self.steps)} "
            f"step{'s' if len(self.steps) != 1 else ''}, {known} of {len(DEFINITIONS)} metrics "
            "known>"
        )

    def metric(self, key: str) -> Metric:
        """Return one metric.

        Parameters
        ----------
        key : str
            One of `DEFINITIONS`.

        Raises
        ------
        OptionError
            There is no such metric.
        """
        for one in self.metrics:
            if one.key == key:
                return one
        raise OptionError(f"metric {key!r}; expected one of {', '.join(DEFINITIONS)}")

    @property
    def missing_tests(self) -> dict[str, tuple[str, ...]]:
        """Tests that would tell the unknown metrics: test -> names of these metrics.

        Also of rates whose interval is open upwards, if no full stroke has told them.
        """
        found: dict[str, list[str]] = {}
        for one in self.metrics[: len(DEFINITIONS)]:
            # a fit that was not asked for, or that no linear model allows, lacks no test
            fitted = one.key == "fitted_dead_time" and self.steps
            open_rate = np.isinf(one.interval.high) and not one.where.startswith("stroke")
            if (open_rate or not one.interval.is_known) and not fitted:
                found.setdefault(one.definition.needs, []).append(one.definition.name)
        return {test: tuple(names) for test, names in found.items()}

    @property
    def level(self) -> Level:
        """``"poor"``: a limit is not met; ``"good"``: all limits are met; ``"caution"`` otherwise.

        Without limits always ``"caution"``: the valve was measured but not judged.
        """
        judgements = {one.judgement for one in self.metrics} - {""}
        if "not met" in judgements:
            return "poor"
        return "good" if judgements == {"met"} else "caution"

    @property
    def verdict(self) -> str:
        """What the limits and the records say, in one sentence."""
        for judgement, said in (
            ("not met", "Limits not met"),
            ("cannot tell", "The records cannot tell whether these limits are met"),
            ("met", "All limits are met"),
        ):
            names = [named_metric(one) for one in self.metrics if one.judgement == judgement]
            if names:
                return f"{said}: {', '.join(names)}."
        known = sum(one.interval.is_known for one in self.metrics[: len(DEFINITIONS)])
        if not self.steps and all(part.kind != "ramp" for one in self.parts for part in one):
            return "Cannot tell: the records contain no valve test."
        return f"Measured: {known} of {len(DEFINITIONS)} metrics; no limits were given."

    def step_records(
        self, *, smallest: float = 0.0, largest: float = np.inf, direction: str | None = None
    ) -> tuple[Record, ...]:
        """Cut out the steps that moved and settled, each as a record that begins before its step.

        They are the input of a joint fit, ``identify(report.step_records(), gains="own")``: one
        linear part for all sizes, with a gain for each.

        Parameters
        ----------
        smallest, largest : float, optional
            Sizes to cut out, in % of the command's span.
        direction : {"opening", "closing"}, optional
            Default: both.

        Returns
        -------
        tuple of Record
            Time counts from the step; the command is exactly that of the two levels. Long steps
            are thinned out to 1500 samples.

        Raises
        ------
        OptionError
            Another direction.
        """
        if direction is not None:
            one_of(direction, "direction", ("opening", "closing"))
        return tuple(
            cut_out(self.records[one.record], one)
            for one in self.steps
            if one.moved
            and one.settled
            and smallest <= abs(one.size) <= largest
            and direction in (None, one.direction)
        )

    def table(self) -> pd.DataFrame:
        """List the metrics against step size and direction.

        Returns
        -------
        pandas.DataFrame
            A row for each size and direction: ``size`` in %, ``direction``, ``stroke``, ``count``,
            ``moved``, ``settled``, then each metric of `StepMetrics.values` with ``_low`` and
            ``_high``, the scatter of the gain and the dead time of the fit. Times in s.
        """
        import pandas as pd

        rows = []
        for one in self.groups:
            row: dict[str, object] = {
                "size": one.size, "direction": one.direction, "stroke": one.stroke,
                "count": one.count, "moved": one.moved, "settled": one.settled,
            }  # fmt: skip
            for key, found in one.estimates.items():
                row |= {key: found.value, f"{key}_low": found.low, f"{key}_high": found.high}
            rows.append(row)
        return pd.DataFrame(rows)

    def step_table(self) -> pd.DataFrame:
        """List every step.

        Returns
        -------
        pandas.DataFrame
            ``record``, ``time``, ``before``, ``after``, ``size``, ``moved``, ``settled``, then the
            metrics of `StepMetrics.values`, each with its standard error ``_std``.
        """
        import pandas as pd

        rows = []
        for one in self.steps:
            row: dict[str, object] = {
                "record": self.records[one.record].name or one.record + 1,
                "time": one.time, "before": one.before, "after": one.after, "size": one.size,
                "reversal": one.reversal, "moved": one.moved, "settled": one.settled,
            }  # fmt: skip
            for key in STEP_METRICS:
                row |= {key: one.values[key], f"{key}_std": one.errors[key]}
            rows.append(row)
        return pd.DataFrame(rows)

    def metric_table(self) -> pd.DataFrame:
        """List the metrics.

        Returns
        -------
        pandas.DataFrame
            Index: key of `DEFINITIONS`. Columns ``name``, ``value``, ``low``, ``high``, ``unit``,
            ``where``, ``smallest``, ``largest`` (limits), ``judgement``, ``definition``,
            ``source``, ``needs``.
        """
        import pandas as pd

        rows = [
            {
                "name": one.definition.name, "value": one.interval.value,
                "low": one.interval.low, "high": one.interval.high, "unit": one.definition.unit,
                "where": one.where, "smallest": one.limit[0], "largest": one.limit[1],
                "judgement": one.judgement, "definition": one.definition.sentence,
                "source": one.definition.source, "needs": one.definition.needs,
            }
            for one in self.metrics
        ]  # fmt: skip
        return pd.DataFrame(rows, index=[one.key for one in self.metrics])

    _heading = "Valve test"

    def _rows(self) -> list[tuple[str, str]]:
        rows = [("verdict", self.verdict)]
        for one in self.metrics:
            if one.interval.is_known:
                told = *in_words(one.interval, one.definition.unit), where_in_words(one)
                rows.append((one.definition.name, " ".join(filter(None, told))))
        for group in self.groups:
            t86 = group.estimates["t86"]
            unknown = f"unknown: {group.moved} of {group.count} moved, {group.settled} settled"
            found = " ".join(in_words(t86, "s")) if t86.is_known else unknown
            rows.append((f"T86, {words_of(group)}", found))
        return rows

    def _notes(self) -> list[str]:
        lacking = [
            f"missing: {test}; needed for {', '.join(names)}"
            for test, names in self.missing_tests.items()
        ]
        return [*super()._notes(), *lacking]
