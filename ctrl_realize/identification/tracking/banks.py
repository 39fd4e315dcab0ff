"""The bank of delays that a tracker asks, and the next one, about poles that have moved."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...numerics.arrays import ComplexArray, FloatArray
from ...numerics.regression.recursive import DelayBank
from ...numerics.state_space.pole_sensitivity import (
    Core,
    Direction,
    moved_core,
    pole_directions,
    sensitivity_system,
)
from .estimate import LinearisedBank, Solution

RUN_IN, SHORT_RUN_IN = 2.0, 0.5
"""Memories that a renewed bank takes before it is asked; the short one where nothing is told by
the bank before it, whose poles are far off. Each renewal is a Gauss-Newton step: poles that have
halved take five or six."""
MOVED, LEAP = 0.04, 0.5
"""Relative move of a pole from which the bank is renewed, and the largest that is then made."""
CLEAR_MOVE = 4.0
"""Standard deviations that such a move must have."""
PENDING = 0.3
"""Relative move of a pole that is being made from which nothing is told meanwhile. Up to there the
interval is wider by as much of the slowest lag: so far may the delay be off."""


class Banks:
    """A bank about the poles of the starting model, and those that take its place.

    `span` is the memory in samples; `fixed` poles do not move.
    """

    def __init__(
        self,
        core: Core,
        poles: ComplexArray,
        zeros: ComplexArray,
        *,
        dt: float,
        candidates: tuple[int, int],
        span: float,
        fixed: bool,
    ) -> None:
        self._zeros, self._dt, self._candidates, self._span = zeros, dt, candidates, span
        directions = [] if fixed else pole_directions(poles, dt)
        self.now = self._about(core, directions, np.zeros(len(directions)))
        self._next: LinearisedBank | None = None

    def _about(self, core: Core, directions: list[Direction], moved: FloatArray) -> LinearisedBank:
        system = sensitivity_system(*core, directions)
        bank = DelayBank(*system, *self._candidates, float(np.exp(-1.0 / self._span)))
        return LinearisedBank(bank, core, directions, moved)

    def update(self, u: float, y: float, count: int) -> bool:
        """Take in sample `count`, and tell whether the next bank has taken over.

        It counts from its first whole sample, and takes over when it is run in.
        """
        self.now.bank.update(u, y)
        if self._next is None:
            return False
        self._next.bank.update(u, y)
        if count == self._next.begin:
            self._next.bank.restart()
        wait = SHORT_RUN_IN if self.pending else RUN_IN
        if count < self._next.begin + wait * self._span:
            return False
        self.now, self._next = self._next, None
        return True

    def follow(self, found: Solution, count: int) -> None:
        """Start a bank about the moved poles, to take over when it has seen enough."""
        clear = np.abs(found.moves) > np.maximum(MOVED, CLEAR_MOVE * found.move_std)
        if self._next is not None or not np.any(clear) or not found.sees_reply:
            return
        step = np.clip(np.where(clear, found.moves, 0.0), -LEAP, LEAP)
        made = moved_core(self.now.core, self._zeros, self.now.directions, step, self._dt)
        if made is None:
            return
        fresh = self._about(*made, self.now.moved + step)
        wait = fresh.bank.settling()
        if wait is not None:
            self._next = replace(fresh, begin=count + wait + self._candidates[1] + 1)

    def core_at(self, found: Solution | None) -> Core:
        """Return the core with its poles moved as they were found; zeros as they were."""
        core = self.now.core
        if found is not None and found.gain:
            made = moved_core(core, self._zeros, self.now.directions, found.moves, self._dt)
            core = core if made is None else made[0]
        return core

    @property
    def moved(self) -> bool:
        """Whether the poles have left those of the starting model."""
        return bool(np.any(self.now.moved))

    @property
    def step_made(self) -> float:
        """Largest relative move of a pole in the bank that is being run in, 0 without one."""
        if self._next is None:
            return 0.0
        return float(max(self._next.moved - self.now.moved, key=abs))

    @property
    def pending(self) -> str:
        """Say that a bank about poles far from these is being run in; empty where none is."""
        step = self.step_made
        if abs(step) <= PENDING:
            return ""
        return (
            f"a pole has moved by about {100 * np.expm1(step):+.0f} %; the reference model is "
            "being updated"
        )
