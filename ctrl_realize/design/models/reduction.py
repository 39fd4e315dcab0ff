"""Reduction of a model to one or two lags with dead time."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import control as ct
import numpy as np
from scipy.optimize import least_squares

from ..._checks import one_of
from ...delayed import DelayedStateSpace
from ...delayed.operands import in_state_space
from ...delayed.parts import check_single
from ...errors import UnsuitableSystemError
from ...numerics.arrays import FloatArray
from ...numerics.blas_threads import single_threaded
from ...numerics.state_space.balancing import split_modes
from ...numerics.state_space.process_models import half_rule, process_step
from ..resolved import warn_unresolved
from ..siso import core_and_dead_time, delayed_system
from .conversions import ContinuousModel, held_fraction, to_continuous, to_discrete
from .process_model import ProcessModel

METHODS = ("optimal", "half_rule")
MOST_SAMPLES = 2**18
FIT_POINTS = 1500
"""Number of points of the step response in a fit; more do not change the parameters."""

NO_LAG = 1e-3
"""Share of the total time below which the last lag of a fit is its remainder, and counts as dead
time. The step response then changes by 5e-6 to 5e-5 of the gain (root mean square, measured for
dead times of 0.05 to 10 lags). A dead time that is so near to the least one is that."""
_ROUNDED = 1e-9  # gain over the largest value of a step response, that is rounding


@single_threaded
def reduce_fopdt(
    system: Any, *, method: str = "optimal", dead_time: float | None = None
) -> ProcessModel:
    """Reduce a system to gain, one lag and dead time.

    Parameters
    ----------
    system : DelayedStateSpace, ContinuousModel, DelaySystem, or a continuous control system
        One input and one output, stable or with one integrator. An integrating system is reduced to
        ``gain exp(-theta s) / s``.
    method : {"optimal", "half_rule"}, optional
        ``"optimal"`` fits the step response by least squares, with the static gain and at least the
        dead time of the system: a lag in its place would overestimate the phase. ``"half_rule"`` is
        Skogestad's, from the poles and zeros of the continuous core (a complex pair counts as two
        equal lags with the same sum).
    dead_time : float, optional
        In s, for a continuous control system, in addition to that of a `DelaySystem`.

    Returns
    -------
    ProcessModel
        Its `error` is that of the step response.

    Raises
    ------
    UnsuitableSystemError
        An unstable system, several channels, no static gain; for the half rule also a core that has
        no continuous counterpart.

    Notes
    -----
    The half rule is that of [1]_: half of the largest neglected lag is added to the dead time and
    half to the remaining lag.

    References
    ----------
    .. [1] S. Skogestad, Simple analytic rules for model reduction and PID controller tuning, J.
       Process Control 13 (2003) 291-309, section 2, doi:10.1016/S0959-1524(02)00062-8.

    Examples
    --------
    Half of the lag of 0.2 s goes to each side, and that of 0.04 s to the dead time:

    >>> import control as ct
    >>> import ctrl_realize as cr
    >>> lags = ct.tf([1], [1, 1]) * ct.tf([1], [0.2, 1]) * ct.tf([1], [0.04, 1])
    >>> cr.design.reduce_fopdt(lags, method="half_rule")
    <ProcessModel 1 exp(-0.14 s) / (1.1 s + 1)>
    >>> round(cr.design.reduce_fopdt(lags).error, 3)
    0.017
    """
    return _reduce(system, method, dead_time, 1)


@single_threaded
def reduce_sopdt(
    system: Any, *, method: str = "optimal", dead_time: float | None = None
) -> ProcessModel:
    """Reduce a system to gain, two lags and dead time.

    As `reduce_fopdt`; an integrating system keeps one lag in addition to its integrator.

    Parameters
    ----------
    system, method, dead_time
        See `reduce_fopdt`.

    Returns
    -------
    ProcessModel

    References
    ----------
    .. [1] S. Skogestad, Simple analytic rules for model reduction and PID controller tuning, J.
       Process Control 13 (2003) 291-309, section 2 (the half rule),
       doi:10.1016/S0959-1524(02)00062-8.

    Examples
    --------
    >>> import control as ct
    >>> import ctrl_realize as cr
    >>> lags = ct.tf([1], [1, 1]) * ct.tf([1], [0.2, 1]) * ct.tf([1], [0.04, 1])
    >>> cr.design.reduce_sopdt(lags, method="half_rule")
    <ProcessModel 1 exp(-0.02 s) / (1 s + 1) (0.22 s + 1)>
    """
    return _reduce(system, method, dead_time, 2)


def _reduce(system: Any, method: str, dead_time: float | None, order: int) -> ProcessModel:
    method = one_of(method, "method", METHODS)
    if isinstance(system, ProcessModel):
        core = in_state_space(system.transfer_function())
        resolution = max(system.lag + system.second_lag, system.dead_time) / 500
        system = ContinuousModel(core, (system.dead_time,), (0.0,), resolution)
    continuous, plant = both_forms(system, dead_time)
    time, step, integrating, gain = _step_record(plant)
    lags = order - int(integrating)
    if method == "half_rule":
        model = _by_half_rule(continuous or to_continuous(plant), lags, integrating, gain)
    else:
        sampled = float(plant.dead_time) - held_fraction(plant)
        least = continuous.dead_time if continuous else sampled
        model = _by_fit(time, step / gain, lags, integrating, gain, least)
    total = _total(time, step / gain, integrating)
    square = np.trapezoid((model.step(time) - step) ** 2, time) / total
    scale = total if integrating else 1.0
    return replace(model, error=float(np.sqrt(square) / abs(gain) / scale))


def both_forms(
    system: Any, dead_time: float | None = None, longest: float = np.inf
) -> tuple[ContinuousModel | None, DelayedStateSpace]:
    """Return a plant in continuous time, if it is given so, and sampled.

    A continuous one is sampled so fast that it has no effect; `longest` limits the sample time.
    """
    if isinstance(system, ContinuousModel):
        return system, to_discrete(system)
    if isinstance(system, ct.LTI) and (system.dt is None or system.dt == 0):
        core, total = core_and_dead_time(system, "a reduction")
        total += 0.0 if dead_time is None else dead_time
        speeds = np.abs(core.poles())
        speeds = speeds[speeds > 1e-10 * speeds.max(initial=0.0)]  # an integrator is none
        span = float(np.sum(1 / speeds)) + total
        if span == 0:
            raise UnsuitableSystemError(
                f"{core.name!r} has no lag and no dead time, which set the times of its loop; "
                "expected one at least, such as plant * cr.delay(1)"
            )
        step = min(span / 1000, longest)
        if total and np.any(core.D):
            # A feedthrough causes a jump; with whole samples it stays in place.
            step = total / max(1, round(total / step))
        model = ContinuousModel(core, (total,), (0.0,), step)
        return model, to_discrete(model)
    warn_unresolved(system)
    return None, delayed_system(system, "a reduction")


def _step_record(plant: DelayedStateSpace) -> tuple[FloatArray, FloatArray, bool, float]:
    """Step response until it has settled (or follows its ramp), thinned; and its gain."""
    check_single(plant, "a reduction")
    dt, core = plant.dt, plant.delay_free
    poles = np.asarray(core.poles())
    at_one = np.abs(poles - 1) < 1e-9
    if np.any(np.abs(poles[~at_one]) > 1 - 1e-12) or at_one.sum() > 1:
        raise UnsuitableSystemError(
            "the system is unstable or has more than one integrator; it cannot be "
            "approximated by lags and a dead time"
        )
    integrating = bool(at_one.any())
    slowest = float(np.abs(poles[~at_one]).max(initial=0.0))
    settling = 10 / -np.log(slowest) if slowest > 0 else 4.0
    # rounded, because lags in whole samples settle at one, from which rounding errors lead away
    count = min(MOST_SAMPLES, 3 * plant.delay // 2 + round(settling) + 20)
    step = plant.step(count)
    gain = _slope(core) if integrating else float(np.real(core.dcgain()))
    reached = abs(gain) * (count * dt if integrating else 1.0)
    if not np.isfinite(gain) or reached <= _ROUNDED * np.abs(step).max():
        raise UnsuitableSystemError(
            f"the static gain is {gain:.2g}, so it cannot be approximated by this model"
        )
    stride = max(1, count // FIT_POINTS)
    return np.arange(count)[::stride] * dt, step[::stride], integrating, float(gain)


def _slope(core: ct.StateSpace) -> float:
    """Slope per second of the step response of an integrating core."""
    A, B, C = (np.asarray(M, dtype=np.float64) for M in (core.A, core.B, core.C))
    integrator, _ = split_modes(A, B, C, lambda z: abs(z - 1) < 1e-9)
    return float((integrator[2] @ integrator[1])[0, 0] / core.dt)


def _by_half_rule(
    model: ContinuousModel, count: int, integrating: bool, gain: float
) -> ProcessModel:
    poles, zeros = np.asarray(model.core.poles()), np.asarray(model.core.zeros())
    if integrating:
        poles = np.delete(poles, np.argmin(np.abs(poles)))
    if np.any(poles.real >= 0):
        raise UnsuitableSystemError("the half rule needs stable lags")
    zeros = zeros[np.isfinite(zeros) & (np.abs(zeros) > 0)]
    # A complex pair is replaced by two equal lags with the same sum: each has tau = -Re p / |p|^2.
    lags = -poles.real / np.abs(poles) ** 2
    times = -zeros.real / np.abs(zeros) ** 2
    leads, inverse = times[times > 0], -times[times < 0]
    factor, kept, remaining = half_rule(
        lags, leads, inverse, model.dead_time, count, integrating=integrating
    )
    lag, second = [*sorted(kept, reverse=True), 0.0, 0.0][:2]
    return ProcessModel(gain * factor, lag, remaining, second, integrating, "half rule")


def _by_fit(
    time: FloatArray, shape: FloatArray, lags: int, integrating: bool, gain: float, dead_time: float
) -> ProcessModel:
    """Fit lags and a dead time of at least `dead_time`."""
    # in units of the span: differences and tolerances of least_squares are absolute below 1
    span = time[-1]
    time, dead_time, shape = time / span, dead_time / span, shape / (span if integrating else 1)
    # Sum of dead time and lags: the area above the step response, or the offset of the ramp.
    total = _total(time, shape, integrating)

    def unpack(p: FloatArray) -> tuple[float, float, float]:
        first, second = ([float(x) for x in p[:lags]] + [0.0, 0.0])[:2]
        return max(first, second), min(first, second), float(p[-1])

    def deviation(p: FloatArray) -> FloatArray:
        lag, second, later = unpack(p)
        return process_step(time, lag, second, later, integrating=integrating) - shape

    tiny = 1e-9
    lower = np.array([*[tiny] * lags, dead_time])
    upper = np.full(lags + 1, 2 + dead_time)
    best: Any = None
    for share in (0.1, 0.4, 0.7):
        parts = {0: [total], 1: [(1 - share) * total, share * total]}.get(
            lags, [(1 - share) * 0.7 * total, (1 - share) * 0.3 * total, share * total]
        )
        start = np.clip(parts, lower + tiny, upper)
        found = least_squares(deviation, start, bounds=(lower, upper), x_scale=total)
        if best is None or found.cost < best.cost:
            best = found
    lag, second, later = unpack(best.x)
    dead_time = later if later - dead_time >= NO_LAG * total else dead_time
    last = lag if integrating else second
    if last < NO_LAG * total:
        dead_time += last
        lag, second = 0.0 if integrating else lag, 0.0
    lag, second, dead_time = span * lag, span * second, span * dead_time
    return ProcessModel(gain, lag, dead_time, second, integrating, "optimal")


def _total(time: FloatArray, shape: FloatArray, integrating: bool) -> float:
    total = time[-1] - shape[-1] if integrating else np.trapezoid(1 - shape, time)
    return float(np.clip(total, 1e-3 * time[-1], time[-1]))
