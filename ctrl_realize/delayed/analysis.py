"""Properties of a system with delay: poles, zeros, bandwidth, transfer function."""

from __future__ import annotations

import control as ct
import numpy as np

from .._checks import integer
from ..errors import DataWarning, warn_caller
from ..numerics.arrays import ComplexArray, FloatArray
from ..numerics.constants import SMALLEST
from ..numerics.internal_delays.dominant import largest
from ..numerics.internal_delays.form import DelayForm
from ..numerics.state_space.responses import markov
from .parts import CoreAndDelays, matrices_of, signals_of

_MOST_LOST = 1e-3  # of a response, by rounding of coefficients that cancel


class DelayedAnalysis(CoreAndDelays):
    """Properties computed from the core, because the augmented matrices are slow or inexact."""

    def poles(self) -> ComplexArray:
        """Poles: those of the core, and exact zeros for the delay."""
        chain = np.zeros(sum(self.input_delays) + sum(self.output_delays), dtype=np.complex128)
        return np.concatenate([self._core.poles(), chain])

    def dominant_poles(self, count: int = 10) -> ComplexArray:
        """Poles of the core that decay most slowly, or grow fastest, the slowest first.

        Parameters
        ----------
        count : int, optional
            Largest number of poles; one more if a pair would be split.

        Returns
        -------
        ndarray
            Descending in magnitude.
        """
        wanted = integer(count, "count", 1)
        return largest(np.asarray(self._core.poles(), dtype=np.complex128), wanted)

    def is_stable(self) -> bool:
        """Whether all poles are inside the unit circle; a delay has its poles at 0."""
        return bool(np.all(np.abs(self._core.poles()) < 1))

    def zeros(self) -> ComplexArray:
        """Finite zeros; for one input and output, those of the core."""
        if isinstance(self.delay, int):
            return np.asarray(self._core.zeros(), dtype=np.complex128)
        return np.asarray(super().zeros(), dtype=np.complex128)

    def _gain_form(self) -> DelayForm:
        return DelayForm(*matrices_of(self._core))

    def to_tf(self) -> ct.TransferFunction:
        """Transfer function: that of the core, with d further poles at zero.

        The denominator has the poles of the core, the numerators are its product with the Markov
        parameters, so that the relative degree is preserved. python-control's ``ct.tf(sys)``
        computes the characteristic polynomial of the augmented matrix, which has no correct digits
        from d = 50 on. Several channels give a matrix of transfer functions. The coefficients of
        several lags that are long beside the sample time cancel each other: a `DataWarning` tells
        if 0.1 % of a response is lost.
        """
        core, n = self._core, self._core.nstates
        poles = np.linalg.eigvals(core.A)
        den = np.real(np.poly(poles)) if n else np.ones(1)
        _warn_of_cancellation(den, poles)
        pulses = markov(*matrices_of(core), n + 1)
        total = np.add.outer(self.output_delays, self.input_delays)
        nums = [[_numerator(den, channel) for channel in row] for row in pulses]
        dens = [[np.concatenate([den, np.zeros(delay)]) for delay in row] for row in total]
        return ct.TransferFunction(nums, dens, self.dt, name=self.name, **signals_of(self))


def _warn_of_cancellation(den: FloatArray, poles: ComplexArray) -> None:
    """Warn about a polynomial that does not have its value between the poles and the circle."""
    turns = np.angle(poles) + 1j * np.log(np.maximum(np.abs(poles), SMALLEST))
    least = np.clip(np.abs(turns).min(initial=1.0), 1e-8, 1.0)
    z = np.exp(1j * np.geomspace(0.1 * least, np.pi, 50))
    factors = np.prod(z[:, None] - poles, axis=1)
    lost = float(np.abs(np.polyval(den, z) / factors - 1).max())
    if lost > _MOST_LOST:
        warn_caller(
            f"the polynomials of order {poles.size} lose {100 * min(lost, 1):.3g} % of a response "
            "at this sample time, since their coefficients cancel; use the state-space model, or "
            "resample it with a larger dt",
            DataWarning,
        )


def _numerator(den: FloatArray, pulses: FloatArray) -> FloatArray:
    num = np.convolve(den, pulses)[: den.size]
    return num[np.argmax(num != 0) :] if np.any(num) else np.zeros(1)
