"""Stability margins, exact at any dead time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import control as ct
import numpy as np

from ..._checks import not_negative
from ..._flags import Flag, flagged
from ...data.shown_units import unit_among
from ...errors import OptionError
from ...numerics.arrays import ComplexArray, FloatArray, locked, read_only
from ...numerics.loops.crossings import (
    encircled,
    follow,
    negative_axis_crossings,
    smallest_distance,
    unit_crossings,
)
from ..resolved import warn_unresolved
from .data_loops import DataLoop, data_loop
from .loop import Loop, open_loop
from .margin_intervals import margin_intervals
from .margin_result import Margins

Curve = Callable[[FloatArray], ComplexArray]
"""Response of a loop at frequencies in rad/s."""

MARGINAL = 1e-9
"""Distance to -1 below which the closed loop counts as being on the stability boundary."""


def margins(
    loop: Any,
    controller: Any = None,
    *,
    dead_time: float = 0.0,
    unstable_poles: int = 0,
    integrators: int | None = None,
) -> Margins:
    """Compute gain, phase, modulus and delay margin of a loop, exact at any dead time.

    All crossovers are bracketed on the exact frequency response, core(z) z^-d, and computed by root
    finding. Stability is determined by a Nyquist count.

    Parameters
    ----------
    loop : system or FrequencyResponseData
        The open loop, or the plant if `controller` is given. Discrete systems, among them
        `DelayedStateSpace`, continuous systems, or a measured response.
    controller : system or float, optional
        Controller; the loop is then plant times controller with negative feedback. It is better to
        give both separately than their product, because cancelled poles are then counted.
    dead_time : float, optional
        Additional dead time in s, for continuous systems.
    unstable_poles : int, optional
        For data only: number of unstable poles of the loop.
    integrators : int, optional
        For data only: number of integrators of the loop; default: from the slope of the gain over
        the lowest octave.

    Returns
    -------
    Margins

    Raises
    ------
    UnsuitableSystemError
        Several channels, mixed or missing time bases, an improper system.
    OptionError
        An option that does not apply to this kind of loop.

    Notes
    -----
    python-control's ``stability_margins`` uses the characteristic polynomial of the augmented
    matrix and is silently wrong from about d = 37 on.

    Gain and phase margin and the modulus margin 1/Ms (the *stability margin* of [1]_) are computed
    at the crossovers of the loop; the delay margin is the smallest ratio of phase margin and
    crossover frequency [2]_. Encirclements are counted by the generalized Nyquist criterion [1]_. A
    discrete controller acts on a measured plant through its hold, which is included unless the
    response has a ``sample_time``, whose hold is part of it.

    References
    ----------
    .. [1] K. J. Astrom and R. M. Murray, Feedback Systems, 2nd ed., Princeton University Press
       2021, sections 10.2 and 10.3.
    .. [2] S. Skogestad and I. Postlethwaite, Multivariable Feedback Control, 2nd ed., Wiley 2005,
       section 2.4.

    Examples
    --------
    >>> import control as ct
    >>> import ctrl_realize as cr
    >>> valve = cr.delayed_ss(ct.tf([1], [0.08, 1]), dead_time=0.029, dt=0.001)
    >>> pi = ct.ss(ct.tf([1, -0.99], [1, -1], 0.001))
    >>> found = cr.design.margins(valve, pi)
    >>> found.stable, round(found.gain_margin, 3), round(found.phase_margin, 2)
    (True, 4.437, 77.4)
    >>> round(1e3 * found.delay_margin, 1)
    121.2
    """
    if any(isinstance(one, ct.FrequencyResponseData) for one in (loop, controller)):
        if dead_time:
            raise OptionError(
                "dead_time is for continuous systems; for data, multiply them by exp(-j "
                "omega tau) instead"
            )
        found = _from_data(data_loop(loop, controller, unstable_poles, integrators))
        return replace(found, time_unit=unit_among(loop, controller))
    if unstable_poles or integrators is not None:
        raise OptionError(
            "unstable_poles and integrators are for measured responses; for systems they are "
            "computed"
        )
    dead_time = not_negative(dead_time, "dead_time", "dead time in s")
    exact = open_loop(loop, controller, dead_time)
    if dead_time and exact.dt:
        raise OptionError(
            f"dead_time={dead_time:g} s with a discrete loop; put the delay into the plant "
            "(delayed_ss, or .replace(delay=...))"
        )
    warn_unresolved(loop)
    return loop_margins(exact)


def loop_margins(loop: Loop) -> Margins:
    """Margins of a loop."""
    omega, values = follow(loop, loop.grid())
    count, closest = closed_loop_count(loop, omega, values), _from_the_start(loop, omega, values)
    phases = _with_ends(loop, negative_axis_crossings(loop, omega, values))
    plain = _collect(loop, omega, values, phases, closest, *count, loop.dt)
    # So close to -1 the count is not reliable.
    stable = plain.stable and plain.modulus_margin > MARGINAL
    room = plain.delay_margin if stable else np.nan
    return replace(plain, stable=stable, delay_margin=room, time_unit=loop.time_unit)


def distance_if_stable(loop: Loop) -> float:
    """Modulus margin of a loop, without the others; 0 if it is not stable."""
    omega, values = follow(loop, loop.grid())
    count, marginal = closed_loop_count(loop, omega, values)
    if count or marginal:
        return 0.0
    distance, _ = _from_the_start(loop, omega, values)
    return distance if distance > MARGINAL else 0.0


def _closest(loop: Curve, omega: FloatArray, values: ComplexArray) -> tuple[float, float]:
    """Smallest distance to -1, and the frequency where it is reached."""
    return smallest_distance(lambda w: 1 + loop(w), omega, 1 + values)


def _from_the_start(loop: Loop, omega: FloatArray, values: ComplexArray) -> tuple[float, float]:
    """The same from frequency 0 on."""
    start = float(abs(1 + loop(np.zeros(1))[0]))
    distance, closest = _closest(loop, omega, values)
    return (start, 0.0) if start < distance else (distance, closest)


def _with_ends(loop: Loop, phases: FloatArray) -> FloatArray:
    """Add omega = 0 and the Nyquist frequency if the real response there is negative."""
    start = loop(np.zeros(1))[0]
    if np.isfinite(start) and start.real < 0:
        phases = np.concatenate([[0.0], phases])
    if not loop.dt:
        return phases
    top = np.pi / loop.dt
    end = loop(np.array([top]))[0]
    near = phases.size > 0 and abs(phases[-1] - top) < 1e-9 * top
    if end.real < 0 and abs(end.imag) < 1e-6 * abs(end) and not near:
        phases = np.concatenate([phases, [top]])
    return phases


def closed_loop_count(
    loop: Loop, omega: FloatArray, response: ComplexArray | None = None
) -> tuple[int, bool]:
    """Count the closed-loop poles outside the stability region.

    `response` is that of the loop at `omega`, if it is known.

    Returns
    -------
    count : int
    marginal : bool
        A closed-loop pole is too close to the boundary for a decision.
    """
    known = None if response is None else (1 + response) * loop.open_characteristic(omega)
    _, values = follow(loop.characteristic, omega, values=known)
    if not loop.dt:
        # The grid ends where the loop has no gain left that could encircle -1. Its factors may
        # still turn there, as those of a controller with a pole at 0 and a fast one do.
        rest = loop.beyond(float(omega[-1]))
        if rest.size:
            values = np.concatenate([values, follow(loop.open_characteristic, rest)[1]])
    return encircled(values)


def _stability_flags(count: int, marginal: bool) -> tuple[Flag, ...]:
    if marginal:
        return (flagged("marginal"),)
    return (flagged("unstable.loop", count=count),) if count else ()


def _collect(
    loop: Curve, omega: FloatArray, values: ComplexArray, phases: FloatArray,
    closest: tuple[float, float], count: int, marginal: bool, dt: float,
) -> Margins:  # fmt: skip
    """Compute the margins of a loop whose unstable poles are counted, on the grid `omega`.

    `phases` are the frequencies where it is real and negative, `closest` is its smallest distance
    to -1, and the frequency where it is reached.
    """
    gains = unit_crossings(loop, omega, values)
    # -1 is at 180 deg: the angle of -L is the phase margin, in -180...180.
    pm = np.degrees(np.angle(-loop(gains)))
    gm = 1 / np.abs(loop(phases))
    waits = np.where(pm < 0, pm + 360, pm) * np.pi / 180 / gains
    stable = count == 0 and not marginal
    return Margins(
        gain_margin=float(gm[np.argmin(np.abs(np.log(gm)))]) if gm.size else float("inf"),
        phase_margin=float(pm[np.argmin(np.abs(pm))]) if pm.size else float("inf"),
        modulus_margin=closest[0],
        delay_margin=float(waits.min(initial=np.inf)) if stable else float("nan"),
        stable=stable,
        unstable_poles=count,
        gain_crossovers=read_only(gains),
        phase_crossovers=read_only(phases),
        phase_margins=read_only(pm),
        gain_margins=read_only(gm),
        modulus_crossover=closest[1],
        dt=dt,
        response=(read_only(omega), locked(values)),
        flags=_stability_flags(count, marginal),
    )


def _from_data(loop: DataLoop) -> Margins:
    omega, values = loop.dense()
    closest = _closest(loop, omega, values)
    phases = negative_axis_crossings(loop, omega, values)
    plain = _collect(loop, omega, values, phases, closest, *loop.closed_loop_count(), 0.0)
    flags = (*plain.flags, *loop.flags())
    intervals = {} if loop.points.std is None else margin_intervals(loop, plain)
    if intervals and plain.stable and intervals["modulus_margin"][0] == 0:
        flags = (*flags, flagged("within_noise"))
    return replace(plain, intervals=intervals, flags=flags)
