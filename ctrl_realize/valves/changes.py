"""Steps and ramps in the command of a valve, whatever its noise and rounding; our own rules."""

from __future__ import annotations

from itertools import groupby

import numpy as np

from ..data import Record
from ..numerics.arrays import FloatArray
from ..numerics.signals.edges import Edge, despike, difference_noise, median_jumps
from ..numerics.signals.noise import mad_sigma, quantisation_step
from ..numerics.valve_test.play import slope_of
from .part import PartKind, TestPart

LEAST_HOLD = 5
"""Samples of a level."""
_LEAST_RAMP = 0.05
"""Smallest ramp, as a fraction of the command's range."""
_STROKE_SHARE = 0.8
"""A step over this fraction of the command's range is a full stroke."""
_STEP_SAMPLES = 8
"""A change of the command that takes longer is a ramp."""
_FLAT = 0.05
"""Largest scatter of the command about a level, as a fraction of the step."""
_BENT = 0.05
"""Largest distance of a ramp from a straight line, as a fraction of its height."""
_ROUNDING = 1e-3
"""Largest rounding of a command along a ramp, as a fraction of its range."""
_BLOCKS = 400  # in which a ramp is looked for in noise


def changes_of(record: Record, span: float) -> list[TestPart]:
    """Steps, strokes and ramps between the levels that the command holds."""
    command = np.ravel(record.input)
    noise = white_noise(command)
    spikes = int(np.clip(command.size // 1000, 1, 6)) if noise else 0
    clean = despike(command, spikes)
    rounding = quantisation_step(command)
    rounding = rounding / np.sqrt(12) if rounding <= _ROUNDING * span else 0.0
    ramps = _noisy_ramps(record, max(noise, rounding), span) if max(noise, rounding) else []
    half = 4 if noise else 1
    width = 2 * half + 1
    jump = median_jumps(clean, width)
    # A median of w samples has 1.25 / sqrt(w) of the deviation of one; two of them differ here.
    threshold = max(5 * 1.25 * noise * np.sqrt(2 / width), 1e-6 * float(np.ptp(command)))
    residue = noise * (1.25 / np.sqrt(2 * spikes + 1) if spikes else 1.0)
    moving = np.abs(jump) > threshold
    for ramp in ramps:
        moving[ramp.start : ramp.stop] = False
    moving = np.concatenate([[False], moving, [False]])
    bounds = np.flatnonzero(np.diff(moving)).reshape(-1, 2)
    found = list(ramps)
    for k, (first, stop) in enumerate(bounds):
        start = int(bounds[k - 1][1]) - 1 - half if k else 0
        end = int(bounds[k + 1][0]) + half if k + 1 < len(bounds) else command.size
        # a median moves half a window before the sample that does
        low, high = int(first) + half, int(stop) - 1 - half
        start = max([start, *(one.stop for one in ramps if one.stop <= low)])
        end = min([end, *(one.start for one in ramps if one.start >= high)])
        before, after = clean[start:low], clean[high:end]
        if min(before.size, after.size) < 1:
            continue
        levels = float(np.median(before)), float(np.median(after))
        height = levels[1] - levels[0]
        flat = [_is_flat(side, _FLAT * abs(height), noise) for side in (before, after)]
        change = clean[low - 1 : high + 1]
        away = np.flatnonzero(np.abs(change - levels[0]) > 0.02 * abs(height) + 4 * residue)
        if not away.size or abs(height) <= threshold:
            continue
        index = low - 1 + int(away[0])
        near = np.abs(clean[index:] - levels[1]) <= 0.02 * abs(height) + 4 * residue
        there = np.flatnonzero(near)
        samples = (int(there[0]) if there.size else command.size - index) + 1
        time = float(record.time[index])
        held = min(before.size, after.size) >= LEAST_HOLD
        if samples <= _STEP_SAMPLES and held and all(flat):
            edge = Edge(index, height, levels[0], samples, start, end)
            kind: PartKind = "stroke" if abs(height) >= _STROKE_SHARE * span else "step"
            found.append(TestPart(kind, start, end, *levels, time, (edge,)))
        elif samples > _STEP_SAMPLES and abs(height) > _LEAST_RAMP * span:
            line = np.linspace(change[0], change[-1], change.size)
            straight = float(np.max(np.abs(change - line))) <= _BENT * abs(height) + 4 * residue
            # it leads from one level to another, or back from where another ramp has led
            ends = any(flat) or bool(found and found[-1].kind == "ramp")
            if straight and ends:
                time = float(record.time[low])
                found.append(TestPart("ramp", low, min(high + 1, command.size), *levels, time))
    return sorted(found, key=lambda one: (one.time, one.start))


def _is_flat(side: FloatArray, limit: float, noise: float) -> bool:
    """Whether the command holds a level, in view of its noise."""
    if not side.size or np.subtract(*np.percentile(side, [95, 5])) > max(limit, 4 * noise):
        return False
    if side.size < 2 * LEAST_HOLD:
        return True
    half = side.size // 2
    drift = abs(float(np.mean(side[-half:]) - np.mean(side[:half])))
    return drift <= max(limit, 5 * noise * float(np.sqrt(2 / half)))


def _noisy_ramps(record: Record, noise: float, span: float) -> list[TestPart]:
    """Ramps of a noisy command: neighbouring blocks differ alike, and a line leaves the noise."""
    command = np.ravel(record.input)
    size = max(command.size // _BLOCKS, LEAST_HOLD)
    count = command.size // size
    if count < 2 * LEAST_HOLD:
        return []
    change = np.diff(np.median(command[: count * size].reshape(count, size), axis=1))
    clear = np.where(np.abs(change) > 3 * 1.25 * noise * np.sqrt(2 / size), np.sign(change), 0.0)
    found = []
    start = 0
    for sign, run in groupby(clear):
        stop = start + len(list(run))
        # the first and the last block contain the ends of the ramp
        low, high = (start + 1) * size, stop * size
        start = stop
        if sign == 0 or high - low < LEAST_HOLD * size:
            continue
        part = command[low:high]
        index = np.arange(part.size, dtype=np.float64)
        slope = slope_of(index, part)
        left = part - np.mean(part) - slope * (index - index.mean())
        rise = slope * part.size
        if abs(rise) < _LEAST_RAMP * span or np.std(left) > max(1.25 * noise, 0.002 * abs(rise)):
            continue
        ends = float(np.mean(part)) - 0.5 * rise, float(np.mean(part)) + 0.5 * rise
        found.append(TestPart("ramp", low, high, *ends, float(record.time[low])))
    return found


def white_noise(signal: FloatArray) -> float:
    """White noise of a signal; third differences do not take a smooth motion for noise."""
    third = np.diff(signal, 3)
    smooth = mad_sigma(third) / np.sqrt(20) if third.size else 0.0
    return min(difference_noise(signal), smooth)
