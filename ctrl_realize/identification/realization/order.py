"""Order supported by an impulse response."""

from __future__ import annotations

import numpy as np

from ...data.impulse_estimate import ImpulseEstimate
from ...numerics.arrays import FloatArray
from .scan_surface import Surface

ABOVE_NOISE = 1.3
"""Singular values above 1.3 times the largest of pure noise belong to the plant; below it the scan
follows the noise and is flagged. (The largest gap finds too few of them, the Gavish-Donoho
threshold hundreds.)"""

WORTH_ONE, WORTH_TWO = 1.3, 4.0
"""Factors by which one more order, or two together, must lower the IAE. A filter that remains in
low-noise data adds singular values above the noise that hardly lower it, and realizing them biases
the delay: 24 samples instead of 37 on a simulated third-order valve at 0.02 % noise."""

WITHIN, MATTERS, WORTH_MORE = 1.0, 0.1, 3.0
"""Thresholds on IAE over the sum of the standard deviations of an estimated response: a model below
the first fits within the uncertainty, and below a tenth of it an improvement is meaningless.
Between them one more order must lower the IAE by a factor of three, because the standard deviations
are conservative. On 24 simulated records of four plants the true order is within 0.9, one less
beyond 1.7 or three times higher, except where noise of half the output hides the last order."""

AS_GOOD = 1.1
"""Without known noise: an IAE up to 1.1 times the smallest is sufficient."""


def suggest_order(surface: Surface, last: FloatArray) -> int:
    """Choose the order whose singular values are significant and improve the fit.

    Parameters
    ----------
    surface : Surface
    last : ndarray, shape (orders,)
        Last singular value of each order, at its best delay.
    """
    misfits = surface.iae.min(axis=1)
    if surface.noise_floor:
        above = np.flatnonzero(last > ABOVE_NOISE * surface.noise_floor)
        most = int(above[-1]) if above.size else 0
        return surface.orders[_worth_it(misfits, most, surface.rounding)]
    if isinstance(surface.impulse, ImpulseEstimate):
        share = misfits / surface.impulse.std[..., : surface.window].sum()
        if share.min() <= WITHIN:
            return surface.orders[_within_deviations(share)]
    as_good = misfits <= AS_GOOD * misfits.min() + surface.rounding
    return surface.orders[int(np.flatnonzero(as_good)[0])]


def _worth_it(misfits: FloatArray, most: int, rounding: float) -> int:
    """Increase the order by one or two as long as this lowers the IAE enough."""
    chosen = 0
    while chosen < most:
        if misfits[chosen] > WORTH_ONE * misfits[chosen + 1] + rounding:
            chosen += 1
        elif chosen + 2 <= most and misfits[chosen] > WORTH_TWO * misfits[chosen + 2] + rounding:
            chosen += 2
        else:
            break
    return chosen


def _within_deviations(share: FloatArray) -> int:
    """Choose the first order that fits within the uncertainty, or one that is far better.

    `share` is the IAE of each order over the sum of the standard deviations.
    """
    chosen = int(np.argmax(share <= WITHIN))
    while chosen + 1 < share.size and share[chosen] > max(MATTERS, WORTH_MORE * share[chosen + 1]):
        chosen += 1
    return chosen
