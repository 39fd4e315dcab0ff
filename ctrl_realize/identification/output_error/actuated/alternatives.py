"""The actuators that can be requested, and what identifies each: one entry of a table each."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Literal, NamedTuple

import numpy as np

from ....actuators import (
    Actuator,
    Backlash,
    Characteristic,
    KanoStiction,
    Resolution,
    Saturation,
    SlewRateLimit,
    Stiction,
)
from ....numerics.actuated import commands
from ....numerics.actuated.kinds import Kind, Place
from ....numerics.actuated.records import ActuatedRecord

Asked = Literal[
    "auto", "slew_rate", "dead_band", "stiction", "resolution", "saturation", "characteristic"
]
Told = Callable[[Sequence[ActuatedRecord]], bool]

_EVERYWHERE: tuple[Place, ...] = ("input", "stem")
_BEFORE: tuple[Place, ...] = ("input",)
_PERCENT = (0.0, 100.0)
_COVERED = 20.0  # of it at least: a curve over less tells nothing of the whole travel


class Alternative(NamedTuple):
    """What can be asked for: kinds and their places, and what a command must be to tell them."""

    words: str
    kinds: tuple[tuple[Kind, tuple[Place, ...], Told], ...]
    expected: str
    test: str

    def wanted(self, parts: Sequence[ActuatedRecord]) -> list[tuple[Kind, Place]]:
        """Kinds that the commands can identify, with the places that are tried."""
        return [
            (kind, place)
            for kind, places, identifiable in self.kinds
            if identifiable(parts)
            for place in places
        ]


class Found(NamedTuple):
    """An actuator as it was found: values, place at the beginning, levels, unit of the command."""

    values: tuple[float, ...]
    start: float
    levels: tuple[float, ...]
    unit: str

    @property
    def travel(self) -> tuple[float, float]:
        """Closed and open position.

        0 and 100 of commands in % that cover a fifth of it, else their range in the records.
        """
        low, high = self.levels[0], self.levels[-1]
        covered = _PERCENT[0] <= low <= high - _COVERED and high <= _PERCENT[1]
        return _PERCENT if self.unit == "%" and covered else (low, high)

    def at(self, part: float) -> float:
        """Command at a part of the range of the commands."""
        return self.levels[0] + part * (self.levels[-1] - self.levels[0])

    def rangeability(self, ratio: float) -> float:
        """Over the travel, from the ratio of the slopes over the range of the commands."""
        low, high = self.travel
        return float(ratio ** ((high - low) / (self.levels[-1] - self.levels[0])))


class Shown(NamedTuple):
    """How a kind of actuator is shown.

    `names` are those of its parameters, `number` what is shown for a value, `unit` that of the
    command (``"u"``), per second (``"u/s"``), or none; `better` says which test tells a parameter
    closer.
    """

    names: Callable[[Found], tuple[str, ...]]
    model: Callable[[Found], Actuator]
    better: str
    unit: Literal["u", "u/s", ""] = "u"
    number: Callable[[Found, float], float] = lambda found, value: value


def _always(parts: Sequence[ActuatedRecord]) -> bool:
    return True


def _called(*names: str) -> Callable[[Found], tuple[str, ...]]:
    return lambda found: names


def _flows(found: Found) -> tuple[str, ...]:
    return tuple(f"flow_at_{level:g}" for level in found.levels[1:-1])


def _equal_percentage(found: Found) -> Actuator:
    low, high = found.travel
    rangeability = found.rangeability(found.values[0])
    ends = (np.array([found.levels[0], found.levels[-1]]) - low) / (high - low)
    flows = rangeability ** (ends - 1.0)
    full = (found.levels[-1] - found.levels[0]) / float(flows[1] - flows[0])
    return Characteristic("equal-percentage", low, high, full, rangeability)


def _points(found: Found) -> Actuator:
    low, high = found.levels[0], found.levels[-1]
    travels = [(level - low) / (high - low) for level in found.levels]
    points = tuple(zip(travels, (0.0, *found.values, 1.0), strict=True))
    return Characteristic("points", low, high, high - low, points=points)


def _ends(found: Found) -> Actuator:
    low, high = found.values
    return Saturation(found.at(low), found.at(high))


_TURNS = "a command that moves on in one direction and turns"
_LEVELS = "a command at three levels or more"
_MORE_LEVELS = "commands at more levels, on both sides of it"
_SMALL = "small steps or a slow ramp, in which the stem is seen to jump,"

ALTERNATIVES: dict[str, Alternative] = {
    "slew_rate": Alternative(
        "a slew-rate limit",
        (
            ("slew_rate", _EVERYWHERE, _always),
            ("slew_rates", _EVERYWHERE, commands.opens_and_closes),
        ),
        "a command that moves",
        "a large step",
    ),
    "dead_band": Alternative(
        "a dead band",
        (("dead_band", _EVERYWHERE, commands.reverses),),
        _TURNS,
        "a staircase up and down",
    ),
    "stiction": Alternative(
        "stiction",
        (
            ("resolution", _BEFORE, commands.reverses),
            ("kano", _BEFORE, commands.reverses),
            ("choudhury", _BEFORE, commands.reverses),
        ),
        _TURNS,
        "a staircase up and down, in small steps,",
    ),
    "resolution": Alternative(
        "a resolution",
        (
            ("resolution", _BEFORE, commands.moves_on),
            ("whole_steps", _BEFORE, commands.moves_on),
        ),
        "a command with four moves or more",
        "a staircase of small steps",
    ),
    "saturation": Alternative(
        "an end of the travel",
        (
            ("top", _EVERYWHERE, commands.has_levels),
            ("bottom", _EVERYWHERE, commands.has_levels),
            ("both_ends", _EVERYWHERE, commands.has_levels),
        ),
        _LEVELS,
        "a staircase through the travel, to its ends,",
    ),
    "characteristic": Alternative(
        "a characteristic",
        (
            ("equal_percentage", _EVERYWHERE, commands.has_levels),
            ("points", _EVERYWHERE, commands.compares_levels),
        ),
        _LEVELS,
        "a staircase through the travel, or records at several positions,",
    ),
}
ASKED: tuple[str, ...] = ("auto", *ALTERNATIVES)

SHOWN: dict[Kind, Shown] = {
    "slew_rate": Shown(
        _called("slew_rate"), lambda found: SlewRateLimit(*found.values), "a larger step", "u/s"
    ),
    "slew_rates": Shown(
        _called("slew_rate_opening", "slew_rate_closing"),
        lambda found: SlewRateLimit(*found.values),
        "a larger step in this direction",
        "u/s",
    ),
    "dead_band": Shown(
        _called("dead_band"),
        lambda found: Backlash(found.values[0], found.start),
        "more reversals, each after two moves in one direction,",
    ),
    "resolution": Shown(
        _called("resolution"),
        lambda found: KanoStiction(found.values[0], found.values[0], found.start),
        _SMALL,
    ),
    "whole_steps": Shown(
        _called("resolution"), lambda found: Resolution(found.values[0]), _SMALL
    ),
    "kano": Shown(
        _called("S", "J"),
        lambda found: KanoStiction(found.values[0], found.values[1], found.start),
        _SMALL + " with reversals",
    ),
    "choudhury": Shown(
        _called("S", "J"),
        lambda found: Stiction(found.values[0], found.values[1], found.start),
        _SMALL + " with reversals",
    ),
    "top": Shown(
        _called("travel_high"),
        lambda found: Saturation(-np.inf, found.at(found.values[0])),
        _MORE_LEVELS,
        number=Found.at,
    ),
    "bottom": Shown(
        _called("travel_low"),
        lambda found: Saturation(found.at(found.values[0]), np.inf),
        _MORE_LEVELS,
        number=Found.at,
    ),
    "both_ends": Shown(
        _called("travel_low", "travel_high"), _ends, _MORE_LEVELS, number=Found.at
    ),
    "equal_percentage": Shown(
        _called("rangeability"),
        _equal_percentage,
        "commands over more of the travel",
        "",
        Found.rangeability,
    ),
    "points": Shown(_flows, _points, "more moves to and from this level", ""),
}  # fmt: skip
