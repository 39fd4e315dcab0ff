"""Representation of a system with dead time: one line, text, HTML."""

from __future__ import annotations

from abc import abstractmethod

import control as ct
import numpy as np

from .._shown import Card, ShownSystem, as_code
from .._wording import in_time
from ..data.shown_units import in_shown_units
from ..numerics.arrays import ComplexArray
from .deferred import DeferredMatrices
from .parts import CoreAndDelays

_MOST_POLES = 8


class CoreCards(ShownSystem, DeferredMatrices):
    """Shows core and delays, not the augmented matrices."""

    _core: ct.StateSpace

    @abstractmethod
    def _facts(self) -> str:
        """Delays and time base in a line."""

    def _line(self) -> str:
        name = "" if self._generic_name_check() else f" {self.name!r}"
        signals = f"{', '.join(self.input_labels)} -> {', '.join(self.output_labels)}"
        order = self._core.nstates
        return f"<{type(self).__name__}{name}: {signals}, order {order}, {self._facts()}>"

    def _with_signals(self, rows: list[tuple[str, str]]) -> Card:
        name = "" if self._generic_name_check() else f" {self.name}"
        signals = f"{', '.join(self.input_labels)} → {', '.join(self.output_labels)}"
        return Card(f"{type(self).__name__}{name}", [("signals", signals), *rows])


class DelayedCards(CoreCards, CoreAndDelays):
    """Shows what is before and behind the core."""

    def _shift(self) -> str:
        if isinstance(self.delay, int):
            return f"z^-{self.delay} ({self.dead_time:.6g} s)"
        return f"input delays {self.input_delays}, output delays {self.output_delays}"

    def _wait(self) -> str:
        if isinstance(self.delay, int):
            return f"{in_time(float(self.dead_time), 5)} = {self.delay} samples, as z^-{self.delay}"
        return f"{self._shift()} samples"

    def _repr_eval_(self) -> str:
        core = as_code(self.delay_free)
        delays = [f"delay={self.input_delays!r}"]
        if any(self.output_delays):
            delays.append(f"output_delay={self.output_delays!r}")
        return f"DelayedStateSpace(\n{core},\n{', '.join(delays)}, name={self.name!r})"

    def _facts(self) -> str:
        fit = f", fit: {self.fit!r}" if self.fit is not None else ""
        return f"{self._shift()}, dt = {self.dt:.6g} s{fit}"

    def __str__(self) -> str:
        lines = [self._line(), "", "core:", *matrix_lines(self._core), f"times {self._shift()}"]
        return "\n".join(lines)

    @in_shown_units
    def _card(self) -> Card:
        rows = [
            ("dead time", self._wait()),
            ("sample time", in_time(self.dt, 6)),
            ("core", f"order {self._core.nstates}"),
            ("poles of the core", _few(self._core.poles())),
        ]
        if self._core.issiso():
            gain = float(np.real(self._core.dcgain()))
            told = f"{gain:.6g}" if np.isfinite(gain) else "none: the model integrates"
            rows.append(("DC gain", told))
        if self.fit is not None:
            rows.append(("fit", repr(self.fit).strip("<>")))
        return self._with_signals(rows)


def matrix_lines(core: ct.StateSpace) -> list[str]:
    """Write the matrices of a core."""
    lines = []
    for letter, matrix in (("A", core.A), ("B", core.B), ("C", core.C), ("D", core.D)):
        lines += [f"{letter} =", *(f"    {row}" for row in str(matrix).splitlines())]
    return lines


def _few(poles: ComplexArray) -> str:
    """Write poles in the z-plane, pairs once, the slowest first, at most a few."""
    slowest = sorted((pole for pole in poles if pole.imag >= 0), key=lambda z: -abs(z))
    shown = [
        f"{pole.real:.4g}" + (f" ± {pole.imag:.3g}j" if pole.imag > 0 else "")
        for pole in slowest[:_MOST_POLES]
    ]
    more = ", …" if len(slowest) > _MOST_POLES else ""
    return ", ".join(shown) + more if shown else "none"
