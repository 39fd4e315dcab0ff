"""Representation of a system with internal delays: one line, text, HTML."""

from __future__ import annotations

from ..._shown import Card, as_code
from ..._wording import in_time
from ...data.shown_units import in_shown_units
from ..cards import CoreCards, matrix_lines

CONTINUOUS = {None: "of any time base", 0: "continuous"}


class InsideCards(CoreCards):
    """Shows what closes loops around the core."""

    internal_delays: tuple[float, ...]

    def _delays(self) -> str:
        count = len(self.internal_delays)
        if not count:
            return "no delay"
        unit = "samples" if self.dt else "s"
        values = ", ".join(f"{delay:g}" for delay in self.internal_delays)
        return f"internal delay{'s' if count > 1 else ''} {values} {unit}"

    def _facts(self) -> str:
        base = f"dt = {self.dt:.6g} s" if self.dt else CONTINUOUS[self.dt]
        return f"{self._delays()}, {base}"

    def _repr_eval_(self) -> str:
        core = as_code(self._core)
        return (
            f"{type(self).__name__}(\n{core},\n{self.internal_delays!r}, name={self.name!r}, "
            f"inputs={self.input_labels!r}, outputs={self.output_labels!r})"
        )

    def __str__(self) -> str:
        head = [self._line(), "", "core, the delays' inputs and outputs last:"]
        return "\n".join([*head, *matrix_lines(self._core)])

    @in_shown_units
    def _card(self) -> Card:
        seconds = [delay * (self.dt or 1.0) for delay in self.internal_delays]
        rows = [
            ("delays inside", ", ".join(in_time(t, 5) for t in seconds) or "none"),
            ("time", f"samples of {in_time(self.dt, 6)}" if self.dt else CONTINUOUS[self.dt]),
            ("core", f"order {self._core.nstates}"),
        ]
        return self._with_signals(rows)
