"""Core, delays, and the augmented matrices, which are computed on demand."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Any

import control as ct
import numpy as np

from .._checks import check_type, system_names
from ..errors import OptionError, UnsuitableSystemError
from ..numerics.arrays import ComplexArray, Matrices
from .chains import past_of
from .deferred import DeferredMatrices

MAX_DELAY = 10_000_000
"""Samples in all delays together; more are a sample time given in another unit."""


class CoreAndDelays(DeferredMatrices):
    """Core and delays of a system with dead time.

    ``A, B, C, D`` and the names of the states follow from core and delays. The matrices are dense,
    (n + d)^2 numbers, and most uses do not need them: they are computed on demand.
    """

    _core: ct.StateSpace
    input_delays: tuple[int, ...]
    output_delays: tuple[int, ...]

    def _name_states(self) -> list[str]:
        chain = past_of(self.input_labels, self.input_delays)
        # outputs before their delay
        chain += past_of([f"{y}*" for y in self.output_labels], self.output_delays)
        names = dict.fromkeys([*self._core.state_labels, *chain])
        if len(names) < self.nstates:
            # A core that itself was made of core and delays has state names of delay lines.
            names = dict.fromkeys([*(f"x[{i}]" for i in range(self._core.nstates)), *chain])
        return list(names)

    def _without_matrices(self) -> str:
        return (
            "sys(z), sys.step, sys.simulate and sys.markov need no matrices; "
            "cr.design.to_discrete(cr.design.to_continuous(sys), dt=dt) gives a system with a "
            "longer sample time"
        )

    @property
    def delay_free(self) -> ct.StateSpace:
        """The core, a plain `control.StateSpace`."""
        names = self.input_labels, self.output_labels, self._core_states()
        core = self._core
        if names != (core.input_labels, core.output_labels, core.state_labels):
            # python-control may have renamed the signals of the system.
            self._core = named(core, *names, name=f"{self.name}_core")
        return self._core

    def _core_states(self) -> list[str]:
        """Names of the core's states."""
        if self._state_names is None:
            return list(self._core.state_labels)
        return list(self._state_names)[: self._core.nstates]

    @property
    def delay(self) -> Any:
        """Dead time in samples: an int, or an array (outputs, inputs) if channels differ."""
        total = np.add.outer(self.output_delays, self.input_delays).astype(np.int64)
        return int(total[0, 0]) if np.all(total == total[0, 0]) else total

    @property
    def dead_time(self) -> Any:
        """Dead time in s: ``delay * dt``."""
        return self.delay * self.dt


def signals_of(system: Any) -> dict[str, Any]:
    """Names of the inputs and outputs of a system or record, as keywords of a new system."""
    return {"inputs": list(system.input_labels), "outputs": list(system.output_labels)}


def stand_in(system: Any) -> ct.StateSpace:
    """Make a system without dynamics with the names of another one, for python-control."""
    ends = np.zeros((system.noutputs, system.ninputs))
    return ct.StateSpace([], [], [], ends, system.dt, name=system.name, **signals_of(system))


def selected(system: ct.StateSpace, key: Any) -> ct.StateSpace:
    """Select channels of a plain system, by number or name.

    Raises
    ------
    OptionError
        There is no output or input of them.
    """
    # python-control names the selection, and refuses invalid keys.
    try:
        chosen = system[key]
        empty = not (chosen.noutputs and chosen.ninputs)
    except ct.ControlDimension:
        empty = True
    if empty:
        raise OptionError(
            f"{key!r} selects no output or no input; there are {system.noutputs} outputs "
            f"and {system.ninputs} inputs, counted from 0"
        )
    return chosen


def named(
    core: ct.StateSpace,
    inputs: Sequence[str],
    outputs: Sequence[str],
    states: Sequence[str],
    name: str | None = None,
) -> ct.StateSpace:
    """Copy the core, with read-only matrices and these names."""
    names = {"inputs": list(inputs), "outputs": list(outputs), "states": list(states)}
    settings = {"name": name, "remove_useless_states": False, **names}
    made = ct.StateSpace(*matrices_of(core), core.dt, **settings)
    for M in matrices_of(made):
        M.flags.writeable = False
    return made


def matrices_of(core: Any) -> Matrices:
    """A, B, C and D of a core."""
    return core.A, core.B, core.C, core.D


def parts_of(core: ct.StateSpace) -> tuple[Matrices, float | None, list[str]]:
    """Return what `with_core` needs of a core: a system of python-control cannot be stored."""
    return matrices_of(core), core.dt, core.state_labels


def with_core(
    kind: Any, matrices: Matrices, dt: float | None, states: list[str], **settings: Any
) -> Any:
    """Make a system of some kind from the parts of its core."""
    core = ct.StateSpace(*matrices, dt, states=states, remove_useless_states=False)
    return kind(core, **settings)


def settled_values(
    values: ComplexArray, points: ComplexArray, *, warn_infinite: bool
) -> ComplexArray:
    """Give a response (p, m, K) python-control's value at poles, and real ones on the real axis."""
    # The Schur form leaves rounding in the imaginary part, and dcgain() would be complex.
    on_axis = points.imag == 0
    values[..., on_axis] = values[..., on_axis].real
    lost = ~np.isfinite(values)
    if lost.any():
        if warn_infinite:
            # The class and words of python-control, whose callers look for them.
            warnings.warn("singular matrix in frequency response", RuntimeWarning, stacklevel=4)
        values[lost] = complex(np.inf, np.nan)
    return values


def check_core(core: Any) -> None:
    """Refuse what is not a discrete state-space system with a sample time."""
    expected = "a discrete control.StateSpace (delayed_ss also takes transfer functions)"
    check_type(core, ct.StateSpace, "core", expected, UnsuitableSystemError)
    if core.dt is None or core.dt is True or not core.dt > 0:
        raise UnsuitableSystemError(
            f"the core's dt is {core.dt!r}; expected a sample time in s (delayed_ss samples a "
            "continuous core)"
        )
    check_entries(core)


def check_entries(system: Any) -> None:
    """Refuse systems with entries that are not finite.

    Raises
    ------
    UnsuitableSystemError
    """
    if isinstance(system, DeferredMatrices):
        return
    if isinstance(system, ct.StateSpace):
        entries = [*matrices_of(system)]
    elif isinstance(system, ct.TransferFunction):
        entries = [part for all_ in (system.num, system.den) for row in all_ for part in row]
    elif isinstance(system, ct.FrequencyResponseData):
        entries = [system.frdata]
    else:
        entries = [np.asarray(system)]
    if not all(np.all(np.isfinite(part)) for part in entries):
        is_system = isinstance(system, ct.InputOutputSystem)
        name = f"the system {system.name!r}" if is_system else f"the gain {system}"
        raise UnsuitableSystemError(f"{name} has non-finite entries; expected finite numbers")


def check_single(system: Any, purpose: str) -> None:
    """Refuse a system with several inputs or outputs."""
    if not system.issiso():
        raise UnsuitableSystemError(
            f"{purpose} needs one input and one output; {system.name!r} has {system.ninputs} "
            f"inputs and {system.noutputs} outputs. Take one channel, such as sys[0, 0]"
        )


def signal_names(given: str | Sequence[str] | None, core: Sequence[str], letter: str) -> list[str]:
    """Name signals: as given, as those of the core, or by a letter if the core has no names."""
    if given is not None:
        names: object = [given] if isinstance(given, str) else given
        if not isinstance(names, Sequence) or not all(isinstance(name, str) for name in names):
            raise OptionError(f"{given!r} is not a list of names")
        if len(names) != len(core):
            raise OptionError(f"names {list(names)} for {len(core)} signals; expected one for each")
        return system_names(names)
    generic = [f"{letter}[{i}]" for i in range(len(core))]
    return [letter] if list(core) == generic and len(generic) == 1 else list(core)
