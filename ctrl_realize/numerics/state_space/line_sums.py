"""Frequency response of a delay line with individual weights.

Our own: the closed form is the geometric series ``sum_{i=1..d} A^(i-1) z^-i = (z I - A)^-1 (I -
z^-d A^d)``.
"""

from __future__ import annotations

import numpy as np

from ..arrays import ComplexArray, FloatArray
from .responses import frequency_response, schur_form

CHUNK = 2048
"""Points that are evaluated together; bounds the memory of the powers."""
LONG = 500
"""Length of a delay line from which on the closed form is used instead of the sum."""
LOST = 1e-11
"""Error, relative to the largest possible value of the sum, above which the sum is used."""


class LineSum:
    r"""Evaluate :math:`\sum_{i=1}^{d} r_i z^{-i}` for columns r_i at many z.

    If the columns are pulse responses, ``r_i = C A^(i-1) B``, and only the last may differ, a long
    delay line has a closed form, whose cost does not depend on d:

    .. math:: C (z I - A)^{-1} (B - z^{-d} A^d B) + (r_d - C A^{d-1} B) z^{-d}

    Near an eigenvalue of A both terms are large and cancel; the sum is used there.

    Parameters
    ----------
    rows : ndarray, shape (r, d)
        Columns r_i.
    pulses : (A, B, C), optional
        Shapes (n, n), (n, 1), (r, n).
    """

    def __init__(
        self, rows: FloatArray, pulses: tuple[FloatArray, FloatArray, FloatArray] | None = None
    ) -> None:
        self._mix, self._few = _low_rank(rows)
        self._length = d = rows.shape[1]
        self._reach = np.abs(rows).sum(axis=1, keepdims=True)
        self._pulses = None
        if pulses is not None and d >= LONG:
            A, B, C = pulses
            before = np.linalg.matrix_power(A, d - 1) @ B
            both = np.hstack([B, A @ before]), C, np.zeros((C.shape[0], 2))
            self._pulses = schur_form(A), both
            self._last = rows[:, -1:] - C @ before

    def __call__(self, z: ComplexArray) -> ComplexArray:
        """Evaluate at points z, shape (r, K)."""
        if self._pulses is None:
            return self._summed(z)
        form, (B, C, none) = self._pulses
        with np.errstate(divide="ignore", invalid="ignore"):
            here, there = np.moveaxis(frequency_response(form, B, C, none, z), 1, 0)
            behind = z ** (-self._length)
            out = here + (self._last - there) * behind
            # Rounding of either term, with n products each; not finite at an eigenvalue itself.
            rough = np.abs(here) * 1e-16 * B.shape[0]
        lost = ~np.all(rough <= LOST * self._reach, axis=0)
        out[:, lost] = self._summed(z[lost])
        return np.asarray(out, dtype=np.complex128)

    def _summed(self, z: ComplexArray) -> ComplexArray:
        parts = [
            self._mix @ _in_powers(self._few, 1 / z[start : start + CHUNK])
            for start in range(0, z.size, CHUNK)
        ]
        return np.hstack([np.zeros((self._mix.shape[0], 0)), *parts])


def _low_rank(rows: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Write rows = mix @ few; all rows of a predictor are combinations of one or two taps.

    The rows have the units of their states: without scaling the smaller ones are lost in rounding.
    """
    size = np.abs(rows).max(axis=1, initial=0.0, keepdims=True)
    size[size == 0] = 1.0
    U, s, V = np.linalg.svd(rows / size, full_matrices=False)
    rank = int(np.sum(s > 1e-15 * s.max(initial=0.0)))
    return size * U[:, :rank] * s[:rank], V[:rank]


def _in_powers(rows: FloatArray, x: ComplexArray) -> ComplexArray:
    """Sum rows[:, i] x^(i+1) by Horner's rule, shape (rows, K)."""
    total = np.zeros((rows.shape[0], x.size), dtype=np.complex128)
    for column in rows.T[::-1]:
        total += column[:, None]
        total *= x
    return total
