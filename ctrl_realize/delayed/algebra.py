"""Channels of a system with delays at its ends, and its minimal realization."""

from __future__ import annotations

from typing import Any, Self

import control as ct

from ..numerics.internal_delays.form import DelayForm, delayed_ends
from .operators import DelayOperators
from .parts import CoreAndDelays, matrices_of, named, selected, signals_of

_ENDS = ("prefix", "suffix")


class DelayedAlgebra(CoreAndDelays, DelayOperators):
    """Operations on the core, which leave the delays as they are."""

    def _form(self) -> DelayForm:
        form = DelayForm(*matrices_of(self._core))
        return delayed_ends(form, self.input_delays, self.output_delays)

    def _around(self, core: ct.StateSpace, **changes: Any) -> Self:
        settings = {**signals_of(self), "time_unit": self.time_unit, **changes}
        settings.setdefault("output_delay", self.output_delays)
        states = self._core_states()
        if len(states) == core.nstates:  # python-control numbers the states again
            core = named(core, core.input_labels, core.output_labels, states)
        return type(self)(core, settings.pop("delay", self.input_delays), **settings)

    def __getitem__(self, key: Any) -> Self:
        """Select channels, by number or name; each keeps its delay."""
        chosen = selected(self.delay_free, key)
        before = [self.input_delays[self.input_index[name]] for name in chosen.input_labels]
        behind = [self.output_delays[self.output_index[name]] for name in chosen.output_labels]
        prefix, suffix = (ct.config.defaults[f"iosys.indexed_system_name_{end}"] for end in _ENDS)
        names = {**signals_of(chosen), "name": f"{prefix}{self.name}{suffix}"}
        return self._around(chosen, delay=before, output_delay=behind, **names)

    def minreal(self, tol: float = 0.0) -> Self:
        """Minimal realization of the core; the delays are unchanged."""
        return self._around(self._core.minreal(tol))
