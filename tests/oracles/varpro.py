"""The slow elimination of linear terms: one orthogonal basis of all of them, complex modes.

The oracle of `ctrl_realize.numerics.engine.eliminate`.
"""

from typing import NamedTuple

import numpy as np

from ctrl_realize.numerics.engine.local_terms import solve_upper
from ctrl_realize.numerics.engine.modal import (
    moved_amplitudes,
    partial_fractions,
    poles_from_parameters,
)
from ctrl_realize.numerics.signals.sines import Sines


class Evaluation(NamedTuple):
    """See the class of this name in the package."""

    residual: np.ndarray
    jacobian: np.ndarray
    sensitivity: np.ndarray
    numerator: np.ndarray
    regression: np.ndarray

    @property
    def cost(self):
        """Weighted sums of squares, shape (B,)."""
        return np.einsum("bm,bm->b", self.residual, self.residual)


def evaluate(problem, structure, parameters):
    """Eliminate the linear terms at parameters (B, 1 + n)."""
    n, count = structure.order, structure.zeros + 1
    batch = parameters.shape[0]
    free, dfree = poles_from_parameters(parameters[:, 1:])
    known = problem.known
    poles = np.concatenate([free, np.tile(known.poles, (batch, 1))], axis=1)
    static, mode, slope = problem.drive.modes(parameters[:, 0], poles)
    residues, gain, dresidues = partial_fractions(poles, known.numerator, count)
    # Columns scaled to equal norm: the powers of s differ by many decades.
    size = np.abs(residues).sum(axis=1)
    size[:, 0] += np.abs(gain)
    columns = np.empty((batch, problem.data.size, count + problem.regressors.shape[1]))
    columns[:, :, :count] = _real_product(mode, residues / size[:, None])
    columns[:, :, 0] += static * (gain / size[:, 0])[:, None]
    columns[:, :, count:] = problem.regressors
    columns = problem.weighted(columns)
    data = np.broadcast_to(problem.weighted_data, (batch, problem.data.size))
    own = None
    if problem.segments is not None:
        own = problem.local_terms(free)
        forced, whole = columns, data
        left = own.without(np.concatenate([columns, data[:, :, None]], axis=2))
        columns, data = left[:, :, :-1], left[:, :, -1]
    # Variable projection: residual = (I - Q Q') data (Golub and Pereyra 1973).
    norm = np.sqrt(np.einsum("bmk,bmk->bk", columns, columns))
    norm[norm == 0] = 1.0
    q, r = np.linalg.qr(columns / norm[:, None])
    inside = np.einsum("bmk,bm->bk", q, data)
    residual = data - np.einsum("bmk,bk->bm", q, inside)
    linear = solve_upper(r, inside) / norm
    numerator = linear[:, :count] / size

    amplitudes = np.einsum("bjk,bk->bj", residues, numerator)
    # Columns of E: the derivatives w.r.t. the dead time and through the amplitudes.
    through = np.empty((batch, poles.shape[1], 1 + n), dtype=np.complex128)
    through[:, :, 0] = -amplitudes * poles
    through[:, :, 1:] = moved_amplitudes(poles, amplitudes, dresidues, numerator)[:, :, :n] @ dfree
    derivative = _real_product(mode, through)
    stretch = amplitudes[:, :n, None] * dfree
    level = np.einsum("bj,bjq->bq", -1.0 / free, dfree).real
    level *= (gain * numerator[:, 0])[:, None]
    derivative[:, :, 1:] += _real_product(slope, stretch)
    derivative[:, :, 1:] += static[:, :, None] * level[:, None]
    if structure.relative_degree == 0 and isinstance(problem.drive, Sines):
        derivative[:, :, 0] += problem.drive.direct_slope(parameters[:, 0]) * numerator[:, -1:]
    derivative = problem.weighted(derivative)
    if own is not None:
        rest = whole - np.einsum("bmk,bk->bm", forced, linear)
        derivative[:, :, 1:] += own.moved(rest, dfree)
    sensitivity = np.sqrt(np.einsum("bmp,bmp->bp", derivative, derivative))
    if own is not None:
        derivative = own.without(derivative)
    jacobian = derivative - q @ (np.swapaxes(q, 1, 2) @ derivative)
    return Evaluation(residual, jacobian, sensitivity, numerator, linear[:, count:])


def _real_product(modes, weights):
    """Real part of the first modes (B, m, J) times weights (B, j, k), real for real modes."""
    if not np.iscomplexobj(modes):
        return modes[:, :, : weights.shape[1]] @ weights.real
    # Re(E w) = Re(E) Re(w) - Im(E) Im(w), as one product of real matrices.
    parts = np.stack([weights.real, -weights.imag], axis=2)
    real = np.ascontiguousarray(modes).view(np.float64)[:, :, : 2 * weights.shape[1]]
    return real @ parts.reshape(weights.shape[0], -1, weights.shape[2])
