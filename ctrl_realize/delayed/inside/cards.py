"""Representation of a system with internal delays: one line, text, HTML."""

from __future__ import annotations

from html import escape

import control as ct

from ..._shown import as_asked, as_code, html_card
from ..._wording import in_time
from ..deferred import DeferredMatrices


class InsideCards(DeferredMatrices):
    """Shows core and delays, not the augmented matrices."""

    _core: ct.StateSpace
    internal_delays: tuple[float, ...]

    def _delays(self) -> str:
        count = len(self.internal_delays)
        if not count:
            return "no delay"
        unit = "samples" if self.dt else "s"
        values = ", ".join(f"{delay:g}" for delay in self.internal_delays)
        return f"internal delay{'s' if count > 1 else ''} {values} {unit}"

    def _line(self) -> str:
        name = "" if self._generic_name_check() else f" {self.name!r}"
        signals = f"{', '.join(self.input_labels)} -> {', '.join(self.output_labels)}"
        base = f"dt = {self.dt:.6g} s" if self.dt else "continuous"
        return (
            f"<{type(self).__name__}{name}: {signals}, order {self._core.nstates}, "
            f"{self._delays()}, {base}>"
        )

    def __repr__(self) -> str:
        return as_asked(self)

    def _repr_eval_(self) -> str:
        core = as_code(self._core)
        count = len(self.internal_delays)
        labels = self.input_labels, self.output_labels
        assert len(self._core.input_labels) == len(labels[0]) + count
        return (
            f"{type(self).__name__}(\n{core},\n{self.internal_delays!r}, name={self.name!r}, "
            f"inputs={labels[0]!r}, outputs={labels[1]!r})"
        )

    def _repr_info_(self, html: bool = False) -> str:
        return escape(self._line()) if html else self._line()

    def __str__(self) -> str:
        lines = [self._line(), "", "core, the delays' inputs and outputs last:"]
        for letter in "ABCD":
            lines.append(f"{letter} =")
            lines += [f"    {row}" for row in str(getattr(self._core, letter)).splitlines()]
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        name = "" if self._generic_name_check() else f" {self.name}"
        signals = f"{', '.join(self.input_labels)} → {', '.join(self.output_labels)}"
        seconds = [delay * (self.dt or 1.0) for delay in self.internal_delays]
        rows = [
            ("signals", signals),
            ("delays inside", ", ".join(in_time(t, 5) for t in seconds) or "none"),
            ("time", f"samples of {in_time(self.dt, 6)}" if self.dt else "continuous"),
            ("core", f"order {self._core.nstates}"),
        ]
        return html_card(f"{type(self).__name__}{name}", rows)

    def _repr_markdown_(self) -> None:
        return None
