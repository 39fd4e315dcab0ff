"""A control loop around a valve: process, tuning, and what makes it oscillate."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .._checks import band, not_negative, one_of, positive, real
from ..actuators import Actuator
from ..actuators.base import actuators_of
from ..errors import OptionError
from ..numerics.engine.plausible_models import PlausibleModel
from ..numerics.loops.reference import simc_pi
from .control_loop import Process, ValveLoop

_TYPICAL: dict[Process, tuple[float, float, float]] = {
    "flow": (1.0, 2.0, 1.0),
    "first-order": (1.0, 20.0, 5.0),
    "integrating": (0.02, np.inf, 5.0),
}
"""Gain, time constant in s and dead time in s of a process if none are given."""


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
    integrating process), its tuning (`tightness` near the gain margin of `open_loop`), or from
    outside (`oscillation`), or does not.

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
    typical_gain, lag, typical_wait = _TYPICAL[kind]
    gain = real(typical_gain if gain is None else gain, "gain", "gain of the process")
    if gain == 0:
        raise OptionError("gain=0; expected a process that responds to its valve")
    if kind == "integrating" and time_constant is not None:
        raise OptionError("an integrating process has no time_constant; expected None")
    if time_constant is not None:
        lag = positive(time_constant, "time_constant", "time in s")
    wait = typical_wait if dead_time is None else dead_time
    wait = not_negative(wait, "dead_time", "dead time in s")
    positive(dt, "dt", "sample time in s")
    positive(tightness, "tightness", "factor")
    not_negative(noise, "noise", "standard deviation in %")
    if oscillation is not None:
        oscillation = band(oscillation, "oscillation", "amplitude in %, period in s")
        positive(oscillation[0], "oscillation", "amplitude in %")
        positive(oscillation[1], "oscillation", "period in s")
    if controller is None:
        # by SIMC, with the closed-loop time constant of the dead time
        poles = np.array([0.0 if np.isinf(lag) else -1 / lag], dtype=np.complex128)
        model = PlausibleModel(wait, poles, gain * (np.abs(poles) if poles.any() else np.ones(1)))
        proportional, integral_time = simc_pi(model, dt)
    else:
        proportional, integral_time = band(controller, "controller", "gain, integral time in s")
        positive(integral_time, "controller", "integral time in s")
    return ValveLoop(
        actuator=actuators_of(actuator),
        process=kind,
        gain=gain,
        time_constant=lag,
        dead_time=wait,
        controller=(tightness * proportional, integral_time),
        oscillation=oscillation,
        noise=float(noise),
        dt=float(dt),
    )
