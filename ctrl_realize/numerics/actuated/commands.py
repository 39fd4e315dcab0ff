"""What the commands of records can tell about an actuator: conditions of our own."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..arrays import FloatArray
from .records import ActuatedRecord

_ALIKE = 1e-3  # of the range of the commands: levels that are one
_MOST_KNOTS = 11
_KNOTS = 6  # of a command that is at no levels


def levels(parts: Sequence[ActuatedRecord]) -> FloatArray:
    """Levels (L,) of all commands, ascending; those closer than 0.1 % of their range are one."""
    every = np.unique(np.concatenate([part.held[0] for part in parts]))
    apart = _ALIKE * float(np.ptp(every))
    return every[np.diff(every, prepend=-np.inf) > apart]


def knots(parts: Sequence[ActuatedRecord]) -> tuple[float, ...]:
    """Levels of a characteristic by points: those of the commands, at most eleven."""
    every = levels(parts)
    if all(part.listed for part in parts):
        if every.size > _MOST_KNOTS:
            every = every[np.round(np.linspace(0, every.size - 1, _MOST_KNOTS)).astype(int)]
    else:
        every = np.linspace(every[0], every[-1], _KNOTS)
    return tuple(every.tolist())


def reverses(parts: Sequence[ActuatedRecord]) -> bool:
    """Whether commands move on in one direction and turn: less tells no dead band from the gain."""
    moves = _moves(parts)
    turned = any(np.any(own[1:] * own[:-1] < 0) for own in moves)
    return turned and sum(own.size for own in moves) > 2


def opens_and_closes(parts: Sequence[ActuatedRecord]) -> bool:
    """Whether commands move in both directions."""
    every = np.concatenate(_moves(parts))
    return bool(np.any(every > 0) and np.any(every < 0))


def moves_on(parts: Sequence[ActuatedRecord]) -> bool:
    """Whether a command moves four times or more: a stem then stays at some and catches up."""
    return max(own.size for own in _moves(parts)) >= 4


def has_levels(parts: Sequence[ActuatedRecord]) -> bool:
    """Whether commands are at three levels or more: two have one gain."""
    return levels(parts).size >= 3


def compares_levels(parts: Sequence[ActuatedRecord]) -> bool:
    """Whether all levels, three or more, are compared by records that share some.

    A record has a level of its own, so that it tells differences between its positions alone.
    """
    every = levels(parts)
    groups: list[set[int]] = []
    for part in parts:
        own = set(np.abs(every - part.held[0][:, None]).argmin(axis=1).tolist())
        apart = [group for group in groups if not group & own]
        groups = [*apart, own.union(*(group for group in groups if group & own))]
    return len(groups) == 1 and has_levels(parts)


def _moves(parts: Sequence[ActuatedRecord]) -> list[FloatArray]:
    return [np.diff(part.command[np.concatenate([[0], part.moves])]) for part in parts]
