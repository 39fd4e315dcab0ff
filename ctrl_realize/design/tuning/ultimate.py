"""Ultimate gain and period: where proportional control makes the loop oscillate."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..._wording import in_time, interval_in_time
from ...delayed import DelayedStateSpace, DelaySystem, delay
from ...errors import UnsuitableSystemError
from ...identification.plausible import continuous_core
from ...numerics.blas_threads import single_threaded
from ...results import Result
from ..loops.loop import open_loop
from ..loops.margins import loop_margins
from ..models.conversions import to_continuous
from ..models.process_model import ProcessModel
from ..resolved import check_sign
from ..siso import delayed_system, is_continuous
from .plant import gain_and_time_units, reference_plant

Interval = tuple[float, float]
PURPOSE = "the ultimate gain"


@dataclass(frozen=True, eq=False, repr=False)
class UltimateGain(Result):
    """Gain of a proportional controller at which the loop oscillates, and the period of that.

    Attributes
    ----------
    gain : float
        Of the controller, input per output of the plant; negative for a plant whose output falls.
    period : float
        In s.
    dt : float
        Sample time in s of the controller and its hold; 0 if both are those of continuous control.
    gain_interval, period_interval : tuple of float, or None
        Extremes over the models that the data do not rule out, 95 %; None without such models. A
        model whose phase never reaches -180 deg has inf and 0.
    gain_unit, time_unit : str
        From the record of an identified plant.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> found = cr.design.ultimate(cr.design.ProcessModel(gain=2.0, lag=20.0, dead_time=5.0))
    >>> found
    <UltimateGain: gain 3.467, period 18.31 s, continuous>
    """

    gain: float
    period: float
    dt: float
    gain_interval: Interval | None = None
    period_interval: Interval | None = None
    gain_unit: str = ""
    time_unit: str = "s"

    def _held(self) -> str:
        return f"behind a hold of {in_time(self.dt, 4)}" if self.dt else "continuous"

    _heading = "Ultimate gain and period"

    def _rows(self) -> list[tuple[str, str]]:
        rows = [
            ("control", self._held()),
            ("gain", f"{self.gain:.4g} {self.gain_unit}".rstrip()),
            ("period", in_time(self.period, 4)),
        ]
        if self.gain_interval is not None and self.period_interval is not None:
            low, high = self.gain_interval
            rows.insert(2, ("95 % interval", f"{low:.4g} to {high:.4g}"))
            rows.append(("95 % interval", interval_in_time(*self.period_interval)))
        return rows

    def __repr__(self) -> str:
        period = in_time(self.period, 4)
        return f"<UltimateGain: gain {self.gain:.4g}, period {period}, {self._held()}>"


@single_threaded
def ultimate(system: Any, *, continuous: bool = False, reverse: bool | None = None) -> UltimateGain:
    """Compute the ultimate gain and period of a plant, exact at any dead time.

    They are those of the phase crossover with the smallest gain margin, as a relay test looks for
    [1]_. For a sampled plant, such as an identified one, a sampled controller and its hold are part
    of the loop: with a sample time of a tenth of the dead time the gain is then some 5 % lower than
    that of continuous control.

    Parameters
    ----------
    system : DelayedStateSpace, DelaySystem or ProcessModel
        Plant with one input and one output, stable or with one integrator.
    continuous : bool, default False
        Tell the values of continuous control for a sampled plant, too.
    reverse : bool, optional
        Whether the output falls when the input rises. Default: by the sign of the static gain,
        which the record of a symmetric relay, or a drift, may leave open; with a value given, the
        response far below the ultimate frequency does not matter.

    Returns
    -------
    UltimateGain
        With intervals if the plant comes from a fit with `plausible_models`.

    Raises
    ------
    UnsuitableSystemError
        The phase never reaches -180 deg, or the loop is unstable with small gains, too; several
        channels; a sign that is neither given nor known.

    References
    ----------
    .. [1] K. J. Astrom and T. Hagglund, Automatic tuning of simple regulators with specifications
       on phase and amplitude margins, Automatica 20 (1984) 645-651,
       doi:10.1016/0005-1098(84)90014-1.

    Examples
    --------
    An integrator ``k / s`` with dead time L has the gain ``pi / (2 k L)`` and the period ``4 L``:

    >>> import control as ct
    >>> import ctrl_realize as cr
    >>> found = cr.design.ultimate(ct.tf([0.1], [1, 0]) * cr.delay(3.0))
    >>> print(f"{found.gain:.4f}, {found.period:.4f} s")
    5.2360, 12.0000 s
    """
    if isinstance(system, ProcessModel) or is_continuous(system):
        plant, exact, step = reference_plant(system, None, PURPOSE)
    else:  # a static gain that is not known does not matter, but for its sign
        plant = exact = delayed_system(system, PURPOSE)
        step = float(plant.dt)
        if reverse is None:
            check_sign(plant, f"{PURPOSE} without reverse=False or True")
    fit = plant.fit
    models = None if fit is None else fit.plausible_models
    others: Iterable[Any] = () if models is None else models.systems
    if continuous and step:
        exact, step = to_continuous(plant).system, 0.0
        others = (
            DelaySystem(continuous_core(m.numerator, m.poles)) * delay(m.dead_time)
            for m in (() if models is None else models.models)
        )
    gain, period = critical_point(exact, reverse)
    found = np.array([_crossing(one, np.sign(gain)) for one in others])
    ends: Any = [(float(each.min()), float(each.max())) for each in found.T] or (None, None)
    gains, periods = ends
    return UltimateGain(gain, period, step, gains, periods, *gain_and_time_units(plant))


def critical_point(
    exact: DelayedStateSpace | DelaySystem, reverse: bool | None = None
) -> tuple[float, float]:
    """Ultimate gain and period of a plant.

    Raises
    ------
    UnsuitableSystemError
    """
    sign = open_loop(exact).sign() if reverse is None else 1.0 - 2.0 * reverse
    gain, period = _crossing(exact, sign)
    if not np.isfinite(gain):
        raise UnsuitableSystemError(
            "the phase of the plant never reaches -180 deg: it has no ultimate gain"
        )
    if reverse is None and not loop_margins(open_loop(exact, 0.01 * gain)).stable:
        raise UnsuitableSystemError(
            "the plant has no ultimate gain: its loop is unstable with small gains, too"
        )
    return gain, period


def _crossing(system: Any, sign: float) -> tuple[float, float]:
    """Gain and period of the phase crossover with the smallest gain margin, of those that swing."""
    loop = open_loop(system)
    # near 1 where the dead time turns: a loop of far too high a gain has countless poles to count
    gain = 1 / abs(loop(np.array([1 / loop.turn_time]))[0]) if loop.turn_time else 1.0
    found = loop_margins(open_loop(system, sign * gain))
    gains = np.where(found.phase_crossovers > 0, gain * found.gain_margins, np.inf)
    if np.isinf(gains).all():
        return sign * np.inf, 0.0
    at = int(np.argmin(gains))
    return sign * float(gains[at]), float(2 * np.pi / found.phase_crossovers[at])
