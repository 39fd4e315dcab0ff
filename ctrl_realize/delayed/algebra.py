"""Products with delays at the ends, computed on the core; other operations give internal delays."""

from __future__ import annotations

from typing import Any, Self

import control as ct
import numpy as np

from ..errors import OptionError
from ..numerics.internal_delays.form import DelayForm, delayed_ends
from .chains import common
from .operands import is_linear
from .operators import DelayOperators
from .parts import CoreAndDelays, named

_ENDS = ("prefix", "suffix")


class DelayedAlgebra(CoreAndDelays, DelayOperators):
    """Operators on core and delay."""

    def _form(self) -> DelayForm:
        core = self._core
        matrices = core.A, core.B, core.C, core.D
        return delayed_ends(*matrices, self.input_delays, self.output_delays)

    def _around(self, core: ct.StateSpace, **changes: Any) -> Self:
        settings: dict[str, Any] = {
            "output_delay": self.output_delays,
            "inputs": self.input_labels,
            "outputs": self.output_labels,
        }
        settings.update(changes)
        states = settings.pop("states", None) or self._core_states()
        if len(states) == core.nstates and len(set(states)) == core.nstates:
            # python-control's operators number the states again.
            core = named(core, core.input_labels, core.output_labels, states)
        return type(self)(core, settings.pop("delay", self.input_delays), **settings)

    def _plain(self) -> ct.StateSpace:
        return ct.StateSpace(self)

    def __getitem__(self, key: Any) -> Self:
        """Select channels, by number or name; each keeps its delay."""
        # python-control names the selection, and refuses invalid keys.
        try:
            chosen = self.delay_free[key]
            empty = not (chosen.noutputs and chosen.ninputs)
        except ct.ControlDimension:
            empty = True
        if empty:
            raise OptionError(
                f"{key!r} selects no output or no input; there are {self.noutputs} outputs "
                f"and {self.ninputs} inputs, counted from 0"
            )
        inputs = [self.input_index[name] for name in chosen.input_labels]
        outputs = [self.output_index[name] for name in chosen.output_labels]
        prefix, suffix = (ct.config.defaults[f"iosys.indexed_system_name_{end}"] for end in _ENDS)
        return self._around(
            chosen,
            delay=tuple(self.input_delays[j] for j in inputs),
            output_delay=tuple(self.output_delays[i] for i in outputs),
            inputs=chosen.input_labels,
            outputs=chosen.output_labels,
            name=f"{prefix}{self.name}{suffix}",
        )

    def __neg__(self) -> Self:
        return self._around(-self._core)

    def __mul__(self, other: Any) -> Any:
        """Series: first `other`, then this system."""
        if _is_scalar(other):
            return self._around(self._core * other)
        if isinstance(other, ct.TransferFunction):
            other = ct.ss(other)
        if isinstance(other, np.ndarray):
            other = np.atleast_2d(other)
            if other.shape[0] == self.ninputs and common(self.input_delays) is not None:
                delays = (common(self.input_delays) or 0,) * other.shape[1]
                names = self.input_labels if other.shape[1] == self.ninputs else None
                return self._around(self._core * other, delay=delays, inputs=names)
            return super().__mul__(other) if is_linear(other) else self._plain() * other
        if isinstance(other, ct.FrequencyResponseData):
            return NotImplemented  # it evaluates this system at its own frequencies
        if not isinstance(other, ct.StateSpace):
            return self._plain() * other
        made = self._series(self, _linear(other))
        return super().__mul__(other) if made is None else made

    def __rmul__(self, other: Any) -> Any:
        """Series: first this system, then `other`."""
        if _is_scalar(other):
            return self._around(other * self._core)
        if isinstance(other, ct.TransferFunction):
            other = ct.ss(other)
        if isinstance(other, np.ndarray):
            other = np.atleast_2d(other)
            if other.shape[1] == self.noutputs and common(self.output_delays) is not None:
                delays = (common(self.output_delays) or 0,) * other.shape[0]
                names = self.output_labels if other.shape[0] == self.noutputs else None
                # A matrix times a 1x1 system promotes it in python-control; here it does not.
                core = ct.StateSpace(
                    self._core.A, self._core.B, other @ self._core.C, other @ self._core.D, self.dt
                )
                return self._around(core, output_delay=delays, outputs=names)
            return super().__rmul__(other) if is_linear(other) else other * self._plain()
        if not isinstance(other, ct.StateSpace):
            return NotImplemented
        made = self._series(_linear(other), self)
        return super().__rmul__(other) if made is None else made

    def minreal(self, tol: float = 0.0) -> Self:
        """Minimal realization of the core; the delays are unchanged."""
        return self._around(self._core.minreal(tol))

    def _series(self, second: ct.StateSpace, first: ct.StateSpace) -> Self | None:
        """Product second * first if the delays between them are common; otherwise None."""
        ends = CoreAndDelays, DelayOperators
        if any(isinstance(s, ends[1]) and not isinstance(s, ends[0]) for s in (first, second)):
            return None
        if second.ninputs != first.noutputs:
            return None
        first_core, entry, behind = _core_and_delays(first)
        second_core, before, after = _core_and_delays(second)
        between = common(tuple(a + b for a, b in zip(behind, before, strict=True)))
        if between is None:
            return None
        return self._around(
            second_core * first_core,
            delay=tuple(d + between for d in entry),
            output_delay=after,
            inputs=first.input_labels,
            outputs=second.output_labels,
            states=[*first_core.state_labels, *second_core.state_labels],
        )


def _linear(system: ct.StateSpace) -> ct.StateSpace:
    """Convert a controller of another class, or an interconnected system, to a plain system."""
    if type(system) is ct.StateSpace or isinstance(system, DelayOperators):
        return system
    return ct.StateSpace(system, remove_useless_states=False)


def _core_and_delays(
    system: ct.StateSpace,
) -> tuple[ct.StateSpace, tuple[int, ...], tuple[int, ...]]:
    """Return core, input delays and output delays; a plain system has none."""
    if isinstance(system, CoreAndDelays):
        return system.delay_free, system.input_delays, system.output_delays
    return system, (0,) * system.ninputs, (0,) * system.noutputs


def _is_scalar(value: Any) -> bool:
    return isinstance(value, (int, float, np.number)) and not isinstance(value, np.complexfloating)
