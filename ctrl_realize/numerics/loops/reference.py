"""The PI that a model asks for, and how robust its loop is on other models of the same data.

The rule is SIMC [1]_ on the model reduced by the half rule. Where its loop is not robust on the
model itself, as for a plant that swings, its gain is lowered until it is: what remains to be seen
is whether the data tell the plant closely enough.

References
----------
.. [1] S. Skogestad, Simple analytic rules for model reduction and PID controller tuning, J. Process
   Control 13 (2003) 291-309, doi:10.1016/S0959-1524(02)00062-8.
"""

from __future__ import annotations

import numpy as np

from ..arrays import ComplexArray, FloatArray
from ..engine.plausible_models import PlausibleModel
from ..state_space.process_models import half_rule

_ROBUST = 1.7
"""Ms of the controller on the model itself: 1.6 with SIMC's choice on a first-order plant [1]_."""
_LOWER, _MOST = 0.75, 20  # factor of a gain that is lowered, and times
_POINTS = 600  # of frequency


def model_response(model: PlausibleModel, omega: FloatArray) -> ComplexArray:
    """Frequency response (M,) of a continuous model at omega in rad/s."""
    s = 1j * omega
    value = np.exp(-model.dead_time * s) * np.polyval(model.numerator[::-1], s)
    return np.asarray(value / np.prod(s[:, None] - model.poles, axis=1))


def simc_pi(model: PlausibleModel, dt: float) -> tuple[float, float]:
    """Gain and integral time in s of a PI; the hold is half a sample more dead time.

    Poles that are 0 are integrators, of which there is one at most.
    """
    poles = model.poles[model.poles != 0]
    integrating = poles.size < model.poles.size
    zeros = np.roots(model.numerator[::-1])
    zeros = zeros[zeros != 0]
    times = -zeros.real / np.abs(zeros) ** 2
    lags, late = -poles.real / np.abs(poles) ** 2, model.dead_time + dt / 2
    leads, unstable = times[times > 0], -times[times < 0]
    order = 0 if integrating else 1
    factor, kept, delay = half_rule(lags, leads, unstable, late, order, integrating=integrating)
    gain = factor * float(model.numerator[0] / np.prod(-poles).real)
    if integrating:
        return 1 / (2 * gain * delay), 8 * delay
    return float(kept[0]) / (2 * gain * delay), min(float(kept[0]), 8 * delay)


def robust_pi(model: PlausibleModel, dt: float) -> tuple[float, float]:
    """Gain and integral time in s of a PI whose loop is robust on the model."""
    kp, ti = simc_pi(model, dt)
    omega = grid(model, dt)
    loop = controller_response(kp, ti, omega, dt) * model_response(model, omega)
    for _ in range(_MOST):
        if largest_sensitivity(loop) <= _ROBUST:
            break
        kp, loop = _LOWER * kp, _LOWER * loop
    return kp, ti


def grid(model: PlausibleModel, dt: float) -> FloatArray:
    """Frequencies in rad/s at which loops are looked at, up to Nyquist's."""
    return np.geomspace(1e-3 / (model.dead_time + dt), np.pi / dt, _POINTS)


def controller_response(kp: float, ti: float, omega: FloatArray, dt: float) -> ComplexArray:
    """Frequency response (M,) of a PI behind a hold."""
    return np.asarray(kp * (1 + 1 / (1j * omega * ti)) * np.exp(-0.5j * omega * dt))


def largest_sensitivity(loop: ComplexArray) -> FloatArray:
    """Ms of frequency responses (..., M) of open loops without unstable poles.

    Infinite where the closed loop is unstable, by the winding of ``1 + L`` about 0.
    """
    distance = 1 + loop
    phase = np.unwrap(np.angle(distance), axis=-1)
    stable = phase[..., -1] > phase[..., 0]
    return np.where(stable, 1 / np.abs(distance).min(axis=-1), np.inf)
