"""Choice of the estimator of an impulse response, by its prediction of held-back data."""

from __future__ import annotations

from dataclasses import dataclass

import control as ct
import numpy as np
from scipy.signal import fftconvolve

from ...data import Record
from ...delayed.simulation import simulate_record
from ...errors import DataError, UnsuitableSystemError
from ...numerics.arrays import FloatArray
from ...numerics.regression.arx import ArxFit, arx_state_space
from .regression import PulseRegression, through_arx, with_prior

HELD_BACK = 1 / 3
"""Fraction of every record that is held back for validation."""
CLEARLY = 0.5
"""Ratio of prediction errors, OKID to regularized, below which OKID is chosen."""
MOST_JUDGED = 6000
"""Number of samples at the end of a record that are simulated for validation."""


@dataclass(frozen=True, eq=False)
class Choice:
    """Method that predicts best, the kernel of every output, and the reason for the choice."""

    method: str
    kernels: tuple[str, ...]
    reason: str


def choose_estimate(group: tuple[Record, ...], count: int, start: str) -> Choice:
    """Fit the first two thirds of every record by both methods, and simulate the rest.

    The regularized estimate is preferred unless OKID is clearly better, because its standard
    deviations are more reliable. If two thirds are too short for one method, the other is used.
    """
    free = ("auto",) * group[0].noutputs
    splits = [round((1 - HELD_BACK) * record.n_samples) for record in group]
    pairs = zip(group, splits, strict=True)
    first = tuple(record.between(*record.time[[0, split - 1]]) for record, split in pairs)
    try:
        smooth = with_prior(first, count, start, free)
    except DataError:
        return Choice("regularized", free, "")
    kernels = smooth.kernels
    if any(record.n_missing for record in group):
        # The simulation needs every sample of the input.
        return Choice("regularized", kernels, "")
    try:
        arx = through_arx(first, count, start)
    except DataError:
        return Choice("regularized", kernels, "")
    smooth_error = _error(group, splits, smooth, count)
    arx_error = _error(group, splits, arx, count)
    better = arx_error < CLEARLY * smooth_error
    reason = (
        "on the last third of the data, not used for estimation, the error is "
        f"{100 * smooth_error:.3g} % of the output for the regularized estimate, "
        f"{_percent(arx_error)} for OKID"
    )
    return Choice("okid" if better else "regularized", kernels, reason)


def _percent(error: float) -> str:
    return f"{100 * error:.3g} %" if error < 10 else "100 % or more (unstable, or nearly)"


def _error(
    group: tuple[Record, ...], splits: list[int], found: PulseRegression, count: int
) -> float:
    """Root mean square of the prediction error on held-back data, relative to the output."""
    missed = total = 0.0
    for record, split in zip(group, splits, strict=True):
        begin = max(split - max(2 * count, record.n_samples - split), 0)
        begin = max(begin, record.n_samples - MOST_JUDGED)
        part = record.between(*record.time[[begin, -1]])
        behind = max(split - begin, 0)
        y = np.atleast_2d(part.output)[:, behind:]
        model = _by_arx(found.arx, part) if found.arx else _by_convolution(found.markov, part)
        error = y - model[:, behind:]
        error = error - error.mean(axis=1, keepdims=True)
        # For a constant output the relative error may be huge: it is limited to a million.
        least = np.maximum(1e-6 * np.abs(error).max(axis=1, keepdims=True), 1e-300)
        scale = np.maximum(y.std(axis=1, keepdims=True), least)
        missed += float(((error / scale) ** 2).sum())
        total += float(y.size)
    return float(np.sqrt(missed / total))


def _by_convolution(markov: FloatArray, record: Record) -> FloatArray:
    u = np.atleast_2d(record.input)
    u = u - u[:, :1]
    full = fftconvolve(markov, u[None], axes=-1)[:, :, : u.shape[1]]
    return np.asarray(full.sum(axis=1))


def _by_arx(fit: ArxFit, record: Record) -> FloatArray:
    system = ct.ss(*arx_state_space(fit), record.dt)
    try:
        return simulate_record(system, record, "estimate")
    except UnsuitableSystemError:
        return np.full(np.atleast_2d(record.output).shape, 1e6 * float(np.ptp(record.output)))
