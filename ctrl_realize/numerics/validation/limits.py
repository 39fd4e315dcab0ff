"""Samples of an output that clips: behind its noise, or before it.

What clips behind the noise cuts it on one side: many samples have exactly the highest or lowest
value. Before the noise a limit leaves a plateau that is reached with a kink and never passed, which
no lags make. Such samples are bounds of the plant's output, no measurements of it (censored data
[1]_); without them the model is that of the plant. The rules that find them are our own.

References
----------
.. [1] J. Tobin, Estimation of relationships for limited dependent variables, Econometrica 26 (1958)
   24-36, doi:10.2307/1907382.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from scipy.ndimage import uniform_filter1d

from ..arrays import BoolArray, FloatArray, IntArray
from ..constants import OUTLIER, VERY_STRONG
from ..signals.noise import (
    correlation_time,
    is_coarse,
    mad_sigma,
    quantisation_step,
    rounding_error,
)
from ..signals.noise_model import coloured_criterion
from .held_output import SELDOM

_TURNS = 0.5
"""Part of its third differences that change sign then: 77 % of white noise (arccos of their
correlation, -3/4), few of a response without noise."""
_FEWEST = 8  # samples at a limit; of Gaussian noise that is not rounded one has its highest value
_OFTEN = 3.0
"""How much more often it occurs than any value between: 1.4 times for the uneven steps of the
converter of a measured hard-disk arm at rest. Noise gets rarer towards its ends."""
_FAR = 2.0  # ranges of the other samples beyond which a value is no limit of theirs
_GAP = 10  # samples between two at a limit that are taken for cut noise as well
_WIDTH = 5  # samples of the means in which a plateau is looked for
_LONG = 12  # samples of a plateau
_WITHIN = 3.0  # standard deviations of these means within which a plateau stays
_MOST = 2000  # samples from the beginning of a motion to the end of its plateau; more are thinned
_ENOUGH = 20  # plateaus, the longest, by which a limit is judged
_BEGUN = 0.5  # part of a rise that is over where it is looked at
_RISE = 6  # samples that are left of it, at least
_BEHIND = 4  # times a rise that are looked at behind it
_EARLY = 2  # samples that are left out before and after a plateau
_RATES = np.geomspace(0.25, 32, 15)  # of lags, over the length of what they explain
_TOLD = 3.0  # by which a kink lowers a likelihood criterion to be told
_BEYOND = 0.02  # part of the range by which a plant passes its limit, on average, to be told


def at_limit(output: FloatArray) -> list[tuple[float, BoolArray]]:
    """Highest or lowest value of a noisy output that clips there, and its samples (N,).

    With the few samples between them: noise that is cut. A value far from all others is a code.
    """
    rows = np.flatnonzero(~np.isnan(output))
    values = output[rows]
    nothing = rounding_error(values)
    ordered = np.sort(values)
    firsts = np.flatnonzero(np.concatenate([[True], np.diff(ordered) > nothing]))
    counts = np.diff(np.append(firsts, values.size))
    if counts.size < _FEWEST:
        return []
    least = max(_FEWEST, _OFTEN * counts[1:-1].max())
    low, high = ordered[firsts[1]], ordered[firsts[-1] - 1]
    sides = [(ordered[0], low, counts[0]), (ordered[-1], high, counts[-1])]
    often = [(end, next_one) for end, next_one, count in sides if count >= least]
    at = [float(end) for end, next_one in often if abs(end - next_one) <= _FAR * (high - low)]
    inner = (values >= low) & (values <= high)
    if not at or not _is_noisy(values, ~inner):
        return []
    found = []
    for end in at:
        samples, equal = np.zeros(output.size, dtype=bool), np.abs(values - end) <= nothing
        runs = _joined(np.flatnonzero(equal), _GAP)
        if runs == [(0, int(np.count_nonzero(equal)) - 1)]:
            continue  # a rest without noise, as of a coarse converter: it cuts none
        for first, last in runs:
            samples[rows[first] : rows[last] + 1] = True
        found.append((end, samples))
    return found


def _is_noisy(values: FloatArray, ends: BoolArray) -> bool:
    """Whether samples that are not at the ends have noise, more than what rounding makes."""
    nothing = rounding_error(values)
    same, third = np.abs(np.diff(values)) <= nothing, np.diff(values, 3)
    third = third[~np.convolve(ends, np.ones(4), "valid").astype(bool) & (np.abs(third) > nothing)]
    if third.size < 2 * _FEWEST or is_coarse(_noise(third), quantisation_step(values)):
        return False
    repeated = np.mean(same[~(ends[1:] | ends[:-1])])
    return bool(repeated <= SELDOM and np.mean(third[1:] * third[:-1] < 0) >= _TURNS)


def _noise(third: FloatArray) -> float:
    """Standard deviation of white noise from third differences, which anything smooth lacks."""
    return mad_sigma(third) / float(np.sqrt(20))


def plateaus(output: FloatArray, edges: Sequence[int]) -> tuple[BoolArray, float]:
    """Samples (N,) at a level that the output reaches with a kink, or keeps, and never passes.

    It keeps a level if that is its response to a whole step. With them goes the decrease of a
    likelihood criterion by the kinks. `edges` are those of steps, or 0 for another input; what is
    before the first is not looked at. A later test has to decide (`clips`).
    """
    found, evidence = np.zeros(output.size, dtype=bool), 0.0
    first = edges[0]
    rows = first + np.flatnonzero(~np.isnan(output[first:]))
    if rows.size < 3 * _LONG:
        return found, evidence
    rest = output[:first][~np.isnan(output[:first])]
    slow = np.std(uniform_filter1d(rest, _WIDTH)) if rest.size > _LONG else 0.0
    for values in (output[rows], -output[rows]):
        kinks, gain = _plateaus(values, list(np.searchsorted(rows, edges)), float(slow))
        for start, stop in kinks:
            found[rows[start] : rows[stop - 1] + 1] = True
            evidence = max(evidence, gain)
    return found, evidence


def _plateaus(
    values: FloatArray, edges: list[int], slow: float
) -> tuple[list[tuple[int, int]], float]:
    """First samples of the plateaus at the upper limit, and those after them; none without a kink.

    `slow` is the standard deviation of means of the noise, where it is known.
    """
    smooth = uniform_filter1d(values, _WIDTH)
    sigma = max(_noise(np.diff(values, 3)), 1e-4 * float(np.ptp(values)))
    error = _WITHIN * max(sigma / np.sqrt(_WIDTH), slow)
    level = float(np.median(values[smooth >= smooth.max() - 2 * error]))
    on = np.flatnonzero(smooth > level - error)
    runs = [(i, k + 1) for i, k in _joined(on, _LONG) if k + 1 - i >= _LONG]
    shortest = sorted(stop - start for start, stop in runs)[-_ENOUGH:][0] if runs else 0
    gain, kinks, free, away = 0.0, [], 0, 0.0
    steps = list(pairwise([*edges, values.size]))
    for start, stop in runs:
        if any(start < edge and stop >= after for edge, after in steps):
            gain = away = np.inf  # a step without a response
        before = max(free, 2 * start - stop, *(edge for edge in edges if edge <= start))
        rise = smooth[before : start + 1] - np.min(smooth[before : start + 1])
        before += int(np.flatnonzero(rise <= _BEGUN * rise[-1])[-1]) if rise[-1] > 0 else 0
        free = stop
        if start - before >= _RISE and stop - start >= shortest:
            near = min(stop, start + _BEHIND * (start - before) + _LONG)
            better, end, slope = _kink(values[before:near])
            gain += better
            away = max(away, slope * (stop - before - end) / 2)
            start = before + end
        kinks.append((max(start - _EARLY, 0), min(stop + _EARLY, values.size)))
    return kinks if gain > _TOLD and away > _BEYOND * np.ptp(values) else [], gain


def _kink(values: FloatArray) -> tuple[float, int, float]:
    """How much better a parabola up to a level fits than lags; its end, and its slope there.

    It rises at its end: one that turns before follows the bend of lags, and hides the kink (66 of
    100 simulated responses to the limit were told, now 87; of 1000 others 6, now 7).
    """
    every = -(-values.size // _MOST)
    values = values[::every]
    size = values.size
    time, level = np.arange(size) / size, np.ones(size)
    lags = min(
        np.sum(_fitted([level, np.exp(-p * time), time * np.exp(-p * time)], values)[1] ** 2)
        for p in _RATES
    )
    found = []
    for end in np.unique(np.linspace(_RISE // 2, size - _LONG // 2, 60).astype(int)):
        to = np.maximum(time[end] - time, 0)
        weights, left = _fitted([level, to, to**2], values)
        if weights[1] < 0:
            found.append((float(np.sum(left**2)), int(end), -float(weights[1]) / size, left))
    if not found:
        return 0.0, 0, 0.0
    cost, end, slope, left = min(found, key=lambda one: one[0])
    independent = size / correlation_time(left)
    gain = independent * float(np.log(lags / cost)) if cost > 0 else 0.0
    return gain, every * end, slope / every


def _fitted(columns: list[FloatArray], values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Weights of columns, and what they leave of values."""
    regressors = np.stack(columns, axis=1)
    weights = np.asarray(np.linalg.lstsq(regressors, values, rcond=None)[0], dtype=np.float64)
    return weights, np.asarray(values - regressors @ weights)


def clips(
    output: FloatArray, linear: FloatArray, beyond: FloatArray, held: BoolArray, *, loaded: bool
) -> bool:
    """Whether a plant and a limit explain an output better than a linear model.

    Clearly better than a plant alone; beside a plant and a load, by the criterion of both.

    Parameters
    ----------
    output, linear : ndarray, shape (N,)
        Samples, and the model that was fitted to all of them.
    beyond : ndarray, shape (N,)
        Model that was fitted to the samples that are not `held`.
    held : ndarray of bool, shape (N,)
        Samples on a plateau, at the upper or lower end.
    loaded : bool
        A step of a load is part of the linear model.
    """
    limited, away = beyond.copy(), 0.0
    for part, sign, level in ends(output, held):
        away = max(away, float(np.mean(sign * beyond[part]) - level))
        limited[part] = sign * np.minimum(sign * beyond[part], level)
    if away < _BEYOND * np.ptp(output):
        return False
    errors = [output - limited, output - linear]
    worst = OUTLIER * max(mad_sigma(errors[0]), rounding_error(output))
    errors = [np.clip(error, -worst, worst) for error in errors]
    if correlation_time(errors[0]) > 1:
        better, other = (coloured_criterion([error])[0] for error in errors)
    else:
        noise = rounding_error(output) ** 2
        better, other = (output.size * np.log(np.mean(e**2) + noise) for e in errors)
    # A load has a time and a lag besides; none is taken but with very strong evidence.
    least = -2 * np.log(output.size) if loaded else VERY_STRONG
    return bool(other - better > least)


def passed(output: FloatArray, model: FloatArray, held: BoolArray) -> BoolArray:
    """Samples (N,) at which a model is beyond the level of those that are held."""
    beyond = np.zeros(output.size, dtype=bool)
    for _, sign, level in ends(output, held):
        beyond |= sign * model > level
    return beyond


def ends(output: FloatArray, held: BoolArray) -> list[tuple[BoolArray, int, float]]:
    """Held samples at the upper and the lower end, the sign of the end, and its level times it."""
    middle = np.nanmedian(output[~held])
    parts = ((held & (output > middle), 1), (held & (output <= middle), -1))
    return [(part, s, float(np.median(s * output[part]))) for part, s in parts if part.any()]


def _joined(index: IntArray, gap: int) -> list[tuple[int, int]]:
    """First and last of indices that are not more than `gap` apart."""
    parts = np.split(index, np.flatnonzero(np.diff(index) > gap) + 1)
    return [(int(part[0]), int(part[-1])) for part in parts if part.size]
