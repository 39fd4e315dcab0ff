"""Static metrics: dead band, resolution, hysteresis, linearity from levels and slow ramps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.special import ndtri

from ..data import Record
from ..numerics.arrays import FloatArray, lock_fields
from ..numerics.constants import Z_95
from ..numerics.valve_test.play import fit_play, slope_of
from ..numerics.valve_test.response import Noise
from .groups import Interval
from .part import TestPart
from .steps import Ranges, StepMetrics

_LARGEST_STAIR = 6.0
"""Largest step of a staircase that tells dead band and resolution, in % of the command's span."""
_COARSER = 2.5
"""Ratio to the finest staircase from which one is not used."""
_FOLLOWED = 0.3
"""The stem has followed a step if it moved by this fraction of it."""
_GOOD_FIT = 4.0
"""Residual variance over the noise up to which the play describes the levels."""
_MOVES = 5.0
"""Standard deviations of the noise by which the stem has moved along a ramp."""
_LEAST_COVERED = 50.0
"""Range of the command in % of its span that linearity and hysteresis need."""
_BINS = 40


@dataclass(frozen=True, eq=False)
class StaticCurve:
    """Position at rest against the command, opening and closing, in % of their spans.

    Attributes
    ----------
    command : ndarray, shape (K,)
    opening, closing : ndarray, shape (K,)
        NaN where the valve did not go in that direction.
    std : float
        Standard error of a point.
    origin : {"ramp", "levels"}

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> t = 0.5 * np.arange(1000)
    >>> u = np.interp(t, [0, 20, 240, 260, 480, 500], [0, 0, 100, 100, 0, 0])
    >>> noise = 0.02 * np.random.default_rng(0).standard_normal(t.size)
    >>> y = u - 0.5 * np.sign(np.gradient(u)) + noise  # a play of 1 %
    >>> curve = cr.valves.valve_report(
    ...     cr.Record(t, u, y, units={"u": "%", "y": "%"}), fit=False
    ... ).curve
    >>> print(curve.origin, round(float(np.nanmean(curve.closing - curve.opening)), 1))
    ramp 1.0
    """

    command: FloatArray
    opening: FloatArray
    closing: FloatArray
    std: float
    origin: str

    def __post_init__(self) -> None:
        lock_fields(self, "command", "opening", "closing")


def dead_band_and_resolution(
    steps: Sequence[StepMetrics], parts: Sequence[TestPart], ranges: Ranges
) -> tuple[Interval, Interval, Interval]:
    """Dead band, resolution and backlash from the staircases of one record, in % of the span."""
    found = []
    stairs = [part for part in parts if part.kind == "staircase"]
    # Coarse stairs tell less, and of a stem that sticks only the play.
    finest = min((abs(part.edges[0].amplitude) for part in stairs), default=0.0)
    for part in stairs:
        own = [step for step in steps if step.command_edge in part.edges]
        coarse = abs(part.edges[0].amplitude) > _COARSER * finest
        if not coarse and max(abs(one.size) for one in own) <= _LARGEST_STAIR:
            found.append(_of_staircase(own, ranges))
    bands, resolutions, backlashes = zip(*found, strict=True) if found else ((), (), ())
    return joined(bands), joined(resolutions), joined(backlashes)


def joined(estimates: Sequence[Interval]) -> Interval:
    """Of the known estimates the intersection of the intervals, or the range if there is none."""
    found = [one for one in estimates if one.is_known]
    if not found:
        return Interval()
    count = sum(one.count for one in found)
    low, high = max(one.low for one in found), min(one.high for one in found)
    if low <= high:
        best = min(found, key=lambda one: one.high - one.low)
        return Interval(float(np.clip(best.value, low, high)), low, high, count)
    value = float(np.mean([one.value for one in found]))
    return Interval(value, min(one.low for one in found), max(one.high for one in found), count)


def _of_staircase(steps: list[StepMetrics], ranges: Ranges) -> tuple[Interval, Interval, Interval]:
    scale = 100 / ranges.command_span
    command = np.array([steps[0].before, *(one.after for one in steps)])
    command = (command - ranges.command[0]) * scale
    travel = np.array([steps[0].travel_before, *(one.travel_after for one in steps)])
    error = max(float(np.mean([one.travel_error for one in steps])), 1e-9)
    fit = fit_play(command, travel, error)
    gain = fit.gain if fit is not None and fit.gain > 0 else 1.0
    change = np.diff(command)
    followed = np.abs(np.diff(travel)) > np.maximum(4 * np.sqrt(2) * error,
                                                    _FOLLOWED * gain * np.abs(change))  # fmt: skip
    step = float(np.median(np.abs(change)))
    hidden = 4 * np.sqrt(2) * error > 0.5 * gain * step
    bands, resolutions = _waits(command, change, followed)
    band, resolution = _bracket(bands), _bracket(resolutions)
    if not np.isfinite(resolution.value) and followed.any():
        resolution = Interval(step, 0.0, step, int(followed.sum()))
    if hidden:
        # movements that noise hides are not waits
        resolution = replace(resolution, low=0.0 if resolution.is_known else np.nan)
    if fit is not None and fit.excess <= _GOOD_FIT and fit.high < np.ptp(command):
        reversals = int(np.sum(change[1:] * change[:-1] < 0))
        # In noise that hides single small steps, a stem that sticks looks like one with play; its
        # mean lag behind the command differs by up to half a step.
        more = 0.5 * step if hidden else 0.0
        play = Interval(fit.width, max(fit.low - more, 0.0), fit.high + more, reversals)
        # A slip jump J below a stair leaves the levels of a play of S - J: the dead band is wider
        # than that by up to the resolution, and no wider than the first change that was followed.
        jump = resolution.high if resolution.is_known else step
        most = np.inf if hidden or not band.is_known else max(band.high, play.high)
        band = replace(play, high=min(play.high + jump, most))
        if not resolution.is_known:
            return band, resolution, Interval()
        return band, resolution, replace(play, low=max(play.low - jump, 0.0))
    if not (band.is_known and resolution.is_known):
        return band, resolution, Interval()
    low, high = max(band.low - resolution.high, 0.0), max(band.high - resolution.low, 0.0)
    # every step moved the valve: all of the dead band may be backlash
    value = band.value - (resolution.value if resolution.low > 0 else 0.0)
    return band, resolution, Interval(float(np.clip(value, low, high)), low, high, band.count)


def _waits(
    command: FloatArray, change: FloatArray, followed: np.ndarray
) -> tuple[list[tuple[float, float]], list[tuple[float, float]]]:
    """Changes of the command between two movements: after a reversal, and in one direction.

    Each is a pair (low, high): the last level without movement and the first with it.
    """
    bands, resolutions = [], []
    last = None
    for k in np.flatnonzero(followed):
        if last is not None:
            way = abs(float(command[k + 1] - command[last + 1]))
            pair = max(way - abs(float(change[k])), 0.0), way
            if change[k] * change[last] < 0:
                bands.append(pair)
            elif (change[last : k + 1] * change[k] > 0).all():
                resolutions.append(pair)
        last = int(k)
    return bands, resolutions


def _bracket(pairs: list[tuple[float, float]]) -> Interval:
    """What all pairs (low, high] have in common; their mean and range if that is nothing."""
    if not pairs:
        return Interval()
    lows, highs = np.array(pairs).T
    low, high = float(lows.max()), float(highs.min())
    if low < high:
        return Interval(0.5 * (low + high), low, high, len(pairs))
    middle = float(np.mean(lows + highs)) / 2
    return Interval(middle, float(lows.min()), float(highs.max()), len(pairs))


def static_curve(
    record: Record, parts: Sequence[TestPart], steps: Sequence[StepMetrics],
    ranges: Ranges, noise: Noise, delay: float,
) -> StaticCurve | None:  # fmt: skip
    """Curve of one record from its ramps, or from the levels of its steps.

    `delay` in s is the mean delay of the response; along a ramp the position is that which the
    command asked for so much earlier.
    """
    ramps = [part for part in parts if part.kind == "ramp"]
    output = 100 * (np.ravel(record.output) - ranges.travel[0]) / ranges.travel_span
    scale = abs(100 / ranges.travel_span)
    if ramps:
        times = record.time - (delay if np.isfinite(delay) else 0.0)
        command = np.interp(times, record.time, np.ravel(record.input))
        command = 100 * (command - ranges.command[0]) / ranges.command_span
        points = [
            (command[part.start : part.stop], output[part.start : part.stop],
             np.sign((part.after - part.before) * ranges.command_span))
            for part in ramps
        ]  # fmt: skip
        return _binned(points, noise, scale)
    return _of_levels(steps, ranges)


def reversal_wait(
    record: Record, parts: Sequence[TestPart], ranges: Ranges, noise: Noise, delay: float
) -> tuple[float, float]:
    """Largest change of the command along a ramp, after one the other way, before a movement.

    In % of the command's span, and without what lag and noise may have added; NaN without such
    ramps. A stem that sticks waits for its dead band and then slides, nearer to the command.
    """
    output, command = np.ravel(record.output), np.ravel(record.input)
    scale, least = abs(100 / ranges.command_span), _MOVES * noise.sigma + noise.quantum
    ramps = [part for part in parts if part.kind == "ramp"]
    waits = [(np.nan, np.nan)]
    for one, two in pairwise(ramps):
        if (one.after - one.before) * (two.after - two.before) >= 0:
            continue
        rest = slice(min(one.stop, two.start - 1), two.start)
        moved = np.abs(output[two.start : two.stop] - np.median(output[rest])) > least
        first = int(np.argmax(moved)) if moved.any() else moved.size - 1
        wait = abs(command[two.start + first] - np.median(command[rest])) * scale
        rate = abs(two.after - two.before) * scale / (two.stop - two.start)
        late = (delay if np.isfinite(delay) else 0.0) / record.dt + 2
        waits.append((wait, wait - rate * late - least * abs(100 / ranges.travel_span)))
    return max(waits, key=lambda pair: np.nan_to_num(pair[0]))


def _binned(
    points: list[tuple[FloatArray, FloatArray, float]], noise: Noise, scale: float
) -> StaticCurve | None:
    low = min(float(command.min()) for command, _, _ in points)
    high = max(float(command.max()) for command, _, _ in points)
    ends = np.linspace(low, high, _BINS + 1)
    middle = 0.5 * (ends[1:] + ends[:-1])
    curves, fewest = [], np.inf
    for way in (1, -1):
        own = [(command, output) for command, output, sign in points if sign == way]
        curve = np.full(_BINS, np.nan)
        if own:
            command = np.concatenate([one for one, _ in own])
            output = np.concatenate([one for _, one in own])
            place = np.clip(np.digitize(command, ends) - 1, 0, _BINS - 1)
            count = np.bincount(place, minlength=_BINS)
            # the position at the middle of the bin, whatever the samples in it
            slope = slope_of(command, output)
            output = output - slope * (command - middle[place])
            total = np.bincount(place, weights=output, minlength=_BINS)
            full = count >= max(3, 0.5 * np.median(count))
            curve[full] = total[full] / count[full]
            fewest = min(fewest, float(np.median(count)))
        curves.append(curve)
    # near its ends a ramp has not reached its steady speed, and the play is not crossed
    inner = (middle > low + 0.05 * (high - low)) & (middle < high - 0.05 * (high - low))
    if not inner.any() or not np.isfinite(curves).any():
        return None
    error = noise.of_mean(int(fewest)) * scale
    return StaticCurve(middle[inner], curves[0][inner], curves[1][inner], error, "ramp")


def _of_levels(steps: Sequence[StepMetrics], ranges: Ranges) -> StaticCurve | None:
    settled = [one for one in steps if one.settled]
    if not settled:
        return None
    after = np.array([one.after for one in settled])
    command = 100 * (after - ranges.command[0]) / ranges.command_span
    travel = np.array([one.travel_after for one in settled])
    opening = np.array([one.size > 0 for one in settled])
    levels = np.unique(np.round(command))
    curves = np.full((2, levels.size), np.nan)
    for row, way in enumerate((opening, ~opening)):
        for k, level in enumerate(levels):
            own = way & (np.abs(command - level) <= 0.5)
            if own.any():
                curves[row, k] = np.mean(travel[own])
    error = float(np.mean([one.travel_error for one in settled]))
    return StaticCurve(levels, curves[0], curves[1], error, "levels")


def _largest_noise(sigma: float, count: int) -> tuple[float, float]:
    """How much noise may have added to the largest of `count` values, and taken from it.

    The former is the 97.5 % point of the largest of so many values without a signal.
    """
    return sigma * float(ndtri(0.975 ** (1 / count))), Z_95 * sigma


def hysteresis_and_linearity(
    curve: StaticCurve | None, band: Interval
) -> tuple[Interval, Interval, Interval]:
    """Hysteresis, linearity, and the dead band by the width of the loop, in % of the spans."""
    unknown = Interval()
    if curve is None:
        return unknown, unknown, unknown
    both = np.isfinite(curve.opening) & np.isfinite(curve.closing)
    enough = int(both.sum()) >= 5 and np.ptp(curve.command[both]) >= 1.0
    hysteresis = width = unknown
    single = np.where(np.isfinite(curve.opening), curve.opening, curve.closing)
    middle = np.where(both, 0.5 * (curve.opening + curve.closing), single)
    # Beside levels of both ways one that was reached from one side is half a dead band off.
    mixed = curve.origin == "levels" and np.isfinite([curve.opening, curve.closing]).any(1).all()
    known = both if mixed else np.isfinite(middle)
    covered = float(np.ptp(curve.command[known])) if known.any() else 0.0
    if enough:
        apart = curve.closing[both] - curve.opening[both]
        gain = slope_of(curve.command[known], middle[known])
        count = int(both.sum())
        if gain > 0.05:
            mean = float(np.median(apart)) / gain
            scatter = max(1.25 * float(np.std(apart, ddof=1)) / np.sqrt(count),
                          np.sqrt(2) * curve.std / np.sqrt(count)) / gain  # fmt: skip
            if curve.origin == "ramp":
                width = Interval(max(mean, 0.0), max(mean - 2 * scatter, 0.0),
                                 max(mean + 2 * scatter, 0.0), 1)  # fmt: skip
            own = band if band.is_known else width
            if own.is_known and covered >= _LEAST_COVERED:
                most = float(np.max(np.abs(apart)))
                noise = _largest_noise(np.sqrt(2) * curve.std, count)
                low = noise[0] + (own.high - own.value) * gain
                high = noise[1] + (own.value - own.low) * gain
                value = max(most - own.value * gain, 0.0)
                hysteresis = Interval(value, max(value - low, 0.0), value + high, count)
    linearity = unknown
    if known.sum() >= 5 and covered >= _LEAST_COVERED:
        line = np.polyval(np.polyfit(curve.command[known], middle[known], 1), curve.command[known])
        away = np.abs(middle[known] - line)
        place = int(np.argmax(away))
        most = float(away[place])
        low, high = _largest_noise(curve.std, 2 * int(known.sum()))
        if curve.origin == "ramp":
            # between two points, or beyond the last, it may be larger by half of their difference
            high += 0.5 * float(np.max(np.abs(np.diff(away)[max(place - 1, 0) : place + 1])))
        linearity = Interval(most, max(most - low, 0.0), most + high, int(known.sum()))
    return hysteresis, linearity, width
