"""Discrete systems closed through delays, stepped in time.

What comes out of a delay of d samples is known d samples ahead, so a block as long as the shortest
delay is computed at once. Short delays become states of the core, the others stay lines of past
samples: cost and memory do not grow with the square of the delays. The blocks are our own.
"""

from __future__ import annotations

import numpy as np

from ..arrays import FloatArray
from ..state_space.responses import BLOCK, block_operators, simulate
from .form import DelayForm

SHORT = 16
"""Samples below which a delay is as fast as states of the core."""


def absorbed(form: DelayForm, at: list[int]) -> DelayForm:
    """Turn some delays into shift registers; states [core; w_i[k+1-d] ...], newest sample first."""
    rest = [i for i in range(len(form.delays)) if i not in at]
    split = form.channels([*rest, *at])
    n, m, p = form.states, form.inputs + len(rest), form.outputs + len(rest)
    lengths = np.array(split.delays[len(rest) :], dtype=np.int64)
    last = n + np.cumsum(lengths) - 1
    first, size = last - lengths + 1, n + int(lengths.sum())
    A, B, C = np.zeros((size, size)), np.zeros((size, m)), np.zeros((p, size))
    A[:n, :n], A[:n, last], B[:n] = form.A, split.B[:, m:], split.B[:, :m]
    A[first, :n], B[first], A[np.ix_(first, last)] = split.C[p:], split.D[p:, :m], split.D[p:, m:]
    C[:, :n], C[:, last] = split.C[:p], split.D[:p, m:]
    shifted = np.setdiff1d(np.arange(n, size), first)
    A[shifted, shifted - 1] = 1.0
    return DelayForm(A, B, C, split.D[:p, :m].copy(), split.delays[: len(rest)])


def recurrence(form: DelayForm, inputs: FloatArray, state: FloatArray | None = None) -> FloatArray:
    """Compute the response of a discrete system.

    Parameters
    ----------
    form : DelayForm
        Delays in samples, at least 1 each.
    inputs : ndarray, shape (m, N)
    state : ndarray, shape (n + sum of the delays,), optional
        Initial state: of the core, then the past of each delay, newest sample first. Default: zero.

    Returns
    -------
    ndarray, shape (p, N)
    """
    N = inputs.shape[1]
    begin, lines_before = np.zeros(form.states), [np.zeros(int(d)) for d in form.delays]
    if state is not None:
        ends = form.states + np.cumsum([0, *map(len, lines_before)])[:-1]
        begin, *lines_before = np.split(state, ends)
    else:
        # Longer than the record they hold nothing back that could come out.
        keep = [i for i, delay in enumerate(form.delays) if delay < N]
        form, lines_before = form.channels(keep), [lines_before[i] for i in keep]
    short = [i for i, delay in enumerate(form.delays) if delay < SHORT]
    form = absorbed(form, short)
    begin = np.concatenate([begin, *(lines_before[i] for i in short)])
    lines_before = [line for i, line in enumerate(lines_before) if i not in short]
    m, p = form.inputs, form.outputs
    if not form.delays:
        return simulate(form.A, form.B, form.C, form.D, inputs, begin)
    delays = np.array(form.delays, dtype=np.int64)
    # a power of two, as the block operators need, and no longer than the shortest delay
    L = min(BLOCK, 1 << (int(delays.min()).bit_length() - 1))
    rows, jump, inside, into = block_operators(form.A, form.B, form.C, form.D, L)
    blocks = -(-N // L)
    given = np.zeros((blocks * L, m))
    given[:N] = inputs.T
    out = np.empty((blocks * L, p))
    longest = int(delays.max())
    past = np.zeros((longest + blocks * L, delays.size))  # z, from `longest` samples before 0
    for i, line in enumerate(lines_before):
        past[longest - line.size : longest, i] = line[::-1]
    lines = np.arange(delays.size)
    offsets = np.arange(L)[:, None] + longest - delays
    # outputs and next state of a block from its state and its inputs, in one product
    step = np.block([[rows, inside], [jump, into]])
    n, width = form.states, m + delays.size
    known = np.zeros(n + L * width)
    known[:n] = begin
    drive = known[n:].reshape(L, width)
    for start in range(0, blocks * L, L):
        drive[:, :m] = given[start : start + L]
        drive[:, m:] = past[start + offsets, lines]
        found = step @ known
        seen = found[: L * (p + delays.size)].reshape(L, -1)
        out[start : start + L] = seen[:, :p]
        past[start + longest : start + longest + L] = seen[:, p:]
        known[:n] = found[seen.size :]
    return np.ascontiguousarray(out[:N].T)
