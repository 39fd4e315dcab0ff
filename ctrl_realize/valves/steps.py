"""Metrics of single steps of the command."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple, dataclass, field

import numpy as np

from ..data import Record
from ..numerics.arrays import FloatArray, lock_fields
from ..numerics.constants import Z_95
from ..numerics.signals.edges import Edge
from ..numerics.signals.noise import quantisation_step
from ..numerics.valve_test.response import UNKNOWN, Estimate, Noise, UnitResponse, steady_noise
from .changes import white_noise
from .part import TestPart

LEVEL_63, LEVEL_86, LEVEL_98 = 1 - float(np.exp(-1)), 1 - float(np.exp(-2)), 0.98
SETTLED_BAND = 0.02
"""Band about the final level that defines settling, as a fraction of the change."""

_RATE = (0.4, 0.8)
"""Part of a change over which the rate is taken: lags still act at its beginning."""
_RATE_ERROR = 5e-4
"""Relative error of a limited rate by a lag of a twelfth of the stroke time, as simulated."""
_LEVEL_SHARE = 0.3
"""Last part of a hold from which a level is taken; twice as much tells whether it stands still."""
_MOVED = 4.0
"""Standard errors by which the output has moved."""
_STILL_MOVING = 0.03
"""Way that is left from the mean level at the end of a hold, as a fraction of the change."""

STEP_METRICS = (
    "dead_time", "t63", "t86", "t98", "overshoot", "settling_time", "gain", "slew_rate",
)  # fmt: skip
"""Numbers that every step has, by name."""


@dataclass(frozen=True)
class Ranges:
    """Command and travel of the closed and the open valve, in the units of the records.

    Examples
    --------
    >>> from ctrl_realize.valves import Ranges
    >>> ranges = Ranges(command=(4.0, 20.0), travel=(0.0, 50.0))
    >>> ranges.command_span, ranges.travel_span
    (16.0, 50.0)
    """

    command: tuple[float, float]
    travel: tuple[float, float]

    @property
    def command_span(self) -> float:
        """Command from closed to open, with its sign."""
        return self.command[1] - self.command[0]

    @property
    def travel_span(self) -> float:
        """Travel from closed to open, with its sign."""
        return self.travel[1] - self.travel[0]


@dataclass(frozen=True, eq=False)
class StepMetrics:
    """What one step of the command shows.

    Times are in s and count from the first sample of the command at its new level; a standard error
    belongs to each number. A number is NaN where the step cannot tell it: the output did not move,
    had not settled when the next step came, or noise hides the level.

    Attributes
    ----------
    record : int
        Position of the record among those of the report.
    time : float
        Of the step, in s.
    before, after : float
        Command, in its unit.
    size : float
        Height of the step in % of the command's span, positive if it opens the valve.
    stroke : bool
        Whether it is a full stroke.
    reversal : bool
        Whether the step before it, within the record, went the other way.
    moved : bool
        Whether the output moved: four standard errors.
    settled : bool
        Whether it stood still at the end of the hold.
    common : bool
        Whether repeats have its errors in common: the output still moved at the end of a hold, or
        its rounding exceeds the noise of a level.
    travel_before, travel_after, travel_error : float
        Output before and after, in % of the travel, and the standard error of the latter.
    values : mapping of str to float
        ``dead_time``, ``t63``, ``t86``, ``t98``, ``settling_time`` in s, ``overshoot`` in % of the
        change, ``gain`` in % of travel per % of command, ``slew_rate`` in % of travel per s.
    errors : mapping of str to float
        Their standard errors, from the noise of the record.
    sampling : mapping of str to (float, float)
        How far below and above the value the number may lie because the response between two
        samples is not known; zero where it changes slowly.
    dt : float
        Sample time of `response` in s.
    mean_delay : float
        Area between the response and its final level, scaled: dead time plus lags, in s.
    command_edge : Edge
        The step in the samples of its record.
    response : ndarray, shape (N,)
        Response from the step on, scaled to 0 before and 1 after; empty if it did not move.

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> t = 0.01 * np.arange(1200)
    >>> stem = 10 * (1 - np.exp(-np.clip(t - 2.3, 0, None) / 0.5))
    >>> record = cr.Record(t, np.where(t < 2, 0, 10), stem, units={"u": "%", "y": "%"})
    >>> (step,) = cr.valves.valve_report(record, fit=False).steps
    >>> print(step.direction, round(step.values["t63"], 3), round(step.values["t86"], 3))
    opening 0.8 1.3
    """

    record: int
    time: float
    before: float
    after: float
    size: float
    stroke: bool
    reversal: bool
    moved: bool
    settled: bool
    common: bool
    travel_before: float
    travel_after: float
    travel_error: float
    values: dict[str, float]
    errors: dict[str, float]
    sampling: dict[str, tuple[float, float]]
    dt: float
    mean_delay: float
    command_edge: Edge = field(repr=False)
    response: FloatArray = field(repr=False)

    def __post_init__(self) -> None:
        lock_fields(self, "response")

    @property
    def direction(self) -> str:
        """``"opening"`` or ``"closing"``."""
        return "opening" if self.size > 0 else "closing"

    def __repr__(self) -> str:
        return f"<StepMetrics {self.size:+.3g} % at {self.time:.4g} s: {self.values}>"


def measured_steps(
    record: Record, parts: Sequence[TestPart], ranges: Ranges, position: int
) -> list[StepMetrics]:
    """Measure all steps of a record."""
    output = np.ravel(record.output)
    noise = noise_of(record, parts)
    edges = [(part, edge) for part in parts for edge in part.edges]
    found = []
    last = 0.0
    for part, edge in edges:
        reversal = last * edge.amplitude < 0
        last = edge.amplitude
        found.append(_measured(record, output, part, edge, ranges, noise, position, reversal))
    return found


def noise_of(record: Record, parts: Sequence[TestPart]) -> Noise:
    """Noise of the output at rest, from the ends of all holds; of ramps alone, white noise."""
    output = np.ravel(record.output)
    quantum = quantisation_step(output)
    if not any(part.edges for part in parts):
        return Noise(max(white_noise(output), quantum / np.sqrt(12)), 1.0, quantum)
    holds = [_tail(output, edge.index, edge.stop) for part in parts for edge in part.edges]
    holds += [output[edge.start : edge.index] for part in parts[:2] for edge in part.edges[:1]]
    return steady_noise(holds, quantum)


def _measured(
    record: Record, output: FloatArray, part: TestPart, edge: Edge, ranges: Ranges,
    noise: Noise, position: int, reversal: bool,
) -> StepMetrics:  # fmt: skip
    start = max(edge.start, 0)
    before, left_before = _level(output[start : edge.index], noise)
    after, left = _level(output[edge.index : edge.stop], noise)
    change = after.value - before.value
    error = float(np.hypot(before.std, after.std))
    moved = abs(change) > max(_MOVED * error, 1.2 * noise.quantum)
    settled = left <= _STILL_MOVING * abs(change)
    travel_error = float(np.hypot(after.std, min(left, abs(change))))
    before, after = (
        Estimate(one.value, float(np.linalg.norm([one.std, min(way, abs(change)), noise.rounding])))
        for one, way in ((before, left_before), (after, left))
    )
    common = max(left_before, left, noise.rounding) > error
    error = float(np.hypot(before.std, after.std))
    size = 100 * edge.amplitude / ranges.command_span
    travel = 100 / ranges.travel_span
    estimates = dict.fromkeys(STEP_METRICS, UNKNOWN)
    estimates["gain"] = Estimate(change * travel / size, error * abs(travel / size))
    mean_delay, shape = float("nan"), np.empty(0)
    if moved:
        response = UnitResponse.of(output[edge.index : edge.stop], (before, after), noise)
        shape = response.shape
        estimates |= _times(response, record.dt, abs(change * travel), settled)
        if settled:
            mean_delay = response.mean_delay() * record.dt
    return StepMetrics(
        record=position, time=float(record.time[edge.index]), before=edge.baseline,
        after=edge.baseline + edge.amplitude, size=size, stroke=part.kind == "stroke",
        reversal=reversal, moved=bool(moved), settled=bool(settled),
        travel_before=(before.value - ranges.travel[0]) * travel,
        travel_after=(after.value - ranges.travel[0]) * travel,
        travel_error=travel_error * abs(travel), common=bool(common),
        values={name: one.value for name, one in estimates.items()},
        errors={name: one.std for name, one in estimates.items()},
        sampling={name: (one.below, one.above) for name, one in estimates.items()},
        dt=record.dt, mean_delay=mean_delay, command_edge=edge, response=shape,
    )  # fmt: skip


def _times(response: UnitResponse, dt: float, change: float, settled: bool) -> dict[str, Estimate]:
    """Times in s and rates; those that need the final level only if it was reached."""

    def seconds(one: Estimate) -> Estimate:
        # an interval that is longer than the hold tells nothing
        known = 2 * Z_95 * one.std < response.shape.size
        return Estimate(*(dt * x for x in astuple(one))) if known else UNKNOWN

    found = {"dead_time": seconds(response.first_motion())}
    if not settled:
        return found
    low, high = response.crossing(_RATE[0]), response.crossing(_RATE[1])
    rise = (high.value - low.value) * dt
    rise_error = float(np.hypot(high.std, low.std)) * dt
    if rise > 0:
        rate = (_RATE[1] - _RATE[0]) * change / rise
        error = rate * float(np.hypot(rise_error / rise, _RATE_ERROR))
        longer, shorter = (high.above + low.below) * dt, (high.below + low.above) * dt
        above = rate * shorter / (rise - shorter) if shorter < rise else float("inf")
        found["slew_rate"] = Estimate(rate, error, rate * longer / (rise + longer), above)
    over = response.overshoot()
    return found | {
        "t63": seconds(response.crossing(LEVEL_63)),
        "t86": seconds(response.crossing(LEVEL_86)),
        "t98": seconds(response.crossing(LEVEL_98)),
        "settling_time": seconds(response.settling(SETTLED_BAND)),
        "overshoot": Estimate(100 * over.value, 100 * over.std),
    }


def _tail(output: FloatArray, start: int, stop: int) -> FloatArray:
    """The last part of a hold, at least five samples if there are."""
    count = max(int(_LEVEL_SHARE * (stop - start)), min(5, stop - start), 1)
    return output[max(stop - count, start) : stop]


def _level(hold: FloatArray, noise: Noise) -> tuple[Estimate, float]:
    """Mean at the end of a hold, and how far the output still goes from there.

    The latter is 0 if noise explains the difference of the last two of three means before the end;
    else the limit of the geometric series of all three, or their difference if they are none.
    """
    tail = _tail(hold, 0, hold.size)
    level = Estimate(float(np.mean(tail)), noise.of_mean(tail.size))
    size = int(2 * _LEVEL_SHARE * hold.size) // 3
    if not size:
        return level, 0.0
    means = hold[hold.size - 3 * size :].reshape(3, size).mean(axis=1)
    earlier, drift = (float(one) for one in np.diff(means))
    if abs(drift) <= max(3 * np.sqrt(2) * noise.of_mean(size), noise.quantum):
        return level, 0.0
    if not 0 < drift * np.sign(earlier) < abs(earlier):
        return level, max(abs(drift), abs(earlier))
    return level, abs(float(means[-1]) + drift**2 / (earlier - drift) - level.value)
