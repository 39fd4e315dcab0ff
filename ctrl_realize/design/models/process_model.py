"""First- and second-order models with dead time, for tuning rules."""

from __future__ import annotations

from dataclasses import dataclass
from numbers import Real

import control as ct
import numpy as np
from numpy.typing import ArrayLike

from ..._checks import finite
from ...delayed import DelayedStateSpace, delayed_ss
from ...errors import OptionError
from ...numerics.arrays import FloatArray
from ...numerics.state_space.process_models import process_step
from ...results import Result


@dataclass(frozen=True, eq=False, repr=False)
class ProcessModel(Result):
    """Gain, one or two lags and a dead time.

    ``gain exp(-dead_time s) / ((lag s + 1)(second_lag s + 1))``.

    An integrating model has ``gain / s`` instead of ``gain``, and its lags may be 0.

    Attributes
    ----------
    gain : float
        Static gain; for an integrating model the slope per second.
    lag, second_lag : float
        In s, ``lag >= second_lag >= 0``.
    dead_time : float
        In s, >= 0.
    integrating : bool
    method : str
        How it was found: ``"given"``, ``"half rule"`` or ``"optimal"``.
    error : float
        Error of the step response relative to that of the reduced system: root mean square over the
        system's total time (dead time plus lags), divided by the gain (for an integrating system by
        gain times total time); nan if nothing was reduced.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> valve = cr.design.ProcessModel(gain=1.0, lag=0.08, dead_time=0.029)
    >>> valve
    <ProcessModel 1 exp(-0.029 s) / (0.08 s + 1)>
    >>> valve.system(0.001).delay
    29
    """

    gain: float
    lag: float
    dead_time: float
    second_lag: float = 0.0
    integrating: bool = False
    method: str = "given"
    error: float = float("nan")

    def __post_init__(self) -> None:
        numbers = (self.gain, self.lag, self.dead_time, self.second_lag)
        if not all(isinstance(x, Real) and np.isfinite(x) for x in numbers) or self.gain == 0:
            raise OptionError(
                f"{numbers} (gain, lag, dead_time, second_lag) must be finite, gain not 0"
            )
        if not self.lag >= self.second_lag >= 0 or self.dead_time < 0:
            raise OptionError(
                f"lag={self.lag:g}, second_lag={self.second_lag:g}, "
                f"dead_time={self.dead_time:g}; expected lag >= second_lag >= 0 and dead_time "
                ">= 0 in s"
            )
        if self.lag == 0 and not self.integrating:
            raise OptionError(
                "lag=0; a model without a lag is a pure dead time, for which there is no "
                "tuning rule"
            )

    def transfer_function(self) -> ct.TransferFunction:
        """Continuous transfer function without the dead time."""
        den = np.polymul([self.lag, 1.0], [self.second_lag, 1.0])
        if self.integrating:
            den = np.append(den, 0.0)
        return ct.tf([self.gain], np.trim_zeros(den, "f"), inputs=["u"], outputs=["y"])

    def system(self, dt: float) -> DelayedStateSpace:
        """Sample the model with a zero-order hold, dead time exact."""
        return delayed_ss(self.transfer_function(), dead_time=self.dead_time, dt=dt)

    def step(self, time: ArrayLike) -> FloatArray:
        """Step response at given times in s."""
        times = self.lag, self.second_lag, self.dead_time
        return self.gain * process_step(finite(time, "time"), *times, integrating=self.integrating)

    @property
    def total_time(self) -> float:
        """Dead time plus lags, in s."""
        return self.lag + self.second_lag + self.dead_time

    @property
    def formula(self) -> str:
        """The transfer function as text, times in s."""
        lags = [f"({T:.4g} s + 1)" for T in (self.lag, self.second_lag) if T]
        below = ["s"] * self.integrating + lags
        return f"{self.gain:.4g} exp(-{self.dead_time:.4g} s) / {' '.join(below)}"

    _heading = "Process model"

    def _rows(self) -> list[tuple[str, str]]:
        rows = [("model", self.formula), ("method", self.method)]
        if np.isfinite(self.error):
            rows.append(("step error (rms)", f"{100 * self.error:.3g} %"))
        return rows

    def __repr__(self) -> str:
        return f"<ProcessModel {self.formula}>"
