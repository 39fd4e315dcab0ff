"""Stability and margins of a controller over a range of dead times."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..._wording import in_time, interval_in_time
from ...numerics.arrays import BoolArray, FloatArray, IntArray
from ...results import Result

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False, repr=False)
class DelayRobustness(Result):
    """Stability and margins of one controller over a range of dead times.

    ``stable`` is true if the loop is stable for every delay within `dead_time_interval` (widened to
    whole samples and to the nominal delay); `stable_from` and `stable_to` are the ends of the range
    around the nominal delay in which it is stable.

    Attributes
    ----------
    delays : ndarray, shape (K,)
        Delays that were tried, increasing: in samples, or in s for a continuous loop. They are
        within the interval, but for the nominal one, which is always among them.
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
    time_unit : str
        Of plots: min, h or day of the record of the plant, otherwise s.

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
    time_unit: str = "s"

    @property
    def stable(self) -> bool:
        """Stable over the whole interval, including delays between those tried."""
        times = self.dead_times
        slack = 1e-6 * self.dt or 1e-9 * times.max()
        # nan, for a loop that is unstable at the nominal delay, compares as false.
        return bool(
            self.stable_from <= max(times.min(), 0.0) + slack
            and times.max() <= self.stable_to + slack
        )

    @property
    def worst_modulus_margin(self) -> float:
        """Smallest modulus margin over the interval; its inverse is the worst Ms."""
        return float(self.modulus_margin.min())

    @property
    def dead_times(self) -> FloatArray:
        """Dead times in s that belong to `delays`."""
        return np.asarray(self.delays * (self.dt or 1.0) - self.fractional_time, dtype=np.float64)

    @property
    def nominal_dead_time(self) -> float:
        """Nominal dead time in s."""
        return self.nominal * (self.dt or 1.0) - self.fractional_time

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

    _heading = "Robustness to the dead time"

    def _rows(self) -> list[tuple[str, str]]:
        low, high = self.dead_time_interval
        samples = f" ({self.nominal} samples)" if self.dt else ""
        return [
            ("nominal", in_time(self.nominal_dead_time, 4) + samples),
            ("interval", interval_in_time(low, high)),
            ("over the interval", "stable" if self.stable else "UNSTABLE somewhere"),
            ("worst modulus margin", f"{self.worst_modulus_margin:.4g}"),
            ("stable", f"from {in_time(self.stable_from, 4)} to {in_time(self.stable_to, 4)}"),
        ]

    def __repr__(self) -> str:
        word = "stable" if self.stable else "unstable somewhere"
        low, high = self.dead_time_interval
        return f"<DelayRobustness {word} in {low:.4g}...{high:.4g} s>"
