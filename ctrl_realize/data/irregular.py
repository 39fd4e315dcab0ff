"""Samples with gaps, irregular time stamps or two sample times, on one uniform time axis."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .._checks import positive
from ..errors import DataError, OptionError, TimeAxisError
from ..numerics.arrays import FloatArray, IntArray
from ..numerics.signals.sample_grid import grid_rows, grid_step, held, regular_step, usual_step
from .record_checks import checked_signal, increasing_stamps
from .resampling import MAX_DENSER, MIN_SAMPLES

_AS_IT_IS = 1.5
"""Steps of the time axis from which on the distance of samples is no step of it."""


def on_one_axis(
    time: ArrayLike,
    input: ArrayLike,
    output: ArrayLike,
    input_time: ArrayLike | None,
    dt: float | None,
) -> tuple[tuple[FloatArray, FloatArray, FloatArray], float]:
    """Time axis, held input, output with NaN where there is no sample, and the sample time in s.

    See `Record.from_samples`.
    """
    stamps = increasing_stamps(time, "time", MIN_SAMPLES)
    moves = stamps if input_time is None else increasing_stamps(input_time, "input_time", 1)
    u = checked_signal(input, "input", moves.size, allow_nan=True)
    y = checked_signal(output, "output", stamps.size, allow_nan=True)
    known = ~np.isnan(np.atleast_2d(u))
    if not known.any(axis=1).all():
        raise DataError("the input has no samples: all of its values are NaN")
    # An input is unknown before its first sample: what came before cannot be used.
    start = float(max(moves[row][0] for row in known))
    seen = stamps >= start
    if np.count_nonzero(seen & ~np.isnan(np.atleast_2d(y)).all(axis=0)) < MIN_SAMPLES:
        raise DataError(
            f"the output has less than {MIN_SAMPLES} samples from {start:g} s on, the first "
            "sample of the input; before it the input is unknown"
        )
    every = np.union1d(stamps[seen], moves[moves >= start])
    every = np.union1d(every, [start])
    most = MAX_DENSER * every.size
    step = grid_step(every, most) if dt is None else positive(dt, "dt", "sample time in s")
    if (every[-1] - every[0]) / step > most:
        raise OptionError(
            f"dt={step:g} s would give {(every[-1] - every[0]) / step:.4g} rows for {every.size} "
            f"samples; the limit is {MAX_DENSER} times as many"
        )
    rows = grid_rows(stamps[seen], float(every[0]), step)
    shared = np.flatnonzero(np.diff(rows) == 0)
    if shared.size and dt is not None:
        first = int(shared[0])
        raise TimeAxisError(
            f"two samples, at {stamps[seen][first]:.9g} s and {stamps[seen][first + 1]:.9g} s, "
            f"lie within dt={step:g} s; expected one sample in each step: give a smaller dt, or "
            "average samples that are closer together"
        )
    axis = every[0] + step * np.arange(max(int(rows[-1]) + 1, MIN_SAMPLES), dtype=np.float64)
    spread = np.full((*y.shape[:-1], axis.size), np.nan)
    spread[..., np.unique(rows)] = _means(y[..., seen], rows)
    # Of several values of an input within a row the last one holds on.
    drives = np.stack([
        held(grid_rows(moves[row], float(axis[0]), step), values[row], np.arange(axis.size))
        for row, values in zip(known, np.atleast_2d(u), strict=True)
    ])  # fmt: skip
    measured = stamps[seen & ~np.isnan(np.atleast_2d(y)).all(axis=0)]
    usual = step if regular_step(every) else regular_step(measured) or usual_step(measured)
    signals = axis, drives[0] if u.ndim == 1 else drives, spread
    return signals, usual if usual > _AS_IT_IS * step else step


def _means(values: FloatArray, rows: IntArray) -> FloatArray:
    """Mean of the values that share a row, NaN where all are missing."""
    if rows.size == 0 or np.all(np.diff(rows)):
        return values
    starts = np.flatnonzero(np.diff(rows, prepend=rows[0] - 1))
    known = ~np.isnan(values)
    sums = np.add.reduceat(np.where(known, values, 0.0), starts, axis=-1)
    counts = np.add.reduceat(known.astype(np.float64), starts, axis=-1)
    return np.asarray(np.where(counts > 0, sums / np.maximum(counts, 1), np.nan))
