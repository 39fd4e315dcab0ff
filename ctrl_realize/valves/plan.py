"""Plan of a valve test: the command, with durations from a first step."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._checks import numbers, positive, real, whole
from .._wording import in_time
from ..data import Record
from ..data.given import as_record
from ..errors import DataError, NoStepError, OptionError
from ..io.atomic import replaced_when_complete
from ..numerics.arrays import FloatArray, read_only
from ..results import Flag, Result
from .evaluate import valve_report
from .parts import range_of, split_test
from .result import ValveReport
from .steps import Ranges, measured_steps

_HOLD = 2.5
"""Hold of a small step, in units of T98: the last third of it is the new level."""
_SLOWER = 6.0
"""Assumed time of a full stroke in units of T98 of the first step, if it is not known."""
_LAG = 0.25
"""Largest lag along the ramp, in % of the command's span."""
_SAMPLES = 20
"""Samples until T63."""
_MOST_SAMPLES = 2_000_000


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


def valve_test_plan(
    first_step: Record | None = None,
    *,
    dead_time: float | None = None,
    time_constant: float | None = None,
    stroke_time: float | None = None,
    command_range: Sequence[float] = (0.0, 100.0),
    center: float = 50.0,
    sizes: Sequence[float] = (2.0, 5.0, 10.0, 50.0),
    repeats: int = 1,
    small_step: float = 0.25,
    stairs: int = 8,
    strokes: int = 1,
    ramp_time: float | None = None,
    dt: float | None = None,
) -> ValveTestPlan:
    """Plan a test that tells all metrics of `valve_report`.

    The command begins with a baseline at `center`, then a staircase of small steps up, down, up and
    back, steps of each size up, back, down and back, full strokes, and a slow ramp over the range
    up and down. The holds follow from the speed of the valve: that of a first step, or a dead time
    and a time constant.

    Parameters
    ----------
    first_step : Record, optional
        Record with one step of some per cent.
    dead_time, time_constant : float, optional
        In s, in place of `first_step`.
    stroke_time : float, optional
        Time of a full stroke in s. Default: six times T98 of the first step.
    command_range : (float, float), default (0, 100)
        Command of the closed and of the open valve.
    center : float, default 50
        Command between the tests, in % of the span.
    sizes : sequence of float
        Steps in % of the span.
    repeats : int, default 1
        Of each size; each gives two steps of each direction. Two give a scatter.
    small_step : float, default 0.25
        Step of the staircase in % of the span: the dead band and the resolution are told to about
        this step.
    stairs : int, default 8
        Small steps in one direction from the center; they must exceed the dead band.
    strokes : int, default 1
        Full strokes up and down.
    ramp_time : float, optional
        Of the ramp in one direction, in s. Default: such that the lag is a quarter per cent.
    dt : float, optional
        Sample time in s. Default: a twentieth of T63, rounded.

    Returns
    -------
    ValveTestPlan

    Raises
    ------
    OptionError
        Neither a first step nor its times, steps outside the range, or more than two million
        samples.
    NoStepError
        The valve did not move or settle in `first_step`.

    Notes
    -----
    Sequence and durations are our own: holds
    of 2.5 times T98, of which the last third is the new level.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> first = cr.bench.valve().step_record(4.0, rng=1)
    >>> plan = cr.valves.valve_test_plan(first, command_range=(4, 20))
    >>> print(f"{plan.duration / 60:.1f} min")
    3.1 min
    """
    ends = range_of(command_range)[:2]
    late, fast, t98 = _speed(first_step, dead_time, time_constant)
    sample = _rounded(fast / _SAMPLES) if dt is None else positive(dt, "dt", "sample time in s")
    sizes = [positive(one, "sizes", "step size in %") for one in sizes]
    middle = real(center, "center", "command in % of the span")
    largest = max(sizes, default=0.0)
    step = positive(small_step, "small_step", "step in %")
    count = whole(stairs, "stairs", 3)
    reach = max(largest, step * count)
    if middle < reach or middle + reach > 100:
        raise OptionError(
            f"steps of {reach:g} % about center={middle:g} % leave the range 0 to 100 %; use "
            "smaller sizes, or another center"
        )
    stroke = _SLOWER * t98 if stroke_time is None else positive(stroke_time, "stroke_time", "time")
    small = _HOLD * t98

    def hold(size: float) -> float:
        return small + 1.5 * stroke * size / 100 if size > 10 else small

    levels: list[tuple[str, float, float]] = [("baseline", middle, 3 * small)]
    level = middle
    for way, many in ((1, count), (-1, 2 * count), (1, 2 * count), (-1, count)):
        for _ in range(many):
            level += way * step
            levels.append(("staircase", level, small))
    for size in sizes:
        for _ in range(whole(repeats, "repeats", 1)):
            for way in (1, 0, -1, 0):
                levels.append((f"steps of {size:g} %", middle + way * size, hold(size)))
    if whole(strokes, "strokes", 0):
        levels.append(("strokes", 0.0, hold(100.0)))
        levels += [("strokes", end, hold(100.0)) for _ in range(strokes) for end in (100.0, 0.0)]
    ramp = 100 / _LAG * fast if ramp_time is None else positive(ramp_time, "ramp_time", "time in s")
    if sum(one[2] for one in levels) + 2 * ramp > _MOST_SAMPLES * sample:
        raise OptionError(
            f"the test has more than {_MOST_SAMPLES} samples of dt={sample:g} s; use a longer dt"
        )
    return _assembled(levels, ramp, small, sample, ends, late, t98, stroke_time is None)


def _assembled(
    levels: list[tuple[str, float, float]], ramp: float, small: float, dt: float,
    ends: tuple[float, float], late: float, t98: float, assumed: bool,
) -> ValveTestPlan:  # fmt: skip
    pieces: list[FloatArray] = []
    sections: list[tuple[str, float, float]] = []
    start = 0
    for name, level, seconds in levels:
        count = max(int(np.ceil(seconds / dt)), 8)
        pieces.append(np.full(count, level))
        if sections and sections[-1][0] == name:
            sections[-1] = (name, sections[-1][1], start + count)
        else:
            sections.append((name, start, start + count))
        start += count
    at = levels[-1][1]
    along = int(np.ceil(ramp / dt))
    rest = max(int(np.ceil(small / dt)), 8)
    way = [np.linspace(at, 0.0, int(along * at / 100), endpoint=False)] if at else []
    way += [
        np.full(rest, 0.0), np.linspace(0, 100, along, endpoint=False), np.full(rest, 100.0),
        np.linspace(100, 0, along, endpoint=False), np.full(rest, 0.0),
    ]  # fmt: skip
    pieces += way
    sections.append(("slow ramp", start, start + sum(one.size for one in way)))
    percent = np.concatenate(pieces)
    choices = [f"speed: dead time {in_time(late)}, T98 {in_time(t98)}"]
    if assumed:
        choices.append(
            f"a full stroke is assumed to take {in_time(_SLOWER * t98)}; give stroke_time if it is "
            "known"
        )
    return ValveTestPlan(
        time=dt * np.arange(percent.size, dtype=np.float64),
        command=ends[0] + percent * (ends[1] - ends[0]) / 100,
        command_range=ends,
        sections=tuple((name, a * dt, b * dt) for name, a, b in sections),
        hold=max(int(np.ceil(small / dt)), 8) * dt,
        choices=tuple(choices),
    )


def _speed(
    first_step: Record | None, dead_time: float | None, time_constant: float | None
) -> tuple[float, float, float]:
    """Dead time, T63 and T98 in s."""
    if first_step is None:
        if dead_time is None or time_constant is None:
            raise OptionError(
                f"dead_time={dead_time!r}, time_constant={time_constant!r}; expected both in s, or "
                "a record of a first step"
            )
        late = real(dead_time, "dead_time", "time in s")
        tau = positive(time_constant, "time_constant", "time in s")
        if late < 0:
            raise OptionError(f"dead_time={late:g}; expected a time that is not negative")
        return late, late + tau, late + 4 * tau
    record = as_record(first_step)
    command = np.ravel(record.input)
    # the scale does not matter for times
    ranges = Ranges((0.0, max(float(np.ptp(command)), 1e-12)), (0.0, 1.0))
    steps = measured_steps(record, split_test(record), ranges, 0)
    known = [one for one in steps if np.isfinite(one.values["t63"])]
    if not known:
        raise NoStepError(
            f"{record!r}: no step with a complete response; the position must move and settle, or "
            "give dead_time and time_constant"
        )
    t63 = max(one.values["t63"] for one in known)
    late = max(one.values["dead_time"] for one in known)
    slow = [one.values[name] for one in known for name in ("t98", "settling_time")]
    t98 = max([one for one in slow if np.isfinite(one)], default=late + 4 * (t63 - late))
    return late, t63, max(t98, t63)


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
    flag = Flag(
        "plan_incomplete",
        f"the records do not contain these sections of the plan: {', '.join(lacking)}",
    )
    return replace(report, flags=(*report.flags, flag))


def _rounded(seconds: float) -> float:
    """The next of 1, 2, 5, 10, ... below."""
    power = 10.0 ** np.floor(np.log10(seconds))
    return float(power * max(one for one in (1, 2, 5) if one * power <= seconds * (1 + 1e-9)))


def _minutes(seconds: float) -> str:
    return f"{seconds:.3g} s" if seconds < 120 else f"{seconds / 60:.1f} min"
