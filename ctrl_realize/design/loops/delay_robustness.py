"""Robustness of a loop to the dead time."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ...data.shown_units import shown_time_unit
from ...delayed import DelayedStateSpace
from ...errors import OptionError
from ...numerics.arrays import locked, read_only
from ...numerics.blas_threads import single_threaded
from ..models.conversions import held_fraction
from ..resolved import warn_unresolved
from ..siso import core_and_dead_time, delayed_system, interval_of_dead_time, is_continuous
from .delay_robustness_result import DelayRobustness
from .loop import Loop, open_loop
from .margin_result import Margins
from .margins import distance_if_stable, loop_margins

MAX_DELAYS = 21
"""Largest number of delays that are tried within an interval."""


@single_threaded
def delay_robustness(
    system: Any, controller: Any, dead_time_interval: tuple[float, float] | None = None
) -> DelayRobustness:
    """Check a controller over an interval of dead times.

    Parameters
    ----------
    system : DelayedStateSpace or DelaySystem
        Plant; its core is kept, its delay is varied. A continuous `DelaySystem` has its dead time
        at input or output.
    controller : system
        Of the same time base.
    dead_time_interval : (float, float), optional
        In s; default: that of the identification, ``system.fit.dead_time_interval``.

    Returns
    -------
    DelayRobustness

    Raises
    ------
    OptionError
        No interval is given or known, or it is invalid.
    UnsuitableSystemError
        Several channels, mixed time bases, or a plant with delays in a loop.

    Notes
    -----
    A loop with a predictor may be stable at the nominal dead time but unstable at shorter and
    longer ones [1]_; so the whole interval is checked, not only its ends.

    References
    ----------
    .. [1] Z. J. Palmor, Stability properties of Smith dead-time compensator controllers, Int. J.
       Control 32 (1980) 937-949.

    Examples
    --------
    >>> import control as ct
    >>> import ctrl_realize as cr
    >>> plant = cr.delayed_ss(ct.tf([1], [0.08, 1]), dead_time=0.1, dt=0.01)
    >>> predictor = cr.design.smith_predictor(plant, ct.tf([2.0, -1.8], [1, -1], 0.01))
    >>> cr.design.delay_robustness(plant, predictor, (0.08, 0.12))
    <DelayRobustness stable in 0.08...0.12 s>

    In continuous time:

    >>> plant = ct.tf([1], [0.08, 1]) * cr.delay(0.1)
    >>> predictor = cr.design.smith_predictor(plant, ct.tf([0.16, 2.0], [0.08, 0]))
    >>> found = cr.design.delay_robustness(plant, predictor, (0.08, 0.12))
    >>> print(f"stable from {found.stable_from:.4f} to {found.stable_to:.4f} s")
    stable from 0.0000 to 0.2490 s
    """
    purpose, nominal = "robustness to the dead time", 0.0
    if is_continuous(system):
        core, nominal = core_and_dead_time(system, purpose)
    else:
        core = system = delayed_system(system, purpose)
        warn_unresolved(system)
    interval = interval_of_dead_time(system, dead_time_interval)
    if interval is None:
        raise OptionError(
            "the model has no dead-time interval; give dead_time_interval=(low, high) in s"
        )
    loop = open_loop(core, controller, nominal)
    found = loop_margins(loop)
    if loop.dt:
        return over_interval(system, loop, found, interval, MAX_DELAYS)
    delays = np.unique([*np.linspace(*interval, MAX_DELAYS), nominal])
    return _tried(system, loop, found, delays, interval, nominal)


def over_interval(
    plant: DelayedStateSpace, loop: Loop, found: Margins, interval: tuple[float, float], most: int
) -> DelayRobustness:
    """Vary the delay of the first factor of a loop, the plant; `found` are the nominal margins.

    Within the interval at most `most` delays are tried, including its ends.
    """
    low, high = interval
    nominal, dt, held = int(plant.delay), float(plant.dt), held_fraction(plant)
    first = int(np.floor((low + held) / dt + 1e-9))
    last = int(np.ceil((high + held) / dt - 1e-9))
    step = max(1, -(-(last - first) // (most - 1)))
    delays = np.unique([*range(first, last, step), last, nominal]).astype(np.int64)
    return _tried(plant, loop, found, delays, interval, nominal, held)


def _tried(
    system: Any,
    loop: Loop,
    found: Margins,
    delays: Any,
    interval: tuple[float, float],
    nominal: float,
    held: float = 0.0,
) -> DelayRobustness:
    """Compute the margins at each delay, in samples, or in s for a continuous loop."""
    known = found.modulus_margin if found.stable else 0.0
    sizes = np.array(
        [known if d == nominal else distance_if_stable(_with_delay(loop, d)) for d in delays]
    )
    (earlier, later), unit = _room(found), loop.dt or 1.0
    return DelayRobustness(
        delays=locked(delays),
        stable_at=locked(sizes > 0),
        modulus_margin=read_only(sizes),
        dead_time_interval=interval,
        nominal=nominal,
        dt=loop.dt,
        stable_from=float(np.maximum(0.0, unit * (nominal - earlier) - held)),
        stable_to=unit * (nominal + later) - held,
        fractional_time=held,
        time_unit=shown_time_unit(system),
    )


def _with_delay(loop: Loop, delay: float) -> Loop:
    if not loop.dt:
        return replace(loop, dead_time=float(delay))
    # The matrices for such a long delay are not needed for its response.
    plant = replace(loop.factors[0], delay=int(delay))
    return replace(loop, factors=(plant, *loop.factors[1:]))


def _room(found: Margins) -> tuple[float, float]:
    """Samples, or s, by which the delay may decrease and increase; nan for an unstable loop.

    The gain of the loop does not depend on the delay: stability is only lost where the loop
    response at one of its gain crossovers passes -1.
    """
    if not found.stable:
        return float("nan"), float("nan")
    lag = np.mod(np.radians(found.phase_margins), 2 * np.pi)
    waits = np.array([2 * np.pi - lag, lag]) / found.gain_crossovers / (found.dt or 1.0)
    earlier, later = waits.min(axis=1, initial=np.inf)
    if found.dt:
        earlier, later = np.ceil(earlier) - 1, np.ceil(later) - 1
    return float(earlier), float(later)
