"""Fit of sines to many records at once, after their transients."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..data import Record
from ..errors import DataError
from ..numerics.arrays import FloatArray
from ..numerics.rational.sines import SineFit, fit_sines

LEAST_SAMPLES = 8
"""Least number of samples for a sine with offset and drift."""
_BATCH_SAMPLES = 300_000
"""Number of samples in a batch, which fits into memory."""
_STEADY_RATIO = 1.5
"""Misfit of a block, relative to the largest of the late ones, above which there is a transient."""
_BLOCKS = 32
"""Number of blocks of a record whose misfits are compared."""
_MIN_PERIODS = 0.9
_BESIDE = (0.75, 4.5)
"""Bins of the spectrum beside a line from which the noise at its frequency is estimated; the
nearest ones are affected by the line and the fit."""


def batches(flat: Sequence[Record]) -> list[list[int]]:
    """Group records of equal length and sample time, in batches that fit into memory."""
    groups: dict[tuple[int, float], list[int]] = {}
    for index, record in enumerate(flat):
        groups.setdefault((record.n_samples, record.dt), []).append(index)
    pieces = []
    for (n_samples, _), members in groups.items():
        size = max(1, _BATCH_SAMPLES // n_samples)
        pieces += [members[i : i + size] for i in range(0, len(members), size)]
    return pieces


def fit_batch(
    records: Sequence[Record],
    starts: FloatArray,
    settle: float | None,
    free_frequency: bool,
    drift: bool,
) -> SineFit:
    """Fit records of equal length: first their last half, then from the end of the transient on."""
    time, signals = _time_and_signals(records)
    n_samples, dt = time.size, records[0].dt
    if settle is None:
        late = np.broadcast_to((np.arange(n_samples) >= n_samples // 2) * 1.0, signals[:, 0].shape)
        first = fit_sines(
            time, signals, starts, free_frequency=free_frequency, drift=drift, mask=late
        )
        mask = _steady(time, signals, first)
        starts = first.omega if free_frequency else starts
    else:
        kept = (time >= settle - 1e-9 * dt) * 1.0
        if kept.sum() < LEAST_SAMPLES:
            raise DataError(
                f"settle={settle:g} s leaves {int(kept.sum())} samples of {records[0]!r}; "
                f"at least {LEAST_SAMPLES} are needed"
            )
        mask = np.broadcast_to(kept, signals[:, 0].shape)
    short = starts * dt * mask.sum(axis=1) < _MIN_PERIODS * 2 * np.pi
    if short.any():
        worst = int(np.flatnonzero(short)[0])
        raise DataError(
            f"{records[worst]!r} keeps less than one period of {starts[worst] / 2 / np.pi:g} "
            "Hz; record for longer, or give a shorter settle"
        )
    return fit_sines(time, signals, starts, free_frequency=free_frequency, drift=drift, mask=mask)


def _time_and_signals(records: Sequence[Record]) -> tuple[FloatArray, FloatArray]:
    """Stack records of equal length: time (N,), input and output (B, 2, N)."""
    time = records[0].dt * np.arange(records[0].n_samples, dtype=np.float64)
    return time, np.stack([[record.input, record.output] for record in records])


def _left(time: FloatArray, signals: FloatArray, fit: SineFit) -> FloatArray:
    """Subtract the fitted sine, offset and drift from the signals."""
    turning = np.exp(1j * fit.omega[:, None] * time)
    model = (fit.phasor[..., None] * turning[:, None]).real
    return np.asarray(signals - model - fit.offset[..., None] - fit.slope[..., None] * time)


def _steady(time: FloatArray, signals: FloatArray, late: SineFit) -> FloatArray:
    """Mark the samples from which on the sine fitted to the late half describes the record."""
    n_samples = time.size
    edges = np.linspace(0, n_samples, min(_BLOCKS, n_samples // 4) + 1).astype(int)
    left = _left(time, signals, late)
    squares = np.add.reduceat(left**2, edges[:-1], axis=2) / np.diff(edges)
    half = squares.shape[2] // 2
    # Rounding counts as misfit, too: otherwise noise-free data would never be steady.
    floor = (1e-6 * np.abs(late.phasor[..., None])) ** 2
    # The largest of the late blocks, and more: an early one may be as large by chance.
    late_most = squares[..., half:].max(axis=2, keepdims=True)
    bound = _STEADY_RATIO * np.maximum(late_most, floor)
    moving = np.any(squares > bound, axis=1)
    moving[:, half:] = False
    settled = np.where(moving.any(axis=1), half - np.argmax(moving[:, half - 1 :: -1], 1), 0)
    # By then a transient has decayed to the noise level; it would still cause a bias common to all
    # repeats. An exponential has vanished after the same time once more.
    start = edges[np.minimum(2 * settled + 1, half)]
    return np.asarray((np.arange(n_samples) >= start[:, None]) * 1.0)


def misfit_beside_line(
    records: Sequence[Record], fit: SineFit
) -> tuple[FloatArray, NDArray[np.int_]]:
    """Ratio of the misfit's spectrum beside the line to its mean; at least 1.

    The covariance of the fit assumes white noise, which underestimates slow noise for a sine. If
    the noise is weaker there than elsewhere, eight bins are too few to detect it.

    Returns
    -------
    stronger : ndarray, shape (B, 2)
        For input and output of each record.
    count : ndarray, shape (B,)
        Number of bins behind it.
    """
    time, signals = _time_and_signals(records)
    late = _left(time, signals, fit)[..., time.size // 2 :]
    power = np.abs(np.fft.rfft(late - late.mean(axis=2, keepdims=True))) ** 2
    bins = np.arange(power.shape[2])
    away = np.abs(bins - fit.omega[:, None] * records[0].dt * late.shape[2] / (2 * np.pi))
    beside = (away > _BESIDE[0]) & (away < _BESIDE[1]) & (bins > 0)
    count = np.maximum(beside.sum(axis=1), 1)
    near = (power * beside[:, None]).sum(axis=2) / count[:, None]
    average = np.maximum(power[..., 1:].mean(axis=2), np.finfo(float).tiny)
    return np.asarray(np.maximum(near / average, 1.0), dtype=np.float64), count
