"""A separable least-squares problem: data, input, and what enters linearly.

The model of one record is

    y(t) = L^-1{ exp(-tau s) b(s) K(s) U(s) / a(s) } + fixed regressors,

with a monic `a` of order n (see `modal`), `b` of degree n - r (r: relative degree) and known
dynamics K in cascade. Numerator, regressors and local terms enter linearly and are eliminated
[1]_, see `eliminate`.

References
----------
.. [1] G. Golub and V. Pereyra, Separable nonlinear least squares: the variable projection method
   and its applications, Inverse Problems 19 (2003) R1-R26, doi:10.1088/0266-5611/19/2/201.
.. [2] L. Ljung, System Identification: Theory for the User, 2nd ed., Prentice Hall 1999, section
   4.5 (model structures as differentiable mappings).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ..arrays import ComplexArray, FloatArray
from .local_terms import ROUNDING, LocalTerms, Segments
from .responses import HeldInput

_ROWS = 64  # of a whitener that are multiplied together


@dataclass(frozen=True, eq=False)
class KnownFactor:
    """Known dynamics: distinct stable poles (J,), numerator over the monic denominator."""

    poles: ComplexArray = field(default_factory=lambda: np.empty(0, dtype=np.complex128))
    numerator: FloatArray = field(default_factory=lambda: np.ones(1))


@dataclass(frozen=True, eq=False)
class Problem:
    """The problem: data (m,), root weights (m,), input, fixed regressors (m, q).

    With `segments` each of them has a separate initial state and regressors. Without them, a
    `whitener` (m, m) may replace the weights for coloured noise.
    """

    data: FloatArray
    root_weight: FloatArray
    drive: HeldInput
    regressors: FloatArray
    known: KnownFactor
    segments: Segments | None = None
    whitener: FloatArray | None = None

    def weighted(self, columns: FloatArray) -> FloatArray:
        """Columns (..., m, k) in units of the noise."""
        if self.whitener is not None:
            # One product of a wide matrix is several times as fast as many of narrow ones.
            wide = np.moveaxis(columns, -2, 0)
            flat = wide.reshape(wide.shape[0], -1)
            white = np.empty_like(flat)
            for rows, span, part in self._white_rows:
                np.matmul(part, flat[span], out=white[rows])
            return np.moveaxis(white.reshape(wide.shape), 0, -2)
        return columns * self.root_weight[:, None]

    @cached_property
    def _white_rows(self) -> list[tuple[slice, slice, FloatArray]]:
        """Rows of the whitener, a number at a time, without the columns that are zero in them.

        Noise has a short memory: most of its factor is what rounding leaves of zeros.
        """
        assert self.whitener is not None
        size = np.abs(self.whitener)
        seen = size > ROUNDING * size.max(axis=1, keepdims=True)
        found = []
        for first in range(0, len(size), _ROWS):
            rows = slice(first, first + _ROWS)
            columns = np.flatnonzero(seen[rows].any(axis=0))
            span = slice(int(columns[0]), int(columns[-1]) + 1)
            found.append((rows, span, np.ascontiguousarray(self.whitener[rows, span])))
        return found

    @cached_property
    def weighted_data(self) -> FloatArray:
        """Data (m,) in units of the noise."""
        return self.weighted(self.data[:, None])[:, 0]

    @cached_property
    def weighted_regressors(self) -> FloatArray:
        """Fixed regressors (m, q) in units of the noise."""
        return self.weighted(self.regressors)

    def local_terms(self, poles: ComplexArray) -> LocalTerms:
        """Local terms of the segments for poles (B, n)."""
        assert self.segments is not None
        return LocalTerms(self.segments, self.root_weight, poles)

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
class Eliminated:
    """The problem without its linear terms, at B parameter sets.

    ``cost`` (B,) is the weighted sum of squares, ``numerator`` (B, n - r + 1) are the coefficients
    of b, lowest power first.
    """

    cost: FloatArray
    numerator: FloatArray


@dataclass(frozen=True, eq=False)
class Compressed(Eliminated):
    """With derivatives, in k rows, as few as possible.

    ``residual`` (B, k) is weighted and orthogonal to all linear terms, ``jacobian`` (B, k, 1 + n)
    is minus its derivative (Kaufman's form).
    """

    residual: FloatArray
    jacobian: FloatArray


@dataclass(frozen=True, eq=False)
class Evaluation(Compressed):
    """In the m rows of the problem.

    ``sensitivity`` (B, 1 + n) is the norm of the model's derivative before the projection,
    ``regression`` (B, q) are the coefficients of the regressors.
    """

    sensitivity: FloatArray
    regression: FloatArray


@dataclass(frozen=True, eq=False)
class Family(Structure, ABC):
    """Model structure with few parameters (k,), the first of which is the dead time.

    A differentiable map from the parameters to models, as in [2]_; `bounds` are theirs.
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

    def compress(self, problem: Problem, parameters: FloatArray) -> Compressed:
        """Eliminate the linear terms at parameters (B, k), in as few rows as can be."""
        return self.evaluate(problem, parameters)


@dataclass(frozen=True, eq=False)
class Mapped:
    """B models of a structure that depend on parameters (k,), and their derivatives.

    ``theta`` (B, 1 + n) are dead time and pole parameters, ``dtheta`` (B, 1 + n, k) their
    derivatives; without them, they are the parameters themselves. ``numerator`` (B, z + 1) is that
    for gain 1, with a gain within ``gains``, and ``dnumerator`` (B, z + 1, k) its derivatives;
    without it, the numerator is free.
    """

    theta: FloatArray
    dtheta: FloatArray | None = None
    numerator: FloatArray | None = None
    dnumerator: FloatArray | None = None
    gains: tuple[float, float] = (-np.inf, np.inf)

    def along(self, slopes: FloatArray, powers: FloatArray, gain: FloatArray | None) -> FloatArray:
        """Derivatives (B, m, k) by the parameters from those by theta (B, m, 1 + n).

        ``powers`` (B, m, z + 1) are the responses to powers of s in the numerator.
        """
        if self.dtheta is None:
            return slopes
        found: FloatArray = slopes @ self.dtheta
        if gain is not None and self.dnumerator is not None:
            found += powers @ (gain[:, None, None] * self.dnumerator)
        return found
