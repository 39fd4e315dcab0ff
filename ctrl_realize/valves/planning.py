"""Durations and levels of a test plan from a first step."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from operator import itemgetter

import numpy as np

from .._checks import integer, not_negative, positive, real
from .._wording import in_time
from ..data import Record
from ..data.given import as_record
from ..errors import NoStepError, OptionError
from .parts import range_of, split_test
from .plan import ValveTestPlan
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
        Step of the staircase in % of the span: the dead band and the resolution are determined to
        about this step.
    stairs : int, default 8
        Small steps in one direction from the center, 3 to 16; they must exceed the dead band.
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
    sizes = [positive(one, "sizes", "step size in %") for one in np.atleast_1d(sizes)]
    middle = real(center, "center", "command in % of the span")
    largest = max(sizes, default=0.0)
    step = positive(small_step, "small_step", "step in %")
    count = integer(stairs, "stairs", 3, 16)
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
        for _ in range(integer(repeats, "repeats", 1)):
            for way in (1, 0, -1, 0):
                levels.append((f"steps of {size:g} %", middle + way * size, hold(size)))
    if integer(strokes, "strokes", 0):
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
    def samples(seconds: float) -> int:
        return max(int(np.ceil(seconds / dt)), 8)

    pieces = [(name, level, level, samples(seconds)) for name, level, seconds in levels]
    at, along, rest = levels[-1][1], int(np.ceil(ramp / dt)), samples(small)
    pieces += [
        ("slow ramp", at, 0.0, int(along * at / 100)), ("slow ramp", 0.0, 0.0, rest),
        ("slow ramp", 0.0, 100.0, along), ("slow ramp", 100.0, 100.0, rest),
        ("slow ramp", 100.0, 0.0, along), ("slow ramp", 0.0, 0.0, rest),
    ]  # fmt: skip
    percent = np.concatenate([np.linspace(a, b, n, endpoint=False) for _, a, b, n in pieces])
    sections, start = [], 0
    for name, own in groupby(pieces, key=itemgetter(0)):
        stop = start + sum(count for *_, count in own)
        sections.append((name, start * dt, stop * dt))
        start = stop
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
        sections=tuple(sections),
        hold=rest * dt,
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
        late = not_negative(dead_time, "dead_time", "time in s")
        tau = positive(time_constant, "time_constant", "time in s")
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
    # Noise may hide the first motion, and the time at which a response has settled.
    late, t63, t98 = (
        max(
            (v for one in known for key in keys if np.isfinite(v := one.values[key])),
            default=np.nan,
        )
        for keys in (("dead_time",), ("t63",), ("t98", "settling_time"))
    )
    if np.isnan(t98):
        t98 = 4 * t63 if np.isnan(late) else late + 4 * (t63 - late)
    return late, t63, max(t98, t63)


def _rounded(seconds: float) -> float:
    """The next of 1, 2, 5, 10, ... below."""
    power = 10.0 ** np.floor(np.log10(seconds))
    return float(power * max(one for one in (1, 2, 5) if one * power <= seconds * (1 + 1e-9)))
