"""Robustness filter of a filtered Smith predictor."""

from __future__ import annotations

import numpy as np
from scipy.linalg import solve_sylvester

from ...numerics.arrays import FloatArray
from ...numerics.state_space.balancing import Part

Filter = tuple[FloatArray, FloatArray, FloatArray, float]


def predictor_filter(alpha: float, delay: int, poles: FloatArray, *, integrating: bool) -> Filter:
    r"""Design a low-pass filter of unit gain that removes given poles from the predictor.

    In the basis ``phi_j = (1-a)/(z-a) ((z-1)/(z-a))^j`` the filter F meets ``F(1) = 1``,
    ``F(p) = p^d`` at each pole, and ``F'(1) = d`` for an integrating core: then
    ``1 - F(z) z^-d`` has zeros at all of them [1]_.

    Parameters
    ----------
    alpha : float
        Pole of the filter, 0...1.
    delay : int
        Delay of the model in samples.
    poles : ndarray, shape (s,)
        Real poles to remove, other than z = 1.
    integrating : bool
        Whether a pole at z = 1 is removed too.

    Returns
    -------
    A, B, C, D
        State space of F, shapes (k, k), (k, 1), (1, k) and a number.

    References
    ----------
    .. [1] J. E. Normey-Rico and E. F. Camacho, Control of Dead-time Processes, Springer 2007,
       doi:10.1007/978-1-84628-829-6.
    """
    count = 1 + poles.size + int(integrating)
    basis = np.arange(count)
    rows, values = [np.where(basis == 0, 1.0, 0.0)], [1.0]
    if integrating:
        # phi_0' = -1/(1-a) and phi_1' = 1/(1-a) at z = 1, all others are 0 there.
        slope = np.zeros(count)
        slope[0], slope[1] = -1 / (1 - alpha), 1 / (1 - alpha)
        rows.append(slope)
        values.append(float(delay))
    for p in poles:
        rows.append((1 - alpha) / (p - alpha) * ((p - 1) / (p - alpha)) ** basis)
        values.append(float(p) ** delay)
    weights = np.linalg.solve(np.array(rows), np.array(values))
    # A cascade: the input of each stage is the stage before it, plus that stage's input.
    A, B = alpha * np.eye(count), np.zeros((count, 1))
    B[0] = 1 - alpha
    for i in range(1, count):
        A[i, 0] = 1.0
        A[i, 1:i] = alpha - 1
    through = np.zeros((count, count))
    for j in range(count):
        through[j, 0] = 1.0
        through[j, 1 : j + 1] = alpha - 1
    return A, B, (weights @ through)[None, :], 0.0


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
