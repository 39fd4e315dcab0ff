"""The bank of candidate delays of a tracker, and its renewal when the poles have moved."""

from __future__ import annotations

from dataclasses import replace
from typing import TypeAlias

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
from .estimate import LinearisedBank, Solution, too_far

RUN_IN, SHORT_RUN_IN = 2.0, 0.5
"""Forgetting times before a renewed bank is used; the shorter one if the previous bank gives no
estimate because its poles are far off. Each renewal is a Gauss-Newton step: poles that have halved
take five or six."""
MOVED, LEAP = 0.04, 0.5
"""Relative move of a pole above which the bank is renewed, and the largest move per renewal."""
CLEAR_MOVE = 4.0
"""Significance of such a move, in standard deviations."""
PENDING = 0.3
"""Relative move of a pole, in a renewal, above which no estimate is given meanwhile. Below it the
interval is widened by the same fraction of the slowest lag, the possible error of the delay."""

Start: TypeAlias = tuple[Core, ComplexArray]
"""Matrices of a model without its delay, and its zeros."""


class Banks:
    """The bank for the poles of the starting model, and those that replace it.

    `delays` are the first and the last candidate and `span` the forgetting time, all in samples;
    with `fixed`, poles do not move.
    """

    def __init__(
        self, start: Start, *, dt: float, delays: tuple[int, int], span: float, fixed: bool
    ) -> None:
        core, self._zeros = start
        self._dt, self._delays, self._span = dt, delays, span
        poles = np.linalg.eigvals(core[0]).astype(np.complex128)
        directions = [] if fixed else pole_directions(poles, dt)
        self.now = self._about(core, directions, np.zeros(len(directions)))
        self._next: LinearisedBank | None = None

    def _about(self, core: Core, directions: list[Direction], moved: FloatArray) -> LinearisedBank:
        system = sensitivity_system(*core, directions)
        bank = DelayBank(system, *self._delays, float(np.exp(-1.0 / self._span)))
        return LinearisedBank(bank, core, directions, moved)

    def update(self, u: float, y: float, count: int) -> bool:
        """Process sample `count`; return whether the next bank has replaced the present one.

        A bank counts from its first complete sample, and is used once it has settled.
        """
        self.now.bank.update(u, y)
        if self._next is None:
            return False
        self._next.bank.update(u, y)
        if count == self._next.begin:
            self._next.bank.restart()
        run_in = SHORT_RUN_IN if self.pending else RUN_IN
        if count < self._next.begin + run_in * self._span:
            return False
        self.now, self._next = self._next, None
        return True

    def follow(self, found: Solution, count: int) -> None:
        """Start a bank for the moved poles, to be used when it has enough samples."""
        clear = np.abs(found.moves) > np.maximum(MOVED, CLEAR_MOVE * found.move_std)
        if self._next is not None or not np.any(clear) or not found.responds:
            return
        step = np.clip(np.where(clear, found.moves, 0.0), -LEAP, LEAP)
        made = moved_core(self.now.core, self._zeros, self.now.directions, step, self._dt)
        if made is None:
            return
        fresh = self._about(*made, self.now.moved + step)
        settling = fresh.bank.settling()
        if settling is not None:
            self._next = replace(fresh, begin=count + settling + self._delays[1] + 1)

    def core_at(self, found: Solution | None) -> Core:
        """Return the core with its poles moved to the estimates; the zeros are unchanged."""
        core = self.now.core
        if found is not None and found.gain:
            made = moved_core(core, self._zeros, self.now.directions, found.moves, self._dt)
            core = core if made is None else made[0]
        return core

    @property
    def moved(self) -> bool:
        """Whether the poles differ from those of the starting model."""
        return bool(np.any(self.now.moved))

    @property
    def step_made(self) -> float:
        """Largest relative move of a pole in the pending bank; 0 if there is none."""
        if self._next is None:
            return 0.0
        return float(max(self._next.moved - self.now.moved, key=abs))

    @property
    def pending(self) -> str:
        """Report that a bank for poles far from the present ones is pending; empty otherwise."""
        return too_far(self.step_made, PENDING)
