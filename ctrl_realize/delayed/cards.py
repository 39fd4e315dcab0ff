"""How a system with dead time shows: one line, text, HTML."""

from __future__ import annotations

import html

from .parts import CoreAndDelays


class DelayedCards(CoreAndDelays):
    """Core and shift, never the augmented matrices."""

    def _shift(self) -> str:
        if isinstance(self.delay, int):
            return f"z^-{self.delay} ({self.dead_time:.6g} s)"
        return f"input delays {self.input_delays}, output delays {self.output_delays}"

    def _fit_line(self) -> str:
        return "" if self.fit is None else f"{self.fit!r}"

    def __repr__(self) -> str:
        name = "" if self._generic_name_check() else f" {self.name!r}"
        signals = f"{', '.join(self.input_labels)} -> {', '.join(self.output_labels)}"
        fit = f", fit: {self._fit_line()}" if self.fit is not None else ""
        return (
            f"<DelayedStateSpace{name}: {signals}, order {self._core.nstates}, {self._shift()}, "
            f"dt = {self.dt:.6g} s{fit}>"
        )

    def __str__(self) -> str:
        lines = [repr(self), "", "core:"]
        for letter in "ABCD":
            lines.append(f"{letter} =")
            lines += [f"    {row}" for row in str(getattr(self._core, letter)).splitlines()]
        return "\n".join([*lines, f"times {self._shift()}"])

    def _repr_html_(self) -> str:
        core = self._core._repr_html_() or html.escape(f"core of order {self._core.nstates}")
        fit = f"<div>{html.escape(self._fit_line())}</div>" if self.fit is not None else ""
        title = "" if self._generic_name_check() else html.escape(f"{self.name}: ")
        return (
            f"<div><div>{title}core of order {self._core.nstates} times "
            f"<b>{html.escape(self._shift())}</b></div>{core}{fit}</div>"
        )

    def _repr_markdown_(self) -> None:
        return None
