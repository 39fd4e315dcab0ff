"""Simulation of a control loop around a valve, as operating data show it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal, TypeAlias

import control as ct
import numpy as np

from .._checks import numbers, positive, real
from ..actuators import Actuator, Saturation, Series
from ..data import Record
from ..delayed import DelayedStateSpace, delayed_ss
from ..errors import OptionError
from ..numerics.arrays import FloatArray, locked
from .control_valve import Seed

Process: TypeAlias = Literal["flow", "first-order", "integrating"]

_LOW, _HIGH = 0.0, 100.0
"""Limits of the controller output in %."""
_MIDDLE = 50.0
"""Controller output and process value of the operating point in %."""
_START = -5.0
"""Deviation of the process value at the start of a simulation in %, so that the loop moves."""


@dataclass(frozen=True, eq=False)
class LoopRecord:
    """Operating data of a simulated loop, with what a plant does not show.

    Attributes
    ----------
    record : Record
        Controller output OP in % as the input, process value PV in % as the output.
    setpoint : ndarray, shape (N,)
        In %.
    position : ndarray, shape (N,)
        Of the valve in %, which is not measured in most plants.
    truth : ValveLoop
        The loop that was simulated.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> sticking = cr.actuators.Stiction(S=5.0, J=2.0)
    >>> loop = cr.bench.valve_loop(sticking).simulate(600.0, rng=1)
    >>> loop
    <LoopRecord (simulated): 600 samples of 1 s, stiction (Choudhury): S = 5, J = 2>
    >>> print(f"{loop.position.std():.1f} % of motion")
    1.3 % of motion
    """

    record: Record
    setpoint: FloatArray
    position: FloatArray
    truth: ValveLoop = field(repr=False)

    def __repr__(self) -> str:
        return (
            f"<LoopRecord (simulated): {self.record.n_samples} samples of {self.record.dt:g} s, "
            f"{self.truth.described}>"
        )


@dataclass(frozen=True, eq=False)
class ValveLoop:
    """A PI controller, a valve and a process with dead time; made by `valve_loop`.

    The attributes are the arguments of `valve_loop`; `controller` contains gain and integral time.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> loop = cr.bench.valve_loop(cr.actuators.Backlash(2.0), process="flow", tightness=2.0)
    >>> cr.design.margins(loop.open_loop)  # without the valve
    <Margins stable: gain 1.301, phase 25.73 deg, modulus 0.2111, delay 0.5592 s>
    """

    actuator: tuple[Actuator, ...]
    process: Process
    gain: float
    time_constant: float
    dead_time: float
    controller: tuple[float, float]
    oscillation: tuple[float, float] | None
    noise: float
    dt: float

    def __repr__(self) -> str:
        return f"<ValveLoop (simulated): {self.process} process, {self.described}>"

    @property
    def described(self) -> str:
        """The valve in words."""
        return str(Series(self.actuator)) if self.actuator else "linear valve"

    @property
    def open_loop(self) -> DelayedStateSpace:
        """Process and controller in series, with a linear valve, for `design.margins`."""
        gain, integral_time = self.controller
        part = self.dt / integral_time
        controller = ct.ss(1, part, gain, gain * (1 + part), self.dt)
        loop: DelayedStateSpace = self._sampled() * controller
        return loop

    def simulate(
        self,
        duration: float = 2000.0,
        rng: Seed = None,
        *,
        setpoint: Sequence[float] | FloatArray | None = None,
        settle: float | None = None,
        name: str = "loop",
    ) -> LoopRecord:
        """Simulate operating data.

        The loop starts with a deviation of 5 % and runs for `settle` before the record begins.

        Parameters
        ----------
        duration : float, default 2000
            Of the record in s.
        rng : numpy.random.Generator or int, optional
            Generator or seed of the noise.
        setpoint : array_like, shape (N,), optional
            In %, for each sample of the record. Default: 50 % throughout.
        settle : float, optional
            In s. Default: half of `duration`.
        name : str, default "loop"
            Of the record.

        Returns
        -------
        LoopRecord

        Raises
        ------
        OptionError
            A duration of less than 10 samples, or a setpoint of another length.

        Examples
        --------
        >>> import ctrl_realize as cr
        >>> loop = cr.bench.valve_loop(cr.actuators.Stiction(5, 2), noise=0.2)
        >>> loop.simulate(600.0, rng=1).record
        <Record 'loop': 600 samples of 1 s, 1 input, 1 output>
        """
        n = round(positive(duration, "duration", "time in s") / self.dt)
        if n < 10:
            raise OptionError(
                f"duration={duration!r} is {n} samples of {self.dt:g} s; expected at least 10"
            )
        before = round(0.5 * n)
        if settle is not None:
            before = round(max(real(settle, "settle", "time in s"), 0.0) / self.dt)
        asked = np.full(n, _MIDDLE) if setpoint is None else numbers(setpoint, "setpoint")
        if asked.shape != (n,) or not np.isfinite(asked).all():
            raise OptionError(
                f"setpoint has shape {asked.shape}; expected {n} finite numbers, one for each "
                "sample"
            )
        generator = np.random.default_rng(rng)
        wanted = np.concatenate([np.full(before, asked[0]), asked])
        time = self.dt * np.arange(before + n, dtype=np.float64)
        added = self.noise * generator.standard_normal(before + n)
        if self.oscillation is not None:
            amplitude, period = self.oscillation
            phase = generator.uniform(0, 2 * np.pi)
            added += amplitude * np.sin(2 * np.pi * time / period + phase)
        commands, positions, values = self._closed(wanted, added)
        record = Record(
            time[:n],
            commands[before:],
            values[before:],
            name=name,
            input_labels=["OP (simulated) [%]"],
            output_labels=["PV (simulated) [%]"],
        )
        return LoopRecord(record, locked(asked), locked(positions[before:]), self)

    def _closed(
        self, setpoint: FloatArray, added: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Run the loop; return controller output, position and process value."""
        process = self._sampled()
        core, delay = process.delay_free, int(process.delay)
        A, B, C, D = (matrix.item() for matrix in (core.A, core.B, core.C, core.D))
        gain, integral_time = self.controller
        valve = Series(self.actuator) if self.actuator else Saturation(_LOW, _HIGH)
        state = valve.steady_state(_MIDDLE)
        at_rest = valve.advance(state, _MIDDLE, self.dt)[1]
        x, integral = _START / C, 0.0
        n = setpoint.size
        commands, positions, values = np.empty(n), np.empty(n), np.empty(n)
        flow = [0.0] * (n + delay)  # in deviations, when it arrives at the process
        for k, (wanted, more) in enumerate(zip(setpoint.tolist(), added.tolist(), strict=True)):
            values[k] = _MIDDLE + C * x + D * flow[k] + more
            error = wanted - values[k]
            summed = integral + self.dt / integral_time * error
            command = _MIDDLE + gain * (error + summed)
            if _LOW <= command <= _HIGH:  # the integral stops where the output is at its limit
                integral = summed
            commands[k] = min(max(command, _LOW), _HIGH)
            state, positions[k] = valve.advance(state, commands[k], self.dt)
            flow[k + delay] = positions[k] - at_rest
            x = A * x + B * flow[k]
        return commands, positions, values

    def _sampled(self) -> DelayedStateSpace:
        """Sample the process: one state, behind whole samples of delay."""
        pole = 0.0 if np.isinf(self.time_constant) else -1 / self.time_constant
        into = self.gain if np.isinf(self.time_constant) else self.gain / self.time_constant
        return delayed_ss(ct.ss(pole, into, 1, 0), dead_time=self.dead_time, dt=self.dt)
