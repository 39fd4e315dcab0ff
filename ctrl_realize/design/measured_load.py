"""Feedforward from a measured load."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import control as ct
import numpy as np

from .._checks import positive
from .._wording import in_time
from ..data.shown_units import in_shown_units
from ..delayed import DelayedStateSpace, delayed_ss
from ..errors import UnsuitableSystemError
from ..results import Result
from .models.process_model import ProcessModel
from .models.reduction import reduce_fopdt

_LAGS, _ROUNDING = 5, 1e-9
"""Lags of both paths within which the largest deviation is looked for, and part of the response to
the load that is rounding."""


@dataclass(frozen=True, eq=False, repr=False)
class Feedforward(Result):
    """A compensator from a measured load to the plant input, and what it leaves.

    ``gain == -load_model.gain / plant_model.gain``, ``lead == plant_model.lag``, ``lag ==
    load_model.lag``.

    Attributes
    ----------
    system : DelayedStateSpace
        From load to plant input; to be added to the output of the controller.
    plant_model, load_model : ProcessModel
        First-order models of both paths, from which it is made.
    gain, lead, lag, delay : float
        ``gain (lead s + 1) / (lag s + 1)`` with a delay; times in s.
    uncovered : float
        Time in s for which a load acts before the plant input can: dead time of the plant less that
        of the load, if that is positive.
    peak : float
        Largest remaining deviation of the output after a unit step of the load, for these models.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> plant = cr.design.ProcessModel(gain=2.0, lag=20.0, dead_time=5.0)
    >>> load = cr.design.ProcessModel(gain=-1.2, lag=30.0, dead_time=2.0)
    >>> made = cr.design.feedforward(plant, load, dt=1.0)
    >>> round(made.gain, 2), made.uncovered, round(made.peak, 3)
    (0.6, 3.0, 0.114)
    """

    system: DelayedStateSpace
    plant_model: ProcessModel
    load_model: ProcessModel
    gain: float
    lead: float
    lag: float
    delay: float
    uncovered: float
    peak: float

    _heading = "Feedforward from a measured load"

    def _rows(self) -> list[tuple[str, str]]:
        late = f", {in_time(self.delay)} later" if self.delay else ""
        rows = [
            ("gain", f"{self.gain:.4g}"),
            ("lead", in_time(self.lead)),
            ("lag", f"{in_time(self.lag)}{late}"),
        ]
        if self.peak:
            left = f"up to {self.peak:.3g} of the output for each unit of the load"
            why = "the dead times differ by a part of a sample"
            if self.uncovered:
                why = f"the load acts {in_time(self.uncovered)} before the plant input can"
            rows.append(("what it leaves", f"{why}: {left}"))
        return rows

    def __repr__(self) -> str:
        return f"<Feedforward: gain {self.gain:.4g}, lead {self.lead:.4g} s, lag {self.lag:.4g} s>"


@in_shown_units
def feedforward(plant: Any, disturbance: Any, *, dt: float | None = None) -> Feedforward:
    """Compensate a measured load: what is added to the plant input so that both cancel.

    Parameters
    ----------
    plant, disturbance : DelayedStateSpace, DelaySystem or ProcessModel
        Models from plant input and from the load to the output, as ``sys[0, 0]`` and ``sys[0, 1]``
        of a model with two inputs. Those of higher order are reduced, see `reduce_fopdt`.
    dt : float, optional
        Sample time in s; default: that of the models.

    Returns
    -------
    Feedforward

    Raises
    ------
    UnsuitableSystemError
        A path that integrates beside one that does not, or no sample time.

    Notes
    -----
    The compensator is ``-G_load / G_plant`` [1]_ of the first-order models, sampled, with the
    difference of the dead times in whole samples: for models of first order whose dead times are
    whole samples it cancels the load at every sample, otherwise `peak` is left. A negative
    difference cannot be realized: the delay is then zero, and a deviation of ``gain_load (1 -
    exp(-t / lag_load))``, t the missing time, is left, which then decays with the lag of the load.

    References
    ----------
    .. [1] K. J. Astrom and T. Hagglund, Advanced PID Control, ISA 2006, section 5.6 (feedforward
       control).

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> plant = cr.design.ProcessModel(gain=2.0, lag=20.0, dead_time=5.0)
    >>> load = cr.design.ProcessModel(gain=-1.2, lag=30.0, dead_time=9.0)
    >>> cr.design.feedforward(plant, load, dt=1.0).system
    <DelayedStateSpace 'feedforward': load -> u, order 1, z^-4 (4 s), dt = 1 s>
    """
    given = plant, disturbance
    paths = [path if isinstance(path, ProcessModel) else reduce_fopdt(path) for path in given]
    first, second = paths
    if first.integrating != second.integrating:
        raise UnsuitableSystemError(
            "one of plant and load integrates and the other does not; expected both or neither: "
            "otherwise the compensator differentiates, or drifts away"
        )
    known = [path.dt for path in given if getattr(path, "dt", None)]
    if dt is None and not known:
        raise UnsuitableSystemError("neither model has a sample time; give dt, in s")
    step = positive(dt if dt is not None else known[0], "dt", "sample time in s")
    gain = -second.gain / first.gain
    poles = [np.exp(-step / path.lag) if path.lag else 0.0 for path in paths]
    late = second.dead_time - first.dead_time
    whole = max(round(late / step), 0)
    share = gain * (1 - poles[1]) / (1 - poles[0])
    lead_lag = ct.tf(share * np.array([1.0, -poles[0]]), [1.0, -poles[1]], step)
    missing = max(-late, 0.0)
    made = delayed_ss(lead_lag, whole, name="feedforward", inputs="load", outputs="u")
    alone = second.system(step)
    count = 2 + int((first.dead_time + second.dead_time + _LAGS * (first.lag + second.lag)) / step)
    caused = float(np.abs(alone.step(count)).max())
    left = float(np.abs((first.system(step) * made + alone).step(count)).max())
    # the response to a unit step of the load after the missing time, which may be no sample
    left = max(left, float(abs(second.step(np.array([second.dead_time + missing]))[0])))
    return Feedforward(
        system=made,
        plant_model=first,
        load_model=second,
        gain=gain,
        lead=first.lag,
        lag=second.lag,
        delay=whole * step,
        uncovered=missing,
        peak=left if left > _ROUNDING * caused else 0.0,
    )
