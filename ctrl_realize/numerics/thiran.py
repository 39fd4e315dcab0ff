"""Thiran all-pass filters: maximally flat fractional delays."""

from __future__ import annotations

from math import comb

import numpy as np

from .arrays import FloatArray


def thiran_denominator(delay: float, order: int) -> FloatArray:
    r"""Denominator of the all-pass filter with maximally flat group delay at frequency 0.

    ``a_k = (-1)^k C(N, k) prod_{i=0..N} (D - N + i) / (D - N + k + i)`` [1]_; the numerator is the
    same, reversed. Stable for D > N - 1.

    Parameters
    ----------
    delay : float
        D in samples, > order - 1.
    order : int
        N.

    Returns
    -------
    ndarray, shape (N + 1,)
        In z, highest power first.

    References
    ----------
    .. [1] J.-P. Thiran, Recursive digital filters with maximally flat group delay, IEEE Trans.
       Circuit Theory 18 (1971) 659-664.
    """
    i = np.arange(order + 1)
    return np.array(
        [
            (-1) ** k * comb(order, k) * np.prod((delay - order + i) / (delay - order + k + i))
            for k in range(order + 1)
        ]
    )
