"""Plan of a valve test: the command, with durations from a first step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from .._flags import flagged
from .._wording import in_time
from ..data import Record
from ..data.given import as_record
from ..experiment.command import PlannedInput, duration_in_words
from ..numerics.signals.edges import difference_noise
from .evaluate import valve_report
from .result import ValveReport

_WHITE = 1.25
"""Standard deviation over that of neighbours up to which noise is white, as of noisy ramps."""
_AVERAGE = 5.0
"""Standard errors of the mean of noise that has none."""


@dataclass(frozen=True, eq=False, repr=False)
class ValveTestPlan(PlannedInput):
    """Command of a valve test, made by `valve_test_plan`.

    Attributes
    ----------
    time : ndarray, shape (N,)
        In s, uniform.
    command : ndarray, shape (N,)
        In the unit of `command_range`; held over each sample.
    command_range : (float, float)
        Command of the closed and of the open valve.
    sections : tuple of (str, float, float)
        Name, start and end in s of each section of the test.
    hold : float
        Duration of a small step in s.
    choices : tuple of str

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> plan = cr.valves.valve_test_plan(dead_time=0.3, time_constant=0.5)
    >>> plan
    <ValveTestPlan: 19.4 min, 58196 samples of 0.02 s>
    >>> [name for name, _, _ in plan.sections]  # doctest: +ELLIPSIS
    ['baseline', 'staircase', 'steps of 2 %', ..., 'strokes', 'slow ramp']
    """

    command_range: tuple[float, float]
    sections: tuple[tuple[str, float, float], ...]
    hold: float
    choices: tuple[str, ...] = field(default=())

    def evaluate(self, records: Record | Sequence[Record], **options: Any) -> ValveReport:
        """Evaluate the records of this test.

        Where the command of a record is that of the plan with noise, as one that was measured, that
        of the plan is used.

        Parameters
        ----------
        records : Record or sequence of Record
            As measured; a test may be in several records.
        **options
            Further arguments of `valve_report`.

        Returns
        -------
        ValveReport
            With the flag ``plan_incomplete`` if the records lack a section of the plan.

        Raises
        ------
        DataError, OptionError
            As `valve_report`.
        """
        given = (records,) if isinstance(records, Record) else tuple(map(as_record, records))
        played = tuple(map(self._played, given))
        result = valve_report(played, **{"command_range": self.command_range, **options})
        if played != given:
            told = "the command is that of the plan: that of the records is the same with noise"
            result = replace(result, choices=(*result.choices, told))
        return _with_plan(result, self)

    def _played(self, record: Record) -> Record:
        """Give a record the command of the plan if its own differs from it by white noise."""
        if not record.issiso():
            return record
        planned = self.record(np.ravel(record.output), time=record.time).input
        noise = np.ravel(record.input) - np.ravel(planned)
        size = float(np.std(noise))
        error = size / np.sqrt(noise.size)
        white = 0 < size <= _WHITE * difference_noise(noise)
        if not white or abs(float(np.mean(noise))) > _AVERAGE * error:
            return record
        return record.__replace__(input=planned)

    _heading = "Plan of a valve test"

    def _rows(self) -> list[tuple[str, str]]:
        return [
            ("duration", duration_in_words(self.duration)),
            ("sample time", in_time(self.dt)),
            ("hold of a small step", in_time(self.hold)),
            *((name, f"{start:.4g} to {stop:.4g} s") for name, start, stop in self.sections),
        ]


def _with_plan(report: ValveReport, plan: ValveTestPlan) -> ValveReport:
    """Add a flag for sections of the plan that the records do not contain."""
    parts = [part for own in report.parts for part in own]
    kinds = {part.kind for part in parts}
    sizes = {round(one.size, 1) for one in report.groups}
    lacking = []
    for name, _, _ in plan.sections:
        if name.startswith("steps of"):
            size = float(name.split()[2])
            there = any(abs(one - size) <= 0.15 * size for one in sizes)
        else:
            there = {"strokes": "stroke", "slow ramp": "ramp"}.get(name, name) in kinds
        if not there:
            lacking.append(name)
    if not lacking:
        return report
    flag = flagged("plan_incomplete", sections=", ".join(lacking))
    return replace(report, flags=(*report.flags, flag))
