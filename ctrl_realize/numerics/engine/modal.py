"""Delayed transfer functions as sums of modes: residues, their derivatives, responses.

b(s) K(s) / (s a(s)) is expanded in partial fractions [1]_: the static gain, and one residue at each
pole. Pairs of conjugate modes are a decaying cosine and sine, so that all columns are real.

The poles are those of real and quadratic factors with logarithmic parameters. An order-n
denominator is written with ``n // 2`` quadratic factors ``s^2 + 2 zeta omega s + omega^2`` and, for
odd n, one real factor ``s + lambda``. The parameters are ``log(lambda)`` (odd n, first), then
``log(omega), log(zeta)`` of every pair. A damping above 1 represents two real poles, so that it
need not be decided in advance which poles are complex.

Our own parametrisation of stable polynomials: all real parameters give a stable one, and relative
changes of a time constant have the same size for slow and fast poles.

References
----------
.. [1] T. Kailath, Linear Systems, Prentice Hall 1980, section 1.1 (modes and partial fractions).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..arrays import BoolArray, ComplexArray, FloatArray, IntArray
from .problem import KnownFactor
from .responses import HeldInput, StepSequence

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


class RealModes:
    """Real columns for the modes of poles (B, J), of which the first `free` are those of a plant.

    For a pair of conjugates they are half the sum of both modes, and their difference over 2j: of a
    time response its real and its imaginary part. ``turning`` (B, pairs) tells which pairs are
    conjugate, ``first`` and ``second`` (pairs,) are the numbers of their poles.
    """

    def __init__(self, poles: ComplexArray, free: int) -> None:
        self.poles = poles
        self.first = np.arange(free % 2, free, 2)
        self.second = self.first + 1
        if poles.shape[1] > free:
            known = poles[0, free:]
            upper = np.flatnonzero(known.imag > 0)
            lower = np.abs(known[:, None] - known[upper].conj()).argmin(axis=0)
            self.first = np.append(self.first, free + upper)
            self.second = np.append(self.second, free + lower)
        self._free = free
        self.turning: BoolArray = poles.imag[:, self.first] != 0
        self.turns = bool(self.turning.any())

    def weights(self, weights: ComplexArray) -> FloatArray:
        """Weights (B, J', k) of complex modes, closed under conjugation, as those of real.

        J' is J, or the number of the free poles.
        """
        found = np.array(weights.real)
        if self.turns:
            first, second, turning = self._pairs(weights.shape[1])
            turning = turning[:, :, None]
            # Re(w E + v F), v conjugate to w: 2 Re(w) (E + F) / 2 - 2 Im(w) (E - F) / 2j.
            found[:, second] = np.where(turning, -2 * weights.imag[:, first], found[:, second])
            found[:, first] *= 1 + turning
        return found

    def columns(self, modes: Any) -> FloatArray:
        """Real columns (B, m, J') of complex modes."""
        found = np.array(modes.real)
        if self.turns:
            first, second, turning = self._pairs(modes.shape[2])
            turning = turning[:, None]
            ahead, behind = modes[:, :, first], modes[:, :, second]
            found[:, :, first] = np.where(turning, (ahead + behind).real / 2, ahead.real)
            found[:, :, second] = np.where(turning, (ahead - behind).imag / 2, behind.real)
        return found

    def _pairs(self, count: int) -> tuple[IntArray, IntArray, BoolArray]:
        """Pairs among the first poles: all of them, or those of the plant."""
        pairs = slice(self._free // 2 if count == self._free else None)
        return self.first[pairs], self.second[pairs], self.turning[:, pairs]


def respond(
    drive: HeldInput, known: KnownFactor, numerator: FloatArray, parameters: FloatArray
) -> FloatArray:
    """Response (m,) of one model, numerator (n - r + 1,), parameters (1 + n,)."""
    pieces = drive.pieces() if isinstance(drive, StepSequence) else [drive]
    parts = [responses(piece, known, numerator[None], parameters[None])[0] for piece in pieces]
    return np.concatenate(parts) if len(parts) > 1 else parts[0]


def responses(
    drive: HeldInput, known: KnownFactor, numerator: FloatArray, parameters: FloatArray
) -> FloatArray:
    """Responses (B, m) of several models, numerators (B, n - r + 1), parameters (B, 1 + n)."""
    free = poles_from_parameters(parameters[:, 1:])[0]
    poles = np.concatenate([free, np.tile(known.poles, (len(free), 1))], axis=1)
    residues, gain, _ = partial_fractions(poles, known.numerator, numerator.shape[1])
    static, mode, _ = drive.modes(parameters[:, 0], poles)
    modes = RealModes(poles, parameters.shape[1] - 1)
    moving = modes.columns(mode) @ modes.weights(residues @ numerator[:, :, None])
    return np.asarray(moving[:, :, 0] + static * (gain * numerator[:, 0])[:, None])


def partial_fractions(
    poles: ComplexArray, known: FloatArray, count: int
) -> tuple[ComplexArray, FloatArray, ComplexArray]:
    """Expand s^i K(s) / (s a(s)), i = 0...count - 1.

    Returns the residues s^(i-1) K / a' at the poles (B, J, count), the static gain (B,) of the
    first, that of the others being zero, and d(s^(i-1) K)/ds over a' at the poles.
    """
    n = poles.shape[1]
    gap = poles[:, :, None] - poles[:, None, :] + np.eye(n)
    slope = np.multiply.reduce(gap, axis=2)
    value = known[0] if known.size == 1 else np.polyval(known, poles)
    gain = known[-1] / np.multiply.reduce(-poles, axis=1).real
    exponent = np.arange(-1, count - 1)
    power = np.empty((*poles.shape, count), dtype=np.complex128)
    power[:, :, 0], power[:, :, 1:2] = 1.0 / poles, 1.0
    for i in range(2, count):
        power[:, :, i] = power[:, :, i - 1] * poles
    residues = power * (value / slope)[:, :, None]
    dresidues = exponent * residues / poles[:, :, None]
    if known.size > 1:
        dresidues += power * (np.polyval(np.polyder(known), poles) / slope)[:, :, None]
    return residues, gain, dresidues


def moved_amplitudes(
    poles: ComplexArray, amplitudes: ComplexArray, dresidues: ComplexArray, numerator: FloatArray
) -> ComplexArray:
    """Derivatives of amplitudes (rows j) w.r.t. poles (columns k), shape (B, J, J)."""
    unit = np.eye(poles.shape[1])
    inverse = 1.0 / (poles[:, :, None] - poles[:, None, :] + unit) - unit
    moved = amplitudes[:, :, None] * inverse
    through = (dresidues @ numerator[:, :, None])[:, :, 0]
    along = through - amplitudes * np.add.reduce(inverse, axis=2)
    return np.asarray(moved + along[:, :, None] * unit)
