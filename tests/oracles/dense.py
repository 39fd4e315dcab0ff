"""The textbook way, written for reading: dense SVD for every delay, states stepped one by one.

Slow on purpose; the fast routes of the toolbox are tested against it.
"""

import numpy as np


def hankel(h: np.ndarray, rows: int, columns: int) -> np.ndarray:
    """Block Hankel matrix, block row by block row; h has the shape (p, m, N), zeros follow it."""
    p, m, length = h.shape
    H = np.zeros((rows * p, columns * m))
    for i in range(rows):
        for j in range(min(columns, max(0, length - i))):
            H[i * p : (i + 1) * p, j * m : (j + 1) * m] = h[:, :, i + j]
    return H


def kung(markov: np.ndarray, delay: int, samples: int, order: int, *, padded: bool = False):
    """A, B, C and all singular values; markov has the shape (p, m, N)."""
    p, m, _ = markov.shape
    r = samples if padded else samples // 2
    h = markov[:, :, delay + 1 : delay + 1 + samples]
    He = hankel(h if padded else h[:, :, : 2 * r - 1], r, r)
    Ha = hankel(h[:, :, 1:] if padded else h[:, :, 1 : 2 * r], r, r)
    U, s, Vt = np.linalg.svd(He)
    root = np.diag(s[:order] ** -0.5)
    A = root @ U[:, :order].T @ Ha @ Vt[:order].T @ root
    B = root @ U[:, :order].T @ He[:, :m]
    C = He[:p] @ Vt[:order].T @ root
    return A, B, C, s


def simulate(A, B, C, D, delay: int, count: int) -> np.ndarray:
    """Markov parameters with the delay put back, shape (p, m, count)."""
    out = np.zeros((*np.shape(D), count))
    state = np.array(B, dtype=float)
    for k in range(delay, count):
        out[:, :, k] = D if k == delay else C @ state
        if k > delay:
            state = A @ state
    return out


def step_response(system, count: int) -> np.ndarray:
    """Response of a single-channel system to a unit step, by the recursion itself."""
    A, B, C, D = (np.asarray(M) for M in (system.A, system.B, system.C, system.D))
    x, out = np.zeros(A.shape[0]), np.empty(count)
    for k in range(count):
        out[k] = (C @ x)[0] + D[0, 0]
        x = A @ x + B[:, 0]
    return out


def scan(markov: np.ndarray, delays, samples: int, orders, window: int, *, padded=False):
    """IAE (orders, delays) and leading singular values (delays, max order) of a SISO scan."""
    g = markov[np.newaxis, np.newaxis]
    misfit = np.empty((len(orders), len(delays)))
    values = np.empty((len(delays), max(orders)))
    for i, d in enumerate(delays):
        A, B, C, s = kung(g, d, samples, max(orders), padded=padded)
        values[i] = s[: max(orders)]
        for j, k in enumerate(orders):
            model = simulate(A[:k, :k], B[:k], C[:, :k], g[:, :, d], d, window)
            misfit[j, i] = np.abs(g[:, :, :window] - model).sum()
    return misfit, values
