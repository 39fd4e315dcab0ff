"""Robustness filter of a filtered Smith predictor."""

from __future__ import annotations

import numpy as np
from scipy.linalg import solve_sylvester

from ...numerics.arrays import FloatArray
from ...numerics.state_space.balancing import Part

Filter = tuple[FloatArray, FloatArray, FloatArray, float]


def predictor_filter(alpha: float, delay: int, *, integrating: bool) -> Filter:
    r"""Design a low-pass filter of unit gain, which removes an integrator from the predictor.

    With ``F'(1) = d`` for an integrating core, ``1 - F(z) z^-d`` has a double zero at z = 1 [1]_:
    ``F = (1-a)/(z-a) (1 + (d (1-a) + 1) (z-1)/(z-a))``.

    Parameters
    ----------
    alpha : float
        Pole of the filter, 0...1.
    delay : int
        Delay of the model in samples.
    integrating : bool
        Whether a pole at z = 1 is removed.

    Returns
    -------
    A, B, C, D
        State space of F, shapes (k, k), (k, 1), (1, k) and a number.

    References
    ----------
    .. [1] J. E. Normey-Rico and E. F. Camacho, Control of Dead-time Processes, Springer 2007,
       doi:10.1007/978-1-84628-829-6.
    """
    weight = delay * (1 - alpha) + 1
    A = np.array([[alpha, 0.0], [1.0, alpha]])
    B = np.array([[1 - alpha], [0.0]])
    C = np.array([[1 + weight, weight * (alpha - 1)]])
    return (A, B, C, 0.0) if integrating else (A[:1, :1], B[:1], np.ones((1, 1)), 0.0)


def removed_part(filter_: Filter, removed: Part) -> FloatArray:
    """Input vector of the filter's states for the remainder of F times the removed modes.

    F(z) G_s(z) is split into the removed poles, which the predictor cancels, and the filter's
    poles; the latter part has the filter's A and C and this input.

    Returns
    -------
    ndarray, shape (k, 1)
    """
    A, B, _, _ = filter_
    removed_A, removed_B, removed_C = removed
    # A X - X A_s + B C_s = 0
    X = solve_sylvester(A, -removed_A, -B @ removed_C)
    return np.asarray(-X @ removed_B, dtype=np.float64)
