"""What the commands of records can tell about an actuator: conditions of our own."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..arrays import FloatArray
from .records import ActuatedRecord

_ALIKE = 1e-3  # of the range of the commands: levels that are one
_MOST_KNOTS = 11
_KNOTS = 6  # of a command that is at more levels


def levels(parts: Sequence[ActuatedRecord]) -> FloatArray:
    """Levels (L,) of all commands, ascending; those closer than 0.1 % of their range are one."""
    every = np.unique(np.concatenate([part.held[0] for part in parts]))
    apart = _ALIKE * float(np.ptp(every))
    return every[np.diff(every, prepend=-np.inf) > apart]


def knots(parts: Sequence[ActuatedRecord]) -> tuple[float, ...]:
    """Levels of a characteristic: those of the commands, or six of a command that is at no few."""
    every = levels(parts)
    if every.size > _MOST_KNOTS:
        every = np.linspace(every[0], every[-1], _KNOTS)
    return tuple(every.tolist())


def moves(parts: Sequence[ActuatedRecord]) -> bool:
    """Whether commands move at all."""
    return any(part.moves.size for part in parts)


def reverses(parts: Sequence[ActuatedRecord]) -> bool:
    """Whether commands move on in one direction and turn: less tells no dead band from the gain."""
    turned = any(np.any(sizes[1:] * sizes[:-1] < 0) for sizes in _sizes(parts))
    return turned and sum(part.moves.size for part in parts) > 2


def opens_and_closes(parts: Sequence[ActuatedRecord]) -> bool:
    """Whether commands move in both directions."""
    every = np.concatenate(_sizes(parts))
    return bool(np.any(every > 0) and np.any(every < 0))


def moves_on(parts: Sequence[ActuatedRecord]) -> bool:
    """Whether a command moves four times or more: a stem then stays at some and catches up."""
    return max(part.moves.size for part in parts) >= 4


def has_levels(parts: Sequence[ActuatedRecord]) -> bool:
    """Whether commands are at three levels or more: two have one gain."""
    return levels(parts).size >= 3


def compares_levels(parts: Sequence[ActuatedRecord]) -> bool:
    """Whether a single record is at all levels, three or more.

    A record has a level of its own, so that it tells differences between its positions alone.
    """
    return max(levels([part]).size for part in parts) == levels(parts).size >= 3


def _sizes(parts: Sequence[ActuatedRecord]) -> list[FloatArray]:
    return [np.diff(part.command[np.concatenate([[0], part.moves])]) for part in parts]
