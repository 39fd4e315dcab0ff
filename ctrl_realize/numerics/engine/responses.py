"""Responses of first-order modes to a delayed, held input, and their derivatives.

The response of a rational transfer function with distinct poles ``p_j`` to an input that changes by
``d_l`` at ``t_l`` and is constant in between is a sum of

    H(t)   = sum_l d_l                                   (the static part)
    E_j(t) = sum_l d_l exp(p_j (t - t_l - tau))

over the changes that have arrived, t > t_l + tau. Derivatives need dE_j/dp_j in addition:

    T_j(t) = sum_l d_l (t - t_l - tau) exp(p_j (t - t_l - tau)).

`StepSequence` evaluates their means over bins of samples for a few changes (steps, ramps), and many
dead times and pole sets at once; `SampledInput` is for a long measured signal, by recursion.

Exact for a held input, as sampling in [1]_; a fractional dead time needs no special treatment,
since changes have times and not sample numbers.

References
----------
.. [1] K. J. Astrom and B. Wittenmark, Computer-Controlled Systems, 3rd ed., Prentice Hall 1997,
   section 2.3.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Protocol, TypeAlias

import numpy as np
from scipy.signal import lfilter

from ..arrays import ComplexArray, FloatArray, IntArray
from ..constants import PIECE

Modes: TypeAlias = tuple[FloatArray, Any, Any]
"""H (B, m), E (B, m, J) and T (B, m, J), the latter real where they are for all of B."""

TOGETHER = 1e-9  # samples by which a move and a sample may be apart and be at one time
_DISTANT = 20.0  # widths of a bin from an arrival, from which on two samples stand for it


class HeldInput(Protocol):
    """An input that is constant between its changes."""

    def modes(self, tau: FloatArray, poles: ComplexArray) -> Modes:
        """Evaluate H, E and T for dead times (B,) and poles (B, J)."""
        ...


@dataclass(frozen=True, eq=False)
class StepSequence:
    """A few changes of the input; the response is needed as means over bins of samples.

    Attributes
    ----------
    first : ndarray, shape (m,)
        Time of the first sample of every bin, in s.
    width : ndarray of int, shape (m,)
        Number of samples in every bin; 1 for single samples.
    dt : float
        Sample time in s.
    moves, sizes : ndarray, shape (L,)
        Times and heights of the changes of the input; sorted.
    samples : ndarray, optional
        Times of all samples, in s, of which every bin has `width` in turn, if others are missing.

    Notes
    -----
    Between two arrivals each mode is one exponential: the sum over the changes is updated from
    arrival to arrival. Means of exponentials are geometric sums, so there is no approximation; bins
    during which a change arrives are computed sample by sample. Where samples are missing, the mean
    of an exponential over a bin is that over two samples with the mean and the variance of their
    times: off by the third power of the width over the time constant, 1e-6 for bins of 5 % of the
    distance from the arrival; wider ones are computed sample by sample.
    """

    first: FloatArray
    width: IntArray
    dt: float
    moves: FloatArray
    sizes: FloatArray
    samples: FloatArray | None = None

    def pieces(self) -> list[StepSequence]:
        """Short sequences whose concatenated responses are the response to this one: memory."""
        stops = range(PIECE, self.first.size, PIECE)
        parts = zip(np.split(self.first, stops), np.split(self.width, stops), strict=True)
        pieces = [replace(self, first=first, width=width) for first, width in parts]
        if self.samples is None:
            return pieces
        own = np.split(self.samples, np.cumsum([piece.width.sum() for piece in pieces])[:-1])
        return [replace(piece, samples=s) for piece, s in zip(pieces, own, strict=True)]

    def modes(self, tau: FloatArray, poles: ComplexArray) -> Modes:
        """Evaluate H, E and T for every bin; see `HeldInput`."""
        # Real exponentials take a third of the time of complex ones.
        rates = poles if poles.imag.any() else poles.real
        since = self.first - tau[:, None]
        here = self._arrived(since)
        held = self._carried(rates) if self.moves.size > 1 else None
        row = np.arange(tau.size)[:, None]
        # The bins of a pole are contiguous, as factorisations have them.
        static, mode, slope = self._decayed(held, rates[:, :, None], since, row, here)
        if self._kinds[0][-1] == 1:
            return static, mode.swapaxes(1, 2), slope.swapaxes(1, 2)
        mean, turn, kind = self.bin_means(rates)
        mean, turn = (part.swapaxes(1, 2).take(kind, axis=2) for part in (mean, turn))
        slope *= mean
        slope += mode * turn
        mode *= mean
        late = here != self._arrived(since + self.lengths)
        if self.samples is not None:
            late |= here != self._arrived(since - _DISTANT * self.lengths)
        row, column = np.nonzero(late)
        if row.size:
            # The samples of all bins during which a change arrives, concatenated.
            count = self.width[column]
            ends = np.cumsum(count)
            within = np.arange(ends[-1]) - np.repeat(ends - count, count)
            away = self._offsets(np.repeat(column, count), within)
            when = np.repeat(since[row, column], count) + away
            owner = np.repeat(row, count)
            parts = self._decayed(held, rates[owner], when, owner, self._arrived(when))
            for values, samples in zip((static, mode, slope), parts, strict=True):
                sums = np.add.reduceat(samples, ends - count, axis=0)
                values[row, ..., column] = sums / count.reshape(-1, *[1] * (sums.ndim - 1))
        return static, mode.swapaxes(1, 2), slope.swapaxes(1, 2)

    @cached_property
    def _kinds(self) -> tuple[IntArray, IntArray]:
        """Distinct widths, and the index of that of every bin."""
        widths, kind = np.unique(self.width, return_inverse=True)
        return widths, kind

    @cached_property
    def lengths(self) -> FloatArray:
        """Time from the first to the last sample of every bin."""
        return self._offsets(np.arange(self.width.size), self.width - 1)

    @cached_property
    def _starts(self) -> IntArray:
        """Number of the first sample of every bin."""
        return np.asarray(np.cumsum(self.width) - self.width)

    def _offsets(self, column: IntArray, within: IntArray) -> FloatArray:
        """Time from the first sample of each of some bins to another one, numbered within it."""
        if self.samples is None:
            return np.asarray(self.dt * within, dtype=np.float64)
        return np.asarray(self.samples[self._starts[column] + within] - self.first[column])

    def bin_means(self, rates: Any) -> tuple[Any, Any, IntArray]:
        """Means of exp(p t) and t exp(p t) over kinds of bins (B, k, J), and the kind of each.

        The time t is that from the first sample of a bin.
        """
        if self.samples is None:
            widths, kind = self._kinds
            mean, turn = _geometric_mean(rates[:, None] * self.dt, widths[:, None])
            return mean, self.dt * turn, kind
        early, late = self.nodes
        first, last = (np.exp(rates[:, None] * node[:, None]) / 2 for node in (early, late))
        turn = first * early[:, None] + last * late[:, None]
        return first + last, turn, np.arange(self.width.size)

    @cached_property
    def nodes(self) -> tuple[FloatArray, FloatArray]:
        """Two times, from the start of every bin, with the mean and variance of its samples'."""
        assert self.samples is not None
        away = self.samples - np.repeat(self.first, self.width)
        middle = np.add.reduceat(away, self._starts) / self.width
        away -= np.repeat(middle, self.width)
        spread = np.sqrt(np.add.reduceat(away**2, self._starts) / self.width)
        # Not before the bin, where a fast response would not have decayed.
        early = np.maximum(middle - spread, 0.0)
        return early, 2 * middle - early

    @cached_property
    def _steps(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Times at which a change has arrived, times of the changes, and levels after them."""
        # For a dead time of whole samples rounding must not decide what has arrived.
        arrivals = self.moves + TOGETHER * self.dt
        level = np.concatenate([[0.0], np.cumsum(self.sizes)])
        return arrivals, np.concatenate([[np.inf], self.moves]), level

    def _arrived(self, since: FloatArray) -> IntArray:
        """Count the changes that have arrived at delayed times (B, m)."""
        arrivals = self._steps[0]
        if arrivals.size == 1:
            return np.asarray(since > arrivals[0], dtype=np.int64)
        return np.searchsorted(arrivals, since, side="left")

    def _decayed(
        self,
        held: tuple[Any, Any] | None,
        rates: Any,
        when: FloatArray,
        row: IntArray,
        here: IntArray,
    ) -> Modes:
        """H, E and T at delayed times, `here` changes after the first state of `_carried`.

        For times (B, m) and rates (B, J, 1) E and T are (B, J, m), for times (K,) and rates (K, J)
        they are (K, J).
        """
        _, start, level = self._steps
        elapsed = np.where(here > 0, when - start[here], 0.0)[:, None]
        static, mode = level[here], np.exp(elapsed * rates)
        if held is None:
            mode *= static[:, None]  # nothing has decayed before
            return static, mode, elapsed * mode
        total, stretch = (np.moveaxis(part[row, here], -1, 1) for part in held)
        slope = stretch * mode
        mode *= total
        slope += elapsed * mode
        return static, mode, slope

    def _carried(self, rates: FloatArray | ComplexArray) -> tuple[Any, Any]:
        """Sums for E and T up to each arrival, decayed to then; entry 0 is before the first."""
        count = self.moves.size + 1
        total = np.zeros((rates.shape[0], count, rates.shape[1]), dtype=rates.dtype)
        stretch = np.zeros_like(total)
        before = np.concatenate([self.moves[:1], self.moves])
        for i in range(1, count):
            gap = before[i] - before[i - 1]
            decay = np.exp(gap * rates)
            stretch[:, i] = (stretch[:, i - 1] + gap * total[:, i - 1]) * decay
            total[:, i] = total[:, i - 1] * decay + self.sizes[i - 1]
        return total, stretch


def _geometric_mean(x: Any, count: IntArray) -> tuple[Any, Any]:
    """Mean over k = 0...count - 1 of exp(k x), and its derivative with respect to x."""
    total = x * count
    ratio, power = np.expm1(x), np.expm1(total)
    mean = power / (count * ratio)
    turn = (power + 1 - mean * (ratio + 1)) / ratio
    small = np.abs(total) < 1e-4
    if small.any():
        half, third = (count - 1) / 2, (count - 1) * (2 * count - 1) / 6
        return np.where(small, 1 + half * x, mean), np.where(small, half + third * x, turn)
    return mean, turn


@dataclass(frozen=True, eq=False)
class SampledInput(HeldInput):
    """A sampled, held input (N,) without its baseline; the response is needed at each sample."""

    signal: FloatArray
    dt: float

    def modes(self, tau: FloatArray, poles: ComplexArray) -> Modes:
        """Evaluate H, E and T at every sample; see `HeldInput`."""
        n = self.signal.size
        moves = np.diff(self.signal, prepend=0.0)
        rates = poles if poles.imag.any() else poles.real
        static = np.zeros((tau.size, n))
        # The samples of a pole are contiguous, as filters and factorisations have them.
        mode = np.zeros((*rates.shape, n), dtype=rates.dtype)
        slope = np.zeros_like(mode)
        for b in range(tau.size):
            # A change at sample l is first visible at the first sample after l + tau/dt.
            whole = int(np.ceil(tau[b] / self.dt - TOGETHER))
            if whole >= n:
                continue
            rest = max(whole * self.dt - tau[b], 0.0)
            static[b, whole:] = self.signal[: n - whole]
            before = None
            for j, pole in enumerate(poles[b]):
                if pole.imag and before is not None and pole == before.conjugate():
                    mode[b, j, whole:] = mode[b, j - 1, whole:].conj()
                    slope[b, j, whole:] = slope[b, j - 1, whole:].conj()
                    continue
                before = pole
                # Real recursions take half of the time of complex ones.
                rate = pole if pole.imag else pole.real
                z = np.exp(rate * self.dt)
                sums = lfilter([1.0], [1.0, -z], moves[: n - whole])
                # d(z^k)/dp = k dt z^k: a second pass of the same recursion.
                weighted = lfilter([0.0, z * self.dt], [1.0, -z], sums)
                gain = np.exp(rate * rest)
                mode[b, j, whole:] = gain * sums
                slope[b, j, whole:] = gain * (weighted + rest * sums)
        return static, np.swapaxes(mode, 1, 2), np.swapaxes(slope, 1, 2)


@dataclass(frozen=True, eq=False)
class SeveralInputs(HeldInput):
    """Inputs of several parts of the data, one below the other.

    Attributes
    ----------
    parts : tuple of HeldInput
    rows : tuple of ndarray of int or slice, optional
        Rows of every part at which the response is needed; default: all.
    """

    parts: tuple[HeldInput, ...]
    rows: tuple[IntArray | slice, ...] | None = None

    @property
    def wanted(self) -> list[tuple[HeldInput, IntArray | slice]]:
        """Every part with its rows."""
        rows = self.rows or (slice(None),) * len(self.parts)
        return list(zip(self.parts, rows, strict=True))

    def modes(self, tau: FloatArray, poles: ComplexArray) -> Modes:
        """Evaluate H, E and T at every row wanted; see `HeldInput`."""
        modes = [
            [values[:, rows] for values in part.modes(tau, poles)] for part, rows in self.wanted
        ]
        joined = (np.concatenate(values, axis=1) for values in zip(*modes, strict=True))
        static, mode, slope = joined
        return static, mode, slope
