"""Order and delays of a model of several channels, by the likelihood of whole records."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ...data import Record
from ...errors import DataError, OrderError
from ...numerics.arrays import FloatArray
from ...numerics.constants import VERY_STRONG
from ...numerics.hankel.delay_models import OneModel, realize_at
from ...numerics.regression.arx import excited_directions
from ...numerics.regression.normal_equations import normal_equations
from ...numerics.state_space.delay_split import aligned
from ...numerics.state_space.section_fit import MOST_STEPS, Experiment, SectionFit, fit_sections
from ...numerics.state_space.sections import Sections, in_sections

ORDERS = (1, 2, 3, 4, 5, 6, 8, 10, 12, 16, 20)
"""Orders that are tried in increasing order, until three in a row bring no improvement."""
PATIENCE = 3  # see above
ENOUGH_SAMPLES = 20000
"""Number of samples for the choice of order and delays; the last fit uses all."""
PER_PARAMETER = 3
"""Least number of measured values for each parameter."""
ROUGHLY = 0.1
"""Convergence of the log likelihood in the first fit of each candidate."""
REACH = 40.0
"""Largest difference of BIC from the best for which a candidate is fitted to its minimum before it
is compared: the last iterations gained up to 40 on measured records (a robot arm, orders 8 to
12)."""
CONVERGED, MOST_TURNS = 1e-6, 100
"""Convergence of the log likelihood then, and the largest number of iterations."""
NEARBY = 10
"""Iterations after which a neighbour of a fitted model is compared with it."""
FARTHEST = 200
"""Largest number of changes of the delays."""

FARTHEST_PLAUSIBLE = 12
"""Number of delays around the estimate that are tried."""

Shares = tuple[tuple[int, ...], tuple[int, ...]]


@dataclass(frozen=True, eq=False)
class Candidate:
    """A fitted model with its delays, and the value of the criterion: smaller is better."""

    found: SectionFit
    order: int
    inputs: tuple[int, ...]
    outputs: tuple[int, ...]
    feedthrough: bool
    bic: float
    converged: bool = False

    @property
    def structure(self) -> tuple[int, Shares, bool]:
        """Order, delays and feedthrough."""
        return self.order, (self.inputs, self.outputs), self.feedthrough


def experiments(
    group: Sequence[Record], shares: Shares, most: int = sys.maxsize, *, drift: bool = False
) -> list[Experiment]:
    """Align inputs and outputs by their delays, up to `most` samples of all records together.

    The state after the delays is unknown at the start of a record, so the past inputs within the
    delays need not be known: the first samples, which depend on them, are left out.
    """
    inputs, outputs = shares
    first = max(inputs)
    found, left = [], most
    for record in group:
        u, y = np.atleast_2d(record.input), np.atleast_2d(record.output)
        samples = min(record.n_samples, left)
        count = samples - first
        if count < 2:
            continue
        v = np.stack([row[first - d : samples - d] for row, d in zip(u, inputs, strict=True)])
        late = np.full((len(y), count), np.nan)
        for row, mine, d in zip(late, y, outputs, strict=True):
            row[: max(count - d, 0)] = mine[first + d : samples]
        level = np.nanmean(y[:, :samples], axis=1, keepdims=True)
        found.append(Experiment(v - v.mean(axis=1, keepdims=True), late - level, drift))
        left -= samples
    if not found:
        raise DataError(f"no record is longer than the delays, {first} samples")
    return found


class Search:
    """Fits of one set of records, for any order and delay, from one impulse response.

    `markov` (p, m, N) is the starting point of the fits; channels are scaled to the same size
    first, otherwise the smallest would be modelled last. All fits but the last use `enough`
    samples. With `drift` every output may have one.
    """

    def __init__(
        self, group: Sequence[Record], markov: FloatArray, top: int, enough: int, *, drift: bool
    ) -> None:
        self._group, self._experiments = group, partial(experiments, group, drift=drift)
        self._markov, self._top, self._enough = markov, top, enough
        u, y = (
            np.hstack([x - np.nanmean(x, axis=1, keepdims=True) for x in map(np.atleast_2d, rows)])
            for rows in ([r.input for r in group], [r.output for r in group])
        )
        self._samples = u.shape[1]
        self._size_in, self._size_out = u.std(axis=1), np.nanstd(y, axis=1)
        self._starts: dict[Shares, OneModel] = {}
        self._compared: list[Candidate] = []
        p, m, _ = markov.shape
        self.highest = max((self._samples * p // PER_PARAMETER - p * m) // (p + m), 0)

    def orders(self, asked: Sequence[int] | None) -> tuple[int, ...]:
        """Return the orders that the records support: excited, and with enough data."""
        tried = tuple(asked) if asked is not None else ORDERS
        possible = tuple(n for n in tried if n <= self.highest and self._excites(n))
        missing = sorted(set(tried) - set(possible))
        if missing and (asked is not None or not possible):
            why = "the input does not excite enough (a sine, or inputs that move together)"
            if missing[0] > self.highest:
                why = f"{self._samples} samples are not enough"
            raise DataError(
                f"{why} for a model of order {missing[0]}; choose a lower order or a richer input"
            )
        return possible

    def fit(
        self, order: int, shares: Shares, *, feedthrough: bool, start: Candidate | None = None
    ) -> Candidate:
        """Fit one structure, starting from another fit or from Kung's realization."""
        model = start.found.model if start is not None else self._kung(order, shares)
        most = MOST_STEPS if start is None else NEARBY
        return self._fitted(model, (order, shares, feedthrough), ROUGHLY, most)

    def converged(self, fits: Sequence[Candidate]) -> list[Candidate]:
        """Fit what may be the best to its minimum: otherwise rounding might decide."""
        found = list(fits)
        for i in sorted(range(len(found)), key=lambda i: found[i].bic):
            one = found[i]
            if not one.converged and one.bic <= min(c.bic for c in found) + REACH:
                found[i] = self._minimum(one)
        self._compared += [c for c in found if c.converged]
        return found

    def as_good(self, best: Candidate, within: float) -> list[Candidate]:
        """Other orders, delays and feedthroughs that are as good, up to convergence."""
        others = [c for c in self._compared if c.structure != best.structure]
        return [c for c in others if abs(c.bic - best.bic) <= within]

    def _minimum(self, one: Candidate) -> Candidate:
        end = self._fitted(one.found.model, one.structure, CONVERGED, MOST_TURNS)
        # B is estimated again first, which may lead to another minimum.
        return replace(min(one, end, key=lambda c: c.bic), converged=True)

    def finish(self, best: Candidate) -> Candidate:
        """Final fit to all samples."""
        _, shares, own = best.structure
        found = fit_sections(self._experiments(shares), best.found.model, feedthrough=own)
        return replace(best, found=found)

    def by_order(
        self, orders: Sequence[int], shares: Shares, *, feedthrough: bool
    ) -> list[Candidate]:
        """Fit increasing orders until there is no more improvement."""
        fits: list[Candidate] = []
        for order in orders:
            try:
                fits.append(self.fit(order, shares, feedthrough=feedthrough))
            except OrderError:
                break
            best = min(range(len(fits)), key=lambda i: fits[i].bic)
            if len(fits) - 1 - best >= PATIENCE:
                break
        if not fits:
            raise OrderError(
                f"the impulse response has a rank below {min(orders)}; choose a lower order"
            )
        return self.converged(fits)

    def improved(self, best: Candidate, *, delays: bool, feedthrough: bool) -> Candidate:
        """Change one delay, the feedthrough or the order at a time, as long as this is better.

        A delay changes by a sample if `delays` are free, the feedthrough if `feedthrough` is, and
        finally the order: with the right delays a lower one may suffice.
        """
        for _ in range(FARTHEST):
            order, shares, own = best.structure
            ways = [(moved, own) for moved in _neighbours(*shares) if delays]
            ways += [(shares, not own)] if feedthrough else []
            tried = [
                self.fit(order, moved, feedthrough=direct, start=best)
                for moved, direct in ways
                if max(moved[0]) + max(moved[1]) < self._markov.shape[-1] // 2
            ]
            best, *tried = self.converged([best, *tried])
            better = min(tried, key=lambda c: c.bic, default=best)
            if better.bic >= best.bic:
                break
            best = better
        return best

    def lowered(self, best: Candidate, orders: Sequence[int], *, delays: bool) -> Candidate:
        """Try lower orders with the delays that were found.

        With one input and output, each of them then finds its own delay: states that model samples
        of the delay would keep it too short.
        """
        for order in (n for n in orders if n < best.order):
            try:
                lower = self.fit(order, (best.inputs, best.outputs), feedthrough=best.feedthrough)
            except OrderError:
                continue
            if delays and self._markov.shape[:2] == (1, 1):
                lower = self.improved(lower, delays=True, feedthrough=False)
            best = min(self.converged([best, lower]), key=lambda c: c.bic)
        return best

    def plausible(self, best: Candidate, independent: float) -> tuple[float, float]:
        """Dead times in samples, of one input and output, that the data do not rule out.

        Those whose model of the same order has a criterion at most `VERY_STRONG` larger, if
        `independent` samples of the residual count as one. With a hold and without feedthrough, the
        first sample of a response shows that the dead time ended within the sample before it.
        """
        low, high = _within(best)
        for feedthrough in {best.feedthrough, False}:
            for step in (-1, 1):
                last, missed = best, 0
                for _ in range(FARTHEST_PLAUSIBLE):
                    delay = last.inputs[0] + step
                    if not 0 <= delay < self._markov.shape[-1] // 2 or missed == 2:
                        break
                    shares = (delay,), last.outputs
                    last = self.fit(best.order, shares, feedthrough=feedthrough, start=last)
                    missed += 1
                    if 0 < last.bic - best.bic - VERY_STRONG * independent <= REACH:
                        last = self._minimum(last)
                    if (last.bic - best.bic) / independent <= VERY_STRONG:
                        first, end = _within(last)
                        low, high, missed = min(low, first), max(high, end), 0
        return low, high

    def _excites(self, order: int) -> bool:
        lags = order + 1
        parts = [np.atleast_2d(r.input) for r in self._group if r.n_samples > lags]
        if not parts:
            return False
        grams = [normal_equations(u, u[:1], lags).gram for u in parts]
        gram = np.asarray(np.sum(grams, axis=0))
        return excited_directions(gram) == len(gram)

    def _kung(self, order: int, shares: Shares) -> Sections:
        """Realize the scaled impulse response after the delays; lower orders are parts of it."""
        if shares not in self._starts:
            scaled = self._markov * self._size_in[:, None] / self._size_out[:, None, None]
            ahead = aligned(scaled, np.add.outer(shares[1], shares[0]))
            samples = ahead.shape[-1] - 1
            top = min(max(self._top, order), samples * min(ahead.shape[:2]))
            self._starts[shares] = realize_at(ahead, 0, samples, top, padded=True)
        whole = self._starts[shares]
        if order > np.count_nonzero(whole.singular_values[: whole.A.shape[0]]):
            raise OrderError(f"order={order} is above the rank of the impulse response")
        direct = np.zeros(self._markov.shape[:2])
        B, C = whole.B[:order] / self._size_in, whole.C[:, :order] * self._size_out[:, None]
        return in_sections(whole.A[:order, :order], B, C, direct)

    def _fitted(
        self, model: Sections, structure: tuple[int, Shares, bool], enough: float, most: int
    ) -> Candidate:
        """Fit one structure from a model, and judge it."""
        order, shares, feedthrough = structure
        data = self._experiments(shares, self._enough)
        found = fit_sections(data, model, feedthrough=feedthrough, enough=enough, most=most)
        p, m, _ = self._markov.shape
        values = found.counts.sum() / p
        used = min(self._samples, self._enough)
        count = order * (p + m) + (p * m if feedthrough else 0)
        # As if the same number of samples remained for all delays, and in units of the outputs.
        loss = found.loss - float(found.counts @ np.log(self._size_out))
        bic = 2 * loss * used / values + count * np.log(used)
        return Candidate(found, order, *shares, feedthrough, float(bic))


def _within(found: Candidate) -> tuple[float, float]:
    """Bounds of the dead time, in samples, of a sampled model of one input and output."""
    delay = found.inputs[0] + found.outputs[0]
    return (max(delay - 1.0, 0.0), float(delay)) if found.feedthrough else (delay, delay + 1.0)


def _neighbours(inputs: tuple[int, ...], outputs: tuple[int, ...]) -> list[Shares]:
    """Delays that are one sample apart in one input or output."""
    both = inputs + outputs
    moved = []
    # Of one input and output only the sum counts.
    for i in range(len(both) - (len(both) == 2)):
        for step in (-1, 1):
            other = [*both]
            other[i] += step
            if other[i] >= 0:
                moved.append((tuple(other[: len(inputs)]), tuple(other[len(inputs) :])))
    return moved
