"""Stable polynomials as real and quadratic factors with logarithmic parameters.

An order-n denominator is written with ``n // 2`` quadratic factors
``s^2 + 2 zeta omega s + omega^2`` and, for odd n, one real factor ``s + lambda``.
The parameters are ``log(lambda)`` (odd n, first), then ``log(omega), log(zeta)`` of every pair. A
damping above 1 represents two real poles, so that it need not be decided in advance which poles are
complex.

Our own parametrisation of stable polynomials: all real parameters give a stable one, and relative
changes of a time constant have the same size for slow and fast poles.
"""

from __future__ import annotations

import numpy as np

from ..arrays import ComplexArray, FloatArray

# Partial fractions need distinct poles. The poles of a pair are kept at least this far apart
# (relative); the effect on the response is of second order, far below any noise.
_GAP = 0.01


def poles_from_parameters(
    theta: FloatArray, *, apart: bool = True
) -> tuple[ComplexArray, ComplexArray]:
    """Return the poles and their derivatives with respect to the parameters.

    Parameters
    ----------
    theta : ndarray, shape (B, n)
        Parameters of B denominators, in 1/s (logarithmic).
    apart : bool, optional
        Separate coincident poles of different factors.

    Returns
    -------
    poles : ndarray, shape (B, n)
        Distinct poles; conjugates are neighbours.
    derivative : ndarray, shape (B, n, n)
        ``derivative[b, i, q]`` is d poles[b, i] / d theta[b, q].
    """
    batch, order = theta.shape
    start = order % 2
    value = np.exp(theta)
    omega, zeta = value[:, start::2], value[:, start + 1 :: 2]
    square = zeta**2 - 1.0
    near = np.abs(square) < _GAP**2 / 4
    if near.any():
        square = np.where(near, np.where(square < 0, -1, 1) * _GAP**2 / 4, square)
    root = np.sqrt(square.astype(np.complex128))
    far = zeta + root
    poles = np.empty((batch, order), dtype=np.complex128)
    # -omega (zeta - root) = -omega / (zeta + root): no cancellation.
    poles[:, start::2] = omega * np.where(square > 0, -1.0 / far, root - zeta)
    poles[:, start + 1 :: 2] = -omega * far
    derivative = np.zeros((batch, order, order), dtype=np.complex128)
    if start:
        poles[:, 0] = derivative[:, 0, 0] = -value[:, 0]
    # The elements of the 2 x 2 blocks on the diagonal: rows are poles, columns omega and zeta.
    block = derivative.reshape(batch, order**2)[:, start * (order + 1) :]
    every = 2 * (order + 1)
    turn, scale = zeta / root, zeta * omega
    block[:, ::every] = poles[:, start::2]
    block[:, order::every] = poles[:, start + 1 :: 2]
    block[:, 1::every] = scale * (turn - 1.0)
    block[:, order + 1 :: every] = -scale * (turn + 1.0)
    # A pair is apart.
    return separated(poles, _GAP) if apart and order > 2 else poles, derivative


def parameters_from_poles(poles: ComplexArray) -> FloatArray:
    """Return the parameters (n,) of one set of stable poles (n,), closed under conjugation."""
    order = poles.size
    upper = sorted((p for p in poles if p.imag > 1e-9 * abs(p)), key=abs)
    real = sorted((p.real for p in poles if abs(p.imag) <= 1e-9 * abs(p)), key=abs)
    pairs = [(abs(p), -p.real / abs(p)) for p in upper]
    theta = []
    if order % 2:
        theta.append(np.log(-real.pop(0)))
    for fast, slow in zip(real[1::2], real[0::2], strict=True):
        omega = float(np.sqrt(fast * slow))
        pairs.append((omega, -(fast + slow) / (2 * omega)))
    for omega, zeta in pairs:
        theta += [np.log(omega), np.log(zeta)]
    return np.array(theta, dtype=np.float64)


def separated(poles: ComplexArray, part: float) -> ComplexArray:
    """Separate coincident poles (B, n) by a part of their size."""
    order = poles.shape[1]
    gap = np.abs(poles[:, :, None] - poles[:, None]) < 0.5 * part * np.abs(poles[:, None])
    if np.count_nonzero(gap) == gap.shape[0] * order:  # only every pole with itself
        return poles
    for j in range(1, order):
        for _ in range(order):
            gap = np.abs(poles[:, :j] - poles[:, j, None]) < 0.5 * part * np.abs(poles[:, j, None])
            clash = gap.any(axis=1)
            if not clash.any():
                break
            poles[clash, j] *= 1 + part
    return poles


def lag_sum(poles: ComplexArray, numerator: FloatArray) -> float:
    """Total delay of b(s)/a(s) without dead time: sum of its lags minus that of its leads, in s."""
    lag = float(np.sum(-1.0 / poles).real)
    if numerator.size > 1 and numerator[0] != 0:
        lag -= float(numerator[1] / numerator[0])
    return lag
