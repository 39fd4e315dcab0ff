"""State-space fits starting from several estimates of the impulse response."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..._flags import Flag, flagged
from ...data import Record
from ...delayed import DelayedStateSpace, fit_of
from ...errors import DataError, DataWarning, DelayRangeError
from ...numerics.arrays import FloatArray, IntArray
from ...numerics.constants import VERY_STRONG
from ...numerics.output_error.any_input.stretch import FOLLOWS
from ...numerics.output_error.selection import CLOSE
from ...numerics.state_space.delay_split import split_delays
from ..impulse.from_io import Method, Start, impulse_from_io
from ..realization.mimo import delay_matrix
from .drift import slopes_of, without_drift
from .result import StateSpaceFit, fitted_system
from .search import ENOUGH_SAMPLES, ORDERS, Candidate, Search, Shares

LEVEL = 0.02
"""Threshold for a response when delays are to be found, relative to a channel's largest Markov
parameter: the search refines them, and too long a delay costs more than too short a one."""
STARTS: tuple[tuple[Start, Method], ...] = (
    ("unknown", "auto"),
    ("rest", "auto"),
    ("unknown", "okid"),
    ("rest", "okid"),
)
"""Estimates of the impulse response to start from: the next one is used if the residual of the best
model so far is correlated with the input."""
SHORT = 300
"""Samples of all records together below which two starts are compared by their criteria: of 20
records of 90 samples at a signal-to-noise ratio of 20, the first alone led 2 to an integrator."""
STILL = 10
"""Samples of constant input at the start of a record after which the plant is in steady state."""


@dataclass(frozen=True, eq=False)
class Outcome:
    """Result from one start: model, and whether all outputs showed a response."""

    system: DelayedStateSpace
    seen: bool
    search: Search
    best: Candidate

    @property
    def fit(self) -> StateSpaceFit:
        """Result of the fit of the model."""
        return fit_of(self.system, StateSpaceFit)


def from_starts(
    group: tuple[Record, ...],
    asked: tuple[int, ...] | None = None,
    delays: ArrayLike | None = None,
    feedthrough: bool | None = None,
    *,
    most_starts: int = len(STARTS),
    enough: int = ENOUGH_SAMPLES,
) -> Outcome:
    """Fit from one estimate of the impulse response after another, until the residual is clean.

    Of a short record two are always tried.
    """
    best: Outcome | None = None
    refused: list[DataError] = []
    short = sum(record.n_samples for record in group) < SHORT
    at_rest = all(np.ptp(r.input[..., :STILL], axis=-1).max() == 0 for r in group)
    still = [without_drift(record, slopes_of(record)) for record in group]
    starts = sorted(STARTS, key=lambda way: way[0] != "rest") if at_rest else list(STARTS)
    for tried, way in enumerate(starts[:most_starts], start=1):
        try:
            found = _from_start(group, still, way, asked, delays, feedthrough, enough)
        except DataError as error:
            refused.append(error)
            continue
        if best is None or found.best.bic < best.best.bic:
            best = found
        # An output without response in one start is tried again in the next.
        clear = (best.seen and not short) or tried > 1
        if clear and all(check.independent for check in best.fit.checks):
            break
    if best is None:
        raise refused[0]
    return best


def _from_start(
    group: tuple[Record, ...],
    still: Sequence[Record],
    way: tuple[Start, Method],
    asked: tuple[int, ...] | None,
    delays: ArrayLike | None,
    feedthrough: bool | None,
    enough: int,
) -> Outcome:
    """Fit from one estimate of the impulse response, that of records that stand still.

    If it shows no response of any output, the fit tells whether the record does.
    """
    start, method = way
    with warnings.catch_warnings():
        # Directions determined by the prior are used for starting only.
        warnings.simplefilter("ignore", DataWarning)
        impulse = impulse_from_io(still, method=method, start=start)
    markov = np.reshape(impulse.markov, (group[0].noutputs, group[0].ninputs, -1))
    unseen = sum(flag.code == "no_response" for flag in impulse.flags)
    drift = any(one is not record for one, record in zip(still, group, strict=True))
    search = Search(group, markov, max(asked or ORDERS), enough, drift=drift)
    orders = search.orders(asked)
    found = delay_matrix(impulse, level=LEVEL) if delays is None else _given_delays(delays, markov)
    # Channels without response follow the others.
    outputs, inputs = (tuple(map(int, one)) for one in split_delays(found, found >= 0)[0])
    shares = inputs, outputs
    fits = search.by_order(orders, shares, feedthrough=feedthrough is not False)
    best = min(fits, key=lambda c: c.bic)
    moved = search.improved(best, delays=delays is None, feedthrough=feedthrough is None)
    if asked is None or len(asked) > 1:
        moved = search.lowered(moved, orders, delays=delays is None)
    bic = {c.order: c.bic for c in fits} | {moved.order: moved.bic}
    if unseen == group[0].noutputs == len(_silence(moved, FOLLOWS)):
        raise DataError(
            "no output shows a response to the inputs above the noise level; check the columns"
        )
    flags = _silence(moved)
    if len(orders) > 1 and best.order == max(asked or ORDERS):
        flags += (flagged("highest_order", order=best.order),)
    flags += tuple(_marginal(search.as_good(moved, CLOSE * VERY_STRONG)))
    choices = _choices(moved, bic, shares)
    system = fitted_system(search.finish(moved), group, bic, choices, flags)
    return Outcome(system, unseen == 0, search, moved)


def _marginal(others: Sequence[Candidate]) -> Iterator[Flag]:
    """Flag a choice so close that rounding may change it."""
    for one in others[:1]:
        yield flagged(
            "marginal_decision.state_space",
            order=one.order,
            inputs=one.inputs,
            outputs=one.outputs,
            feedthrough="and" if one.feedthrough else "and no",
        )


def _silence(best: Candidate, more: float = 0.0) -> tuple[Flag, ...]:
    """Flag outputs of which the model explains no more than it would explain of noise, and `more`.

    It is in units of chi-square.
    """
    found = best.found
    # Parameters of one output: its row of C and D, and the initial state.
    count = 2 * best.order + best.found.model.D.shape[1] * best.feedthrough
    gain = found.counts * np.log(found.spread / found.variance)
    silent = np.flatnonzero(gain < count * np.log(found.counts) + more)
    return tuple(flagged("no_response", output=a) for a in silent)


def _choices(best: Candidate, bic: dict[int, float], begun: Shares) -> tuple[str, ...]:
    choices = []
    if len(bic) > 1:
        more = {order: value - best.bic for order, value in bic.items() if order != best.order}
        others = ", ".join(f"{order} ({value:+.0f})" for order, value in sorted(more.items()))
        choices.append(f"order {best.order} has the smallest BIC; others: {others}")
    if (best.inputs, best.outputs) != begun:
        choices.append(
            f"delays start from the onsets of the responses, {begun[0]} and {begun[1]}, and "
            "were moved while that lowered BIC"
        )
    return tuple(choices)


def _given_delays(delays: ArrayLike, markov: FloatArray) -> IntArray:
    """Check given delays against the data."""
    found = np.asarray(delays)
    p, m, N = markov.shape
    whole = found.shape == (p, m) and found.dtype.kind in "iu"
    if not whole or found.min() < -1 or found.max() < 0:
        raise DelayRangeError(
            f"delays has shape {found.shape} and dtype {found.dtype}; expected whole numbers "
            f">= -1 of shape {(p, m)}, not all -1"
        )
    if found.max() > N - 3:
        raise DelayRangeError(f"a delay of {found.max()} leaves none of the {N} samples to realize")
    return found.astype(np.int64)
