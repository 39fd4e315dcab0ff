"""Estimated impulse responses, with standard deviations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._wording import in_time
from ..numerics.arrays import FloatArray, lock_fields
from ..results import Flag, Result
from .impulse import ImpulseResponse


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class ImpulseEstimate(ImpulseResponse, Result):
    """Estimated unit-pulse response: an `ImpulseResponse` with standard deviations.

    ``markov +- 2 std`` is the 95 % band of a Markov parameter, for white output noise, on average
    over the response: a regularised estimate is smoother than its first step after a dead time, and
    one of OKID has nothing beyond its order, so that there fewer are within. The errors of
    neighbouring parameters are correlated. `noise_std` is the noise in the outputs.

    Attributes
    ----------
    markov, std : ndarray, shape (N,) or (p, m, N)
    noise_std : ndarray, shape (p,)
        Standard deviation of the residual of each output, in its unit.
    method : str
        Method, in words.
    rows : int
        Number of equations: samples whose whole past is known.
    choices : tuple of str
        Automatic choices, with reasons.
    flags : tuple of Flag

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> u, noise = np.random.default_rng(0).standard_normal((2, 2000))
    >>> y = 3.0 * np.roll(u, 5) + 0.1 * noise
    >>> estimate = cr.impulse_from_io(cr.Record(0.01 * np.arange(2000), u, y), 20)
    >>> print(f"{estimate.markov[5]:.3f} +- {2 * estimate.std[5]:.3f}")
    2.998 +- 0.004
    >>> print(estimate.noise_std.round(2))
    [0.1]
    """

    std: FloatArray
    noise_std: FloatArray
    method: str
    rows: int
    choices: tuple[str, ...] = ()
    flags: tuple[Flag, ...] = ()

    def __post_init__(self) -> None:
        super().__init__(self.markov, self.dt, name=self.name)
        lock_fields(self, "std", "noise_std")

    def _title(self) -> str:
        return f"Impulse response {self.name!r}" if self.name else "Impulse response"

    def _rows(self) -> list[tuple[str, str]]:
        gains = np.atleast_2d(self.markov.sum(axis=-1))
        return [
            ("method", self.method),
            ("length", f"{self.n_samples} samples of {in_time(self.dt, 6)}, {self.rows} equations"),
            ("sum (gain)", ", ".join(f"{g:.4g}" for g in gains.ravel())),
            ("largest std", f"{self.std.max():.3g}"),
            ("residual std", ", ".join(f"{s:.3g}" for s in self.noise_std)),
        ]

    def __repr__(self) -> str:
        return super().__repr__().replace("<ImpulseResponse", "<ImpulseEstimate")
