r"""Responses behind a flow with convection and diffusion, and their derivatives.

Residence times in a pipe or a packed bed have an inverse Gaussian distribution [1]_, [2]_: with a
mean m and a standard deviation c m the transfer function is

    exp((1 - sqrt(1 + 2 c^2 m s)) / c^2),

and 2/c^2 is the Peclet number. The integral of exp(p (t - s)) over the residence times s < t is

    M = exp(p t + (1 - q) / c^2) F(t; m/q),    q = sqrt(1 + 2 c^2 m p),

with the distribution F of [2]_, for which the density is tilted by exp(-p s); F consists of a
part that is early and one that is late. Derivatives need nothing that M does not:
dF/dm leaves the late part alone, as the densities in it cancel.

References
----------
.. [1] O. Levenspiel, Chemical Reaction Engineering, 3rd ed., Wiley 1999, chapter 13 (The dispersion
   model).
.. [2] J. L. Folks and R. S. Chhikara, The inverse Gaussian distribution and its statistical
   application - a review, J. Roy. Statist. Soc. B 40 (1978) 263-289.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import erfcx

from ..arrays import ComplexArray, FloatArray

_DOUBLE = 1e-12
"""Instead of a square of q of 0, where a derivative is a quotient of two zeros."""


@dataclass(frozen=True, eq=False)
class FlowModes:
    """Modes exp(p t) in series with a flow, at times (m,), and their derivatives.

    ``values`` (m, J), ``by_time``, ``by_mean`` and ``by_spread`` (the latter two with respect to
    logarithms), and ``by_pole``; real if the poles are.
    """

    values: Any
    by_time: Any
    by_mean: Any
    by_spread: Any
    by_pole: Any


def flow_modes(
    time: FloatArray, mean: float, spread: float, poles: FloatArray | ComplexArray
) -> FlowModes:
    r"""Responses of modes in series with dispersion.

    Parameters
    ----------
    time : ndarray, shape (m,)
        Time since the start of the flow, in s; positive.
    mean, spread : float
        Mean residence time in s, and its standard deviation over the mean.
    poles : ndarray, shape (J,)
        In 1/s; 0 for the flow itself, the fraction that has left the pipe.

    Notes
    -----
    With x = t/m and z = (1 -+ q x) / sqrt(2 c^2 x) a mode is exp(-(1 - x)^2 / (2 c^2 x)) / 2 times
    the sum of both erfcx(z); t times the density of the residence times is
    exp(-(1 - x)^2 / (2 c^2 x)) / (c sqrt(2 pi x)).
    """
    x = time / mean
    root = 1 / (spread * np.sqrt(2 * x))
    envelope = 0.5 * np.exp(-((root * (1 - x)) ** 2))
    arriving = 2 / np.sqrt(np.pi) * root * envelope
    complex_ones = bool(np.any(poles.imag != 0))
    rates = poles if complex_ones else poles.real
    columns = []
    for rate in rates:
        square = (1 + 2 * spread**2 * mean * rate) or _DOUBLE
        q = np.sqrt(square) if complex_ones or square > 0 else 1j * np.sqrt(-square)
        value, late = _parts(q, x, root, envelope, time * rate + (1 - q) / spread**2)
        turned = (value - 2 * late) * (mean / q)
        curved = ((1 - q) ** 2 * value - 2 * (square + 1) * late) / (q * spread**2)
        if not complex_ones:
            turned, curved = turned.real, curved.real
        by_time, by_mean = rate * value + arriving / time, -rate * turned - arriving
        columns.append((value, by_time, by_mean, curved + 2 * arriving, time * value - turned))
    return FlowModes(*(np.stack(column, axis=1) for column in zip(*columns, strict=True)))


def _parts(
    q: Any, x: FloatArray, root: FloatArray, envelope: FloatArray, tilt: Any
) -> tuple[Any, Any]:
    """A mode, and its late part."""
    late = envelope * erfcx(root * (1 + q * x))
    if q.real == 0:
        return 2 * late.real, late  # the early part is its conjugate
    early = root * (1 - q * x)
    behind = early.real < 0
    # erfcx(z) = 2 exp(z^2) - erfcx(-z): for negative z it would overflow.
    sign = np.where(behind, -1.0, 1.0)
    whole = np.exp(np.where(behind, tilt, -np.inf))
    return whole + late + sign * envelope * erfcx(sign * early), late
