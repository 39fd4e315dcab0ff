"""The actuators that can be requested, what identifies each, and the words about them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Literal, NamedTuple

import numpy as np

from ...._parameters import Parameter
from ...._wording import plainly
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


def missing_tests(names: Sequence[str]) -> str:
    """Say which tests would identify what the command cannot."""
    every = [ALTERNATIVES[name] for name in names]
    tests = "; ".join(f"{one.words} ({one.test.rstrip(',')})" for one in every)
    return f"not tried, since the command cannot identify them (with a test that can): {tests}"


def cannot_tell(name: str) -> str:
    """Say why an actuator that was requested is not fitted."""
    one = ALTERNATIVES[name]
    return (
        f"actuator={name!r}: expected {one.expected}, got records that cannot distinguish "
        f"{one.words} from gain and dead time; try {one.test} or actuator='auto'"
    )


def not_needed(names: Sequence[str], evidence: float) -> str:
    """Say that a linear model is enough."""
    tried = " or ".join(ALTERNATIVES[name].words for name in names)
    return (
        f"linear: the evidence for {tried} is not very strong (information criterion "
        f"{plainly(abs(evidence), 3)} {'lower' if evidence > 0 else 'higher'} with it)"
    )


def unresolved(parameter: Parameter, test: str) -> str:
    """Say that the records determine a parameter badly, and which test would help."""
    return (
        f"{parameter.label} lies between {parameter.low:.3g} and {parameter.high:.3g}, and the "
        f"records do not determine it more closely; {test} would"
    )


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
