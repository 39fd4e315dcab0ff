"""Residuals and Jacobians of a batch, in as many rows as the model has directions.

Response, derivatives, regressors and data of a delayed transfer function lie in the space of the
static part, the modes exp(p t) and their derivatives t exp(p t), the regressors and the data. An
orthogonal transformation [1]_ takes the rows of a record, hundreds or thousands, to as many as
these columns are. Squares and products of residual and Jacobian, all that a search needs, do not
change: they are those of `varpro.evaluate`, which remains for records with local terms or known
dynamics, for points of a frequency response, and where the residual itself is needed.

Pairs of conjugate modes are a decaying cosine and sine, so that all columns are real.

References
----------
.. [1] G. H. Golub and C. F. Van Loan, Matrix Computations, 4th ed., Johns Hopkins 2013, section
   5.3 (the full-rank least squares problem).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from ..arrays import ComplexArray, FloatArray
from .local_terms import solve_upper
from .poles import poles_from_parameters
from .responses import StepSequence
from .varpro import Family, Problem, Structure, evaluate, moved_amplitudes, partial_fractions


@dataclass(frozen=True, eq=False)
class Compressed:
    """Residual (B, k), minus its derivative (B, k, 1 + n), and the square of the residual (B,)."""

    residual: FloatArray
    jacobian: FloatArray
    cost: FloatArray


def compress(problem: Problem, structure: Structure, parameters: FloatArray) -> Compressed:
    """Eliminate the linear terms at parameters (B, 1 + n); see `varpro.evaluate`."""
    if not _compressible(problem, structure):
        state = evaluate(problem, structure, parameters)
        return Compressed(state.residual, state.jacobian, state.cost)
    n = structure.order
    batch = parameters.shape[0]
    poles, dpoles = poles_from_parameters(parameters[:, 1:])
    basis = _Basis(poles)
    table = _factor(problem, parameters[:, 0], basis)
    residues, gain, dresidues = partial_fractions(
        poles, problem.known.numerator, structure.zeros + 1
    )
    residual, numerator, q = _eliminated(table, basis, residues, gain)
    amplitudes = (residues @ numerator[:, :, None])[:, :, 0]
    # Derivatives through the modes, and through what multiplies their derivatives.
    moved = np.zeros((batch, 2, n, 1 + n), dtype=np.complex128)
    moved[:, 0, :, 0] = -amplitudes * poles
    moved[:, 0, :, 1:] = moved_amplitudes(poles, amplitudes, dresidues, numerator) @ dpoles
    moved[:, 1, :, 1:] = amplitudes[:, :, None] * dpoles
    through = np.zeros((batch, 1 + 2 * n, 1 + n))
    level = ((1.0 / poles)[:, None] @ dpoles)[:, 0].real
    through[:, 0, 1:] = level * (-gain * numerator[:, 0])[:, None]
    through[:, 1:] = basis.real(moved).reshape(batch, 2 * n, 1 + n)
    derivative = table[:, :, : 1 + 2 * n] @ through
    derivative -= q @ (np.swapaxes(q, 1, 2) @ derivative)
    return Compressed(residual, derivative, np.add.reduce(residual * residual, axis=1))


@dataclass(frozen=True, eq=False)
class Eliminated:
    """Sums of squares (B,), and coefficients (B, z + 1) of the numerator, lowest power first."""

    cost: FloatArray
    numerator: FloatArray


def eliminate(problem: Problem, structure: Structure, parameters: FloatArray) -> Eliminated:
    """Eliminate the linear terms, and leave derivatives aside."""
    if not _compressible(problem, structure):
        state = evaluate(problem, structure, parameters)
        return Eliminated(state.cost, state.numerator)
    poles, _ = poles_from_parameters(parameters[:, 1:])
    basis = _Basis(poles)
    table = _factor(problem, parameters[:, 0], basis)
    residues, gain, _ = partial_fractions(poles, problem.known.numerator, structure.zeros + 1)
    residual, numerator, _ = _eliminated(table, basis, residues, gain)
    return Eliminated(np.add.reduce(residual * residual, axis=1), numerator)


def _compressible(problem: Problem, structure: Structure) -> bool:
    plain = problem.real and problem.segments is None and not problem.known.poles.size
    return plain and not isinstance(structure, Family)


def _eliminated(
    table: FloatArray, basis: _Basis, residues: ComplexArray, gain: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Residual (B, k), numerator (B, z + 1) and an orthonormal basis of the responses."""
    batch, n, count = residues.shape
    weights = np.zeros((batch, 1 + n, count))
    weights[:, 0, 0] = gain
    weights[:, 1:] = basis.real(residues)
    columns = table[:, :, : 1 + n] @ weights
    # Columns scaled to equal norm: the powers of s differ by many decades.
    norm = np.sqrt(np.add.reduce(columns * columns, axis=1))
    norm[norm == 0] = 1.0
    columns /= norm[:, None]
    data = table[:, :, -1:]
    if count == 1:
        inside = np.swapaxes(columns, 1, 2) @ data
        return (data - columns @ inside)[:, :, 0], inside[:, :, 0] / norm, columns
    q, r = np.linalg.qr(columns)
    inside = np.swapaxes(q, 1, 2) @ data
    return (data - q @ inside)[:, :, 0], solve_upper(r, inside[:, :, 0]) / norm, q


class _Basis:
    """Real modes of poles (B, n): of conjugate pairs the real and the imaginary part of the first.

    ``turning`` (B, n // 2) tells which pairs are conjugate.
    """

    def __init__(self, poles: ComplexArray) -> None:
        self.poles = poles
        self.first = poles.shape[1] % 2
        self.turning = poles.imag[:, self.first :: 2] != 0
        self.turns = bool(self.turning.any())
        if self.turns:
            # Re(w E + its conjugate) = 2 Re(w) Re(E) - 2 Im(w) Im(E), Im(w) = -Im(its conjugate).
            self._parts = np.zeros((2, *poles.shape))
            self._parts[0] = 1.0
            self._parts[0, :, self.first :: 2] += self.turning
            self._parts[0, :, self.first + 1 :: 2] -= self.turning
            self._parts[1, :, self.first + 1 :: 2] = 2 * self.turning

    def real(self, weights: ComplexArray) -> FloatArray:
        """Weights (B, ..., n, k) of complex modes, closed under conjugation, as those of real."""
        if not self.turns:
            return np.asarray(weights.real)
        shape = (2, len(weights), *[1] * (weights.ndim - 3), weights.shape[-2], 1)
        real, imaginary = self._parts.reshape(shape)
        return np.asarray(weights.real * real + weights.imag * imaginary)

    def modes(self, values: Any) -> FloatArray:
        """Real modes (B, m, n) of complex ones."""
        found = np.array(values.real)
        if self.turns:
            second = found[:, :, self.first + 1 :: 2]
            second[:] = np.where(self.turning[:, None], values[:, :, self.first :: 2].imag, second)
        return found


def _factor(problem: Problem, tau: FloatArray, basis: _Basis) -> FloatArray:
    """Triangular factor of all columns (B, k, 2n + 2), without the rows of the regressors.

    Columns are the static part, the modes, their derivatives, and the data.
    """
    batch, n = basis.poles.shape
    q = problem.regressors.shape[1]
    # A column is contiguous, as LAPACK has it.
    space = np.empty((batch, q + 2 * n + 2, problem.data.size))
    space[:, :q] = problem.weighted_regressors.T
    space[:, -1] = problem.weighted_data
    inside = space[:, q:-1]
    if not _step_columns(problem, tau, basis, inside):
        static, mode, slope = problem.drive.modes(tau, basis.poles)
        parts = [static[:, :, None], basis.modes(mode), basis.modes(slope)]
        inside[:] = np.swapaxes(problem.weighted(np.concatenate(parts, axis=2)), 1, 2)
    return triangle(np.swapaxes(space, 1, 2))[:, q:, q:]


def triangle(columns: FloatArray) -> FloatArray:
    """Triangular factor (B, k, k) of columns (B, m, k) with m >= k; fewer rows if m < k."""
    # What LAPACK leaves, without the reflections below; `mode="r"` takes as long again for that.
    left = np.swapaxes(np.linalg.qr(columns, mode="raw")[0], 1, 2)
    rows = min(left.shape[1:])
    return np.asarray(left[:, :rows] * _upper(rows, left.shape[2]))


@lru_cache(maxsize=64)
def _upper(rows: int, columns: int) -> FloatArray:
    return np.triu(np.ones((rows, columns)))


def _step_columns(problem: Problem, tau: FloatArray, basis: _Basis, columns: FloatArray) -> bool:
    """Weighted static part, modes and their derivatives, to `columns` (B, 1 + 2n, m).

    False where that is not possible: for other inputs than one step, coloured noise, missing
    samples, and bins in which the step arrives.
    """
    drive = problem.drive
    if not isinstance(drive, StepSequence) or problem.whitener is not None:
        return False
    elapsed = drive.since_the_step(tau)
    if elapsed is None:
        return False
    n = basis.poles.shape[1]
    static, modes, slopes = columns[:, 0], columns[:, 1 : 1 + n], columns[:, 1 + n :]
    np.multiply(elapsed > 0, drive.sizes[0] * problem.root_weight, out=static)
    # The mean of a mode over a bin is its first sample times a factor; that of t exp(p t) has the
    # mean of the time besides.
    rates = basis.poles.real
    factor, lag, kind = drive.means(rates)
    np.multiply(rates[:, :, None], elapsed[:, None], out=modes)
    np.exp(modes, out=modes)
    modes *= factor.take(kind, axis=2)
    modes *= static[:, None]
    np.multiply(modes, elapsed[:, None] + lag.take(kind, axis=2), out=slopes)
    for pair in range(n // 2 if basis.turns else 0):
        # Cosine and sine instead of both of a pair; the slopes are a product of complex numbers.
        rows = np.flatnonzero(basis.turning[:, pair])
        i = basis.first + 2 * pair
        when, rate = elapsed[rows], basis.poles[rows, i, None]
        factor, lag, kind = drive.means(rate)
        factor, lag = np.log(factor[:, 0]), lag[:, 0]
        decay = static[rows] * np.exp(rate.real * when + factor.real.take(kind, axis=1))
        phase = rate.imag * when + factor.imag.take(kind, axis=1)
        length, turn = when + lag.real.take(kind, axis=1), lag.imag.take(kind, axis=1)
        cosine, sine = decay * np.cos(phase), decay * np.sin(phase)
        modes[rows, i], modes[rows, i + 1] = cosine, sine
        slopes[rows, i] = cosine * length - sine * turn
        slopes[rows, i + 1] = cosine * turn + sine * length
    return True
