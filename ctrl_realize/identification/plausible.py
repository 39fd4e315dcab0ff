"""Models that the data of a fit do not rule out, as systems of python-control."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import control as ct
import numpy as np
from numpy.typing import ArrayLike

from .._wording import interval_in_time
from ..delayed import DelayedStateSpace, delayed_ss
from ..numerics.arrays import ComplexArray, FloatArray
from ..numerics.engine.plausible_models import PlausibleModel
from ..numerics.loops.reference import model_response
from ..results import Result


def continuous_core(numerator: FloatArray, poles: ComplexArray) -> ct.StateSpace:
    """Companion form of b(s)/a(s), in a time unit that makes its entries comparable."""
    n = poles.size
    moving = np.abs(poles[poles != 0])
    unit = float(np.exp(np.mean(np.log(moving)))) if moving.size else 1.0
    a = np.real(np.poly(poles / unit))[1:]
    b = np.zeros(n)
    b[: numerator.size] = numerator * unit ** (np.arange(numerator.size) - float(n))
    matrix = np.eye(n, k=1)
    matrix[-1] = -a[::-1]
    last = np.zeros((n, 1))
    last[-1] = 1.0
    return ct.StateSpace(unit * matrix, unit * last, b[None], np.zeros((1, 1)))


@dataclass(frozen=True, eq=False, repr=False)
class PlausibleModels(Result):
    """Models that the data do not rule out, all equally likely; ``len()`` of them.

    Structures are drawn by their evidence, dead times, poles and numerators by the likelihood (see
    `numerics.engine.plausible_models`). A further one lies between the extremes of 39 with 95 %, at
    any one frequency or time.

    Attributes
    ----------
    models : tuple of PlausibleModel
        Dead time in s, poles in rad/s, and numerator, lowest power first, of each.
    dt : float
        In s.
    time_unit : str
        Of plots and cards: min, h or day of the record, otherwise s.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> record = cr.bench.valve().step_record(16, rng=5)
    >>> models = cr.identify(record, structures=[(3, 3)]).fit.plausible_models
    >>> len(models), models.systems[0].dt == models.dt
    (39, True)
    >>> models.frequency_response([1.0, 10.0]).shape
    (39, 2)
    """

    models: tuple[PlausibleModel, ...]
    dt: float
    time_unit: str = "s"

    def __len__(self) -> int:
        return len(self.models)

    @cached_property
    def systems(self) -> tuple[DelayedStateSpace, ...]:
        """The models behind a hold, for simulation and design."""
        base: dict[str, Any] = {"dt": self.dt, "time_unit": self.time_unit}
        return tuple(
            delayed_ss(continuous_core(m.numerator, m.poles), dead_time=m.dead_time, **base)
            for m in self.models
        )

    def frequency_response(self, omega: ArrayLike) -> ComplexArray:
        """Responses (39, M) of the continuous models at omega (M,) in rad/s."""
        at = np.atleast_1d(np.asarray(omega, dtype=np.float64))
        return np.stack([model_response(one, at) for one in self.models])

    def _rows(self) -> list[tuple[str, str]]:
        waits = [one.dead_time for one in self.models]
        orders = sorted({one.poles.size for one in self.models})
        return [
            ("models", str(len(self))),
            ("orders", ", ".join(map(str, orders))),
            ("dead times", interval_in_time(min(waits), max(waits))),
        ]

    _heading = "Models that the data do not rule out"

    def __repr__(self) -> str:
        return f"<PlausibleModels {len(self)} models>"
