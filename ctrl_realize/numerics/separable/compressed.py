"""Residuals and Jacobians of a batch, in as many rows as the model has directions.

Response, derivatives, regressors and data of a delayed transfer function lie in the space of the
static part, the modes exp(p t) and their derivatives t exp(p t), the regressors and the data. An
orthogonal transformation [1]_ takes the rows of a record, hundreds or thousands, to as many as
these columns are. Squares and products of residual and Jacobian, all that a search needs, do not
change: they are those of `varpro.evaluate`, which remains for records with local terms or known
dynamics, and where the residual itself is needed.

Pairs of conjugate modes are a decaying cosine and sine, so that all columns are real.

References
----------
.. [1] G. H. Golub and C. F. Van Loan, Matrix Computations, 4th ed., Johns Hopkins 2013, section
   5.3 (the full-rank least squares problem).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import BoolArray, ComplexArray, FloatArray
from .local_terms import solve_upper
from .poles import poles_from_parameters
from .responses import StepSequence
from .varpro import Problem, Structure, evaluate, moved_amplitudes, partial_fractions


@dataclass(frozen=True, eq=False)
class Compressed:
    """Residual (B, k), minus its derivative (B, k, 1 + n), and the square of the residual (B,)."""

    residual: FloatArray
    jacobian: FloatArray
    cost: FloatArray


def compress(problem: Problem, structure: Structure, parameters: FloatArray) -> Compressed:
    """Eliminate the linear terms at parameters (B, 1 + n); see `varpro.evaluate`."""
    if problem.segments is not None or problem.known.poles.size or problem.known.numerator.size > 1:
        state = evaluate(problem, structure, parameters)
        return Compressed(state.residual, state.jacobian, state.cost)
    n, count = structure.order, structure.zeros + 1
    batch = parameters.shape[0]
    poles, dpoles = poles_from_parameters(parameters[:, 1:])
    turning = poles.imag[:, n % 2 :: 2] != 0
    table = _factor(problem, parameters[:, 0], poles, turning)
    data = table[:, :, -1]

    residues, gain, dresidues = partial_fractions(poles, problem.known.numerator, count)
    size = np.abs(residues).sum(axis=1)
    size[:, 0] += np.abs(gain)
    weights = np.zeros((batch, 1 + n, count))
    weights[:, 0, 0] = gain
    _in_real_modes(residues, turning, weights[:, 1:])
    weights /= size[:, None]
    columns = table[:, :, : 1 + n] @ weights
    norm = np.sqrt(np.einsum("bmk,bmk->bk", columns, columns))
    norm[norm == 0] = 1.0
    columns /= norm[:, None]
    q, r = (columns, np.ones((batch, 1, 1))) if count == 1 else np.linalg.qr(columns)
    inside = np.einsum("bmk,bm->bk", q, data)
    residual = data - np.einsum("bmk,bk->bm", q, inside)
    numerator = solve_upper(r, inside) / (norm * size)

    amplitudes = (residues @ numerator[:, :, None])[:, :, 0]
    moved = np.empty((batch, n, 1 + n), dtype=np.complex128)
    moved[:, :, 0] = -amplitudes * poles
    moved[:, :, 1:] = moved_amplitudes(poles, amplitudes, dresidues, numerator) @ dpoles
    through = np.zeros((batch, 1 + 2 * n, 1 + n))
    level = ((-1.0 / poles)[:, None] @ dpoles)[:, 0].real
    through[:, 0, 1:] = level * (gain * numerator[:, 0])[:, None]
    _in_real_modes(moved, turning, through[:, 1 : 1 + n])
    _in_real_modes(amplitudes[:, :, None] * dpoles, turning, through[:, 1 + n :, 1:])
    derivative = table[:, :, : 1 + 2 * n] @ through
    derivative -= q @ (np.swapaxes(q, 1, 2) @ derivative)
    return Compressed(residual, derivative, np.einsum("bm,bm->b", residual, residual))


def _factor(
    problem: Problem, tau: FloatArray, poles: ComplexArray, turning: BoolArray
) -> FloatArray:
    """Triangular factor of all columns (B, k, 2n + 2), without the rows of the regressors.

    Columns are the static part, the modes, their derivatives, and the data.
    """
    batch, n = poles.shape
    q = problem.regressors.shape[1]
    # A column is contiguous, as LAPACK has it.
    space = np.empty((batch, q + 2 * n + 2, problem.data.size))
    space[:, :q] = problem.weighted_regressors.T
    space[:, -1] = problem.weighted_data
    inside = space[:, q:-1]
    if not _step_columns(problem, tau, poles, turning, inside):
        static, mode, slope = problem.drive.modes(tau, poles)
        parts = [static[:, :, None], *(_real_modes(modes, turning) for modes in (mode, slope))]
        inside[:] = np.swapaxes(problem.weighted(np.concatenate(parts, axis=2)), 1, 2)
    factor = np.asarray(np.linalg.qr(np.swapaxes(space, 1, 2), mode="r"))
    return factor[:, q:, q:]


def _step_columns(
    problem: Problem,
    tau: FloatArray,
    poles: ComplexArray,
    turning: BoolArray,
    columns: FloatArray,
) -> bool:
    """Weighted static part, modes and their derivatives, to `columns` (B, 1 + 2n, m).

    False where that is not possible: for other inputs than one step, coloured noise, missing
    samples, and bins in which the step arrives.
    """
    drive = problem.drive
    if not isinstance(drive, StepSequence) or problem.whitener is not None:
        return False
    since = drive.since_the_step(tau)
    if since is None:
        return False
    n = poles.shape[1]
    here = since > 0
    elapsed = since[:, None] * here[:, None]
    static = columns[:, 0]
    np.multiply(here, drive.sizes[0] * problem.root_weight, out=static)
    modes, slopes = columns[:, 1 : 1 + n], columns[:, 1 + n :]
    rates = poles if turning.any() else poles.real
    # The mean of a mode over a bin is its first sample times a factor, that of t exp(p t) has the
    # mean of the time besides.
    factor, lag, kind = drive.means(rates)
    factor = np.log(factor)
    np.multiply(rates.real[:, :, None], elapsed, out=modes)
    modes += factor.real.take(kind, axis=2)
    np.exp(modes, out=modes)
    modes *= static[:, None]
    stretch = elapsed + lag.real.take(kind, axis=2)
    np.multiply(modes, stretch, out=slopes)
    first = n % 2
    for pair in range(turning.shape[1]):
        rows = np.flatnonzero(turning[:, pair])
        if not rows.size:
            continue
        # Cosine and sine instead of both of a pair; the slopes are a product of complex numbers.
        i = first + 2 * pair
        phase = rates.imag[rows, i, None] * elapsed[rows, 0]
        phase += factor.imag[rows, i].take(kind, axis=1)
        decay, length, turn = modes[rows, i], stretch[rows, i], lag.imag[rows, i].take(kind, axis=1)
        cosine, sine = decay * np.cos(phase), decay * np.sin(phase)
        modes[rows, i], modes[rows, i + 1] = cosine, sine
        slopes[rows, i] = cosine * length - sine * turn
        slopes[rows, i + 1] = cosine * turn + sine * length
    return True


def _real_modes(modes: Any, turning: BoolArray) -> FloatArray:
    """Modes (B, m, n) with real and imaginary part instead of both of a conjugate pair."""
    real = np.array(modes.real)
    if np.iscomplexobj(modes):
        first = modes.shape[2] % 2
        real[:, :, first + 1 :: 2] = np.where(
            turning[:, None], modes[:, :, first::2].imag, real[:, :, first + 1 :: 2]
        )
    return real


def _in_real_modes(weights: ComplexArray, turning: BoolArray, out: FloatArray) -> None:
    """Weights (B, n, k) of modes, those of a pair conjugate, as weights of `_real_modes`."""
    out[:] = weights.real
    if turning.any():
        first = weights.shape[1] % 2
        turns = turning[:, :, None]
        # Re(w E + its conjugate) = 2 Re(w) Re(E) - 2 Im(w) Im(E).
        out[:, first::2] *= 1 + turns
        out[:, first + 1 :: 2] = np.where(
            turns, -2 * weights[:, first::2].imag, out[:, first + 1 :: 2]
        )
