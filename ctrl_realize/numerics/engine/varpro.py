"""Separable least squares for delayed transfer functions, many starts at once.

The model of one record is

    y(t) = L^-1{ exp(-tau s) b(s) K(s) U(s) / a(s) } + fixed regressors,

with a monic `a` of order n (see `pole_factors`), `b` of degree n - r (r: relative degree) and known
dynamics K in cascade. Numerator and regressors enter linearly and are eliminated (variable
projection [2]_, [3]_); for dead time and poles Kaufman's Jacobian [1]_ is used. A whole batch of
models is evaluated by the same array operations; `batch_search` optimises them.

References
----------
.. [1] L. Kaufman, A variable projection method for solving separable nonlinear least squares
   problems, BIT 15 (1975) 49-57, doi:10.1007/BF01932995.
.. [2] G. H. Golub and V. Pereyra, The differentiation of pseudo-inverses and nonlinear least
   squares problems whose variables separate, SIAM J. Numer. Anal. 10 (1973) 413-432,
   doi:10.1137/0710036.
.. [3] G. Golub and V. Pereyra, Separable nonlinear least squares: the variable projection method
   and its applications, Inverse Problems 19 (2003) R1-R26, doi:10.1088/0266-5611/19/2/201.
.. [4] L. Ljung, System Identification: Theory for the User, 2nd ed., Prentice Hall 1999, section
   4.5 (model structures as differentiable mappings).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from ..arrays import ComplexArray, FloatArray
from ..signals.sines import Sines
from .local_terms import FixedTerms, LocalTerms, Segments, solve_upper
from .poles import poles_from_parameters
from .responses import HeldInput


@dataclass(frozen=True, eq=False)
class KnownFactor:
    """Known dynamics: distinct stable poles (J,), numerator over the monic denominator."""

    poles: ComplexArray = field(default_factory=lambda: np.empty(0, dtype=np.complex128))
    numerator: FloatArray = field(default_factory=lambda: np.ones(1))


@dataclass(frozen=True, eq=False)
class Problem:
    """The problem: data (m,), root weights (m,), input, fixed regressors (m, q).

    With `segments` each of them has a separate initial state and regressors. Without them, a
    `whitener` (m, m) may replace the weights for coloured noise. `real` tells whether the modes of
    conjugate poles are conjugate, as those of signals are.
    """

    data: FloatArray
    root_weight: FloatArray
    drive: HeldInput
    regressors: FloatArray
    known: KnownFactor
    segments: Segments | None = None
    whitener: FloatArray | None = None
    real: bool = True

    def weighted(self, columns: FloatArray) -> FloatArray:
        """Columns (..., m, k) in units of the noise."""
        if self.whitener is not None:
            # One product of a wide matrix is several times as fast as many of narrow ones.
            wide = np.moveaxis(columns, -2, 0)
            white = self.whitener @ wide.reshape(wide.shape[0], -1)
            return np.asarray(np.moveaxis(white.reshape(wide.shape), 0, -2))
        return columns * self.root_weight[:, None]

    @cached_property
    def weighted_data(self) -> FloatArray:
        """Data (m,) in units of the noise."""
        return self.weighted(self.data[:, None])[:, 0]

    @cached_property
    def weighted_regressors(self) -> FloatArray:
        """Fixed regressors (m, q) in units of the noise."""
        return self.weighted(self.regressors)

    @cached_property
    def _fixed(self) -> FixedTerms:
        assert self.segments is not None
        return FixedTerms(self.segments, self.root_weight)

    def local_terms(self, poles: ComplexArray) -> LocalTerms:
        """Local terms of the segments for poles (B, n)."""
        return LocalTerms(self._fixed, poles)

    def local_count(self, order: int) -> int:
        """Number of local linear terms of all segments, for a model of a given order."""
        if self.segments is None:
            return 0
        return self.segments.shapes + order * (int(self.segments.edges.size) - 1)


@dataclass(frozen=True)
class Structure:
    """Order n and relative degree r: n poles, n - r zeros."""

    order: int
    relative_degree: int

    @property
    def zeros(self) -> int:
        """Number of zeros, n - r."""
        return self.order - self.relative_degree

    @property
    def free(self) -> int:
        """Number of free parameters beside dead time and gain."""
        return self.order + self.zeros

    @property
    def plain(self) -> Structure:
        """Structure of which order and relative degree are all that is given."""
        return Structure(self.order, self.relative_degree)

    def theta(self, parameters: FloatArray) -> FloatArray:
        """Dead time and pole parameters (1 + n,) of one model: the parameters themselves."""
        return parameters


@dataclass(frozen=True, eq=False)
class Bounds:
    """Bounds of the parameters ``[tau, pole parameters...]``, shapes (1 + n,)."""

    low: FloatArray
    high: FloatArray
    smooth: bool = False
    """Without samples there are no kinks of the dead time."""


@dataclass(frozen=True, eq=False)
class Evaluation:
    """The problem without its linear terms, at B parameter sets.

    ``residual`` (B, m) is weighted and orthogonal to all linear terms, ``jacobian`` (B, m, 1 + n)
    is minus its derivative (Kaufman's form), ``sensitivity`` (B, 1 + n) the norm of the model's
    derivative before the projection. ``numerator`` (B, n - r + 1) are the coefficients of b, lowest
    power first, ``regression`` (B, q) those of the regressors.
    """

    residual: FloatArray
    jacobian: FloatArray
    sensitivity: FloatArray
    numerator: FloatArray
    regression: FloatArray

    @property
    def cost(self) -> FloatArray:
        """Weighted sums of squares, shape (B,)."""
        return np.asarray(np.einsum("bm,bm->b", self.residual, self.residual))


@dataclass(frozen=True, eq=False)
class Family(Structure, ABC):
    """Model structure with few parameters (k,), the first of which is the dead time.

    A differentiable map from the parameters to models, as in [4]_; `bounds` are theirs.
    """

    bounds: Bounds

    # Two families of one order differ.
    __eq__ = object.__eq__
    __hash__ = object.__hash__

    @abstractmethod
    def directions(self, problem: Problem, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Directions j in which a model x (k,) may change.

        Its weighted derivatives (m, j), orthogonal to the terms that are estimated with it, and
        those of `theta` and numerator (1 + n + z + 1, j).
        """

    @abstractmethod
    def evaluate(self, problem: Problem, parameters: FloatArray) -> Evaluation:
        """Eliminate the linear terms at parameters (B, k)."""


def evaluate(problem: Problem, structure: Structure, parameters: FloatArray) -> Evaluation:
    """Eliminate the linear terms at parameters (B, 1 + n)."""
    if isinstance(structure, Family):
        return structure.evaluate(problem, parameters)
    n, count = structure.order, structure.zeros + 1
    batch = parameters.shape[0]
    free, dfree = poles_from_parameters(parameters[:, 1:])
    known = problem.known
    poles = free
    if known.poles.size:
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


def _real_product(modes: Any, weights: ComplexArray) -> FloatArray:
    """Real part of the first modes (B, m, J) times weights (B, j, k), real for real modes."""
    if not np.iscomplexobj(modes):
        return np.asarray(modes[:, :, : weights.shape[1]] @ weights.real)
    # Re(E w) = Re(E) Re(w) - Im(E) Im(w), as one product of real matrices.
    parts = np.stack([weights.real, -weights.imag], axis=2)
    real = modes.view(np.float64)[:, :, : 2 * weights.shape[1]]
    return np.asarray(real @ parts.reshape(weights.shape[0], -1, weights.shape[2]))


def respond(
    drive: HeldInput, known: KnownFactor, numerator: FloatArray, parameters: FloatArray
) -> FloatArray:
    """Response (m,) of one model, numerator (n - r + 1,), parameters (1 + n,)."""
    parts = [
        responses(piece, known, numerator[None], parameters[None])[0] for piece in drive.pieces()
    ]
    return np.concatenate(parts) if len(parts) > 1 else parts[0]


def responses(
    drive: HeldInput, known: KnownFactor, numerator: FloatArray, parameters: FloatArray
) -> FloatArray:
    """Responses (B, m) of several models, numerators (B, n - r + 1), parameters (B, 1 + n)."""
    poles = poles_from_parameters(parameters[:, 1:])[0]
    if known.poles.size:
        poles = np.concatenate([poles, np.tile(known.poles, (len(poles), 1))], axis=1)
    residues, gain, _ = partial_fractions(poles, known.numerator, numerator.shape[1])
    amplitudes = residues @ numerator[:, :, None]
    static, mode, _ = drive.modes(parameters[:, 0], poles)
    level = gain * numerator[:, 0]
    return _real_product(mode, amplitudes)[:, :, 0] + static * level[:, None]


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
    poles: ComplexArray,
    amplitudes: ComplexArray,
    dresidues: ComplexArray,
    numerator: FloatArray,
) -> ComplexArray:
    """Derivatives of amplitudes (rows j) w.r.t. poles (columns k), shape (B, J, J)."""
    own = np.eye(poles.shape[1])
    inverse = 1.0 / (poles[:, :, None] - poles[:, None, :] + own) - own
    moved = amplitudes[:, :, None] * inverse
    through = (dresidues @ numerator[:, :, None])[:, :, 0]
    along = through - amplitudes * np.add.reduce(inverse, axis=2)
    return np.asarray(moved + along[:, :, None] * own)
