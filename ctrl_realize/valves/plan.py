"""Plan of a valve test: the command, with durations from a first step."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._checks import numbers
from .._flags import flagged
from .._wording import in_time
from ..data import Record
from ..errors import DataError
from ..io.atomic import replaced_when_complete
from ..numerics.arrays import FloatArray, read_only
from ..results import Result
from .evaluate import valve_report
from .result import ValveReport


@dataclass(frozen=True, eq=False)
class ValveTestPlan(Result):
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

    time: FloatArray
    command: FloatArray
    command_range: tuple[float, float]
    sections: tuple[tuple[str, float, float], ...]
    hold: float
    choices: tuple[str, ...] = field(default=())

    def __post_init__(self) -> None:
        object.__setattr__(self, "time", read_only(self.time))
        object.__setattr__(self, "command", read_only(self.command))

    def __repr__(self) -> str:
        return (
            f"<ValveTestPlan: {_minutes(self.duration)}, {self.time.size} samples of {self.dt:g} s>"
        )

    @property
    def dt(self) -> float:
        """Sample time in s."""
        return float(self.time[1] - self.time[0])

    @property
    def duration(self) -> float:
        """Duration in s."""
        return self.time.size * self.dt

    def to_csv(self, path: str | os.PathLike[str]) -> Path:
        """Write the command to a file, atomically.

        Parameters
        ----------
        path : path-like
            Its columns are ``time_s`` and ``command``; a third one with the measured position makes
            it a record for `read_record`.

        Raises
        ------
        OSError
            The folder is missing or cannot be written.
        """
        target = Path(path)
        table = np.stack([self.time, self.command], axis=1)
        with replaced_when_complete(target) as temporary:
            np.savetxt(
                temporary, table, fmt="%.10g", delimiter=",", header="time_s,command", comments=""
            )
        return target

    def record(
        self, position: ArrayLike, *, time: ArrayLike | None = None, **labels: Any
    ) -> Record:
        """Make a record of the measured position and the command of the plan.

        Parameters
        ----------
        position : array_like, shape (N,)
        time : array_like, shape (N,), optional
            In s from the start of the plan. Default: that of the plan.
        **labels
            Further arguments of `Record`.

        Raises
        ------
        DataError
            A position that is not as long as its time.
        """
        measured = numbers(position, "position")
        stamps = self.time if time is None else numbers(time, "time")
        if measured.shape != stamps.shape:
            raise DataError(
                f"position has shape {measured.shape}; expected {stamps.shape}, one for each time"
            )
        last = np.searchsorted(self.time, stamps + 1e-6 * self.dt, side="right") - 1
        return Record(stamps, self.command[np.clip(last, 0, None)], measured, **labels)

    def evaluate(self, records: Record | Sequence[Record], **options: Any) -> ValveReport:
        """Evaluate the records of this test.

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
        given = (records,) if isinstance(records, Record) else tuple(records)
        result = valve_report(given, **{"command_range": self.command_range, **options})
        return _with_plan(result, self)

    def _title(self) -> str:
        return "Plan of a valve test"

    def _rows(self) -> list[tuple[str, str]]:
        return [
            ("duration", _minutes(self.duration)),
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


def _minutes(seconds: float) -> str:
    return f"{seconds:.3g} s" if seconds < 120 else f"{seconds / 60:.1f} min"
