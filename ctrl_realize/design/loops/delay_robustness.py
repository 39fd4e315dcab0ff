"""Robustness of a loop to the dead time."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..._wording import in_time, interval_in_time
from ...delayed import DelayedStateSpace
from ...errors import OptionError
from ...numerics.arrays import BoolArray, FloatArray, IntArray, locked, read_only
from ...numerics.blas_threads import single_threaded
from ...results import Result
from ..resolved import warn_unresolved
from ..siso import (
    core_and_dead_time,
    delayed_system,
    held_fraction,
    interval_of_dead_time,
    is_continuous,
)
from .loop import Loop, open_loop
from .margin_result import Margins
from .margins import loop_margins

if TYPE_CHECKING:
    import pandas as pd

MAX_DELAYS = 21
"""Largest number of delays that are tried within an interval."""


@dataclass(frozen=True, eq=False, repr=False)
class DelayRobustness(Result):
    """Stability and margins of one controller over a range of dead times.

    ``stable`` is true if the loop is stable for every delay within `dead_time_interval` (widened to
    whole samples and to the nominal delay); `stable_from` and `stable_to` are the ends of the range
    around the nominal delay in which it is stable.

    Attributes
    ----------
    delays : ndarray, shape (K,)
        Delays that were tried, increasing: in samples, or in s for a continuous loop.
    stable_at : ndarray of bool, shape (K,)
    modulus_margin : ndarray, shape (K,)
        ``min |1 + L|``; 0 if unstable.
    dead_time_interval : tuple of float
        In s, from the identification or as given.
    nominal : float
        Nominal delay of the system, in samples or s.
    dt : float
        Sample time in s; 0 for a continuous loop.
    stable_from, stable_to : float
        Dead times in s, of a discrete loop in whole samples; beyond them the loop is unstable.
    fractional_time : float
        Time in s by which the delay exceeds the dead time, if the core contains a fraction of a
        sample: ``dead_times = delays * dt - fractional_time``.

    Examples
    --------
    >>> import control as ct
    >>> import ctrl_realize as cr
    >>> plant = cr.delayed_ss(ct.tf([1], [0.08, 1]), dead_time=0.1, dt=0.01)
    >>> predictor = cr.design.smith_predictor(plant, ct.tf([4.0, -3.8], [1, -1], 0.01))
    >>> found = cr.design.delay_robustness(plant, predictor, (0.08, 0.12))
    >>> print(f"stable from {found.stable_from:.2f} to {found.stable_to:.2f} s")
    stable from 0.08 to 0.12 s
    >>> print(f"worst modulus margin {found.worst_modulus_margin:.2f}")
    worst modulus margin 0.11
    """

    delays: IntArray | FloatArray
    stable_at: BoolArray
    modulus_margin: FloatArray
    dead_time_interval: tuple[float, float]
    nominal: float
    dt: float
    stable_from: float
    stable_to: float
    fractional_time: float = 0.0

    @property
    def stable(self) -> bool:
        """Stable over the whole interval, including delays between those tried."""
        times = self.dead_times[self._inside()]
        slack = 1e-6 * self.dt or 1e-9 * times.max()
        # nan, for a loop that is unstable at the nominal delay, compares as false.
        return bool(
            self.stable_from <= max(times.min(), 0.0) + slack
            and times.max() <= self.stable_to + slack
        )

    @property
    def worst_modulus_margin(self) -> float:
        """Smallest modulus margin over the interval; its inverse is the worst Ms."""
        return float(self.modulus_margin[self._inside()].min())

    @property
    def dead_times(self) -> FloatArray:
        """Dead times in s that belong to `delays`."""
        return np.asarray(self.delays * (self.dt or 1.0) - self.fractional_time, dtype=np.float64)

    @property
    def nominal_dead_time(self) -> float:
        """Nominal dead time in s."""
        return self.nominal * (self.dt or 1.0) - self.fractional_time

    def _inside(self) -> BoolArray:
        low, high = self.dead_time_interval
        if not self.dt:
            inside = (self.delays >= low) & (self.delays <= high)
            return np.asarray(inside | (self.delays == self.nominal), dtype=np.bool_)
        inside = (self.delays >= np.floor((low + self.fractional_time) / self.dt + 1e-9)) & (
            self.delays <= np.ceil((high + self.fractional_time) / self.dt - 1e-9)
        )
        return np.asarray(inside | (self.delays == self.nominal), dtype=np.bool_)

    def table(self) -> pd.DataFrame:
        """One row for each delay."""
        import pandas as pd

        return pd.DataFrame(
            {
                "delay": self.delays,
                "dead_time": self.dead_times,
                "stable": self.stable_at,
                "modulus_margin": self.modulus_margin,
            }
        )

    def _title(self) -> str:
        return "Robustness to the dead time"

    def _rows(self) -> list[tuple[str, str]]:
        low, high = self.dead_time_interval
        return [
            (
                "nominal",
                in_time(self.nominal_dead_time, 4)
                + (f" ({self.nominal} samples)" if self.dt else ""),
            ),
            ("interval", interval_in_time(low, high)),
            ("over the interval", "stable" if self.stable else "UNSTABLE somewhere"),
            ("worst modulus margin", f"{self.worst_modulus_margin:.4g}"),
            ("stable", f"from {in_time(self.stable_from, 4)} to {in_time(self.stable_to, 4)}"),
        ]

    def __repr__(self) -> str:
        word = "stable" if self.stable else "unstable somewhere"
        low, high = self.dead_time_interval
        return f"<DelayRobustness {word} in {low:.4g}...{high:.4g} s>"


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
    if is_continuous(system):
        return _continuous(system, controller, dead_time_interval)
    plant = delayed_system(system, "robustness to the dead time")
    warn_unresolved(plant)
    interval = _interval(plant, dead_time_interval)
    loop = open_loop(plant, controller)
    return over_interval(plant, loop, loop_margins(loop), interval, MAX_DELAYS)


def _interval(plant: Any, given: tuple[float, float] | None) -> tuple[float, float]:
    interval = interval_of_dead_time(plant, given)
    if interval is None:
        raise OptionError(
            "the model has no dead-time interval; give dead_time_interval=(low, high) in s"
        )
    return interval


def _continuous(system: Any, controller: Any, given: tuple[float, float] | None) -> DelayRobustness:
    core, nominal = core_and_dead_time(system, "robustness to the dead time")
    interval = _interval(system, given)
    loop = open_loop(core, controller, nominal)
    found = loop_margins(loop)
    delays = np.unique([*np.linspace(*interval, MAX_DELAYS), nominal])
    sizes = np.array(
        [
            _modulus(found if d == nominal else loop_margins(replace(loop, dead_time=float(d))))
            for d in delays
        ]
    )
    earlier, later = _room(found)
    return DelayRobustness(
        delays=read_only(delays),
        stable_at=locked(sizes > 0),
        modulus_margin=read_only(sizes),
        dead_time_interval=interval,
        nominal=nominal,
        dt=0.0,
        stable_from=float(np.maximum(0.0, nominal - earlier)),
        stable_to=nominal + later,
    )


def over_interval(
    plant: DelayedStateSpace,
    loop: Loop,
    found: Margins,
    interval: tuple[float, float],
    most: int,
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
    sizes = np.array([_modulus(found if d == nominal else _at(loop, int(d))) for d in delays])
    earlier, later = _room(found)
    return DelayRobustness(
        delays=locked(delays),
        stable_at=locked(sizes > 0),
        modulus_margin=read_only(sizes),
        dead_time_interval=interval,
        nominal=nominal,
        dt=dt,
        stable_from=float(np.maximum(0.0, dt * (nominal - earlier) - held)),
        stable_to=dt * (nominal + later) - held,
        fractional_time=held,
    )


def _at(loop: Loop, delay: int) -> Margins:
    # The matrices for such a long delay are not needed for its response.
    plant = replace(loop.factors[0], delay=delay)
    return loop_margins(replace(loop, factors=(plant, *loop.factors[1:])))


def _modulus(found: Margins) -> float:
    return found.modulus_margin if found.stable else 0.0


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
