"""A stem with friction that is a law of motion: the LuGre model."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from .._checks import not_negative, positive
from ..errors import OptionError
from ..numerics.actuators.lugre import LuGre, lugre_stem, lugre_step
from ..numerics.arrays import FloatArray
from .base import Actuator, State


@dataclass(frozen=True)
class LuGreFriction(LuGre, Actuator):
    """A stem, a mass on a spring, with friction by the LuGre model.

    The drive would hold the stem at the command if there were no friction. Static friction holds it
    until the force of the spring exceeds `static`, a deviation of ``static / spring``; bristles of
    stiffness `bristle` deflect before (presliding), and friction falls from `static` to `coulomb`
    with the velocity (Stribeck effect). A well damped stem that is fast compared with the sample
    time, and whose Stribeck velocity is small, behaves like `HeStiction` with ``static / spring``
    and ``coulomb / spring``.

    Parameters
    ----------
    mass, spring : float
        Of the stem, in consistent units: a force is ``spring`` times a position.
    coulomb, static : float
        Kinetic and static friction, as forces; ``coulomb <= static``.
    stribeck : float
        Velocity at which friction has fallen most of the way.
    bristle : float
        Stiffness of the bristles; much more than `spring`.
    damping : float
        Damping of the bristles.
    viscous : float
        Viscous friction, force over velocity.

    Raises
    ------
    OptionError
        Parameters that are not positive (damping and viscous friction may be 0), or
        ``coulomb > static``.

    References
    ----------
    .. [1] C. Canudas de Wit, H. Olsson, K. J. Astrom and P. Lischinsky, A new model for control of
       systems with friction, IEEE Trans. Automatic Control 40 (1995) 419-425, equations (3) to
       (6), doi:10.1109/9.376053.

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> stem = cr.actuators.LuGreFriction(
    ...     mass=1.0, spring=100.0, coulomb=100.0, static=150.0, stribeck=0.01, bristle=1e5,
    ...     damping=300.0, viscous=60.0,
    ... )
    >>> command = np.repeat([0.0, 1.0, 10.0], 20)
    >>> stem.simulate(command, dt=0.2)[[19, 39, 59]].round(1).tolist()
    [0.0, 0.0, 9.0]
    """

    _states: ClassVar[tuple[str, ...]] = ("position", "velocity", "deflection")
    _timed: ClassVar[bool] = True

    def __post_init__(self) -> None:
        for name in ("mass", "spring", "coulomb", "static", "stribeck", "bristle"):
            positive(getattr(self, name), name, "parameter of the stem")
        for name in ("damping", "viscous"):
            not_negative(getattr(self, name), name, "parameter of the stem")
        if self.coulomb > self.static:
            raise OptionError(
                f"coulomb={self.coulomb!r}, static={self.static!r}; expected coulomb <= static"
            )

    def __str__(self) -> str:
        return (
            f"LuGre friction: static {self.static / self.spring:g}, Coulomb "
            f"{self.coulomb / self.spring:g} in units of the command"
        )

    def _rest(self, command: float) -> State:
        return (command, 0.0, 0.0)

    def _advance(self, state: State, command: float, dt: float) -> tuple[State, float]:
        after = lugre_step(np.array(state), command, self, dt)
        return tuple(after.tolist()), state[0]

    def _simulated(self, command: FloatArray, dt: float) -> FloatArray:
        return lugre_stem(command, self, dt)
