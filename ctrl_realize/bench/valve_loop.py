"""A simulated control loop around a valve, as operating data show it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal, TypeAlias

import numpy as np

from .._checks import band, one_of, positive, real
from ..actuators import Actuator, Saturation, Series
from ..actuators.base import actuators_of
from ..data import Record
from ..errors import OptionError
from ..numerics.arrays import FloatArray, locked
from ..numerics.state_space.sampling import sample_with_dead_time
from .control_valve import Seed

Process: TypeAlias = Literal["flow", "first-order", "integrating"]

_TYPICAL: dict[Process, tuple[float, float, float]] = {
    "flow": (1.0, 2.0, 1.0),
    "first-order": (1.0, 20.0, 5.0),
    "integrating": (0.02, np.inf, 5.0),
}
"""Gain, time constant in s and dead time in s of a process if none are given."""
_LOW, _HIGH = 0.0, 100.0
"""Limits of the controller output in %."""
_MIDDLE = 50.0
"""Controller output and process value of the operating point in %."""
_START = -5.0
"""Deviation of the process value at the start of a simulation in %, so that the loop moves."""
_LONGEST_GAIN_MARGIN = 1e3


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
    >>> print(f"gain margin {loop.gain_margin:.2f}, stable without the valve: {loop.stable}")
    gain margin 1.30, stable without the valve: True
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
    def stable(self) -> bool:
        """Whether the loop is stable with a linear valve."""
        return self._radius(1.0) < 1

    @property
    def gain_margin(self) -> float:
        """Factor of the controller gain at which the loop with a linear valve becomes unstable.

        Below 1 for an unstable loop; at most 1000.
        """
        low, high = 0.0, 1.0
        while self._radius(high) < 1:
            low, high = high, 2 * high
            if high > _LONGEST_GAIN_MARGIN:
                return _LONGEST_GAIN_MARGIN
        for _ in range(40):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if self._radius(middle) < 1 else (low, middle)
        return 0.5 * (low + high)

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
        before = round(0.5 * n) if settle is None else round(max(settle, 0.0) / self.dt)
        asked = np.full(n, _MIDDLE) if setpoint is None else np.asarray(setpoint, np.float64)
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
        A, B, C, D, delay = self._sampled()
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

    def _sampled(self) -> tuple[float, float, float, float, int]:
        """Sample the process: one state, behind whole samples of delay."""
        pole = 0.0 if np.isinf(self.time_constant) else -1 / self.time_constant
        into = self.gain if np.isinf(self.time_constant) else self.gain / self.time_constant
        one = np.ones((1, 1))
        A, B, C, D, delay = sample_with_dead_time(
            pole * one, into * one, one, 0 * one, self.dt, self.dead_time
        )
        return A.item(), B.item(), C.item(), D.item(), delay

    def _radius(self, factor: float) -> float:
        """Largest magnitude of a pole of the linear loop, with the controller gain times a factor.

        States: that of the process, the commands on their way, and the integral.
        """
        A, B, C, D, delay = self._sampled()
        gain, integral_time = self.controller
        part = self.dt / integral_time
        n = delay + 2
        arriving = np.eye(n)[1] if delay else np.zeros(n)
        error = -(C * np.eye(n)[0] + D * arriving)
        integral = np.eye(n)[-1] + part * error
        command = factor * gain * (error + integral)
        loop = np.zeros((n, n))
        loop[0] = A * np.eye(n)[0] + B * (arriving if delay else command)
        loop[1:delay] = np.eye(n)[2 : delay + 1]
        if delay:
            loop[delay] = command
        loop[-1] = integral
        return float(np.abs(np.linalg.eigvals(loop)).max())


def valve_loop(
    actuator: Actuator | Sequence[Actuator] | None = None,
    *,
    process: Process = "first-order",
    gain: float | None = None,
    time_constant: float | None = None,
    dead_time: float | None = None,
    tightness: float = 1.0,
    controller: tuple[float, float] | None = None,
    oscillation: tuple[float, float] | None = None,
    noise: float = 0.0,
    dt: float = 1.0,
) -> ValveLoop:
    """Set up a PI control loop around a valve, for operating data with a known cause.

    Controller output, position and process value are in % about an operating point of 50 %. A loop
    oscillates because of its valve (`actuator` with stiction, or with backlash before an
    integrating process), its tuning (`tightness` near `ValveLoop.gain_margin`), or from outside
    (`oscillation`), or does not.

    Parameters
    ----------
    actuator : Actuator, or sequence of Actuator, optional
        Between controller output and process, in %. Default: a linear valve.
    process : {"first-order", "flow", "integrating"}
        A lag and a dead time of 20 and 5 s, of 2 and 1 s, or an integrator behind 5 s, unless the
        next three arguments are given.
    gain : float, optional
        Of the process, % per % (default 1), or % per s and % if it is integrating (default 0.02).
    time_constant, dead_time : float, optional
        In s; an integrating process has no time constant.
    tightness : float, default 1
        Factor on the controller gain of the tuning rule.
    controller : (float, float), optional
        Gain, and integral time in s. Default: the SIMC rule [1]_, with half a sample added to the
        dead time.
    oscillation : (float, float), optional
        Amplitude in % and period in s of a sine that is added to the process value.
    noise : float, default 0
        Standard deviation of the noise of the process value in %, which the controller sees.
    dt : float, default 1
        Sample time in s.

    Returns
    -------
    ValveLoop

    Raises
    ------
    OptionError
        An invalid argument.

    References
    ----------
    .. [1] S. Skogestad, Simple analytic rules for model reduction and PID controller tuning,
       Journal of Process Control 13 (2003) 291-309, section 3, doi:10.1016/S0959-1524(02)00062-8.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> loop = cr.bench.valve_loop(cr.actuators.Stiction(S=5.0, J=2.0), process="flow")
    >>> loop
    <ValveLoop (simulated): flow process, stiction (Choudhury): S = 5, J = 2>
    >>> gain, integral_time = loop.controller
    >>> print(f"{gain:.3f}, {integral_time:.2f} s")
    0.667, 2.00 s
    """
    kind = one_of(process, "process", tuple(_TYPICAL))
    typical = _TYPICAL[kind]
    chosen = typical[0] if gain is None else real(gain, "gain", "gain of the process")
    if chosen == 0:
        raise OptionError("gain=0; expected a process that responds to its valve")
    if kind == "integrating" and time_constant is not None:
        raise OptionError("an integrating process has no time_constant; expected None")
    lag = typical[1]
    if time_constant is not None:
        lag = positive(time_constant, "time_constant", "time in s")
    wait = typical[2]
    if dead_time is not None:
        wait = real(dead_time, "dead_time", "dead time in s")
        if wait < 0:
            raise OptionError(f"dead_time={dead_time!r}; expected a value >= 0 s")
    positive(dt, "dt", "sample time in s")
    positive(tightness, "tightness", "factor")
    if real(noise, "noise", "standard deviation in %") < 0:
        raise OptionError(f"noise={noise!r}; expected a value >= 0")
    if oscillation is not None:
        amplitude, period = band(oscillation, "oscillation", "amplitude in %, period in s")
        positive(amplitude, "oscillation", "amplitude in %")
        positive(period, "oscillation", "period in s")
        oscillation = (amplitude, period)
    if controller is None:
        proportional, integral_time = _simc(chosen, lag, wait + dt / 2)
    else:
        proportional, integral_time = band(controller, "controller", "gain, integral time in s")
        positive(integral_time, "controller", "integral time in s")
    return ValveLoop(
        actuator=actuators_of(actuator),
        process=kind,
        gain=chosen,
        time_constant=lag,
        dead_time=wait,
        controller=(tightness * proportional, integral_time),
        oscillation=oscillation,
        noise=float(noise),
        dt=float(dt),
    )


def _simc(gain: float, lag: float, dead_time: float) -> tuple[float, float]:
    """Tune a PI controller by the SIMC rule with the closed-loop time constant of the dead time."""
    closed = 2 * dead_time
    if np.isinf(lag):
        return 1 / (gain * closed), 4 * closed
    return lag / (gain * closed), min(lag, 4 * closed)
