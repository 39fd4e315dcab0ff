"""Delays of several channels: split into those of inputs and outputs, and tapped delay lines.

One tapped delay line per input serves all outputs, one per output all inputs.

References
----------
.. [1] A. Schrijver, Theory of Linear and Integer Programming, Wiley 1986, chapter 19 (Totally
   unimodular matrices).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog

from ..arrays import FloatArray, IntArray, Matrices


def split_delays(delays: IntArray, known: NDArray[np.bool_]) -> list[tuple[IntArray, IntArray]]:
    """Split delays into outputs and inputs: ``outputs[i] + inputs[j] <= delays[i, j]``.

    Parameters
    ----------
    delays : ndarray of int, shape (p, m)
    known : ndarray of bool, shape (p, m)
        Entries that have a delay; the others impose no limit.

    Returns
    -------
    list of (outputs, inputs)
        Whole numbers >= 0 of shapes (p,) and (m,). The first leaves the smallest sum of residual
        delays. If that sum is zero it is the only one; otherwise it is followed by the two splits
        that give priority to the inputs, or the outputs, with other residual delays.

    Notes
    -----
    The smallest sum is a linear program whose constraints are the edges of a bipartite graph:
    totally unimodular, so that its vertices are whole numbers (see the module).
    """
    p, m = delays.shape
    rows, columns = np.nonzero(known)
    limits = np.hstack([np.eye(p)[rows], np.eye(m)[columns]])
    # Number of entries that each delay serves, with a small penalty on the samples it takes: of
    # equal splits the order of the channels would choose, so those of outputs cost more.
    cost = np.repeat([0.6, 0.5], [p, m]) / (p + m)
    gain = np.concatenate([known.sum(axis=1), known.sum(axis=0)]) - cost
    top = float(delays[known].max(initial=0))
    found = linprog(-gain, A_ub=limits, b_ub=delays[known], bounds=(0.0, top), method="highs")
    shares = np.rint(np.asarray(found.x)).astype(np.int64)
    ways = [_balanced(shares[:p], shares[p:])]
    if np.any(known & (delays != np.add.outer(*ways[0]))):
        first = least_known(delays, known)
        ways.append(_balanced(least_known((delays - first).T, known.T), first))
        second = least_known(delays.T, known.T)
        ways.append(_balanced(second, least_known(delays - second[:, None], known)))
    return ways


def least_known(delays: IntArray, known: NDArray[np.bool_], axis: int = 0) -> IntArray:
    """Return the smallest known entries along an axis; 0 where there is none."""
    least = np.min(delays, axis, where=known, initial=np.iinfo(np.int64).max)
    return np.where(known.any(axis), least, 0)


def _balanced(outputs: IntArray, inputs: IntArray) -> tuple[IntArray, IntArray]:
    """Move the common delay to the side with fewer signals; to the inputs if they are equal."""
    p, m = outputs.size, inputs.size
    common = int(outputs.min()) if m <= p else -int(inputs.min())
    return outputs - common, inputs + common


def aligned(markov: FloatArray, delays: IntArray) -> FloatArray:
    """Advance every channel of a response (p, m, N) by its delay, to a length that all have."""
    length = markov.shape[-1] - int(delays.max())
    return np.take_along_axis(markov, delays[:, :, None] + np.arange(length), axis=-1)


def joined_rows(parts: list[Matrices], taps: IntArray) -> Matrices:
    """Join one model per output, each with all inputs, with tapped input delay lines.

    Parameters
    ----------
    parts : list of (A, B, C, D)
        Shapes (n, n), (n, m), (1, n), (1, m).
    taps : ndarray of int, shape (p, m)
        Delay of input j on its way to model i.

    Returns
    -------
    A, B, C, D : ndarray
        Of order ``sum n + sum_j max_i taps[i, j]``.
    """
    p, m = taps.shape
    orders = [part[0].shape[0] for part in parts]
    lengths = taps.max(axis=0)
    size = sum(orders) + int(lengths.sum())
    A, B = np.zeros((size, size)), np.zeros((size, m))
    C, D = np.zeros((p, size)), np.zeros((p, m))
    starts = sum(orders) + np.concatenate([[0], np.cumsum(lengths)[:-1]])
    for j in range(m):
        if lengths[j]:
            B[starts[j], j] = 1.0
        for k in range(1, lengths[j]):
            A[starts[j] + k, starts[j] + k - 1] = 1.0
    at = 0
    for i, (Ai, Bi, Ci, Di) in enumerate(parts):
        own = slice(at, at + orders[i])
        A[own, own], C[i, own] = Ai, Ci[0]
        for j in range(m):
            if taps[i, j]:
                source = starts[j] + taps[i, j] - 1
                A[own, source], C[i, source] = Bi[:, j], Di[0, j]
            else:
                B[own, j], D[i, j] = Bi[:, j], Di[0, j]
        at += orders[i]
    return A, B, C, D


def joined_columns(parts: list[Matrices], taps: IntArray) -> Matrices:
    """Join one model per input, each with all outputs, with tapped output delay lines.

    The transpose of `joined_rows`: `parts` have shapes (n, n), (n, 1), (p, n), (p, 1).
    """
    turned = [(A.T, C.T, B.T, D.T) for A, B, C, D in parts]
    A, B, C, D = joined_rows(turned, taps.T)
    return A.T, C.T, B.T, D.T
