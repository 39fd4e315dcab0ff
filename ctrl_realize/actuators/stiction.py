"""Stems that stick: the data-driven models of Choudhury and Kano."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from .._checks import not_negative, positive, within
from ..numerics.actuators.friction import StemState, kano, stem_at_rest, stem_step
from ..numerics.arrays import FloatArray
from .base import Actuator, State


@dataclass(frozen=True)
class _StickAndJump(Actuator):
    """A model with the two parameters S and J, and the state of a stem with a memory."""

    S: float
    J: float
    start: float = 0.0

    _states: ClassVar[tuple[str, ...]] = StemState._fields
    _author: ClassVar[str]
    _sided: ClassVar[bool]

    def __post_init__(self) -> None:
        positive(self.S, "S", "width of dead band plus stick band")
        not_negative(self.J, "J", "slip jump, usually at most S")
        within(self.start, "start", "place within the friction", -1, 1)

    def __str__(self) -> str:
        return f"stiction ({self._author}): S = {self.S:g}, J = {self.J:g}"

    def _rest(self, command: float) -> State:
        stem = stem_at_rest(command, self.S, self.J, self.start, sided=self._sided)
        return tuple(map(float, stem))

    def _advance(self, state: State, command: float, dt: float) -> tuple[State, float]:
        last, position, way, rest, moving, paused, slope = state
        stem = last, position, way, rest, moving > 0.5, paused > 0.5, slope
        after = stem_step(stem, command, self.S, self.J, self._sided)
        return tuple(map(float, after)), after[1]

    def _simulated(self, command: FloatArray, dt: float) -> FloatArray:
        return kano(command, self.S, self.J, self.start, sided=self._sided)


@dataclass(frozen=True)
class Stiction(_StickAndJump):
    """Stiction as described by S and J: the data-driven model of Choudhury, Thornhill and Shah.

    At a reversal the stem sticks until the command has changed by S, dead band plus stick band;
    then it slips by J, and follows at a distance of (S - J) / 2. A stem that stopped because the
    command paused needs only J. Plotted over the command, the position goes around a parallelogram
    with a step of height J after each reversal.

    Parameters
    ----------
    S : float
        Dead band plus stick band, in the unit of the command.
    J : float
        Slip jump; 0 for backlash of width S, S for a stem that catches up at once.
    start : float, default 0
        How the stem came to rest: 1 by a move up, -1 by a move down, 0 relaxed between the two. The
        first move needs a change of J after a move up, and of S otherwise, in either direction:
        the model does not know on which side of the friction a stem at rest is.

    Raises
    ------
    OptionError
        S is not positive, J is negative, or a start outside -1...1.

    References
    ----------
    .. [1] M. A. A. S. Choudhury, N. F. Thornhill and S. L. Shah, Modelling valve stiction, Control
       Engineering Practice 13 (2005) 641-658, section 5 and figure 9,
       doi:10.1016/j.conengprac.2004.05.005.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> valve = cr.actuators.Stiction(S=4.0, J=2.0, start=1)
    >>> print(valve)
    stiction (Choudhury): S = 4, J = 2
    >>> valve.simulate([0, 4, 8, 6, 4, 3, 2]).tolist()
    [-1.0, 3.0, 7.0, 7.0, 7.0, 4.0, 3.0]
    """

    _author = "Choudhury"
    _sided = False


@dataclass(frozen=True)
class KanoStiction(_StickAndJump):
    """Stiction by the model of Kano and others, which also remembers the side of the friction.

    The same parameters as `Stiction`; after a pause a reversal needs S here, and J there.

    Parameters
    ----------
    S : float
        Dead band plus stick band, in the unit of the command.
    J : float
        Slip jump.
    start : float, default 0
        How the stem came to rest: 1 by a move up, -1 by a move down, 0 relaxed between the two.

    Raises
    ------
    OptionError
        S is not positive, J is negative, or a start outside -1...1.

    References
    ----------
    .. [1] M. Kano, H. Maruta, H. Kugemoto and K. Shimizu, Practical model and detection algorithm
       for valve stiction, IFAC Symposium on Dynamics and Control of Process Systems, Cambridge
       2004, section 2.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> valve = cr.actuators.KanoStiction(S=4.0, J=2.0, start=1)
    >>> valve.simulate([0, 4, 8, 8, 6, 4, 3, 2]).tolist()
    [-1.0, 3.0, 7.0, 7.0, 7.0, 7.0, 4.0, 3.0]
    """

    _author = "Kano"
    _sided = True
