"""Means over a window that moves along a signal."""

from __future__ import annotations

import numpy as np

from .arrays import FloatArray

_WIDE = 256
"""Samples from which on sums that are carried along are quicker than a sum for every window."""


def moving_mean(values: FloatArray, width: int) -> FloatArray:
    """Mean over `width` samples about every sample, zeros beyond the ends.

    Windows of an even number of samples reach one sample further back than ahead.

    Parameters
    ----------
    values : ndarray, shape (N,)
    width : int

    Notes
    -----
    A wide window is the end of one block of `width` samples and the beginning of the next. Sums
    are carried along within the blocks only: a wild sample spoils no means but its own, as it
    would in a sum over everything before.

    Examples
    --------
    >>> import numpy as np
    >>> from ctrl_realize.numerics.moving_mean import moving_mean
    >>> print(moving_mean(np.array([0.0, 0.0, 3.0, 3.0, 3.0]), 3))
    [0. 1. 2. 3. 2.]
    """
    if width < _WIDE or values.size <= width:
        return np.convolve(values, np.ones(width) / width, "same")
    ahead = width // 2
    count = -(-(values.size + width) // width)
    padded = np.zeros(count * width)
    padded[ahead : ahead + values.size] = values
    blocks = padded.reshape(count, width)
    following = np.cumsum(blocks[:, ::-1], axis=1)[:, ::-1].ravel()[: values.size]
    leading = np.zeros_like(blocks)
    np.cumsum(blocks[:, :-1], axis=1, out=leading[:, 1:])
    return np.asarray((following + leading.ravel()[width : width + values.size]) / width)
