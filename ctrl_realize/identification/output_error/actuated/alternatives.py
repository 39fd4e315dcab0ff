"""The actuators that can be requested, what identifies each, and the words about them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from typing import Literal

import numpy as np

from ...._facts import facts
from ...._parameters import Parameter
from ...._wording import chosen, plainly
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


ALTERNATIVES: dict[str, dict[Kind, Told]] = {
    "slew_rate": {"slew_rate": commands.moves, "slew_rates": commands.opens_and_closes},
    "dead_band": {"dead_band": commands.reverses},
    "stiction": {"resolution": commands.reverses, "stiction": commands.reverses},
    "resolution": {"resolution": commands.moves_on},
    "saturation": {"saturation": commands.has_levels},
    "characteristic": {"characteristic": commands.compares_levels},
}
"""Kinds that are tried for what is asked for, and whether commands can tell each."""
ASKED: tuple[str, ...] = ("auto", *ALTERNATIVES)


@cache
def _words() -> dict[str, dict[str, str]]:
    return facts("identification/output_error/actuated/alternatives.toml")


def wanted(name: str, parts: Sequence[ActuatedRecord]) -> list[tuple[Kind, Place]]:
    """Kinds that the commands can identify, with the places that are tried."""
    told = [kind for kind, identifiable in ALTERNATIVES[name].items() if identifiable(parts)]
    return [(kind, place) for kind in told for place in KINDS[kind].places]


def missing_tests(names: Sequence[str]) -> str:
    """Say which tests would identify what the command cannot."""
    every = [_words()[name] for name in names]
    tests = "; ".join(f"{one['words']} ({one['test'].rstrip(',')})" for one in every)
    return chosen("actuator.skipped", tests=tests)


def cannot_tell(name: str) -> str:
    """Say why an actuator that was requested is not fitted."""
    words, expected, test = _words()[name].values()
    return (
        f"actuator={name!r}: expected {expected}, got records that cannot distinguish {words} "
        f"from gain and dead time; try {test} or actuator='auto'"
    )


def not_needed(names: Sequence[str], evidence: float) -> str:
    """Say that a linear model is enough."""
    tried = " or ".join(_words()[name]["words"] for name in names)
    side, size = "lower" if evidence > 0 else "higher", plainly(abs(evidence), 3)
    return chosen("actuator.linear", tried=tried, evidence=size, side=side)


def unresolved(parameter: Parameter, kind: Kind) -> str:
    """Say that the records determine a parameter badly, and which test would help."""
    name = [name for name, kinds in ALTERNATIVES.items() if kind in kinds][-1]
    return (
        f"{parameter.label} lies between {parameter.low:.3g} and {parameter.high:.3g}, and the "
        f"records do not determine it more closely; {_words()[name]['test']} would"
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
