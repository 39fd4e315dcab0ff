"""IAE as a function of the delay, and the models for every delay."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..._wording import in_time
from ...data import ImpulseResponse
from ...numerics.arrays import FloatArray
from ...results import Flag, IntervalKind
from .result import ImpulseFit, Realization


@dataclass(frozen=True, eq=False)
class DelayScan(ImpulseFit):
    """IAE of the best model for every candidate delay.

    ``iae[d]`` is the sum of ``|impulse.markov[k] - model.markov(n)[k]|`` over the fixed window
    ``n = samples + max_delay + 1``, for all channels together, of the model
    ``realize(impulse, order, delay=d, samples=samples)``. ``delay`` is the smallest d whose IAE
    equals the minimum up to rounding; ``interval`` contains all d within 5 % of it.

    Attributes
    ----------
    iae : ndarray, shape (max_delay + 1,)
    delay : int
        Best delay in samples.
    delay_interval : tuple of int
        Smallest and largest delay, in samples, with an IAE within 5 % of the minimum; `interval` is
        the same in s. It shows how flat the curve is, and is not a confidence interval: it does not
        contain the bias of the method.
    order, samples : int
        Order of all models; Markov parameters after each delay used.
    feedthrough : bool
        Whether the models have the feedthrough G[d] (the paper); otherwise 0.
    singular_values : ndarray, shape (max_delay + 1, order)
        Of the Hankel matrix for each delay.
    noise_floor : float or None
        Largest singular value of a Hankel matrix of the noise before the step; None if that noise
        is not known.
    impulse : ImpulseResponse
        The impulse response.
    realization : Realization
        Realization of the returned model after `delay`.
    flags : tuple of Flag
        ``"delay_at_bound"``, ``"no_delay_resolved"``, ``"several_minima"``,
        ``"order_in_noise"``, ``"order_near_noise"``, and those of
        `realization`.
    choices : tuple of str
        Automatic choices, with reasons (`identify`).

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> pulse = np.r_[np.zeros(38), 0.1 * 0.9 ** np.arange(300)]     # 37 samples, then a lag
    >>> scan = cr.estimate_delay(pulse, 1, max_delay=60, dt=0.01).fit
    >>> print(scan.delay, scan.delay_interval, scan.iae[[30, 36, 38]].round(3))
    37 (37, 38) [1.133 0.302 0.   ]
    """

    iae: FloatArray
    delay: int
    delay_interval: tuple[int, int]
    order: int
    samples: int
    feedthrough: bool
    singular_values: FloatArray
    noise_floor: float | None
    impulse: ImpulseResponse = field(repr=False)
    realization: Realization = field(repr=False)
    flags: tuple[Flag, ...] = ()
    choices: tuple[str, ...] = ()

    @property
    def interval(self) -> tuple[float, float]:
        """`delay_interval` in s."""
        return (self.delay_interval[0] * self.dt, self.delay_interval[1] * self.dt)

    @property
    def interval_kind(self) -> IntervalKind:
        """``"flatness"``: it shows how flat the curve is."""
        return "flatness"

    @property
    def least_iae(self) -> float:
        """Smallest integrated absolute error, in the unit of the output per input."""
        return float(self.iae[self.delay])

    @property
    def max_delay(self) -> int:
        """Largest delay that was tried, in samples."""
        return int(self.iae.size - 1)

    @property
    def contrast(self) -> float:
        """IAE without delay divided by the smallest; below 1.3 no delay is resolved."""
        least = float(self.iae[self.delay])
        return float(self.iae[0]) / least if least > 0 else np.inf

    @property
    def noise_ratio(self) -> float | None:
        """Last singular value of the model over that of the noise; reliable above 3."""
        if self.noise_floor is None:
            return None
        last = float(self.singular_values[self.delay, -1])
        return last / self.noise_floor if self.noise_floor > 0 else np.inf

    _method = "delay scan by approximate realization"

    def _title(self) -> str:
        return f"Delay scan: {self.delay} samples ({in_time(self.delay * self.dt, 5)})"

    def _rows(self) -> list[tuple[str, str]]:
        low, high = self.delay_interval
        rows = [
            ("within 5 % of the smallest IAE", f"{low}...{high} samples"),
            ("tried", f"0...{self.max_delay} samples of {in_time(self.dt, 6)}"),
            ("order", f"{self.order}"),
            ("samples after each delay", f"{self.samples}"),
            *self._rows_before(),
            ("feedthrough D", "G[d]" if self.feedthrough else "0"),
            ("smallest IAE", f"{self.iae[self.delay]:.4g}"),
            ("IAE without delay", f"{self.contrast:.3g} times the smallest"),
        ]
        if self.noise_ratio is not None:
            rows.append((f"singular value {self.order}", f"{self.noise_ratio:.2f} times the noise"))
        return rows

    def __repr__(self) -> str:
        flags = f", {len(self.flags)} flags" if self.flags else ""
        low, high = self.delay_interval
        return (
            f"<DelayScan: d = 0...{self.max_delay}, best {self.delay} ({low}...{high}), "
            f"order {self.order}{flags}>"
        )
