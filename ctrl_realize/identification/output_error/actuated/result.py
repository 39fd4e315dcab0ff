"""What a fit has found about an actuator."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...._parameters import Parameter
from ....actuators import Actuator, SlewRateLimit
from ....numerics.actuated.motions import Place
from ....numerics.arrays import FloatArray

_PLACES: dict[Place, str] = {"input": "before the lags", "stem": "behind the lags"}


@dataclass(frozen=True)
class ActuatorFit:
    """Actuator that was estimated together with dead time and lags.

    ``output = level + gain * G(model(input))`` for an actuator at the input, where G is the linear
    part with unit gain, and ``level + gain * model(G(input))`` for one at the stem.

    Attributes
    ----------
    model : Actuator
        From `ctrl_realize.actuators`, in the unit of the input.
    actuator_at : {"input", "stem"}
        Whether it acts before the lags of the linear part, or behind them. The dead time commutes
        with it.
    parameters : tuple of Parameter
        Estimates with standard errors and 95 % intervals (profile likelihood): ``"slew_rate"`` per
        second, or ``"slew_rate_opening"`` and ``"slew_rate_closing"``; ``"dead_band"``;
        ``"resolution"``; ``"S"`` and ``"J"``; ``"travel_low"``, ``"travel_high"`` or both; or, from
        0 at the lowest to 1 at the highest command, ``"flow_at_40"``, ... at those between. The
        standard error is half of the interval over 1.96.
    starts : tuple of float
        Place within play or friction at the beginning of each record, from -1 (came from above) to
        1 (from below); empty where it does not matter.
    evidence : float
        Information criterion of the best linear model minus that of this one.
    unresolved : tuple of str
        What the records cannot tell, in words, and the test that would.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> slow = cr.actuators.SlewRateLimit(300.0)
    >>> valve = cr.bench.valve(actuator=slow, actuator_at="input", lvdt_hz=None)
    >>> record = valve.step_record(16, rng=1)  # 300 % of 16 mA in a second
    >>> fit = cr.fit_output_error(record, structures=[(3, 3)], actuator="slew_rate").fit
    >>> rate = fit.actuator["slew_rate"]
    >>> low, high = fit.interval
    >>> print(f"{rate.value:.1f}, true 48; {low < valve.truth.dead_time < high}")
    48.0, true 48; True
    """

    model: Actuator
    actuator_at: Place
    parameters: tuple[Parameter, ...]
    starts: tuple[float, ...]
    evidence: float
    unresolved: tuple[str, ...] = ()

    def __getitem__(self, name: str) -> Parameter:
        """Parameter by its name."""
        for one in self.parameters:
            if one.name == name:
                return one
        raise KeyError(f"{name!r}; expected one of {[one.name for one in self.parameters]}")

    def in_words(self) -> str:
        """Write the actuator with its parameters and intervals."""
        numbers = ", ".join(
            f"{one.label} {one.text()} ({one.interval_text() or 'one end is unknown'})"
            for one in self.parameters
        )
        return f"{numbers}; {self.where}"

    @property
    def where(self) -> str:
        """Where it acts: "before the lags" or "behind the lags"."""
        return _PLACES[self.actuator_at]

    def position(self, command: FloatArray, dt: float) -> FloatArray:
        """Pass a command (N,) through the actuator alone; a slew limit at its mean over samples."""
        position = self.model.simulate(np.asarray(command), dt)
        if not isinstance(self.model, SlewRateLimit):
            return position
        return np.asarray((position + np.concatenate([position[:1], position[:-1]])) / 2)

    def driven(
        self,
        linear: Callable[[FloatArray], FloatArray],
        command: FloatArray,
        gain: float,
        dt: float,
    ) -> FloatArray:
        """Response (N,) of the actuator together with a linear part, from rest.

        Parameters
        ----------
        linear : callable
            Response (N,) of the linear part to an input (N,).
        command : ndarray, shape (N,)
        gain : float
            Static gain of the linear part.
        dt : float
            Sample time in s.

        Returns
        -------
        ndarray, shape (N,)
        """
        if self.actuator_at == "input":
            position = self.position(command, dt)
            return linear(position - position[0])
        demand = command[0] + linear(command - command[0]) / gain
        position = self.model.simulate(demand, dt)
        return np.asarray(gain * (position - position[0]))
