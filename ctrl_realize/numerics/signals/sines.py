r"""Points of a frequency response as rows of a separable least-squares problem.

In `engine.modal` a model is a sum of modes of an input. A point of a frequency response is the
response to another input, :math:`e^{j \omega t}`: with the residues r_j of ``G(s) / s`` at its
poles p_j and its static gain g, G has

.. math:: e^{-j \omega \tau} G(j \omega) =
          e^{-j \omega \tau} \Bigl( g + \sum_j r_j \frac{j \omega}{j \omega - p_j} \Bigr),

so that ``E_j = exp(-j omega tau) j omega / (j omega - p_j)`` takes the place of the exponentials of
a step response. The derivative with respect to the dead time is ``-sum_j r_j p_j E_j`` for both if
``g + sum_j r_j = 0``; otherwise that sum is the direct term, which turns with the dead time. Real
and imaginary parts are separate rows [1]_.

References
----------
.. [1] R. Pintelon and J. Schoukens, System Identification: A Frequency Domain Approach, 2nd ed.,
   Wiley 2012, chapter 9, doi:10.1002/9781118287422.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import ComplexArray, FloatArray


@dataclass(frozen=True, eq=False)
class Sines:
    """Steady state of sines: real parts of all points, then imaginary parts.

    Attributes
    ----------
    omega : ndarray, shape (K,)
        In rad/s.
    """

    omega: FloatArray

    def pieces(self) -> list[Sines]:
        """All points."""
        return [self]

    def modes(self, tau: FloatArray, poles: ComplexArray) -> tuple[FloatArray, Any, Any]:
        """Evaluate H, E and T of every row; see `engine.responses`."""
        s = 1j * self.omega
        turn = np.exp(-s * tau[:, None])
        gap = s[:, None] - poles[:, None, :]
        mode = turn[:, :, None] * (s[:, None] / gap)
        # Re(-j z) is the imaginary part of z.
        static = np.concatenate([turn.real, turn.imag], axis=1)
        both = np.concatenate([mode, -1j * mode], axis=1)
        return static, both, both / np.concatenate([gap, gap], axis=1)

    def direct_slope(self, tau: FloatArray) -> FloatArray:
        """Derivative of a direct term of 1 with respect to the dead time, shape (B, 2 K)."""
        turned = -1j * self.omega * np.exp(-1j * self.omega * tau[:, None])
        return np.concatenate([turned.real, turned.imag], axis=1)


def stacked_parts(values: NDArray[Any]) -> FloatArray:
    """Stack real parts on top of imaginary parts."""
    return np.concatenate([values.real, values.imag])
