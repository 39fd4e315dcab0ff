"""Limits of an actuator's motion: slew rate, travel, dead zone, backlash, resolution."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from .._checks import not_negative, positive, real, within
from ..errors import OptionError
from ..numerics.actuators.friction import backlash
from ..numerics.actuators.limits import resolved, slew_limited, without_dead_zone
from ..numerics.arrays import FloatArray
from .base import Actuator, State


class _OfTwoSamples(Actuator):
    """A model whose only state is its position: one step is the array kernel on one sample."""

    _states: ClassVar[tuple[str, ...]] = ("position",)

    @abstractmethod
    def _followed(self, command: FloatArray, dt: float, last: float | None) -> FloatArray:
        """Positions for commands (N,), behind a last position or at rest."""

    def _advance(self, state: State, command: float, dt: float) -> tuple[State, float]:
        moved = float(self._followed(np.array([command]), dt, state[0])[0])
        return (moved,), moved

    def _simulated(self, command: FloatArray, dt: float) -> FloatArray:
        return self._followed(command, dt, None)

    def _rest(self, command: float) -> State:
        return (float(self._simulated(np.array([command]), 1.0)[0]),)


@dataclass(frozen=True)
class SlewRateLimit(_OfTwoSamples):
    """Motion at no more than a given rate, as of a piston that is filled through an orifice.

    A step of height h takes h / rate. A lag behind it then looks like dead time that grows with
    the step. Positions are those at the end of each sample. Between them the actuator moves on a
    line: held over the samples they are half a sample early, and those of the middle, each minus
    half of the move in its sample, are not.

    Parameters
    ----------
    opening : float
        Largest rate upwards, per second.
    closing : float, optional
        Largest rate downwards, per second, as a positive number. Default: that upwards.

    Raises
    ------
    OptionError
        A rate that is not a positive number.

    References
    ----------
    .. [1] H. K. Khalil, Nonlinear Systems, 3rd ed., Prentice Hall 2002, section 1.2.7.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> piston = cr.actuators.SlewRateLimit(opening=20.0, closing=40.0)
    >>> print(piston)
    slew rate at most 20 per s up, 40 per s down
    >>> piston.simulate([0, 50, 50, 50, 0, 0], dt=1.0).tolist()
    [0.0, 20.0, 40.0, 50.0, 10.0, 0.0]
    """

    opening: float
    closing: float | None = None

    _timed: ClassVar[bool] = True

    def __post_init__(self) -> None:
        positive(self.opening, "opening", "rate per second")
        if self.closing is not None:
            positive(self.closing, "closing", "rate per second")

    def __str__(self) -> str:
        if self.closing is None or self.closing == self.opening:
            return f"slew rate at most {self.opening:g} per s"
        return f"slew rate at most {self.opening:g} per s up, {self.closing:g} per s down"

    def _followed(self, command: FloatArray, dt: float, last: float | None) -> FloatArray:
        closing = self.opening if self.closing is None else self.closing
        return slew_limited(command, self.opening, closing, dt, last)


@dataclass(frozen=True)
class Backlash(_OfTwoSamples):
    """Play between drive and stem: after a reversal the command moves by `width` in vain.

    The same as a dead band, and as stiction without a slip jump that remembers the side of the
    friction, ``KanoStiction(width, 0)``.

    Parameters
    ----------
    width : float
        Total width of the play.
    start : float, default 0
        Place within the play at first: 0 its middle, 1 where a rising command moves the stem at
        once, -1 where a falling one does.

    Raises
    ------
    OptionError
        A width below 0, or a start outside -1...1.

    References
    ----------
    .. [1] M. A. A. S. Choudhury, N. F. Thornhill and S. L. Shah, Modelling valve stiction, Control
       Engineering Practice 13 (2005) 641-658, section 2, doi:10.1016/j.conengprac.2004.05.005.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> gear = cr.actuators.Backlash(2.0)
    >>> gear.simulate([0, 10, 9, 8, 7]).tolist()
    [0.0, 9.0, 9.0, 9.0, 8.0]
    """

    width: float
    start: float = 0.0

    def __post_init__(self) -> None:
        not_negative(self.width, "width", "width of the play")
        within(self.start, "start", "place within play or friction", -1, 1)

    def __str__(self) -> str:
        return f"backlash of width {self.width:g}"

    def _followed(self, command: FloatArray, dt: float, last: float | None) -> FloatArray:
        if last is None:
            return backlash(command, self.width, self.start)
        return backlash(np.append(last, command), self.width)[1:]


@dataclass(frozen=True)
class Resolution(_OfTwoSamples):
    """Motion in whole steps: smaller changes of the command do not move the stem.

    A ramp becomes a staircase, in both directions; at a reversal up to one more step is lost.

    Parameters
    ----------
    step : float
        Smallest change that moves the stem.

    Raises
    ------
    OptionError
        A step that is not positive.

    References
    ----------
    .. [1] H. K. Khalil, Nonlinear Systems, 3rd ed., Prentice Hall 2002, section 1.2.7.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> cr.actuators.Resolution(0.5).simulate([0, 0.4, 0.6, 1.6, 1.2]).tolist()
    [0.0, 0.0, 0.5, 1.5, 1.5]
    """

    step: float

    def __post_init__(self) -> None:
        positive(self.step, "step", "change of the command")

    def __str__(self) -> str:
        return f"resolution of {self.step:g}"

    def _followed(self, command: FloatArray, dt: float, last: float | None) -> FloatArray:
        return resolved(command, self.step, last)


class StaticMap(Actuator):
    """A map without memory."""

    def _rest(self, command: float) -> State:
        return ()

    def _advance(self, state: State, command: float, dt: float) -> tuple[State, float]:
        return (), float(self._simulated(np.array([command]), dt)[0])


@dataclass(frozen=True)
class Saturation(StaticMap):
    """Travel between two stops.

    Parameters
    ----------
    low, high : float
        Lowest and highest position; infinite where there is no stop.

    Raises
    ------
    OptionError
        ``low >= high``.

    References
    ----------
    .. [1] H. K. Khalil, Nonlinear Systems, 3rd ed., Prentice Hall 2002, section 1.2.7.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> cr.actuators.Saturation(0, 100).simulate([-5, 50, 120]).tolist()
    [0.0, 50.0, 100.0]
    """

    low: float = 0.0
    high: float = 100.0

    def __post_init__(self) -> None:
        for name, end in (("low", self.low), ("high", self.high)):
            if end not in (-np.inf, np.inf):
                real(end, name, "end of the travel")
        if not self.low < self.high:
            raise OptionError(f"low={self.low!r}, high={self.high!r}; expected low < high")

    def __str__(self) -> str:
        if not np.isfinite(self.low):
            return f"travel up to {self.high:g}"
        if not np.isfinite(self.high):
            return f"travel down to {self.low:g}"
        return f"travel from {self.low:g} to {self.high:g}"

    def _simulated(self, command: FloatArray, dt: float) -> FloatArray:
        return np.asarray(np.clip(command, self.low, self.high))


@dataclass(frozen=True)
class DeadZone(StaticMap):
    """No response between two commands, slope 1 outside; as of an overlapped spool valve.

    Parameters
    ----------
    low, high : float
        Between them the output is 0.

    Raises
    ------
    OptionError
        ``low >= high``, or not finite.

    References
    ----------
    .. [1] H. K. Khalil, Nonlinear Systems, 3rd ed., Prentice Hall 2002, section 1.2.7.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> cr.actuators.DeadZone(-1, 1).simulate([-3, 0.5, 4]).tolist()
    [-2.0, 0.0, 3.0]
    """

    low: float
    high: float

    def __post_init__(self) -> None:
        ordered(self.low, self.high)

    def __str__(self) -> str:
        return f"dead zone from {self.low:g} to {self.high:g}"

    def _simulated(self, command: FloatArray, dt: float) -> FloatArray:
        return without_dead_zone(command, self.low, self.high)


def ordered(low: float, high: float) -> None:
    """Check two ends.

    Raises
    ------
    OptionError
        Not in this order, or not finite.
    """
    if not real(low, "low", "lower end") < real(high, "high", "upper end"):
        raise OptionError(f"low={low!r}, high={high!r}; expected low < high")
