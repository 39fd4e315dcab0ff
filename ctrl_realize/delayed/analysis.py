"""Properties of a system with delay: poles, zeros, bandwidth, transfer function."""

from __future__ import annotations

from typing import Any

import control as ct
import numpy as np

from .._checks import integer
from ..numerics.arrays import ComplexArray
from ..numerics.internal_delays.dominant import largest
from ..numerics.internal_delays.form import DelayForm
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
        return largest(np.asarray(self._core.poles(), dtype=np.complex128), wanted)

    def is_stable(self) -> bool:
        """Whether all poles are inside the unit circle; a delay has its poles at 0."""
        return bool(np.all(np.abs(self._core.poles()) < 1))

    def zeros(self) -> ComplexArray:
        """Finite zeros; for one input and output, those of the core."""
        if self.issiso() or isinstance(self.delay, int):
            return np.asarray(self._core.zeros(), dtype=np.complex128)
        return np.asarray(super().zeros(), dtype=np.complex128)

    def _gain_form(self) -> DelayForm:
        core = self._core
        return DelayForm(core.A, core.B, core.C, core.D)

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
