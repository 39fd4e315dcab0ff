"""Simulated loops whose cause of oscillation is known."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

import ctrl_realize as cr

CAUSES = ("stiction", "tuning or external", "none")
_DURATION = {"flow": 1500.0, "first-order": 4000.0, "integrating": 6000.0}
_PERIOD = {"flow": 15.0, "first-order": 60.0, "integrating": 100.0}
_QUANTUM = 0.25
_AT_MARGIN = 0.97


@dataclass(frozen=True)
class World:
    """A loop, its cause of oscillation, and what happens to its record."""

    name: str
    cause: str
    loop: cr.bench.ValveLoop
    quantum: float = 0.0

    @property
    def process(self) -> str:
        """As `diagnose_loop` is told."""
        return "self-regulating" if self.loop.process == "first-order" else self.loop.process

    def signals(self, seed: int) -> tuple[np.ndarray, np.ndarray, str]:
        """Controller output, process value, and the cause: none where the stem came to rest."""
        made = self.loop.simulate(_DURATION[self.loop.process], rng=seed)
        op, pv = np.ravel(made.record.input), np.ravel(made.record.output)
        if self.quantum:
            op, pv = (self.quantum * np.round(each / self.quantum) for each in (op, pv))
        return op, pv, self.cause if np.ptp(made.position) > 0 else "none"


def worlds() -> Iterator[World]:
    """All of them."""
    loop, models = cr.bench.valve_loop, cr.actuators
    for process in ("flow", "first-order", "integrating"):
        for S, J in ((3.0, 1.0), (5.0, 0.5), (5.0, 2.0), (3.0, 3.0), (8.0, 4.0)):
            made = loop(models.KanoStiction(S, J), process=process, noise=0.1)
            yield World(f"{process}: S = {S:g}, J = {J:g}", "stiction", made)
        made = loop(models.Stiction(5.0, 2.0), process=process, noise=0.1)
        yield World(f"{process}: S = 5, J = 2 (Choudhury)", "stiction", made)
        made = loop(models.KanoStiction(5.0, 2.0), process=process, noise=0.4)
        yield World(f"{process}: S = 5, J = 2, noise 0.4 %", "stiction", made)
        made = loop(models.KanoStiction(5.0, 2.0), process=process, noise=0.1)
        yield World(
            f"{process}: S = 5, J = 2, rounded to {_QUANTUM:g} %", "stiction", made, _QUANTUM
        )
    for process in ("flow", "first-order", "integrating"):
        margin = cr.design.margins(loop(process=process).open_loop).gain_margin
        for part in (0.9, _AT_MARGIN):
            made = loop(process=process, tightness=part * margin, noise=0.3)
            yield World(f"{process}: {part:.0%} of the gain margin", "tuning or external", made)
        for height in (1.0, 4.0):
            made = loop(process=process, oscillation=(height, _PERIOD[process]), noise=0.1)
            yield World(f"{process}: external sine of {height:g} %", "tuning or external", made)
        made = loop(process=process, oscillation=(2.0, _PERIOD[process]), noise=0.4)
        yield World(f"{process}: external sine of 2 %, noise 0.4 %", "tuning or external", made)
        made = loop(process=process, oscillation=(2.0, _PERIOD[process]), noise=0.1)
        yield World(
            f"{process}: external sine of 2 %, rounded to {_QUANTUM:g} %", "tuning or external",
            made, _QUANTUM,
        )  # fmt: skip
    for process in ("flow", "first-order", "integrating"):
        yield World(f"{process}: noise alone", "none", loop(process=process, noise=0.3))
        made = loop(models.Backlash(0.5), process=process, noise=0.3, tightness=0.5)
        yield World(f"{process}: noise, backlash of 0.5 %", "none", made)
