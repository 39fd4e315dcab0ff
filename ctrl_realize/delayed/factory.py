"""Make a system with dead time from any linear system, with exact sampling if it is continuous."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial

import control as ct
import numpy as np

from .._checks import check_type, positive, real
from ..errors import DelayRangeError, OptionError, UnsuitableSystemError
from ..numerics.state_space.sampling import sample_with_dead_time, split_dead_time
from ..results import ModelFit
from .operands import check_proper, in_state_space
from .parts import MAX_DELAY, check_core, matrices_of, signals_of
from .system import DelayedStateSpace


def delayed_ss(
    core: ct.StateSpace | ct.TransferFunction,
    delay: int | Sequence[int] | None = None,
    *,
    dead_time: float | None = None,
    dt: float | None = None,
    output_delay: int | Sequence[int] = 0,
    fit: ModelFit | None = None,
    name: str | None = None,
    inputs: str | Sequence[str] | None = None,
    outputs: str | Sequence[str] | None = None,
    time_unit: str = "s",
) -> DelayedStateSpace:
    """Add a dead time to a system.

    Parameters
    ----------
    core : control.StateSpace or control.TransferFunction
        Discrete, or continuous with `dt`: it is then sampled exactly with a zero-order hold, for
        any dead time.
    delay : int or sequence of int, optional
        Dead time in samples; one for each input if they differ.
    dead_time : float, optional
        The same in s, instead of `delay`. For a discrete core it must be a multiple of its sample
        time. For a continuous one, a dead time of (d + f) samples, 0 < f < 1, gives a core of the
        same order with feedthrough and the delay d + 1.
    dt : float, optional
        Sample time in s for a continuous core.
    output_delay, fit, name, inputs, outputs, time_unit
        As for `DelayedStateSpace`.

    Returns
    -------
    DelayedStateSpace

    Raises
    ------
    UnsuitableSystemError
        A core that is not a linear system, a continuous one without `dt`, or a fractional delay of
        a core with feedthrough.
    DelayRangeError
        A negative delay, or one that is not a multiple of a discrete core's sample time.

    Notes
    -----
    Sampling with a zero-order hold and a dead time of any length follows [1]_.

    References
    ----------
    .. [1] K. J. Astrom and B. Wittenmark, Computer-Controlled Systems, 3rd ed., Prentice Hall 1997,
       section 2.3.

    Examples
    --------
    >>> import control as ct
    >>> import ctrl_realize as cr
    >>> lag = ct.tf([1], [0.08, 1])
    >>> cr.delayed_ss(lag, dead_time=0.0289, dt=7.8125e-4).delay
    37
    >>> cr.delayed_ss(lag, dead_time=0.025, dt=0.01)
    <DelayedStateSpace: u -> y, order 1, z^-3 (0.03 s), dt = 0.01 s>
    """
    expected = "a control.StateSpace or TransferFunction"
    kinds = ct.StateSpace, ct.TransferFunction
    check_type(core, kinds, "core", expected, UnsuitableSystemError)
    if delay is not None and dead_time is not None:
        raise OptionError(f"delay={delay!r} and dead_time={dead_time!r}: expected one of them")
    if isinstance(core, ct.TransferFunction):
        check_proper(core, "a model with dead time")
    system = core if isinstance(core, ct.StateSpace) else in_state_space(core)
    made = partial(
        DelayedStateSpace, output_delay=output_delay, fit=fit, name=name, inputs=inputs,
        outputs=outputs, time_unit=time_unit,
    )  # fmt: skip
    wait = 0.0 if dead_time is None else real(dead_time, "dead_time", "dead time in s, >= 0")
    if wait < 0:
        raise DelayRangeError(f"dead_time={wait:g} s; expected a value >= 0")
    if system.isctime(strict=True) or (dt is not None and system.dt is None):
        if dt is None:
            raise UnsuitableSystemError("the core is continuous; give dt, its sample time in s")
        step = positive(dt, "dt", "sample time in s")
        _check_span(system, wait, step)
        if split_dead_time(wait, step)[1] and np.any(system.D):
            raise UnsuitableSystemError(
                "the core has a feedthrough D, whose response jumps between two samples when "
                f"the dead time is {wait / step:.6g} samples; use a whole number of samples"
            )
        *sampled, samples = sample_with_dead_time(*matrices_of(system), step, wait)
        if not all(np.isfinite(M).all() for M in sampled):
            raise UnsuitableSystemError(
                f"sampled every {step:g} s the core has non-finite entries; its poles reach "
                f"{np.abs(system.poles()).max(initial=0.0):.3g} rad/s: use a shorter dt"
            )
        discrete = ct.StateSpace(*sampled, step, remove_useless_states=False, **signals_of(system))
        return made(discrete, samples if delay is None else delay)
    check_core(system)
    if dt is not None and not np.isclose(positive(dt, "dt", "sample time in s"), system.dt):
        raise OptionError(f"dt={dt:g} s, but the core has the sample time {system.dt:g} s")
    _check_span(system, wait, system.dt)
    samples, rest = split_dead_time(wait, system.dt)
    if rest:
        raise DelayRangeError(
            f"dead_time={wait:g} s is {wait / system.dt:.6g} samples of {system.dt:g} s; a "
            "discrete core needs a whole number of samples (a continuous core takes any dead time)"
        )
    return made(system, samples if delay is None else delay)


def _check_span(system: ct.StateSpace, dead_time: float, step: float) -> None:
    """Refuse sample times far too short for the dead time, or far too long for the core."""
    if dead_time / step > MAX_DELAY:
        raise DelayRangeError(
            f"dead_time={dead_time:g} s is {dead_time / step:.3g} samples of {step:g} s; at most "
            f"{MAX_DELAY} are allowed: use a longer sample time"
        )
    matrices = (system.A, system.B) if system.isctime() else ()
    largest = max((float(np.abs(M).max(initial=0.0)) for M in matrices), default=0.0)
    if not math.isfinite(largest * step):
        raise UnsuitableSystemError(
            f"the core has entries up to {largest:.3g} per s, too large for samples of {step:g} s: "
            "use a shorter dt"
        )
