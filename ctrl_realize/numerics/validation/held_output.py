"""Outputs that stand still where a plant does not: held between samples, or at their limit.

Our own rule: noise of one quantisation step [1]_ repeats a value seldom, a held output most of the
time.

References
----------
.. [1] B. Widrow and I. Kollar, Quantization Noise, Cambridge University Press 2008,
   doi:10.1017/CBO9780511754661.
"""

from __future__ import annotations

import numpy as np

from ..arrays import FloatArray

_FAST = 0.2
"""Part of the steepest slope of a model from which its output counts as moving."""
_FEWEST = 8
_SELDOM = 0.2
"""Part of equal neighbours up to which an output is said to have noise."""
_LONG = 20


def held_share(output: FloatArray, fitted: FloatArray) -> float:
    """Part of the samples that repeat the one before while the model moves; 0 if it never does.

    Noise with a deviation of the quantisation step repeats 28 % of them.
    """
    moves = np.abs(np.diff(fitted))
    moving = moves >= _FAST * moves.max(initial=0.0)
    if not moves.any() or moving.sum() < _FEWEST:
        return 0.0
    return float(np.mean(np.diff(output)[moving] == 0))


def longest_hold(output: FloatArray, fitted: FloatArray) -> int:
    """Longest time in samples for which an output is held while the model moves."""
    moves = np.abs(np.diff(fitted))
    moving = moves >= _FAST * moves.max(initial=0.0)
    stands = np.concatenate([[False], (np.diff(output) == 0) & moving, [False]])
    ends = np.flatnonzero(np.diff(stands.astype(np.int8)))
    return int((ends[1::2] - ends[::2]).max(initial=0))


def samples_at_limit(output: FloatArray) -> int:
    """Count the samples in runs at the highest or lowest value of an output that has noise."""
    same = np.diff(output) == 0
    count = 0
    for limit in (output.max(), output.min()):
        at = np.concatenate([[False], output == limit, [False]])
        ends = np.flatnonzero(np.diff(at.astype(np.int8)))
        runs = ends[1::2] - ends[::2]
        inside = int(runs[runs >= _LONG].sum())
        elsewhere = same[(output[1:] != limit)]
        if inside and elsewhere.size > _LONG and np.mean(elsewhere) <= _SELDOM:
            count += inside
    return count
