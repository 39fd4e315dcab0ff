"""Model of the noise that a fit leaves, as Ljung's H(q) = 1 / D(q)."""

from __future__ import annotations

from dataclasses import dataclass

import control as ct
import numpy as np
from numpy.typing import ArrayLike
from scipy.signal import lfilter

from .._checks import finite, integer
from ..numerics.arrays import FloatArray
from ..numerics.signals.noise_model import noise_lags, whitening_filter
from ..results import Result

_SETTLED = 20  # correlation times, until drawn noise has forgotten how it began


@dataclass(frozen=True, eq=False, repr=False)
class NoiseModel(Result):
    """Autoregression e[k] = a_1 e[k-1] + ... + a_r e[k-r] + w[k] of a residual e, w white.

    Burg's method, the order of the smallest Bayesian information criterion, at most 25 and one for
    20 samples (Stoica and Moses, Spectral Analysis of Signals, 2005, section 3.9.3). Samples beyond
    four standard deviations are cut for it. Where a fit has made coloured noise white, beside
    inputs other than steps, the model is that of the fit: restricted maximum likelihood (Harville
    1977), which makes up for what the fit has followed of the noise.

    Attributes
    ----------
    coefficients : ndarray, shape (r,)
        a_1 to a_r; none for white noise.
    std : float
        Standard deviation of the innovations w, in the unit of the output.
    dt : float
        In s.

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> record = cr.bench.valve(noise=0.01).step_record(16, rng=5)
    >>> noise = cr.identify(record).fit.noise_model
    >>> noise.system.dt == record.dt
    True
    >>> draws = noise.draw(1000, rng=1)  # for a simulation
    """

    coefficients: FloatArray
    std: float
    dt: float

    @property
    def system(self) -> ct.TransferFunction:
        """H(z) = 1 / (1 - a_1 z^-1 - ... - a_r z^-r), from the innovations to the noise."""
        return ct.tf([1.0, *np.zeros(self.coefficients.size)], self._denominator, self.dt)

    @property
    def sigma(self) -> float:
        """Standard deviation of the noise itself, in the unit of the output."""
        return self.std * float(np.linalg.norm(self._response))

    @property
    def correlation_time(self) -> float:
        """Samples that count as one for means over many: 1 for white noise."""
        return float(np.sum(self._response) ** 2 / np.sum(self._response**2))

    def predict(self, residual: ArrayLike) -> FloatArray:
        """Predict every sample of a residual (N,) from those before it, one step ahead.

        Added to the output of the model this is the one-step prediction of the measured output
        (Ljung, System Identification, 2nd ed. 1999, eq. 3.20). Before the first sample it is zero.
        """
        past = finite(residual, "residual")
        return np.asarray(lfilter(np.concatenate([[0.0], self.coefficients]), [1.0], past))

    def draw(self, n: int, rng: int | np.random.Generator | None = None) -> FloatArray:
        """Draw n samples of Gaussian noise with this model."""
        count = integer(n, "n", 1) + self._memory
        white = self.std * np.random.default_rng(rng).standard_normal(count)
        return np.asarray(lfilter([1.0], self._denominator, white)[self._memory :])

    @property
    def _denominator(self) -> FloatArray:
        return np.concatenate([[1.0], -self.coefficients])

    @property
    def _response(self) -> FloatArray:
        """Noise after an innovation of 1."""
        return np.asarray(lfilter([1.0], self._denominator, np.eye(1, self._memory)[0]))

    @property
    def _memory(self) -> int:
        slowest = np.abs(np.roots(self._denominator)).max(initial=0.0)
        return int(np.ceil(_SETTLED / max(1.0 - slowest, 1e-4)))

    def _rows(self) -> list[tuple[str, str]]:
        order = self.coefficients.size
        return [
            ("noise", f"autoregressive, order {order}" if order else "white"),
            ("innovations", f"{self.std:.4g}"),
            ("correlation time", f"{self.correlation_time:.3g} samples"),
        ]

    _heading = "Noise of a fit"

    def __repr__(self) -> str:
        return f"<NoiseModel order {self.coefficients.size}, innovations {self.std:.4g}>"


def noise_of(residual: FloatArray, dt: float, denominator: FloatArray | None = None) -> NoiseModel:
    """Model what a fit leaves of an output, shape (N,); by the polynomial of the fit if it has one.

    A fit follows a part of slow noise, for which its own polynomial makes up.
    """
    left = residual[~np.isnan(residual)] - np.nanmean(residual)
    if denominator is None:
        denominator = whitening_filter(left, noise_lags(left.size))
    order = denominator.size - 1
    innovations = lfilter(denominator, [1.0], left)[order:]
    return NoiseModel(-denominator[1:], float(np.std(innovations)), dt)
