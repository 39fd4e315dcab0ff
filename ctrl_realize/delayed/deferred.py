"""State-space systems whose matrices are computed on demand."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import control as ct
import numpy as np

from .._checks import system_name
from .._parameters import checked_time_unit
from ..data.shown_units import shown_time_unit
from ..errors import DelayRangeError
from ..numerics.arrays import FloatArray, Matrices
from ..numerics.internal_delays.form import DelayForm
from .chains import with_chains
from .readers import warn_of_an_interconnection, warn_of_the_reader

MAX_STATES = 20_000
"""A is dense, as python-control needs it: 20 000 states take 3 GB."""


class DeferredMatrices(ct.StateSpace, ABC):  # type: ignore[misc]  # control is untyped
    """State-space system with a delay line, whose matrices are computed when they are first used.

    Abstract: subclasses (a delayed model, a predictor) define the matrices in the three methods
    below.
    """

    # NumPy leaves its operators to ours, and does not unpack a system as a sequence.
    __array_ufunc__ = None

    _augmented: Matrices | None
    _state_names: dict[str, int] | None
    _registers: int

    def _begin(self, states: int, nstates: int, dt: float | None, **names: Any) -> None:
        """Set up the system without matrices; `states` is their number without the delay line."""
        self._locked = False
        self._time_unit = checked_time_unit(names.pop("time_unit", "s"))
        if names.get("name") is not None:
            names["name"] = system_name(names["name"])
        # Not StateSpace.__init__, which needs the matrices.
        ct.NonlinearIOSystem.__init__(
            self, self._next_state, self._output, states=states, dt=dt, **names
        )
        # The names of the delay line's states are made on demand.
        self.nstates = nstates
        self._registers = nstates - states
        self._state_names = None
        self._augmented = None

    @property
    def time_unit(self) -> str:
        """Unit in which plots and cards write times: as given, otherwise that of the fit, or s."""
        fitted = shown_time_unit(getattr(self, "fit", None))
        return fitted if self._time_unit == "s" else self._time_unit

    @abstractmethod
    def _form(self) -> DelayForm:
        """Return core and delays, those at inputs and outputs as additional channels."""

    def _make_matrices(self) -> Matrices:
        """Compute A, B, C, D, the delay line's states last."""
        return with_chains(self._form())

    @abstractmethod
    def _name_states(self) -> list[str]:
        """Return the names of all states, the delay line's last."""

    @abstractmethod
    def _without_matrices(self) -> str:
        """Return advice for the case that the matrices would be too large."""

    @property
    def state_index(self) -> dict[str, int]:
        """Names and positions of the states; past samples last."""
        if self._state_names is not None:
            return self._state_names
        # not stored: they depend on the signal names, which python-control may change
        return {name: i for i, name in enumerate(self._name_states())}

    @state_index.setter
    def state_index(self, names: dict[str, int] | None) -> None:
        self._state_names = names

    def _matrices(self) -> Matrices:
        if self._augmented is None:
            if self.nstates > MAX_STATES:
                raise DelayRangeError(
                    f"matrices of {self.nstates} states have {8 * self.nstates**2 // 10**9} "
                    f"GB, the limit is {MAX_STATES} states. {self._without_matrices()}"
                )
            made = self._make_matrices()
            for M in made:
                M.flags.writeable = False
            self._augmented = made
        return self._augmented

    def _next_state(self, t: Any, x: Any, u: Any, params: Any) -> FloatArray:
        A, B, _, _ = self._matrices()
        return np.asarray(A @ np.atleast_1d(x) + B @ np.atleast_1d(u))

    def _output(self, t: Any, x: Any, u: Any, params: Any) -> FloatArray:
        _, _, C, D = self._matrices()
        return np.asarray(C @ np.atleast_1d(x) + D @ np.atleast_1d(u))

    @property
    def A(self) -> FloatArray:
        """Dynamics matrix, the delay line's states last; read-only."""
        warn_of_the_reader(self._registers, self.nstates)
        return self._matrices()[0]

    @property
    def B(self) -> FloatArray:
        """Input matrix, read-only."""
        return self._matrices()[1]

    @property
    def C(self) -> FloatArray:
        """Output matrix, read-only."""
        return self._matrices()[2]

    @property
    def D(self) -> FloatArray:
        """Direct term, read-only."""
        return self._matrices()[3]

    def _update_params(self, params: Any) -> None:
        warn_of_an_interconnection(self._registers, self.nstates)
        super()._update_params(params)

    def __setattr__(self, attribute: str, value: Any) -> None:
        # Core and matrices would become inconsistent; python-control's `append` does such an
        # assignment.
        if attribute in ("A", "B", "C", "D", "dt") and self.__dict__.get("_locked", False):
            raise AttributeError(
                f"{attribute} of a {type(self).__name__} cannot be changed; build a new one "
                "(delayed_ss, or the design function), or take a plain copy with ct.ss(sys)"
            )
        super().__setattr__(attribute, value)
