"""Delayed transfer functions as sums of modes: residues, their derivatives, responses.

b(s) K(s) / (s a(s)) is expanded in partial fractions [1]_: the static gain, and one residue at each
pole. Pairs of conjugate modes are a decaying cosine and sine, so that all columns are real.

References
----------
.. [1] T. Kailath, Linear Systems, Prentice Hall 1980, section 1.1 (modes and partial fractions).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..arrays import BoolArray, ComplexArray, FloatArray, IntArray
from .poles import poles_from_parameters
from .problem import KnownFactor
from .responses import HeldInput, StepSequence


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
