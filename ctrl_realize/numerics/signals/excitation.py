"""Part of a long record in which its inputs move.

Our own rule, to use a limited number of samples where the input has most of its variance.
"""

from __future__ import annotations

import numpy as np

from ..arrays import FloatArray

_HOPS = 4  # starts in the length of a stretch that are looked at, to save time
_ENOUGH = 0.5  # of the most that any stretch has: errors are then 1.4 times as large at most
_TOGETHER = 2**20  # samples that are looked at together


def lively_start(inputs: FloatArray, count: int) -> int:
    """First sample of the first part with nearly the largest variance of the inputs.

    That is, half the variance of the part of `count` samples with the largest one. For an input
    that moves from the beginning this is 0.

    Parameters
    ----------
    inputs : ndarray, shape (m, N)
    count : int
        Number of samples of a part.
    """
    samples = inputs.shape[1]
    hop = max(count // _HOPS, 1)
    blocks = samples // hop
    if samples <= count or blocks < _HOPS:
        return 0
    moves = np.zeros((len(inputs), blocks - _HOPS + 1))
    for row, moved in zip(inputs, moves, strict=True):
        means, squares = _block_sums(row[: blocks * hop].reshape(blocks, hop), float(row[0]))
        window = np.ones(_HOPS)
        mean = np.convolve(means, window, "valid") / (_HOPS * hop)
        variance = np.convolve(squares, window, "valid") / (_HOPS * hop) - mean**2
        # rounding error of an input that is constant far from its initial value
        variance[variance < 1e-12 * mean**2] = 0.0
        if variance.max() > 0:
            moved[:] = variance / variance.max()
    # for all inputs together if they ever move together
    together = moves.min(axis=0)
    moved = together if together.max() > 0 else moves.max(axis=0)
    if moved.max() == 0:
        return int(samples - count)  # it moves at the very end, if at all
    return int(hop * np.argmax(moved >= _ENOUGH * moved.max()))


def _block_sums(rows: FloatArray, level: float) -> tuple[FloatArray, FloatArray]:
    """Sums and sums of squares of the rows, relative to a level."""
    sums, squares = np.empty(len(rows)), np.empty(len(rows))
    step = max(_TOGETHER // rows.shape[1], 1)
    for first in range(0, len(rows), step):
        part = rows[first : first + step] - level
        sums[first : first + step] = part.sum(axis=1)
        squares[first : first + step] = np.einsum("bh,bh->b", part, part)
    return sums, squares
