"""Part of long records that is fitted: every sample of fast plants, and means of slow ones.

A plant is seen for as many of its time constants as the record has, up to a limit of computing
time. The selection is our own rule.

References
----------
.. [1] L. Ljung, System Identification: Theory for the User, 2nd ed., Prentice Hall 1999, section
   13.4 (A direct approach).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from ...arrays import FloatArray
from ...engine.problem import Structure
from ...engine.structures import Candidate
from ...engine.window_fit import WindowFit
from ...rules import Rule
from ..other_structures import Requested
from .condensed import MOST_LAGS
from .data import BEYOND, SampledData, cut
from .loads import Refit, beside_loads
from .window import (
    ORDERS,
    WHITE,
    SampledWindow,
    fit_windows,
    in_coloured_noise,
    rests,
    simulates_worse,
)

FOLLOWS = 36.0
"""Least chi-square of the response to the input: six standard deviations. White noise without any
relation to the input reached 23 in 25 records, for the best of all delays and lags."""
FOLLOWS_IN_LOOPS = 25.0
"""That of lags and noise fitted together in a loop: five. 30 loops about nothing that responds
reached 18; of 24 loops in AR(0.97) noise whose set point moves once, 36 refused nine."""

DIED_AWAY = 10.0  # slowest time constants in which a response ends, but for 5e-5 of it
_SEEN = 40.0  # slowest time constants in the part that is fitted, if the record is as long
_RESOLVED = 4.0, 8.0  # blocks in the fastest and in the slowest time constant
_GROWTH = 16  # of blocks, before the time constants are looked at again
_SIMPLE = (Structure(1, 1), Structure(2, 2))
_FEWEST = 200  # blocks in the shortest of several records
_MOST_AVERAGED = 4e6  # samples of which means are formed if fewer show the plant for long enough
_WORTHWHILE = 1.2  # length of a record over that of a part of it that is taken for all
_NEARLY = 0.8  # of a record, from which on all of it is taken


def fit_stretch(
    data: SampledData, structures: Sequence[Structure], requested: Requested
) -> SampledWindow:
    """Fit structures to a part of the records, by default dead times up to `SampledData.sought`.

    Records that begin at rest are fitted as such. If that is not what they show, or leaves nothing
    to the input, they are fitted as others are.
    """

    def fit(
        data: SampledData,
        structures: Sequence[Structure],
        like: WindowFit | None = None,
        huber: bool = requested.huber,
    ) -> SampledWindow:
        limit = data.sought if requested.latest is None else requested.latest
        within = requested.earliest, max(limit, requested.earliest)
        return fit_windows(data, structures, within, huber, np.ones(1), like=like)

    part = fit(data, structures)
    if data.rested:
        others = replace(data, rested=False)
        free = None if rests(part) else fit(others, structures)
        # What is taken for a motion, and leaves more than noise, may be a load.
        if free is None or free.fit.correlation > WHITE:
            loaded, white = _beside_loads(part, fit, requested)
            if rests(loaded) if loaded.loads else free is None:
                found = loaded if requested.structures is not None else white
                if explained(found.fit) >= FOLLOWS:
                    return found
        part = free or fit(others, structures)
    part, white = _beside_loads(part, fit, requested)
    return part if requested.structures is not None else white


def _beside_loads(
    part: SampledWindow, fit: Refit, requested: Requested
) -> tuple[SampledWindow, SampledWindow]:
    """Fit beside loads where they are looked for; the same with the noise made white."""
    whiten = partial(made_white, requested=requested)
    sought = requested.whiten and requested.compared and not requested.loop
    if sought and Rule.SAMPLED_LOADS.on:
        return beside_loads(part, fit, whiten)
    return part, part if requested.structures is not None else whiten(part)


def made_white(part: SampledWindow, requested: Requested) -> SampledWindow:
    """Fit again with the noise made white, if it is coloured and the records are complete."""
    coloured = part.fit.correlation > WHITE and requested.whiten and part.data.complete
    if not (coloured and Rule.COLOURED.on):
        return part
    weighted = in_coloured_noise(part, requested.structures)
    # In a loop the noise model is needed for consistency [1]_.
    if requested.simulates and not requested.loop and simulates_worse(weighted, part):
        return part
    return replace(weighted, unweighted=part.model, loads=part.loads)


def samples_in_a_block(
    outputs: Sequence[FloatArray], inputs: Sequence[FloatArray], dt: float, requested: Requested
) -> tuple[int, SampledWindow | None]:
    """Samples of which the mean is fitted, so that a slow plant is seen for long enough.

    That is, `_SEEN` of its slowest time constants if the record is as long, and more while blocks
    are short beside its time constants. Simple structures tell, in coloured noise, which imitates a
    slow plant, all of them; if that fit is the one that is wanted it is returned as well. The first
    part may be too short, show no response, or leave room for a fast pole that is none: longer
    blocks are looked at until they do not grow.
    """
    sizes, plain = [y.size for y in outputs], replace(requested, whiten=False)
    longest, every = max(sizes), 1
    while True:
        data = cut(outputs, inputs, dt, every, requested.known, requested.rested)
        rows = max(y.size for y in data.outputs)
        if longest < _WORTHWHILE * every * rows:
            return every, None
        fit = fit_stretch(data, _SIMPLE, plain).fit
        if every == 1 and _seen_to_end(fit, dt):
            return 1, None
        if every == 1 and fit.correlation > WHITE and requested.whiten and data.complete:
            done = fit_stretch(data, ORDERS, requested)
            fit = done.fit
            if _seen_to_end(fit, dt):
                return 1, done
        wanted = min(longest / rows, max(min(sizes) / _FEWEST, 1.0))
        if explained(fit) >= FOLLOWS:
            poles = fit.best.poles * dt
            slow, fast = 1.0 / float(np.abs(poles.real).min()), 1.0 / float(np.abs(poles).max())
            most = min(fast / _RESOLVED[0], slow / _RESOLVED[1], _MOST_AVERAGED / rows)
            enough = max(_SEEN * slow / rows, most, 1.0)
            wanted = enough if enough < _NEARLY * wanted else wanted
        following = int(np.ceil(min(wanted, _GROWTH * every)))
        if following < _WORTHWHILE * every or following * rows >= longest:
            return following, None
        every = following


def _seen_to_end(fit: WindowFit, dt: float) -> bool:
    """Whether the output follows the input, and its response ends within `MOST_LAGS` samples."""
    return explained(fit) >= FOLLOWS and response_samples(fit.best, dt) <= MOST_LAGS


def response_samples(best: Candidate, dt: float) -> float:
    """Samples until the response of a model to a pulse has ended."""
    slowest = float(1.0 / np.abs(best.poles.real).min())
    return (BEYOND * best.dead_time + DIED_AWAY * slowest) / dt


def explained(fits: WindowFit) -> float:
    """Chi-square of the forced response: local terms alone against local terms and input."""
    problem, best = fits.problem, fits.best
    assert problem.segments is not None
    own = problem.local_terms(best.poles[None])
    alone = float(np.sum(own.without(problem.data[None, :, None]) ** 2))
    return (alone - best.cost) / max(fits.variance, 1e-300)
