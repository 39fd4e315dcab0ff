"""What all models of actuators share: simulation of an array, and a system of python-control."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, TypeAlias

import control as ct
import numpy as np
from numpy.typing import ArrayLike

from .._checks import finite, positive, real
from ..errors import DataError, OptionError
from ..numerics.arrays import FloatArray

State: TypeAlias = tuple[float, ...]


class Actuator(ABC):
    """Base class of the models of this module: a command goes in, a position comes out.

    Both have the same unit, usually % of the travel, and the parameters of a model have it as well;
    rates are per second. A model is a frozen record of its parameters. ``nlsys(dt)`` with the
    initial state ``initial_state(command[0])`` is the same system as ``simulate(command, dt)``.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> model = cr.actuators.Backlash(2.0)
    >>> print(model)
    backlash of width 2
    >>> isinstance(model, cr.actuators.Actuator)
    True
    """

    _states: ClassVar[tuple[str, ...]] = ()
    _timed: ClassVar[bool] = False

    @property
    def state_names(self) -> tuple[str, ...]:
        """Names of the states of `nlsys`; none for a static map."""
        return self._states

    def simulate(self, command: ArrayLike, dt: float | None = None) -> FloatArray:
        """Simulate the positions for a command.

        Parameters
        ----------
        command : array_like, shape (N,)
            Held over each sample. Before it the actuator is at rest at the first value.
        dt : float, optional
            Sample time in s; only models with a rate need it.

        Returns
        -------
        ndarray, shape (N,)

        Raises
        ------
        DataError
            Not a vector of finite numbers.
        OptionError
            The model needs a sample time and there is none.

        Examples
        --------
        >>> import ctrl_realize as cr
        >>> cr.actuators.Backlash(2.0).simulate([0, 5, 5, 2, 0]).tolist()
        [0.0, 4.0, 4.0, 3.0, 1.0]
        """
        given = finite(command, "command")
        if given.ndim != 1 or given.size == 0:
            raise DataError(f"command has shape {given.shape}; expected N >= 1 numbers")
        return self._simulated(given, self._checked(dt))

    def nlsys(
        self,
        dt: float,
        *,
        name: str | None = None,
        inputs: str = "command",
        outputs: str = "position",
    ) -> ct.NonlinearIOSystem:
        """Return the model as a discrete-time system of python-control.

        It can be connected by `control.interconnect` and simulated by
        `control.input_output_response`. The initial state 0 is rest at the command 0; pass
        `initial_state` as ``X0`` for another one.

        Parameters
        ----------
        dt : float
            Sample time in s.
        name : str, optional
            Name of the system; default: the kind of actuator.
        inputs, outputs : str
            Names of the signals.

        Returns
        -------
        control.NonlinearIOSystem

        Raises
        ------
        OptionError
            The sample time is not a positive number.

        Examples
        --------
        >>> import control as ct
        >>> import numpy as np
        >>> import ctrl_realize as cr
        >>> valve = cr.actuators.Backlash(2.0).nlsys(0.1)
        >>> t = 0.1 * np.arange(5)
        >>> ct.input_output_response(valve, t, [0, 5, 5, 2, 0]).outputs.tolist()
        [0.0, 4.0, 4.0, 3.0, 1.0]
        """
        step = positive(dt, "dt", "sample time in s")
        # python-control starts at the state 0, which must be rest: states are counted from there.
        rest = np.array(self._rest(0.0), dtype=np.float64)

        def moved(x: FloatArray, u: FloatArray) -> tuple[State, float]:
            return self._advance(tuple((x + rest).tolist()), float(u[0]), step)

        def update(_t: float, x: FloatArray, u: FloatArray, _params: Any) -> FloatArray:
            return np.subtract(moved(x, u)[0], rest)

        def output(_t: float, x: FloatArray, u: FloatArray, _params: Any) -> FloatArray:
            return np.array([moved(x, u)[1]])

        return ct.nlsys(
            update if self.state_names else None,
            output,
            name=name or type(self).__name__,
            inputs=[inputs],
            outputs=[outputs],
            states=list(self.state_names) or None,
            dt=step,
        )

    def initial_state(self, command: float = 0.0) -> FloatArray:
        """State of `nlsys` at rest at a command, shape (number of states,).

        Parameters
        ----------
        command : float, default 0

        Returns
        -------
        ndarray

        Examples
        --------
        >>> import ctrl_realize as cr
        >>> cr.actuators.Backlash(2.0).initial_state(50.0).tolist()
        [50.0]
        """
        return np.subtract(self.steady_state(command), self._rest(0.0))

    def steady_state(self, command: float) -> State:
        """State of `advance` at rest at a command.

        Parameters
        ----------
        command : float

        Returns
        -------
        tuple of float

        Examples
        --------
        >>> import ctrl_realize as cr
        >>> cr.actuators.Backlash(2.0).steady_state(50.0)
        (50.0,)
        """
        return self._rest(real(command, "command", "command at rest"))

    def advance(self, state: State, command: float, dt: float) -> tuple[State, float]:
        """Advance by one sample.

        Parameters
        ----------
        state : tuple of float
            From `steady_state`, or from the sample before.
        command, dt : float
            Command during this sample, and its length in s.

        Returns
        -------
        state : tuple of float
            For the next sample.
        position : float
            At this sample.

        Examples
        --------
        >>> import ctrl_realize as cr
        >>> model = cr.actuators.Backlash(2.0)
        >>> model.advance(model.steady_state(50.0), 53.0, 0.1)
        ((52.0,), 52.0)
        """
        return self._advance(state, command, dt)

    @abstractmethod
    def _rest(self, command: float) -> State: ...

    @abstractmethod
    def _advance(self, state: State, command: float, dt: float) -> tuple[State, float]: ...

    @abstractmethod
    def _simulated(self, command: FloatArray, dt: float) -> FloatArray:
        """Simulate a checked command by the array kernel of the model."""

    def _checked(self, dt: float | None) -> float:
        """Return the sample time; 1 where none is needed."""
        if dt is None:
            if self._timed:
                raise OptionError(f"{type(self).__name__} needs dt, the sample time in s")
            return 1.0
        return positive(dt, "dt", "sample time in s")


@dataclass(frozen=True)
class Series(Actuator):
    """Several models in a row: the position of one is the command of the next.

    Parameters
    ----------
    parts : sequence of Actuator
        The first one gets the command.

    Raises
    ------
    OptionError
        Something else among the parts, or none at all.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> from ctrl_realize.actuators import Backlash, SlewRateLimit
    >>> valve = cr.actuators.Series([SlewRateLimit(20.0), Backlash(1.0)])
    >>> print(valve)
    slew rate at most 20 per s, then backlash of width 1
    >>> valve.simulate([0, 50, 50, 50, 50], dt=1.0).tolist()
    [0.0, 19.5, 39.5, 49.5, 49.5]
    """

    parts: tuple[Actuator, ...]

    def __init__(self, parts: Sequence[Actuator]) -> None:
        object.__setattr__(self, "parts", actuators_of(parts))
        if not self.parts:
            raise OptionError("parts is empty; expected at least one actuator")

    def __str__(self) -> str:
        return ", then ".join(str(part) for part in self.parts)

    @property
    def state_names(self) -> tuple[str, ...]:
        """Names of the states, with the number of the part."""
        return tuple(
            f"{name}_{number}"
            for number, part in enumerate(self.parts, start=1)
            for name in part.state_names
        )

    def _rest(self, command: float) -> State:
        state: State = ()
        for part in self.parts:
            own = part._rest(command)
            state += own
            command = part._advance(own, command, 1.0)[1]
        return state

    def _advance(self, state: State, command: float, dt: float) -> tuple[State, float]:
        after: State = ()
        for part in self.parts:
            count = len(part.state_names)
            own, command = part._advance(state[:count], command, dt)
            after, state = after + own, state[count:]
        return after, command

    def _simulated(self, command: FloatArray, dt: float) -> FloatArray:
        for part in self.parts:
            command = part._simulated(command, dt)
        return command

    def _checked(self, dt: float | None) -> float:
        return max(part._checked(dt) for part in self.parts)


def actuators_of(given: Actuator | Sequence[Actuator] | None) -> tuple[Actuator, ...]:
    """Return one model, several, or none as a tuple; a `Series` becomes its parts.

    Raises
    ------
    OptionError
        Anything else.
    """
    parts = () if given is None else (given,) if isinstance(given, Actuator) else given
    if not isinstance(parts, list | tuple):
        raise OptionError(f"expected actuators or a list of them, got {given!r}")
    found: tuple[Actuator, ...] = ()
    for part in parts:
        if not isinstance(part, Actuator):
            raise OptionError(
                f"expected an actuator such as Stiction(5, 2), got {part!r}; the models are in "
                "ctrl_realize.actuators"
            )
        found += part.parts if isinstance(part, Series) else (part,)
    return found
