"""What is to be noted about a valve test."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..numerics.constants import Z_95
from ..numerics.validation.own_response import homogeneity
from ..results import Flag
from .groups import SizeAndDirection
from .part import TestPart
from .steps import StepMetrics

_BY_CHANCE = 1e-3
_LATER = 1.25
"""Dead times that differ by less do not matter, whatever their errors."""


def flags_of(
    steps: tuple[StepMetrics, ...],
    groups: tuple[SizeAndDirection, ...],
    parts: tuple[tuple[TestPart, ...], ...],
) -> Iterator[Flag]:
    """List the flags of a test."""  # fmt: skip
    if not steps and all(part.kind != "ramp" for own in parts for part in own):
        yield Flag(
            "no_valve_test",
            "the command holds no level between its changes, and is no slow ramp: these are "
            "records of operation; valve_test_plan writes a test, and diagnose_loop tells "
            "whether the valve makes a loop oscillate",
        )
    still = [one for one in steps if not one.moved]
    if still:
        sizes = sorted({round(abs(one.size), 2) for one in still})
        yield Flag(
            "did_not_move",
            f"the position did not follow {len(still)} of {len(steps)} steps (sizes "
            f"{', '.join(f'{one:g}' for one in sizes[:6])} %): resolution or dead band is of "
            "this size, or the noise hides it",
        )
    unsettled = [one for one in steps if one.moved and not one.settled]
    if unsettled:
        yield Flag(
            "not_settled",
            f"{len(unsettled)} of {len(steps)} responses had not settled when the next step "
            "came: only their dead time is used; hold longer",
        )
    known = [one for one in groups if one.estimates["dead_time"].is_known and not one.stroke]
    if len(known) > 1:
        times = np.array([one.estimates["dead_time"].value for one in known])
        errors = np.array(
            [(one.estimates["dead_time"].high - one.estimates["dead_time"].low) for one in known]
        ) / (2 * Z_95)
        chance = homogeneity(times, errors)[1]
        late, early = known[int(np.argmax(times))], known[int(np.argmin(times))]
        if chance < _BY_CHANCE and times.max() > _LATER * times.min():
            yield Flag(
                "dead_time_varies",
                f"the dead time depends on the step: {times.max():.3g} s for {late.size:.3g} % "
                f"{late.direction}, {times.min():.3g} s for {early.size:.3g} % "
                f"{early.direction} (p = {chance:.1g}): friction, play, or a rate limit",
            )
