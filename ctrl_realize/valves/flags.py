"""What is to be noted about a valve test."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain

import numpy as np

from .._flags import Flag, flagged
from ..numerics.constants import Z_95
from ..numerics.validation.own_response import homogeneity
from .groups import SizeAndDirection
from .part import TestPart
from .steps import Ranges, StepMetrics

_BY_CHANCE = 1e-3
_BEYOND = 0.05
"""Part of the span by which a command leaves a wrong range; NAMUR NE 43 has 3.8 to 20.5 mA, 0.031.
"""
_LATER = 1.25
"""Dead times that differ by less do not matter, whatever their errors."""


def flags_of(
    steps: tuple[StepMetrics, ...],
    groups: tuple[SizeAndDirection, ...],
    parts: tuple[tuple[TestPart, ...], ...],
    ranges: Ranges,
) -> Iterator[Flag]:
    """List the flags of a test."""  # fmt: skip
    largest = max((abs(one.size) for one in steps), default=0.0)
    held = [level for one in chain(*parts) for level in (one.before, one.after)]
    held += [one.after for one in steps]
    (low, high), span = ranges.command, ranges.command_span
    away = max((abs((level - low) / span - 0.5) - 0.5 for level in held), default=0.0)
    if away > _BEYOND:
        yield flagged("range_in_doubt", away=100 * away, low=low, high=high)
    gains = [one.values["gain"] for one in steps if one.moved and abs(one.size) >= 0.5 * largest]
    if gains and np.median(gains) < 0:
        high, low = ranges.travel
        yield flagged("range_in_doubt.reversed", low=low, high=high)
    if not steps and all(part.kind != "ramp" for own in parts for part in own):
        # one part without a step or a ramp is a baseline: the command holds one level all the time
        yield flagged("no_valve_test.constant" if all(parts) else "no_valve_test")
    still = [one for one in steps if not one.moved]
    if still:
        sizes = sorted({round(abs(one.size), 2) for one in still})
        named = ", ".join(f"{one:g}" for one in sizes[:6])
        yield flagged("did_not_move", still=len(still), count=len(steps), sizes=named)
    unsettled = sum(one.moved and not one.settled for one in steps)
    if unsettled:
        yield flagged("not_settled.valve", unsettled=unsettled, count=len(steps))
    known = [one for one in groups if one.estimates["dead_time"].is_known and not one.stroke]
    if len(known) > 1:
        found = [one.estimates["dead_time"] for one in known]
        times = np.array([one.value for one in found])
        errors = np.array([one.high - one.low for one in found]) / (2 * Z_95)
        chance = homogeneity(times, errors)[1]
        late, early = (
            f"{one.size:.3g} % {one.direction}"
            for one in (known[int(np.argmax(times))], known[int(np.argmin(times))])
        )
        if chance < _BY_CHANCE and times.max() > _LATER * times.min():
            yield flagged(
                "dead_time_varies", longest=times.max(), late=late, shortest=times.min(),
                early=early, chance=chance,
            )  # fmt: skip
