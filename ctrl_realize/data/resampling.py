"""Resampling of records with time jitter onto a uniform time axis."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .._checks import not_negative, numbers, positive
from ..errors import OptionError, TimeAxisError
from ..numerics.arrays import FloatArray
from ..numerics.signals.time_axis import sample_time
from .record_checks import check_shape, checked_signal, increasing_stamps

MIN_SAMPLES = 3
MAX_DENSER = 100
_GAP = 2.5
"""Sample times between two samples from which on a value between them is not interpolated."""


def resampled(
    time: ArrayLike, input: ArrayLike, output: ArrayLike, dt: float | None, max_jitter: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Interpolate time, input and output; see `Record.resampled`."""
    not_negative(max_jitter, "max_jitter", "in sample steps")
    stamps = increasing_stamps(time, "time", MIN_SAMPLES)
    steps = np.diff(stamps)
    usual = float(np.median(steps))
    worst = int(np.argmax(steps))
    if steps[worst] > (1 + max_jitter) * usual:
        raise TimeAxisError(
            f"time has a gap at row {worst + 1}: {steps[worst]:.6g} s where {usual:.6g} s is "
            f"usual; max_jitter={max_jitter:g} allows {(1 + max_jitter) * usual:.6g} s"
        )
    step = sample_time(stamps) if dt is None else positive(dt, "dt", "sample time in s")
    samples = (stamps[-1] - stamps[0]) / step
    if samples > MAX_DENSER * stamps.size:
        raise OptionError(
            f"dt={step:g} s would give {samples:.4g} samples from {stamps.size}; the limit is "
            f"{MAX_DENSER} times as many"
        )
    count = int(np.floor(samples * (1 + 1e-12))) + 1
    uniform = stamps[0] + step * np.arange(count)
    moved = []
    for what, given in (("input", input), ("output", output)):
        values = checked_signal(given, what, stamps.size)
        rows = np.atleast_2d(values)
        fresh = np.stack([_at(uniform, stamps, row, held=what == "input") for row in rows])
        moved.append(fresh[0] if values.ndim == 1 else fresh)
    return uniform, moved[0], moved[1]


def held_at(time: ArrayLike, reference: ArrayLike | None, uniform: FloatArray) -> FloatArray | None:
    """Last value of a set point at every row of a new time axis; None without one."""
    if reference is None:
        return None
    stamps, values = numbers(time, "time"), numbers(reference, "reference")
    check_shape(values, "reference", stamps.size)
    # A stamp that rounding puts behind its row belongs to it.
    slack = 1e-6 * (uniform[1] - uniform[0])
    last = np.searchsorted(stamps, uniform + slack, side="right") - 1
    return np.asarray(values[..., np.maximum(last, 0)])


def at_equal_distances(
    time: FloatArray, input: FloatArray, output: FloatArray, step: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Signals of a fine time axis at a coarser one: mean input of a step, interpolated output.

    Outputs across a gap are missing.
    """
    axis = time[0] + step * np.arange(int((time[-1] - time[0]) / step * (1 + 1e-12)) + 1)
    rows = np.searchsorted(time, axis - 1e-6 * step)
    counts = np.diff(rows, append=time.size)
    means = np.add.reduceat(np.atleast_2d(input), rows, axis=1) / counts
    found = np.full((len(np.atleast_2d(output)), axis.size), np.nan)
    for row, values in zip(found, np.atleast_2d(output), strict=True):
        known = np.flatnonzero(~np.isnan(values))
        after = np.clip(np.searchsorted(time[known], axis), 1, known.size - 1)
        near = time[known[after]] - time[known[after - 1]] <= _GAP * step
        inside = (axis >= time[known[0]] - step) & (axis <= time[known[-1]] + step)
        row[:] = np.where(near & inside, np.interp(axis, time[known], values[known]), np.nan)
    return axis, means[0] if input.ndim == 1 else means, found[0] if output.ndim == 1 else found


def _at(uniform: FloatArray, stamps: FloatArray, values: FloatArray, *, held: bool) -> FloatArray:
    """Interpolate a signal; an input that holds its levels takes the value of the nearest stamp.

    An input holds its levels if most of its values are those of the sample before. Between two
    levels it never had another value, which a straight line would invent.
    """
    if held and np.mean(np.diff(values) == 0) > 0.5:
        middles = (stamps[1:] + stamps[:-1]) / 2
        return values[np.searchsorted(middles, uniform, side="right")]
    return np.interp(uniform, stamps, values)
