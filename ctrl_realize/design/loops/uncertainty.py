"""Bounds of the uncertainty of an identified model."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import control as ct
import numpy as np
from numpy.typing import ArrayLike

from ..._checks import numbers
from ...delayed import DelayedStateSpace, DelaySystem
from ...errors import DataError, OptionError
from ...identification.campaign.campaign import Campaign
from ...numerics.arrays import ComplexArray, FloatArray, read_only
from ..models.conversions import held_fraction
from ..resolved import warn_unresolved
from ..siso import (
    core_and_dead_time,
    delayed_system,
    interval_of_dead_time,
    is_continuous,
    with_dead_time,
)
from .robust_stability import UncertaintyBound

GRID_POINTS = 400
"""Default number of frequencies of a bound."""


def uncertainty_bound(
    systems: Any,
    nominal: DelayedStateSpace | DelaySystem | None = None,
    omega: ArrayLike | None = None,
    *,
    dead_time_interval: tuple[float, float] | None = None,
) -> UncertaintyBound:
    """Bound the relative error of a nominal model by the spread of models and of the dead time.

    Parameters
    ----------
    systems : Campaign or sequence of systems
        Models of the same plant, all discrete or all continuous; may be empty if only the dead time
        is uncertain.
    nominal : DelayedStateSpace or DelaySystem, optional
        Default: the campaign's ``system``, or the first of the sequence.
    omega : array_like, optional
        rad/s, increasing, > 0; default: 400 points up to the Nyquist frequency, for a continuous
        system up to a hundred times its fastest pole or the inverse of its dead time.
    dead_time_interval : (float, float), optional
        In s; default: that of the nominal model's identification, if it has one. Its effect is
        added to the spread of the systems, which is computed at their own delays.

    Returns
    -------
    UncertaintyBound

    Raises
    ------
    OptionError
        There is nothing to make a bound from.
    DataError
        Frequencies that do not increase, or systems with another sample time.

    Notes
    -----
    The bound is on the multiplicative (relative) uncertainty of [1]_: plants ``G (1 + Delta)`` with
    ``|Delta(j w)|`` at most the bound. An error x of the dead time alone gives ``|exp(-j w x) -
    1|``.

    References
    ----------
    .. [1] S. Skogestad and I. Postlethwaite, Multivariable Feedback Control, 2nd ed., Wiley 2005,
       section 7.4 (Representing uncertainty in the frequency domain).

    Examples
    --------
    >>> import control as ct
    >>> import ctrl_realize as cr
    >>> plant = cr.delayed_ss(ct.tf([1], [0.08, 1]), dead_time=0.03, dt=0.001)
    >>> others = [plant.replace(delay=29), 1.1 * plant]
    >>> bound = cr.design.uncertainty_bound(others, plant)
    >>> bound.check(cr.design.pid(plant))
    <RobustnessCheck robust: margin 10 at 0.33 rad/s>
    """
    models = _models(systems)
    if nominal is None:
        nominal = systems.system if isinstance(systems, Campaign) else next(iter(models), None)
    if nominal is None:
        raise OptionError(
            "expected systems or a nominal system, got neither; give nominal and dead_time_interval"
        )
    plant, dead_time = _plant(nominal)
    warn_unresolved(plant)
    interval = interval_of_dead_time(plant, dead_time_interval)
    if not models and interval is None:
        raise OptionError(
            "no systems to compare and no dead-time interval; give dead_time_interval in s"
        )
    grid = _grid(plant, dead_time, omega)
    base = _response(plant, grid)
    spread = np.zeros(grid.size)
    for model in models:
        other = _plant(model)[0]
        if not np.isclose(other.dt, plant.dt, rtol=1e-6, atol=0):
            raise DataError(f"a system has dt={other.dt:g} s, the nominal one dt={plant.dt:g} s")
        spread = np.maximum(spread, np.abs(_response(other, grid) / base - 1))
    delay_part = np.zeros(grid.size)
    if interval is not None:
        low, high = interval
        off = max(abs(low - dead_time), abs(high - dead_time))
        # |exp(-jx) - 1| increases to 2 at x = pi; beyond that a smaller error gives 2.
        delay_part = 2 * np.sin(np.minimum(grid * off, np.pi) / 2)
    return UncertaintyBound(
        omega=read_only(grid),
        bound=read_only(spread + delay_part),
        spread=read_only(spread),
        delay_part=read_only(delay_part),
        nominal=plant,
        n_systems=len(models),
    )


def _models(systems: Any) -> list[Any]:
    if isinstance(systems, Campaign):
        return [row.system for row in systems.good]
    if isinstance(systems, ct.StateSpace) or not isinstance(systems, Iterable):
        raise OptionError(
            f"systems is a {type(systems).__name__}; expected a Campaign or a list of systems"
        )
    return list(systems)


def _plant(system: Any) -> tuple[DelayedStateSpace | DelaySystem, float]:
    """Check a system, and return it with its dead time in s."""
    purpose = "an uncertainty bound"
    if is_continuous(system):
        _, dead_time = core_and_dead_time(system, purpose)
        return with_dead_time(system, purpose), dead_time
    plant = delayed_system(system, purpose)
    return plant, float(plant.dead_time) - held_fraction(plant)


def _grid(
    plant: DelayedStateSpace | DelaySystem, dead_time: float, omega: ArrayLike | None
) -> FloatArray:
    if omega is None:
        if isinstance(plant, DelayedStateSpace):
            top = 0.999 * np.pi / plant.dt
            slow = np.abs(np.log(np.abs(np.asarray(plant.delay_free.poles())) + 1e-12)) / plant.dt
        else:
            slow = np.abs(plant.core.poles())
            top = 100 * max(slow.max(initial=0.0), 1 / dead_time if dead_time else 0.0) or 1.0
        slowest = slow[slow > 1e-9 * top].min(initial=top)
        return np.geomspace(np.clip(1e-3 * slowest, 1e-8 * top, 0.01 * top), top, GRID_POINTS)
    grid = numbers(omega, "omega")
    if grid.ndim != 1 or grid.size == 0 or grid[0] <= 0 or np.any(np.diff(grid) <= 0):
        raise DataError("omega must be increasing and > 0, in rad/s")
    return grid


def _response(system: DelayedStateSpace | DelaySystem, omega: FloatArray) -> ComplexArray:
    points = np.exp(1j * omega * system.dt) if system.dt else 1j * omega
    return np.asarray(system.horner(points)[0, 0], dtype=np.complex128)
