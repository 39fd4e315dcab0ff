"""Robust stability of a loop against a multiplicative uncertainty: the small-gain theorem."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import control as ct
import numpy as np

from ..._checks import check_type
from ...delayed import DelayedStateSpace, DelaySystem
from ...numerics.arrays import FloatArray, read_only
from ...numerics.blas_threads import single_threaded
from ...results import Result
from .loop import open_loop
from .margin_result import Margins
from .margins import margins


@dataclass(frozen=True, eq=False, repr=False)
class UncertaintyBound(Result):
    """Multiplicative uncertainty: every plant is ``nominal (1 + Delta)``, ``|Delta| <= bound``.

    ``bound = spread + delay_part``, the largest relative difference of the given systems and the
    effect ``|exp(-j omega x) - 1|`` of the largest error x of the dead time.

    Attributes
    ----------
    omega : ndarray, shape (K,)
        rad/s.
    bound, spread, delay_part : ndarray, shape (K,)
        Ratios.
    nominal : DelayedStateSpace or DelaySystem
    n_systems : int
        Number of systems behind the spread.

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> plant = cr.design.ProcessModel(gain=1.0, lag=0.08, dead_time=0.03).system(0.001)
    >>> omega = np.array([1.0, 10.0])
    >>> found = cr.design.uncertainty_bound(
    ...     [1.1 * plant], plant, omega, dead_time_interval=(0.025, 0.035)
    ... )
    >>> print(found.spread.round(3), found.delay_part.round(3), found.bound.round(3))
    [0.1 0.1] [0.005 0.05 ] [0.105 0.15 ]
    """

    omega: FloatArray
    bound: FloatArray
    spread: FloatArray
    delay_part: FloatArray
    nominal: DelayedStateSpace | DelaySystem
    n_systems: int

    @property
    def frd(self) -> ct.FrequencyResponseData:
        """The bound as a `control.FrequencyResponseData`."""
        return ct.frd(self.bound.astype(complex), self.omega, name="uncertainty", smooth=True)

    def check(self, controller: Any) -> RobustnessCheck:
        """Test a controller with this bound, see `robust_stability`."""
        return robust_stability(self, controller)

    _heading = "Multiplicative uncertainty"

    def _rows(self) -> list[tuple[str, str]]:
        above = np.flatnonzero(self.bound >= 1)
        where = f"{self.omega[above[0]]:.4g} rad/s" if above.size else "nowhere on the grid"
        return [
            ("systems", str(self.n_systems)),
            ("at low frequency", f"{100 * self.bound[0]:.3g} %"),
            ("reaches 100 % at", where),
        ]

    def __repr__(self) -> str:
        return (
            f"<UncertaintyBound {100 * self.bound[0]:.3g} % at {self.omega[0]:.3g} rad/s ... "
            f"{100 * self.bound[-1]:.3g} % at {self.omega[-1]:.3g} rad/s>"
        )


@dataclass(frozen=True, eq=False, repr=False)
class RobustnessCheck(Result):
    """Result of a robust-stability test (small-gain theorem).

    ``robust`` is ``nominal.stable`` and ``|T| bound < 1`` at every frequency; `margin` is the
    factor by which the bound can be multiplied before this fails.

    Attributes
    ----------
    robust : bool
    margin : float
    omega_critical : float
        Where ``|T| bound`` is largest, rad/s.
    complementary : ndarray, shape (K,)
        ``|T|`` on the grid of the bound.
    uncertainty : UncertaintyBound
    nominal : Margins
    performance : float
        Largest ``|S| / (1 - |T| bound)``: the worst sensitivity peak of all plants within the
        bound; inf if it is not robust.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> plant = cr.design.ProcessModel(gain=1.0, lag=0.08, dead_time=0.03).system(0.001)
    >>> bound = cr.design.uncertainty_bound([1.3 * plant], plant, dead_time_interval=(0.025, 0.035))
    >>> found = bound.check(cr.design.pid(plant))
    >>> print(f"margin {found.margin:.2f}, least at {found.omega_critical:.1f} rad/s")
    margin 2.59, least at 23.5 rad/s
    """

    robust: bool
    margin: float
    omega_critical: float
    complementary: FloatArray
    uncertainty: UncertaintyBound
    nominal: Margins
    performance: float

    _heading = "Robust stability"

    def _rows(self) -> list[tuple[str, str]]:
        worst = f"{self.performance:.4g}" if np.isfinite(self.performance) else "unbounded"
        factor = f"{self.margin:.4g} (at {self.omega_critical:.4g} rad/s)"
        return [
            ("nominal loop", "stable" if self.nominal.stable else "UNSTABLE"),
            ("all plants within the bound", "stable" if self.robust else "NOT guaranteed"),
            ("largest factor on the bound", factor),
            ("worst sensitivity peak", f"{worst} (nominal {self.nominal.ms:.4g})"),
        ]

    def __repr__(self) -> str:
        word = "robust" if self.robust else "not robust"
        return (
            f"<RobustnessCheck {word}: margin {self.margin:.3g} at {self.omega_critical:.3g} rad/s>"
        )


@single_threaded
def robust_stability(uncertainty: UncertaintyBound, controller: Any) -> RobustnessCheck:
    """Check that a controller stabilizes every plant within a bound.

    Parameters
    ----------
    uncertainty : UncertaintyBound
    controller : control system
        For the nominal plant of the bound.

    Returns
    -------
    RobustnessCheck

    Notes
    -----
    Sufficient, and for a bound on the size of Delta alone also necessary; such a bound contains
    other errors than a wrong dead time, so `delay_robustness` may be less conservative.

    The condition is ``|T(j w)| |Delta(j w)| < 1`` at all frequencies, with the complementary
    sensitivity T [1]_.

    References
    ----------
    .. [1] S. Skogestad and I. Postlethwaite, Multivariable Feedback Control, 2nd ed., Wiley 2005,
       section 7.5 (SISO robust stability).

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> plant = cr.design.ProcessModel(gain=1.0, lag=0.08, dead_time=0.03).system(0.001)
    >>> bound = cr.design.uncertainty_bound([plant.replace(delay=29), 1.1 * plant], plant)
    >>> for closed_loop_time in (0.03, 0.015):
    ...     pi = cr.design.pid(plant, closed_loop_time=closed_loop_time)
    ...     print(f"{cr.design.robust_stability(bound, pi).margin:.2f}")
    10.00
    8.36
    """
    check_type(uncertainty, UncertaintyBound, "uncertainty", "that of uncertainty_bound")
    plant = uncertainty.nominal
    nominal = margins(plant, controller)
    values = open_loop(plant, controller)(np.array(uncertainty.omega))
    T = np.abs(values / (1 + values))
    product = T * uncertainty.bound
    at = int(np.argmax(product))
    robust = bool(nominal.stable and product[at] < 1)
    worst = float(np.max(np.abs(1 / (1 + values)) / (1 - product))) if robust else float("inf")
    return RobustnessCheck(
        robust=robust,
        margin=float(1 / product[at]) if product[at] else float("inf"),
        omega_critical=float(uncertainty.omega[at]),
        complementary=read_only(T),
        uncertainty=uncertainty,
        nominal=nominal,
        performance=worst,
    )
