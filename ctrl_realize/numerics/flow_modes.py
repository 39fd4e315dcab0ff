"""Step responses behind a flow that disperses, in closed form."""

from __future__ import annotations

import numpy as np
from scipy.special import wofz

from .arrays import ComplexArray, FloatArray


def flow_modes(
    time: FloatArray, mean: float, spread: float, poles: ComplexArray
) -> tuple[FloatArray, ComplexArray]:
    r"""Step responses of a flow, and of modes behind it.

    Parameters
    ----------
    time : ndarray, shape (m,)
        Since the flow set in, in s; positive.
    mean, spread : float
        Mean residence time in s, and its standard deviation over the mean.
    poles : ndarray, shape (J,)
        In 1/s.

    Returns
    -------
    passed : ndarray, shape (m,)
        Part of the flow that has passed.
    modes : ndarray, shape (m, J)
        exp(p t) behind the flow: the integral of exp(p (t - s)) over the residence times s.

    Notes
    -----
    With q = sqrt(1 + 2 c^2 m p), x = t/m and z = (1 -+ q x) / sqrt(2 c^2 x) a mode is
    exp(-(1 - x)^2 / (2 c^2 x)) / 2 times the sum of both erfcx(z); ``p = 0`` is the flow itself.
    """
    x = time[:, None] / mean
    rates = np.append(poles, 0.0)
    q = np.sqrt(1 + 2 * spread**2 * mean * rates.astype(np.complex128))
    root = 1 / (spread * np.sqrt(2 * x))
    envelope = 0.5 * np.exp(-((root * (1 - x)) ** 2))
    early, late = root * (1 - q * x), root * (1 + q * x)
    behind = early.real < 0
    # erfcx(z) = 2 exp(z^2) - erfcx(-z): of a negative z it would overflow.
    sign = np.where(behind, -1.0, 1.0)
    whole = np.exp(np.where(behind, rates * mean * x + (1 - q) / spread**2, -np.inf))
    values = whole + envelope * (wofz(1j * late) + sign * wofz(1j * sign * early))
    return values[:, -1].real, values[:, :-1]
