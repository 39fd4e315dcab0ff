"""What a loop does when the dead time is not the one it was designed for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import OptionError
from ..numerics.arrays import FloatArray, IntArray, read_only
from ..results import Result
from .margins import margins
from .siso import delayed_system

if TYPE_CHECKING:
    import pandas as pd

MAX_DELAYS = 21


@dataclass(frozen=True, eq=False, repr=False)
class DelayRobustness(Result):
    """Stability and margins of one controller over a range of dead times.

    ``stable`` is true when the loop is stable for every delay within `dead_time_interval`;
    `stable_from` and `stable_to` bound the whole range around the nominal delay that is.

    Attributes
    ----------
    delays : ndarray of int, shape (K,)
        Delays tried, in samples, rising.
    stable_at : ndarray of bool, shape (K,)
    modulus_margin : ndarray, shape (K,)
        ``min |1 + L|``; 0 where unstable.
    dead_time_interval : tuple of float
        In s, from the identification or as given.
    nominal : int
        Delay of the system as given.
    dt : float
    stable_from, stable_to : float
        Dead times in s, in whole samples; beyond them the loop is unstable.
    """

    delays: IntArray
    stable_at: np.ndarray[Any, np.dtype[np.bool_]]
    modulus_margin: FloatArray
    dead_time_interval: tuple[float, float]
    nominal: int
    dt: float
    stable_from: float
    stable_to: float

    @property
    def stable(self) -> bool:
        """Stable over the whole interval."""
        return bool(self.stable_at[self._inside()].all())

    @property
    def worst_modulus_margin(self) -> float:
        """Smallest modulus margin over the interval; its inverse is the worst Ms."""
        return float(self.modulus_margin[self._inside()].min())

    def _inside(self) -> np.ndarray[Any, np.dtype[np.bool_]]:
        low, high = self.dead_time_interval
        inside = (self.delays >= np.floor(low / self.dt + 1e-9)) & (
            self.delays <= np.ceil(high / self.dt - 1e-9)
        )
        return np.asarray(inside | (self.delays == self.nominal), dtype=np.bool_)

    def table(self) -> pd.DataFrame:
        """One row for each delay."""
        import pandas as pd

        return pd.DataFrame(
            {
                "delay": self.delays,
                "dead_time": self.delays * self.dt,
                "stable": self.stable_at,
                "modulus_margin": self.modulus_margin,
            }
        )

    def _title(self) -> str:
        return "Robustness to the dead time"

    def _rows(self) -> list[tuple[str, str]]:
        low, high = self.dead_time_interval
        return [
            ("nominal", f"{self.nominal * self.dt:.4g} s ({self.nominal} samples)"),
            ("interval", f"{low:.4g} ... {high:.4g} s"),
            ("over the interval", "stable" if self.stable else "UNSTABLE somewhere"),
            ("worst modulus margin", f"{self.worst_modulus_margin:.4g}"),
            ("stable", f"from {self.stable_from:.4g} to {self.stable_to:.4g} s"),
        ]

    def __repr__(self) -> str:
        word = "stable" if self.stable else "unstable somewhere"
        low, high = self.dead_time_interval
        return f"<DelayRobustness {word} in {low:.4g}...{high:.4g} s>"


def delay_robustness(
    system: Any, controller: Any, dead_time_interval: tuple[float, float] | None = None
) -> DelayRobustness:
    """Check a controller over an interval of dead times.

    Parameters
    ----------
    system : DelayedStateSpace
        Plant; its core stays, its delay is varied.
    controller : system
        Of the same sample time.
    dead_time_interval : (float, float), optional
        In s; by default that of the identification, ``system.fit.dead_time_interval``.

    Returns
    -------
    DelayRobustness

    Raises
    ------
    OptionError
        No interval given and none known, or one that is none.

    Examples
    --------
    >>> import control as ct
    >>> import ctrl_realize as cr
    >>> plant = cr.delayed_ss(ct.tf([1], [0.08, 1]), dead_time=0.1, dt=0.01)
    >>> predictor = cr.design.smith_predictor(plant, ct.tf([2.0, -1.8], [1, -1], 0.01))
    >>> cr.design.delay_robustness(plant, predictor, (0.08, 0.12))
    <DelayRobustness stable in 0.08...0.12 s>
    """
    plant = delayed_system(system, "robustness to the dead time")
    if dead_time_interval is None:
        dead_time_interval = getattr(plant.fit, "dead_time_interval", None)
        if dead_time_interval is None:
            raise OptionError(
                "the system carries no interval of its dead time; give "
                "dead_time_interval=(low, high) in s"
            )
    low, high = (float(x) for x in dead_time_interval)
    if not 0 <= low <= high < np.inf:
        raise OptionError(
            f"dead_time_interval=({low:g}, {high:g}); needed is 0 <= low <= high in s"
        )
    nominal, dt = int(plant.delay), float(plant.dt)
    first, last = int(np.floor(low / dt + 1e-9)), int(np.ceil(high / dt - 1e-9))
    step = max(1, -(-(last - first) // (MAX_DELAYS - 1)))
    delays = np.unique([*range(first, last, step), last, nominal]).astype(np.int64)
    found = {int(d): _margin(plant, controller, int(d)) for d in delays}

    def is_stable(delay: int) -> bool:
        if delay not in found:
            found[delay] = _margin(plant, controller, delay)
        return found[delay] > 0

    return DelayRobustness(
        delays=delays,
        stable_at=np.array([found[int(d)] > 0 for d in delays]),
        modulus_margin=read_only(np.array([found[int(d)] for d in delays])),
        dead_time_interval=(low, high),
        nominal=nominal,
        dt=dt,
        stable_from=dt * _edge(is_stable, nominal, -1),
        stable_to=dt * _edge(is_stable, nominal, +1),
    )


def _margin(plant: Any, controller: Any, delay: int) -> float:
    found = margins(plant.replace(delay=delay, fit=None), controller)
    return found.modulus_margin if found.stable else 0.0


def _edge(is_stable: Any, start: int, direction: int) -> float:
    """Walk from a stable delay in growing strides, then bisect to the last stable one."""
    if not is_stable(start):
        return float("nan")
    good, stride = start, 1
    while True:
        there = max(0, good + direction * stride)
        if there == good:
            return float(good)
        if not is_stable(there):
            break
        good, stride = there, 2 * stride
        if good > 100 * (start + 100):
            return float("inf")
    bad = there
    while abs(bad - good) > 1:
        middle = (bad + good) // 2
        good, bad = (middle, bad) if is_stable(middle) else (good, middle)
    return float(good)
