"""Kano's model of stiction and a linear process behind it, compared with a record of a loop.

The linear part is a first-order lag, or an integrator, behind a dead time; its gain is fitted by
least squares, its lag and dead time are searched. Drift is removed from both sides alike.

Where the stem was before the record decides whether it slips in the first cycle, and a slip that is
missed may never be made up for: the output then swings about another level by less than S. In a
limit cycle the stem stopped where the output turned. So the stem is tried at rest at the largest
and at the smallest output of the first half cycles; and at that of every cycle, so that what is
missed in one does no harm in the next. This is our own.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter

from ..actuators.friction import kano_rows
from ..arrays import FloatArray, IntArray
from .cycles import crossings, smoothed, without_drift

_LONGEST_DELAY = 0.6
"""Over the period."""
_HALF_CYCLES = 3
"""At whose extremes of the output the stem is tried at rest."""
_SMOOTHED = 0.25
"""Part of a period over which the output is averaged before its half cycles are told apart."""
_AT_ONCE = 1_500_000
"""Samples that are simulated at once: some megabytes."""


class Trial(NamedTuple):
    """One pair of S and J with its best linear part; `error` is the part of power that is left."""

    error: float
    stick: float
    jump: float
    gain: float
    lag: float
    delay: int
    start: int


class StickingLoop:
    """Output and value (N,) of a loop, and the models that are compared with them.

    The linear part sees means over `every` samples, of which the value is thinned out; lags and
    delays are in thinned samples. `sign` is that of the gain.
    """

    def __init__(
        self, output: FloatArray, value: FloatArray, period: float, sign: float, every: int = 1
    ) -> None:
        self.output, self.period, self.sign, self.every = output, period / every, sign, every
        half = max(round(period / 2), 1)
        once = [
            {first + int(place(output[first : first + half])): side}
            for first in range(0, _HALF_CYCLES * half, half)
            for place, side in ((np.argmax, 1.0), (np.argmin, -1.0))
        ]
        cycles = _stops_of_cycles(output, period)
        self.starts = (*cycles, *once)
        self.every_cycle = range(len(cycles))
        self.once = range(len(cycles), len(self.starts))
        self.longest = max(int(_LONGEST_DELAY * self.period), 1)
        self._first = self.longest + -(-_HALF_CYCLES * half // every)
        self._half = round(self.period) // 2
        self.value = without_drift(self._thinned(value[None]), self.period)[0, self._first :]
        self.power = float(self.value @ self.value)
        # A stem whose motion is below it stands still, but for rounding.
        self._still = 1e-12 * float(output.var()) * self.value.size

    def linear(self, lags: Sequence[float], delays: Sequence[int]) -> Trial:
        """Fit the linear part without stiction."""
        position, none = self._thinned(self.output[None]), np.zeros(1)
        return self._best(position, none, none, lags, delays)[0]

    def best(
        self,
        sticks: FloatArray,
        jumps: FloatArray,
        lags: Sequence[float],
        delays: Sequence[int],
        starts: Sequence[int],
    ) -> list[Trial]:
        """Fit the linear part for each pair of S and J (M,); the best of the starts is taken."""
        found = []
        rows = max(_AT_ONCE // self.output.size, 1)
        for first in range(0, sticks.size, rows):
            stick, jump = sticks[first : first + rows], jumps[first : first + rows]
            of_starts = [
                self._best(self._positions(stick, jump, start), stick, jump, lags, delays, start)
                for start in starts
            ]
            found += [min(each) for each in zip(*of_starts, strict=True)]
        return found

    def residual(self, trial: Trial) -> FloatArray:
        """Value minus the model, without drift."""
        stick, jump = np.array([trial.stick]), np.array([trial.jump])
        position = self._thinned(self.output[None])
        if trial.stick:
            position = self._positions(stick, jump, trial.start)
        late = self._lagged(self._level(position), trial.lag)[0]
        first = self._first - trial.delay
        return np.asarray(self.value - trial.gain * late[first : first + self.value.size])

    def _best(
        self,
        positions: FloatArray,
        sticks: FloatArray,
        jumps: FloatArray,
        lags: Sequence[float],
        delays: Sequence[int],
        start: int = 0,
    ) -> list[Trial]:
        rows, ones = np.arange(sticks.size), np.ones(sticks.size)
        found = np.outer([1.0, 0.0, lags[0], delays[0]], ones)  # error, gain, lag and delay
        level = self._level(positions)
        for each in lags:
            power, product = self._sums(self._lagged(level, each), self._first - np.array(delays))
            good = (power > self._still) & (self.sign * product > 0)
            factor = np.where(good, product / np.where(good, power, 1.0), 0.0)
            left = 1 - factor * product / self.power
            best = np.argmin(left, axis=1)
            least = left[rows, best]
            new = np.maximum(least, 0.0), factor[rows, best], each * ones, np.take(delays, best)
            found = np.where(least < found[0], new, found)
        error, gain, lag, delay = found.tolist()
        columns = zip(error, sticks.tolist(), jumps.tolist(), gain, lag, delay, strict=True)
        return [Trial(e, s, j, g, t, int(late), start) for e, s, j, g, t, late in columns]

    def _positions(self, sticks: FloatArray, jumps: FloatArray, start: int) -> FloatArray:
        stops = self.starts[start]
        first, ahead = min(stops), min(stops) // self.every
        begin = ahead * self.every
        command = np.append(np.full(first - begin, self.output[first]), self.output[first:])
        own = {0: stops[first]} | {k - begin: stops[k] for k in stops}
        moved = kano_rows(command, sticks, jumps, own)
        return np.pad(self._thinned(moved), ((0, 0), (ahead, 0)), mode="edge")

    def _thinned(self, rows: FloatArray) -> FloatArray:
        count = rows.shape[1] // self.every
        total = rows[:, : count * self.every : self.every].copy()
        for k in range(1, self.every):
            total += rows[:, k : count * self.every : self.every]
        return np.ascontiguousarray(total / self.every)

    def _level(self, positions: FloatArray) -> FloatArray:
        """Positions without drift, from half a period before the first, at rest until then."""
        begin = ((0, 0), (2 * self._half, 0))
        return without_drift(np.pad(positions - positions[:, :1], begin), self.period)

    def _lagged(self, level: FloatArray, lag: float) -> FloatArray:
        """Response of the lag, or of an integrator, without drift.

        Both are linear, so that the drift of all lags can be removed at once before them.
        """
        late = level
        if np.isinf(lag):
            late = np.cumsum(level, axis=1)
        elif lag > 0:
            decay = np.exp(-1 / lag)
            late = lfilter([1 - decay], [1, -decay], level, axis=1)
        return np.asarray(late[:, 2 * self._half :])

    def _sums(self, late: FloatArray, first: IntArray) -> tuple[FloatArray, FloatArray]:
        """Power of rows (M, ...) from each of `first` on, and products with the value (M, D)."""
        low, high, n = int(first.min()), int(first.max()), self.value.size
        shifted = np.zeros((high - low + n, first.size))
        for k, place in enumerate((first - low).tolist()):
            shifted[place : place + n, k] = self.value
        part = late[:, low : low + n]
        change = late[:, low + n : high + n] ** 2 - late[:, low:high] ** 2
        since = np.cumsum(np.pad(change, ((0, 0), (1, 0))), axis=1)
        power = np.einsum("ij,ij->i", part, part)[:, None] + since
        return power[:, first - low], late[:, low : high + n] @ shifted


def _stops_of_cycles(output: FloatArray, period: float) -> tuple[dict[int, float], ...]:
    """Extremes of the output in all half cycles, from the first, second and third on."""
    clean = smoothed(without_drift(output, period), period, _SMOOTHED)
    offset = (output.size - clean.size) // 2
    edges = offset + np.round(crossings(clean)).astype(int)
    stops: dict[int, float] = {}
    for first, last in pairwise(edges.tolist()):
        part = output[first : last + 1]
        up = clean[(first + last) // 2 - offset] > 0
        stops[first + int(np.argmax(part) if up else np.argmin(part))] = 1.0 if up else -1.0
    places = list(stops)
    count = min(_HALF_CYCLES, len(places))
    return tuple({k: stops[k] for k in places[first:]} for first in range(count))
