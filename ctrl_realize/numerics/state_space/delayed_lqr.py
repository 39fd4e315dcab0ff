"""Optimal state feedback of a core whose inputs have different delays.

Known as the regulator for multiple input delays [1]_; with one delay it is the stationary gain on
the predicted state [2]_.

References
----------
.. [1] H. Zhang, G. Duan and L. Xie, Linear quadratic regulation for linear time-varying systems
   with multiple input delays, Automatica 42 (2006) 1465-1476, doi:10.1016/j.automatica.2006.04.007.
.. [2] Z. Artstein, Linear systems with delayed controls: a reduction, IEEE Trans. Automat. Control
   27 (1982) 869-879, doi:10.1109/TAC.1982.1103023.
"""

from __future__ import annotations

import numpy as np

from ..arrays import FloatArray, IntArray

Weights = tuple[FloatArray, FloatArray]


def line_gain(
    A: FloatArray, B: FloatArray, weights: Weights, final: Weights, delays: tuple[int, ...]
) -> FloatArray:
    r"""Gain for the core's state and the past inputs within the delays.

    Let v_j[t] be the input that acts t samples from now: ``v_j[t] = u_j[t - d_j]``. It is known for
    ``t < d_j`` and free from then on. After the longest delay T all inputs are free, and the
    stationary regulator with its cost P applies. From T back to the shortest delay each sample is
    one step of the Riccati recursion for the inputs that are free at t; the known ones enter as
    known disturbances, by a term of the cost that is linear in the state:

    .. math:: V_t(x) = x^T P_t x + 2 x^T S_t z + \dots, \quad z = [x_0; u_1[-1], u_1[-2] \dots]

    A forward sweep then predicts ``x[t] = M_t z`` along the optimum and gives the row of input j at
    ``t = d_j``.

    Parameters
    ----------
    A, B : ndarray, shapes (n, n), (n, m)
    weights : tuple of ndarray
        Q (n, n) and R (m, m); R must not couple inputs of different delays.
    final : tuple of ndarray
        Gain (m, n) and cost (n, n) of the stationary regulator without delays.
    delays : tuple of int
        One for each input, in samples.

    Returns
    -------
    ndarray, shape (m, n + sum of delays)
        ``u = -gain @ [core; line of input 1, newest first; line of input 2; ...]``.

    Notes
    -----
    ``(T - min(delays))`` steps with matrices of the core's size; the full Riccati equation has the
    size of core and delay lines.
    """
    n, m = B.shape
    d = np.array(delays, dtype=np.int64)
    starts = n + np.cumsum(d) - d
    size = n + int(d.sum())
    first, last = int(d.min()), int(d.max())
    core_gain, cost = final

    def arriving(t: int) -> tuple[IntArray, FloatArray]:
        """Entries of z that act on the core at t, and their columns of B."""
        late = np.flatnonzero(d > t)
        return starts[late] + d[late] - t - 1, B[:, late]

    laws: list[tuple[IntArray, FloatArray, FloatArray]] = []
    P, S = cost, np.zeros((n, size))
    for t in range(last - 1, first - 1, -1):
        free = np.flatnonzero(d <= t).astype(np.int64)
        Bf = B[:, free]
        entries, columns = arriving(t)
        S[:, entries] += P @ columns
        weight = weights[1][np.ix_(free, free)] + Bf.T @ P @ Bf
        both = np.linalg.solve(weight, Bf.T @ np.hstack([P @ A, S])).astype(np.float64)
        on_state, on_line = both[:, :n], both[:, n:]
        laws.append((free, on_state, on_line))
        closed = A - Bf @ on_state
        P, S = weights[0] + A.T @ P @ closed, closed.T @ S
        P = (P + P.T) / 2

    gain = np.zeros((m, size))
    M = np.eye(n, size)
    for t in range(last):
        ahead = A @ M
        entries, columns = arriving(t)
        ahead[:, entries] += columns
        if t >= first:
            free, on_state, on_line = laws.pop()
            law = on_state @ M + on_line
            now = d[free] == t
            gain[free[now]] = law[now]
            ahead -= B[:, free] @ law
        M = ahead
    gain[d == last] = (core_gain @ M)[d == last]
    return gain
