"""Outputs that are constant while the plant moves: held or interpolated between samples, or stuck.

Our own rule: noise of one quantisation step [1]_ rarely repeats a value, a held output does so most
of the time. Of a trend that a historian compresses [2]_ straight lines are left.

References
----------
.. [1] B. Widrow and I. Kollar, Quantization Noise, Cambridge University Press 2008,
   doi:10.1017/CBO9780511754661.
.. [2] E. H. Bristol, Data compression for display and storage, US patent 4 669 097, 1987 (the
   swinging door).
"""

from __future__ import annotations

import numpy as np

from ..arrays import BoolArray, FloatArray, IntArray, runs
from ..constants import SMALLEST
from ..signals.noise import is_coarse, quantisation_step, rounding_error

_FAST = 0.2
"""Part of the steepest slope of a model from which its output counts as moving: of one lag, until
it has made 80 % of its way."""
_FEWEST_UPDATES = 20
"""Changes of an output that are enough: by chance, all of so many distances are even in one of half
a million records. Ablation: repeats left out."""
_BAND, _EVEN = 0.01, 3.0
"""Least change of an output that is stored when it has changed enough, over its range, and longest
distance of updates that come at about equal ones, over their median."""
_RARE, _VARIOUS = 0.5, 0.5
"""Part of the samples that are updates at most, and part of their changes that differ in size at
least: those of a coarse converter have few sizes."""
_FEWEST = 8  # changes, and moving samples of which a part can be judged
SELDOM = 0.2
"""Part of equal neighbours up to which an output is said to have noise."""
_LONG = 20
"""Samples: with a fifth of equal neighbours noise stands for so long by 0.2^19, with fewer for a
shorter time by as much."""
_BY_CHANCE = 3.0  # equal neighbours of which none is seen in one of twenty records
_PASSED = 0.2
"""Part of the range of a model that it makes while an output without noise is taken for stuck."""
_LONGEST = 100
"""Samples of a hold beneath noise at most: time."""
_CERTAIN, _FLAT = 5.0, 2.5
"""Standard errors by which an output follows its model less than one that is not held, at least,
and by which it may do so within its holds. Ablation: holds beneath noise."""
_SHARP = 2.5
"""How far a curve through the corners of straight lines leaves them, over what rounding may. Lines
about smooth curves that are rounded have 1.2 at most (0.9 in 166 measured signals), rounded
swinging doors 5.6 and more."""
_ALIKE, _MOST = 0.15, 0.9
"""Steps of 0.0445 that are recorded with two digits are 0.04 and 0.05 (the tacho of a motor): they
differ by 12 % of their mean; of the steps of a held curve 30 % would be that near to a multiple."""


def held_share(output: FloatArray, fitted: FloatArray) -> float:
    """Fraction of samples that repeat the previous one while the model moves; 0 if it never does.

    Noise with a standard deviation of the quantisation step repeats 28 % of them.
    """
    held, moving = _held(output, fitted)
    if not moving.any() or moving.sum() < _FEWEST:
        return 0.0
    return float(np.mean(held[moving]))


def updates(output: FloatArray, inputs: FloatArray) -> BoolArray:
    """Samples (N,) at which a held or interpolated output is updated; all of them if it is neither.

    Changes of an output (N,), NaN where it is missing, that is updated every few samples have
    distances with a common divisor, or about equal ones; one that is stored when it has changed
    enough has no small changes. Of these the first and last sample count as updates. One that is
    interpolated has its bends at such distances, and more of them than its inputs move. Where an
    output is a monotonic function of one of the inputs (M, N) some samples before, its changes are
    the input's.
    """
    changes, rounding = np.abs(np.diff(output)), rounding_error(output[np.isfinite(output)])
    at = 1 + np.flatnonzero(changes > rounding)  # not beside a missing one
    sizes, new = changes[at - 1], np.zeros(output.size, dtype=np.bool_)
    # Steps of one size are those of a converter, which an even ramp passes at equal distances.
    if at.size < _FEWEST or np.ptp(sizes) <= rounding or _static(output, inputs, at, rounding):
        return ~new
    kinks = 2 * int(np.count_nonzero(np.diff(inputs).any(axis=0)))
    for some in (at, _bends(output, kinks, 2 * rounding)):
        period = int(np.gcd.reduce(np.diff(some)))
        if period > 1 and some.size >= _FEWEST_UPDATES:
            new[some[0] % period :: period] = True
            return new
    new[at], new[0], new[-1] = True, True, True
    # Values at an end of the range are those of a limit, and before the first change it is at rest.
    inside = (output > np.nanmin(output)) & (output < np.nanmax(output))
    inside[: at[0]] = inside[at[-1] + 1 :] = False
    rare = np.count_nonzero(new & inside) < _RARE * np.count_nonzero(inside)
    various = np.unique(np.round(sizes / rounding)).size > _VARIOUS * at.size
    large = sizes.min() > _BAND * np.nanmax(output) - _BAND * np.nanmin(output)
    even = np.diff(at).max() <= _EVEN * np.median(np.diff(at)) and at.size >= _FEWEST_UPDATES
    return new if rare and various and (large or even) else np.ones_like(new)


def _bends(output: FloatArray, kinks: int, rounding: float) -> IntArray:
    """Samples at which the slope changes most; none if these may be so many kinks of a response.

    An interpolated output is straight elsewhere, but for the digits of its file.
    """
    turns = np.nan_to_num(np.abs(np.diff(output, 2)))
    most = np.sort(np.argsort(turns)[-_FEWEST_UPDATES:])
    elsewhere = np.ones_like(turns, dtype=np.bool_)
    elsewhere[most[0] % (period := int(np.gcd.reduce(np.diff(most)))) :: period] = False
    bends = np.count_nonzero(turns > turns[elsewhere].max(initial=rounding))
    return 1 + most if bends > max(kinks, _FEWEST_UPDATES - 1) else most[:0]


def _static(output: FloatArray, inputs: FloatArray, at: IntArray, rounding: float) -> bool:
    """Whether the first changes are those of a gain behind a dead time, which may saturate.

    It changes at half of the input's moves at least, the first time after one of them or with one
    before the record: one that is held moves at more of them.
    """
    moves = np.append(0, 1 + np.flatnonzero(np.diff(inputs).any(axis=0)))
    if moves.size > 2 * at.size:
        return False
    some = at[:_FEWEST_UPDATES]
    late = some[0] - moves[moves <= some[0]]
    levels = inputs[:, some - late[:, None]]  # inputs, dead times, changes
    order = np.argsort(levels, axis=-1, kind="stable")
    way = np.diff(output[some][order])
    same = np.diff(np.take_along_axis(levels, order, axis=-1)) == 0
    alone = np.all((np.abs(way) <= rounding) | ~same, axis=-1)
    one_way = np.all(way >= -rounding, axis=-1) | np.all(way <= rounding, axis=-1)
    return bool(np.any(alone & one_way))


def hold_in_noise(output: FloatArray, fitted: FloatArray) -> tuple[int, int, float] | None:
    """Period of an output (N,) that is held beneath noise, its first update, variance of the noise.

    An output that is not held follows its model (N,) between any two samples, with a factor of one;
    within holds it does not at all, and beside an update by more. The factor is estimated by least
    squares for every period and first update, without the means of the holds. The output is NaN
    where it is missing.
    """
    moves = np.abs(np.diff(fitted))
    moving = np.flatnonzero(moves >= _FAST * moves.max(initial=0.0))
    longest = min(output.size // 4, int(np.ptp(moving)) if moving.size else 0, _LONGEST)
    seen = np.isfinite(output)
    y, f = (np.where(seen, v - np.mean(v[seen]), 0.0) for v in (output, fitted))
    ends = longest + 1, 2 * longest
    sums = [np.cumsum(np.pad(v, ends)) for v in (seen + 0.0, y, f, y * y, y * f, f * f)]
    best, found = _CERTAIN, None
    for period in range(2, longest + 1):
        count = output.size // period + 2  # of holds, also of those at the ends, which may be cut
        before, at = longest - period, longest + count * period
        n, of_y, of_f, yy, yf, ff = (
            (v[longest:at] - v[before : at - period]).reshape(count, period) for v in sums
        )
        n = np.maximum(n, 1.0)
        yy, yf, ff = (
            np.sum(whole - left * right / n, axis=0)
            for whole, left, right in ((yy, of_y, of_y), (yf, of_y, of_f), (ff, of_f, of_f))
        )
        ff = np.maximum(ff, SMALLEST)
        variance = np.maximum(yy - yf**2 / ff, 0.0) / np.maximum(np.sum(n - 1, axis=0) - 1, 1.0)
        error = np.maximum(np.sqrt(variance / ff), SMALLEST)
        follows = yf / ff
        # Its whole motion is at the updates, in the middle of what begins half a period later.
        between = np.roll(follows + _FLAT * error, -(period // 2)) >= 1
        held = between & (follows <= _FLAT * error)
        certain = np.where(held, (1 - follows) / error, 0.0)
        first = int(np.argmax(certain))
        if certain[first] > best:
            best, found = float(certain[first]), (period, first, float(variance[first]))
    if found is None or is_coarse(np.sqrt(found[2]), quantisation_step(output[seen])):
        return None  # a converter holds what moves less than its step
    return found


def longest_hold(output: FloatArray, fitted: FloatArray) -> int:
    """Longest time in samples for which an output is constant while the model moves."""
    starts, ends = runs(_held(output, fitted)[0])
    return int((ends - starts).max(initial=0))


def straight_lines(output: FloatArray, drive: FloatArray) -> IntArray:
    """Samples (K,) at which an output (N,) turns between straight lines; none if it does not.

    Lines are made as long as all samples within are near them. An input (N,) that moves gives the
    response of an integrator, or of an actuator at its largest rate, two corners.
    """
    way = np.diff(output)
    turns = np.abs(np.diff(way))
    width = max(map(quantisation_step, (turns, output)))
    width = max(width, rounding_error(output))
    turns = turns[way[1:] != 0]
    if not turns.size or np.median(turns) > 2 * width:
        return np.zeros(0, dtype=np.int64)
    corners, ahead = [0], 2
    while (first := corners[-1]) < output.size - 1:
        part = output[first + 1 : first + 1 + ahead]
        count = np.arange(1, part.size + 1)
        slope, slack = (part - output[first]) / count, width / count
        steepest = np.minimum.accumulate(slope + slack)
        flattest = np.maximum.accumulate(slope - slack)
        near = np.flatnonzero((flattest <= slope) & (slope <= steepest))
        if near[-1] + 1 == ahead:
            ahead *= 2
        else:
            corners.append(first + 1 + int(near[-1]))
            ahead = 2 * int(near[-1] + 1)
    at = np.array(corners)
    length = np.diff(at)
    slopes, shorter = np.diff(output[at]) / length, np.minimum(length[1:], length[:-1])
    # The middle of a chord is an eighth of its length times its change of slope off a parabola.
    off = (np.abs(np.diff(slopes)) * shorter / 8)[shorter > 2]  # samples
    if off.size <= 2 * np.count_nonzero(np.diff(drive)) or np.median(off) < _SHARP * width:
        return at[:0]
    return at


def holds_in_motion(output: FloatArray, corners: IntArray) -> IntArray:
    """Samples between corners (K,) or updates of an output (N,) between which it moves fast."""
    apart = np.diff(corners)
    slopes = np.abs(np.diff(output[corners])) / apart
    return np.asarray(apart[slopes >= _FAST * slopes.max()])


def _held(output: FloatArray, fitted: FloatArray) -> tuple[BoolArray, BoolArray]:
    """Samples (N - 1,) that repeat the previous one, and those in which the model moves.

    Rounding repeats a value as long as the signal moves by less than a quantisation step: an output
    counts as held only if the model moves by more than that.
    """
    moves = np.abs(np.diff(fitted))
    moving = (moves >= _FAST * moves.max(initial=0.0)) & (moves > 0)
    held = _repeats(output) & moving
    way = np.concatenate([[0.0], np.cumsum(moves)])
    starts, ends = runs(held)
    rounded = way[ends] - way[starts] <= _converter_step(output)
    for start, end in zip(starts[rounded], ends[rounded], strict=True):
        held[start:end] = False
    return held, moving


def _converter_step(output: FloatArray) -> float:
    """Quantisation step, 0 if there is none; a record with few digits rounds it once more."""
    gaps = np.diff(np.unique(output))
    gaps = gaps[gaps > rounding_error(output)]
    if gaps.size == 0:
        return 0.0
    step = float(np.mean(gaps[gaps <= 1.5 * np.median(gaps)]))
    multiples = gaps / step
    alike = np.abs(multiples - np.round(multiples)) <= _ALIKE
    return step if alike.mean() > _MOST else 0.0


def stuck_samples(output: FloatArray, fitted: FloatArray) -> tuple[int, int]:
    """First and last sample of the longest run of equal values that noise does not explain.

    Twice the same if there is none. Where the model moves slowly a noisy output seldom repeats a
    value, a quantised one does so most of the time. An output without noise may rest, but not while
    the model moves.
    """
    same = _repeats(output)
    starts, ends = runs(same)
    if not starts.size:
        return 0, 0
    longest = int(np.argmax(ends - starts))
    first, last = int(starts[longest]), int(ends[longest])
    moves = np.abs(np.diff(fitted))
    quiet = moves < _FAST * moves.max(initial=0.0)
    quiet[first:last] = False
    share = max(float(np.mean(same[quiet])), _BY_CHANCE / quiet.sum()) if quiet.any() else 1.0
    least = (_LONG - 1) * np.log(SELDOM) / np.log(share) if share <= SELDOM else np.inf
    if last - first < least or quiet.sum() < _LONG:
        return 0, 0
    noise = float(np.median(np.abs(np.diff(output - fitted)[quiet])))
    passed = float(np.ptp(fitted[first : last + 1])) > _PASSED * np.ptp(fitted)
    return (first, last) if passed or noise > np.median(moves[quiet]) else (0, 0)


def _repeats(output: FloatArray) -> BoolArray:
    """Samples (N - 1,) equal to the previous one, up to rounding."""
    return np.abs(np.diff(output)) <= rounding_error(output)
