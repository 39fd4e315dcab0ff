"""Normal equations of models that are linear in lagged signals, in O(N log N + n^2).

Row k of the regression contains ``z[k], z[k-1], ..., z[k-n+1]`` for every signal z. An entry of its
Gram matrix differs from the previous one along the diagonal by the samples at the ends, so one
correlation by FFT and n row operations give the whole matrix; the tall regression matrix, 800 MB
for 1e5 samples and 1000 lags, is not formed.

Only rows with a complete past are used (the covariance method [1]_): the past before the record has
no effect.

References
----------
.. [1] L. Ljung, System Identification: Theory for the User, 2nd ed., Prentice Hall 1999, section
   10.1 (the covariance method).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..arrays import FloatArray, IntArray
from ..hankel.matrix import fft_length

CHUNK = 4096
"""Number of rows that are formed at once if some have to be left out."""


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """Sums of products over the rows of a regression, free of an offset per record.

    ``gram = Phi^T Phi`` (q, q), ``cross = Phi^T Y`` (q, p), ``power = Y^T Y`` (p, p), each without
    the mean of every column over its record; `rows` is the number of rows and `freedom` that of the
    rows minus the offsets.
    """

    gram: FloatArray
    cross: FloatArray
    power: FloatArray
    rows: int
    freedom: int

    def __add__(self, other: NormalEquations) -> NormalEquations:
        pairs = zip(vars(self).values(), vars(other).values(), strict=True)
        return NormalEquations(*(one + two for one, two in pairs))

    def take(self, columns: Sequence[int]) -> NormalEquations:
        """Keep some of the regressors."""
        index = np.asarray(columns, dtype=np.int64)
        return NormalEquations(
            self.gram[np.ix_(index, index)], self.cross[index], self.power, self.rows, self.freedom
        )


def complete_rows(signals: FloatArray, targets: FloatArray, lags: int) -> NDArray[np.bool_]:
    """Mark the rows lags-1 ... N-1 whose target and past are complete, shape (N-lags+1,)."""
    gaps = np.concatenate([[0], np.cumsum(~np.isfinite(signals).all(axis=0))])
    whole = gaps[lags:] == gaps[:-lags]
    return np.asarray(whole & np.isfinite(targets[:, lags - 1 :]).all(axis=0))


def normal_equations(
    signals: FloatArray, targets: FloatArray, lags: int, *, offset: bool = True
) -> NormalEquations:
    """Sum the products of lagged signals with each other and with the targets.

    Parameters
    ----------
    signals : ndarray, shape (s, N)
        Regressors; NaN removes the rows that contain it.
    targets : ndarray, shape (p, N)
        Left-hand sides; NaN removes its row.
    lags : int
        Lags 0 ... lags-1 of every signal; ``1 <= lags <= N``.
    offset : bool, default True
        Include an unknown constant in every target.

    Returns
    -------
    NormalEquations
        Regressors are ordered signal by signal.
    """
    keep = complete_rows(signals, targets, lags)
    # Means are subtracted first: sums with large offsets would lose digits.
    filled = _centred if offset else _zeroed
    z, y = filled(signals), filled(targets)
    gram, sums = _gram(z, lags)
    cross = _correlation(y[:, lags - 1 :], z, lags).reshape(y.shape[0], -1).T
    tail = y[:, lags - 1 :]
    power, total, rows = tail @ tail.T, tail.sum(axis=1), int(keep.sum())
    dropped = np.flatnonzero(~keep)
    if 2 * dropped.size > keep.size:
        chosen, sign = np.flatnonzero(keep), 1.0
        gram, sums, cross = np.zeros_like(gram), np.zeros_like(sums), np.zeros_like(cross)
        power, total = np.zeros_like(power), np.zeros_like(total)
    else:
        chosen, sign = dropped, -1.0
    for start in range(0, chosen.size, CHUNK):
        index = chosen[start : start + CHUNK]
        phi = _rows(z, lags, index)
        part = tail[:, index]
        gram += sign * (phi.T @ phi)
        cross += sign * (phi.T @ part.T)
        power += sign * (part @ part.T)
        sums += sign * phi.sum(axis=0)
        total += sign * part.sum(axis=1)
    if offset and rows > 0:
        gram -= np.outer(sums, sums) / rows
        cross -= np.outer(sums, total) / rows
        power -= np.outer(total, total) / rows
    return NormalEquations(gram, cross, power, rows, max(rows - offset, 0))


def _centred(signals: FloatArray) -> FloatArray:
    known = np.isfinite(signals)
    count = np.maximum(known.sum(axis=1, keepdims=True), 1)
    mean = np.where(known, signals, 0.0).sum(axis=1, keepdims=True) / count
    return np.where(known, signals - mean, 0.0)


def _zeroed(signals: FloatArray) -> FloatArray:
    return np.where(np.isfinite(signals), signals, 0.0)


def _rows(z: FloatArray, lags: int, index: IntArray) -> FloatArray:
    windows = np.lib.stride_tricks.sliding_window_view(z, lags, axis=1)[:, index, ::-1]
    return windows.transpose(1, 0, 2).reshape(index.size, -1)


def _correlation(late: FloatArray, z: FloatArray, lags: int) -> FloatArray:
    """Sum ``late[a, k] z[b, k + lags - 1 - i]`` over k; shape (rows of late, s, lags)."""
    points = fft_length(z.shape[1])
    product = np.conj(np.fft.rfft(late, n=points))[:, None] * np.fft.rfft(z, n=points)[None]
    out: FloatArray = np.fft.irfft(product, n=points)[:, :, :lags][:, :, ::-1]
    return out


def _gram(z: FloatArray, lags: int) -> tuple[FloatArray, FloatArray]:
    s, N = z.shape
    first = _correlation(z[:, lags - 1 :], z, lags)  # (a, b, j): z_a[k] z_b[k-j]
    gram = np.empty((s, lags, s, lags))
    entering = z[:, : lags - 1][:, ::-1]  # z[lags-2-i]
    leaving = z[:, N - lags + 1 :][:, ::-1]  # z[N-1-i]
    gram[:, 0] = first
    gram[:, :, :, 0] = first.transpose(1, 2, 0)
    for i in range(lags - 1):
        gram[:, i + 1, :, 1:] = (
            gram[:, i, :, :-1]
            + entering[:, i, None, None] * entering[None]
            - leaving[:, i, None, None] * leaving[None]
        )
    flat = gram.reshape(s * lags, s * lags)
    run = np.concatenate([np.zeros((s, 1)), np.cumsum(z, axis=1)], axis=1)
    sums = (run[:, N - np.arange(lags)] - run[:, lags - 1 - np.arange(lags)]).ravel()
    return (flat + flat.T) / 2, sums
