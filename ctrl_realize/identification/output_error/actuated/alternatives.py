"""The actuators that can be requested, what identifies each, and how each is shown."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Literal, NamedTuple

import numpy as np

from ....actuators import (
    Actuator,
    Backlash,
    Characteristic,
    KanoStiction,
    Saturation,
    SlewRateLimit,
)
from ....numerics.actuated import commands
from ....numerics.actuated.motions import KINDS, Kind, Motion, Place, at_parts
from ....numerics.actuated.records import ActuatedRecord

Asked = Literal[
    "auto", "slew_rate", "dead_band", "stiction", "resolution", "saturation", "characteristic"
]
Told = Callable[[Sequence[ActuatedRecord]], bool]


class Alternative(NamedTuple):
    """What can be asked for: kinds, what a command must be to tell each, and a test that does."""

    words: str
    kinds: dict[Kind, Told]
    expected: str
    test: str

    def wanted(self, parts: Sequence[ActuatedRecord]) -> list[tuple[Kind, Place]]:
        """Kinds that the commands can identify, with the places that are tried."""
        told = [kind for kind, identifiable in self.kinds.items() if identifiable(parts)]
        return [(kind, place) for kind in told for place in KINDS[kind].places]


_TURNS = "a command that moves on in one direction and turns"
_LEVELS = "a command at three levels or more"

ALTERNATIVES: dict[str, Alternative] = {
    "slew_rate": Alternative(
        "a slew-rate limit",
        {"slew_rate": commands.moves, "slew_rates": commands.opens_and_closes},
        "a command that moves",
        "a larger step",
    ),
    "dead_band": Alternative(
        "a dead band",
        {"dead_band": commands.reverses},
        _TURNS,
        "a staircase up and down",
    ),
    "stiction": Alternative(
        "stiction",
        {"resolution": commands.reverses, "stiction": commands.reverses},
        _TURNS,
        "a staircase up and down, in small steps,",
    ),
    "resolution": Alternative(
        "a resolution",
        {"resolution": commands.moves_on},
        "a command with four moves or more",
        "a staircase of small steps",
    ),
    "saturation": Alternative(
        "an end of the travel",
        {"saturation": commands.has_levels},
        _LEVELS,
        "a staircase through the travel, to its ends,",
    ),
    "characteristic": Alternative(
        "a characteristic",
        {"characteristic": commands.compares_levels},
        _LEVELS,
        "a staircase through the travel, or records at several positions that share some,",
    ),
}
ASKED: tuple[str, ...] = ("auto", *ALTERNATIVES)


def alternative_of(kind: Kind) -> Alternative:
    """Last entry that has a kind."""
    return [one for one in ALTERNATIVES.values() if kind in one.kinds][-1]


def model_of(motion: Motion, start: float) -> Actuator:
    """Actuator that was found; `start` is its place within play or friction."""
    values, levels = motion.values, motion.levels
    if motion.kind == "dead_band":
        return Backlash(values[0], start)
    if motion.kind in ("resolution", "stiction"):
        return KanoStiction(values[0], values[-1], start)
    if motion.kind == "saturation":
        low, high = at_parts(levels, values).tolist()
        # An end beyond the commands is none that is known.
        return Saturation(
            low if low > levels[0] else -np.inf, high if high < levels[-1] else np.inf
        )
    if motion.kind == "characteristic":
        low, reach = levels[0], levels[-1] - levels[0]
        travels = [(level - low) / reach for level in levels]
        points = tuple(zip(travels, (0.0, *values, 1.0), strict=True))
        return Characteristic("points", low, levels[-1], reach, points=points)
    return SlewRateLimit(*values)
