"""Properties of a system with delay: poles, zeros, bandwidth, transfer function."""

from __future__ import annotations

from typing import Any

import control as ct
import numpy as np
from scipy.optimize import brentq

from .._checks import integer, real
from ..numerics.arrays import ComplexArray
from .parts import CoreAndDelays


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
        poles = np.asarray(self._core.poles(), dtype=np.complex128)
        poles = poles[np.lexsort((-poles.imag, -np.abs(poles)))]
        split = wanted < poles.size and poles[wanted - 1].imag > 0
        return poles[: wanted + split]

    def is_stable(self) -> bool:
        """Whether all poles are inside the unit circle; a delay has its poles at 0."""
        return bool(np.all(np.abs(self._core.poles()) < 1))

    def zeros(self) -> ComplexArray:
        """Finite zeros; for one input and output, those of the core."""
        if self.issiso() or isinstance(self.delay, int):
            return np.asarray(self._core.zeros(), dtype=np.complex128)
        return np.asarray(super().zeros(), dtype=np.complex128)

    def damp(self) -> Any:
        """Natural frequency, damping and poles; delay poles have infinite frequency."""
        # log(0) of the poles at 0 is intended, and python-control would warn about each.
        with np.errstate(divide="ignore", invalid="ignore"):
            return super().damp()

    def bandwidth(self, dbdrop: float = -3) -> float:
        """Lowest frequency in rad/s at which the gain is `dbdrop` dB below that at 0.

        python-control 0.10.2 raises an error for every discrete system: it evaluates G(jw) instead
        of G(exp(jw dt)).
        """
        if not self.issiso():
            raise TypeError("system should be a SISO system")
        drop = real(dbdrop, "dbdrop", "drop of the gain in dB, below 0")
        if drop >= 0:
            raise ValueError("expecting dbdrop be a negative scalar in dB")
        level = abs(complex(self(1.0, warn_infinite=False))) * 10 ** (drop / 20)
        if not np.isfinite(level):
            return float("nan")
        nyquist = np.pi / self.dt
        grid = np.concatenate(
            [np.geomspace(nyquist * 1e-7, nyquist, 2000), np.linspace(0, nyquist, 2000)[1:]]
        )
        grid.sort()
        gain = np.abs(self._core(np.exp(1j * grid * self.dt)))
        below = np.flatnonzero(gain < level)
        if below.size == 0:
            return float("inf")
        first = int(below[0])
        if first == 0:
            return float(grid[0])
        return float(
            brentq(
                lambda w: abs(complex(self._core(np.exp(1j * w * self.dt)))) - level,
                grid[first - 1],
                grid[first],
                xtol=1e-14 * nyquist,
            )
        )

    def to_tf(self, *args: Any, **kwargs: Any) -> ct.TransferFunction:
        """Transfer function: that of the core, with d further poles at zero.

        python-control's ``ct.tf(sys)`` computes the characteristic polynomial of the augmented
        matrix, which has no correct digits from d = 50 on. Several channels give a matrix of
        transfer functions.
        """
        core = ct.tf(self._core, *args, **kwargs)
        total = np.add.outer(self.output_delays, self.input_delays)
        den = [
            [np.concatenate([core.den[i][j], np.zeros(total[i, j])]) for j in range(core.ninputs)]
            for i in range(core.noutputs)
        ]
        return ct.TransferFunction(
            core.num, den, self.dt, inputs=self.input_labels, outputs=self.output_labels
        )
