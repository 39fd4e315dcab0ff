"""Where the inputs of records move, and whether they do in more than one way.

The part of a long record is chosen by a rule of our own, to use a limited number of samples where
the input has most of its variance. An input that obeys a linear recurrence of second order is
persistently exciting of order 2 at most [1]_: it tells two numbers of a plant.

References
----------
.. [1] L. Ljung, System Identification: Theory for the User, 2nd ed., Prentice Hall 1999, section
   13.2 (persistence of excitation).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from ..arrays import FloatArray

_HOPS = 4  # starts in the length of a stretch that are looked at, to save time
_ENOUGH = 0.5  # of the most that any stretch has: errors are then 1.4 times as large at most
_TOGETHER = 2**20  # samples that are looked at together
_PARTS, _COLUMNS = 128, 10_000  # of the shortest input: not every sample, to save time


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


def beyond_order_two(inputs: Sequence[FloatArray]) -> float:
    """Part of the moves of inputs (N,) that recurrences of second order leave, squared.

    It is about 0 for a sinusoid, a ramp or an exponential, whatever their offset, that fills the
    records; a ramp behind a rest of a tenth of its record leaves 0.003, binary signals 0.8.
    """
    fewest = min(signal.size for signal in inputs)
    step = max(fewest // _PARTS, 1)
    half, thin = max((fewest - step) // 2, 1), fewest // _COLUMNS + 1
    moves = [signal[step:] - signal[:-step] for signal in inputs]
    rows = np.concatenate([sliding_window_view(one, half)[::step, ::thin] for one in moves])
    squares = np.linalg.eigvalsh(rows @ rows.T)
    # between equal samples a pulse moves nothing
    return float(squares[:-2].sum() / squares.sum()) if squares[-1] > 0 else 1.0
