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
.. [2] K. J. Astrom and B. Wittenmark, Computer-Controlled Systems, 3rd ed., Prentice Hall 1997,
   section 2.3 (Sampling a system with time delay).
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

    def modes(self, tau: FloatArray, poles: ComplexArray) -> tuple[FloatArray, Any, Any]:
        """Evaluate H, E and T of every row; see `engine.responses`."""
        s = 1j * self.omega
        turn = np.exp(-s * tau[:, None])
        gap = s[:, None] - poles[:, None, :]
        mode = turn[:, :, None] * (s[:, None] / gap)
        return _rows(turn, mode, mode / gap)

    def direct_slope(self, tau: FloatArray) -> FloatArray:
        """Derivative of a direct term of 1 with respect to the dead time, shape (B, 2 K)."""
        turned = -1j * self.omega * np.exp(-1j * self.omega * tau[:, None])
        return np.concatenate([turned.real, turned.imag], axis=1)


@dataclass(frozen=True, eq=False)
class HeldSines:
    r"""The same of sines that are held between two samples, over the response of the hold.

    Samples of the responses to a step of ``z^k - z^(k-1)`` at every sample k sum up [2]_ to

    .. math:: E_j = z^{-d} e^{p_j (d T - \tau)} \frac{1 - z^{-1}}{1 - e^{p_j T} z^{-1}},
              \quad d = \lceil \tau / T \rceil,

    with all aliases; within a sample a direct term does not depend on the dead time.

    Attributes
    ----------
    omega : ndarray, shape (K,)
        In rad/s.
    step : float
        Sample time T in s.
    """

    omega: FloatArray
    step: float

    def modes(self, tau: FloatArray, poles: ComplexArray) -> tuple[FloatArray, Any, Any]:
        """Evaluate H, E and T of every row; see `engine.responses`."""
        angle = 1j * self.omega * self.step
        whole = np.ceil(tau / self.step - 1e-9)[:, None]
        left, late = (self.step * whole - tau[:, None])[:, :, None], np.exp(-angle)[:, None]
        turn = np.exp(-whole * angle) * angle / -np.expm1(-angle)
        decay = np.exp(poles * self.step)[:, None, :] * late
        mode = (turn[:, :, None] * (1 - late)) * np.exp(poles[:, None, :] * left) / (1 - decay)
        return _rows(turn, mode, mode * (left + self.step * decay / (1 - decay)))


def _rows(
    turn: ComplexArray, mode: ComplexArray, slope: ComplexArray
) -> tuple[FloatArray, Any, Any]:
    """Real parts of H, E and T, and then imaginary parts, which are real parts of -j z."""
    both = [np.concatenate([part, -1j * part], axis=1) for part in (mode, slope)]
    return np.concatenate([turn.real, turn.imag], axis=1), both[0], both[1]


def stacked_parts(values: NDArray[Any]) -> FloatArray:
    """Stack real parts on top of imaginary parts."""
    return np.concatenate([values.real, values.imag])
