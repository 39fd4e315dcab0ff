"""Exact sampling of a continuous model behind a zero-order hold and a dead time."""

from __future__ import annotations

import math

import numpy as np
from scipy.linalg import expm

from .arrays import FloatArray


def zero_order_hold(A: FloatArray, B: FloatArray, dt: float) -> tuple[FloatArray, FloatArray]:
    """Sample x' = A x + B u with u held over each sample.

    Parameters
    ----------
    A, B : ndarray, shapes (n, n), (n, m)
    dt : float
        Sample time in s.

    Returns
    -------
    Phi, Gamma : ndarray, shapes (n, n), (n, m)
        exp(A dt) and the integral of exp(A s) B over 0..dt.
    """
    n, m = B.shape
    block = np.zeros((n + m, n + m))
    block[:n, :n] = A
    block[:n, n:] = B
    grown = expm(block * dt)
    return grown[:n, :n], grown[:n, n:]


def split_dead_time(dead_time: float, dt: float) -> tuple[int, float]:
    """Split a dead time into whole samples and a rest in 0..1 (a fraction of dt).

    A rest closer to a whole sample than rounding can tell is that whole sample.

    Examples
    --------
    >>> from ctrl_realize.numerics.sampling import split_dead_time
    >>> split_dead_time(0.3, 0.1)
    (3, 0.0)
    """
    samples = dead_time / dt
    whole = math.floor(samples)
    rest = samples - whole
    tolerance = 1e-9 * max(1.0, samples)
    if rest < tolerance:
        rest = 0.0
    elif rest > 1 - tolerance:
        whole, rest = whole + 1, 0.0
    return whole, rest


def sample_with_dead_time(
    A: FloatArray, B: FloatArray, C: FloatArray, D: FloatArray, dt: float, dead_time: float
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, int]:
    """Sample a continuous model whose input is held and then delayed by any dead time.

    With dead time (d + f) dt, 0 < f < 1, the held input that acts during a sample changes
    once, after f dt. With Gamma0 the integral of exp(A s) B over the rest (1-f) dt, the state
    x[k] - Gamma0 u[k-d-1] makes the model order n again, with feedthrough C Gamma0 and
    delay d + 1.

    Parameters
    ----------
    A, B, C, D : ndarray, shapes (n, n), (n, m), (p, n), (p, m)
        Continuous model; D must be zero when the dead time is no multiple of `dt`.
    dt, dead_time : float
        In s.

    Returns
    -------
    A, B, C, D : ndarray
        Sampled core.
    delay : int
        Whole samples that stand before it.
    """
    whole, rest = split_dead_time(dead_time, dt)
    if rest == 0.0:
        Phi, Gamma = zero_order_hold(A, B, dt)
        return Phi, Gamma, C, D, whole
    if np.any(D):
        raise AssertionError("a fractional delay of a direct term is no state-space model")
    early, Gamma0 = zero_order_hold(A, B, (1 - rest) * dt)
    late, partial = zero_order_hold(A, B, rest * dt)
    Phi = late @ early
    Gamma1 = early @ partial
    return Phi, Phi @ Gamma0 + Gamma1, C, C @ Gamma0, whole + 1
