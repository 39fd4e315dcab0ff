"""Fewer delay channels: delays that meet merge, and those at an end move out of the core.

All rules compare entries as they stand, and so find what the structure of an interconnection leaves
alike: the same signal twice, a chain of two delays, a channel that nothing reads. They are our own.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from scipy.sparse.csgraph import connected_components

from ..arrays import FloatArray, IntArray
from .form import DelayForm, without_zero_delays

Paths: TypeAlias = tuple[DelayForm, FloatArray, FloatArray, FloatArray, FloatArray]
"""Core, delays at its inputs and at its outputs, gain behind it and gain before it."""
ALIKE = 4 * np.finfo(np.float64).eps
"""Relative rounding within which two rows are multiples of one another."""


def merged(form: DelayForm) -> DelayForm:
    """Return the same system with the fewest channels that these rules reach.

    Raises
    ------
    numpy.linalg.LinAlgError
        A loop through delays of 0 has no solution, or many.
    """
    form = without_zero_delays(form)
    while form.delays:
        smaller = _without_dead(form) or _without_twins(form) or _with_one_chain(form)
        if smaller is None:
            break
        form = smaller
    return form


def _into(form: DelayForm) -> FloatArray:
    """What each channel's w drives: columns of [B; D]."""
    return np.vstack([form.B, form.D])[:, form.inputs :]


def _out_of(form: DelayForm) -> FloatArray:
    """What each channel's z reads: rows of [C D]."""
    return np.hstack([form.C, form.D])[form.outputs :]


def _without_dead(form: DelayForm) -> DelayForm | None:
    """Drop channels that nothing drives or that drive nothing."""
    alive = np.any(_into(form) != 0, axis=0) & np.any(_out_of(form) != 0, axis=1)
    return None if alive.all() else form.channels(np.flatnonzero(alive).tolist())


def _without_twins(form: DelayForm) -> DelayForm | None:
    """Merge two channels of one delay that read, or drive, the same up to a factor."""
    dual = form.dual()
    for i, delay in enumerate(form.delays):
        for j in range(i):
            if form.delays[j] != delay:
                continue
            if (merged_form := _with_twin(form, i, j)) is not None:
                return merged_form
            if (merged_form := _with_twin(dual, i, j)) is not None:
                return merged_form.dual()
    return None


def _with_twin(form: DelayForm, i: int, j: int) -> DelayForm | None:
    """Drop channel i if it reads what channel j reads, up to a factor."""
    reads, m = _out_of(form), form.inputs
    factor = _factor(reads[j], reads[i])
    if factor is None:
        return None
    # w_i = factor w_j
    B, D = form.B.copy(), form.D.copy()
    B[:, m + j] += factor * B[:, m + i]
    D[:, m + j] += factor * D[:, m + i]
    rest = [k for k in range(len(form.delays)) if k != i]
    return DelayForm(form.A, B, form.C, D, form.delays).channels(rest)


def _factor(one: FloatArray, other: FloatArray) -> float | None:
    """Find c with other = c * one, None where there is none."""
    if not np.array_equal(one != 0, other != 0):
        return None
    at = int(np.argmax(np.abs(one)))
    factor = float(other[at] / one[at])
    close = np.abs(other - factor * one) <= ALIKE * np.abs(other)
    return factor if close.all() else None


def _with_one_chain(form: DelayForm) -> DelayForm | None:
    """Merge a delay that reads nothing but another one, which nothing else reads."""
    m, p, n = form.inputs, form.outputs, form.states
    reads, drives = _out_of(form), _into(form)
    for i in range(len(form.delays)):
        (at,) = np.nonzero(reads[i])
        if at.size != 1 or at[0] < n + m or at[0] == n + m + i:
            continue
        j = int(at[0]) - n - m
        (driven,) = np.nonzero(drives[:, j])
        if not np.array_equal(driven, [n + p + i]):
            continue
        factor = reads[i, at[0]]
        C, D = form.C.copy(), form.D.copy()
        C[p + i], D[p + i] = factor * form.C[p + j], factor * form.D[p + j]
        delays = list(form.delays)
        delays[i] += delays[j]
        rest = [k for k in range(len(delays)) if k != j]
        return DelayForm(form.A, form.B, C, D, tuple(delays)).channels(rest)
    return None


def ends_apart(form: DelayForm) -> tuple[tuple[float, ...], tuple[float, ...], DelayForm]:
    """Take delays at the inputs and outputs out of a form.

    Returns
    -------
    before, behind : tuple of float
        Delays of the inputs and of the outputs.
    rest : DelayForm
        What is left; without channels if all delays stood at the ends.
    """
    before, rest = _inputs_apart(form)
    behind, dual = _inputs_apart(rest.dual())
    rest = dual.dual()
    one = len(rest.delays) == rest.inputs == rest.outputs == 1
    # All of a single input goes through the single delay, and never twice.
    if one and not _reaches(rest, 0, 0) and not _reaches(rest, 1, 1):
        before[0] += rest.delays[0]
        rest = without_zero_delays(DelayForm(rest.A, rest.B, rest.C, rest.D, (0.0,)))
    return tuple(before), tuple(behind), rest


def _inputs_apart(form: DelayForm) -> tuple[list[float], DelayForm]:
    """Take delays at the inputs out of a form."""
    before, keep = [0.0] * form.inputs, []
    B, D = form.B.copy(), form.D.copy()
    n, m, p = form.states, form.inputs, form.outputs
    for i, (delay, reads) in enumerate(zip(form.delays, _out_of(form), strict=True)):
        (at,) = np.nonzero(reads)
        j = int(at[0]) - n if at.size == 1 else m
        # nothing but this channel may read the input, and not its own output either
        if 0 <= j < m and np.count_nonzero(B[:, j]) + np.count_nonzero(D[:, j]) == 1:
            before[j] += delay
            factor = D[p + i, j]
            D[p + i, j] = 0.0
            B[:, j], D[:, j] = factor * B[:, m + i], factor * D[:, m + i]
        else:
            keep.append(i)
    return before, DelayForm(form.A, B, form.C, D, form.delays).channels(keep)


def paths_apart(form: DelayForm) -> Paths | None:
    """Take all delays out of a form without loops through them: left, delays, core, delays, right.

    A delay that reads inputs of equal delays and no state is one before a further input of the
    core, which has their signal; one that drives outputs and no state is behind a further output.

    Returns
    -------
    core : DelayForm
        Without delays.
    before, behind : ndarray
        Delays of its inputs and outputs.
    left, right : ndarray
        Gains from its outputs to those of the form, and from the form's inputs to its own.
    None
        A delay is in a loop, or reads and drives more.
    """
    before, behind, rest = ends_apart(form)
    n, m, p = rest.states, rest.inputs, rest.outputs
    reads, drives = _out_of(rest), _into(rest).T
    heads, tails = [], []
    for i in range(len(rest.delays)):
        read, driven = np.flatnonzero(reads[i]) - n, np.flatnonzero(drives[i]) - n
        if _alike(read, before):
            heads.append((i, int(read[0])))
        elif _alike(driven, behind):
            tails.append((i, int(driven[0])))
        else:
            return None
    columns = [*range(m), *(m + i for i, _ in heads)]
    rows = [*range(p), *(p + i for i, _ in tails)]
    late = [m + i for i, _ in tails]
    if np.any(rest.D[np.ix_([p + i for i, _ in tails], late)]):
        return None
    core = DelayForm(rest.A, rest.B[:, columns], rest.C[rows], rest.D[np.ix_(rows, columns)])
    return (
        core,
        np.array([*before, *(before[j] + rest.delays[i] for i, j in heads)]),
        np.array([*behind, *(behind[k] + rest.delays[i] for i, k in tails)]),
        np.hstack([np.eye(p), rest.D[:p, late]]),
        np.vstack([np.eye(m), rest.D[[p + i for i, _ in heads], :m]]),
    )


def _alike(signals: IntArray, delays: Sequence[float]) -> bool:
    """Whether all signals are ends of a form, and have the same delay."""
    some = signals.size > 0 and signals.min() >= 0 and signals.max() < len(delays)
    return some and np.ptp(np.take(delays, signals)) == 0


def _reaches(form: DelayForm, column: int, row: int) -> bool:
    """Whether an input of the core can be seen at an output, by the structure of its entries."""
    entries = [[form.A, form.B[:, [column]]], [form.C[[row]], form.D[[row], [column]][None]]]
    # the output closed to the input: what leads from one to the other is then in a loop
    links = np.block(entries) != 0
    _, label = connected_components(links, directed=True, connection="strong")
    return bool(links[-1, -1] or np.count_nonzero(label == label[-1]) > 1)
