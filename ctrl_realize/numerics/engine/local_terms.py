"""Linear terms that belong to one segment of the data only: its level, drift and initial state.

Several records of one plant have common poles, numerator and dead time. The local terms of each
enter linearly and affect only its own samples, so they are projected out segment by segment; a
hundred records cost no more than one of the same length.

An initial state of the plant gives a free response, a sum of exp(p_j t) with free amplitudes. Since
the poles of a pair may be real, complex, or almost equal, its columns are

    (exp(p t) + exp(q t)) / 2    and    (exp(p t) - exp(q t)) / (p - q),

which are real and independent in every case.

Linear terms are projected out as in [1]_, [2]_; since a term of one segment is zero in all others,
the projection is block diagonal.

References
----------
.. [1] G. H. Golub and V. Pereyra, The differentiation of pseudo-inverses and nonlinear least
   squares problems whose variables separate, SIAM J. Numer. Anal. 10 (1973) 413-432,
   doi:10.1137/0710036.
.. [2] G. Golub and V. Pereyra, Separable nonlinear least squares: the variable projection method
   and its applications, Inverse Problems 19 (2003) R1-R26, doi:10.1088/0266-5611/19/2/201.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from ..arrays import ComplexArray, FloatArray, IntArray
from .responses import StepSequence

_OVER = 1e-12
"""Part of a free response that is left at the first row, below which nothing of it counts."""


@dataclass(frozen=True, eq=False)
class Segments:
    """Parts of the data with a separate initial state each.

    Attributes
    ----------
    edges : ndarray of int, shape (R + 1,)
        Segment r has the rows ``edges[r]...edges[r + 1] - 1``.
    clock : ndarray, shape (m,)
        Time since the first sample of the segment, in s; of a bin that of its first sample.
    regressors : ndarray, shape (m, q)
        Known shapes, which have separate coefficients in every segment. A segment with fewer of
        them has zeros in its last columns.
    bins : StepSequence, optional
        With the bins over which the first rows are means; the other rows are single samples.
    """

    edges: IntArray
    clock: FloatArray
    regressors: FloatArray
    bins: StepSequence | None = None

    @classmethod
    def single(
        cls, clock: FloatArray, regressors: FloatArray, bins: StepSequence | None = None
    ) -> Segments:
        """All rows in one segment."""
        return cls(np.array([0, clock.size]), clock, regressors, bins)

    @property
    def rows(self) -> list[slice]:
        """Number of rows of every segment."""
        edges = [int(edge) for edge in self.edges]
        return [slice(a, b) for a, b in pairwise(edges)]

    @cached_property
    def shapes(self) -> int:
        """Number of known shapes of all segments together."""
        return sum(int(self.regressors[rows].any(axis=0).sum()) for rows in self.rows)


class FixedTerms:
    """Part of the local terms that does not depend on the plant, orthonormalised once.

    Parameters
    ----------
    segments : Segments
    root_weight : ndarray, shape (m,)
    """

    def __init__(self, segments: Segments, root_weight: FloatArray) -> None:
        self.segments = segments
        self.weight = root_weight
        weighted = segments.regressors * root_weight[:, None]
        self.parts = [_orthonormal(weighted[rows]) for rows in segments.rows]


class LocalTerms:
    """Local terms of all segments for B sets of poles, prepared for projection.

    Parameters
    ----------
    fixed : FixedTerms
    poles : ndarray, shape (B, n)
        Of the plant; conjugates are neighbours, an odd one comes first.
    """

    def __init__(self, fixed: FixedTerms, poles: ComplexArray) -> None:
        segments = fixed.segments
        self._fixed = fixed
        self._rows = segments.rows
        self._poles = poles
        self._weight = fixed.weight
        self._decay, self._slope = _decay(segments, poles)
        self._known = segments.regressors.shape[1]
        columns = _free_columns(self._decay, poles) * self._weight[:, None]
        self._bases: list[FloatArray] = []
        self._triangles: list[FloatArray] = []
        self._shared: list[FloatArray] = []
        self._norms: list[FloatArray] = []
        for rows, (q, _, _) in zip(self._rows, fixed.parts, strict=True):
            own, norm = _normalised(columns[:, rows])
            shared = q.T @ own
            own = own - q @ shared
            # Repeated: columns that are nearly within the fixed terms lose digits the first time.
            again = q.T @ own
            basis, triangle = np.linalg.qr(own - q @ again)
            basis *= np.any(columns[:, rows], axis=1)[:, None, : basis.shape[2]]
            self._bases.append(basis)
            self._triangles.append(triangle)
            self._shared.append(shared + again)
            self._norms.append(norm)

    def without(self, columns: FloatArray) -> FloatArray:
        """Project the local terms out of weighted columns (B, m, k)."""
        left = np.empty_like(columns)
        for rows, (q, _, _), basis in zip(self._rows, self._fixed.parts, self._bases, strict=True):
            part = columns[:, rows]
            part = part - q @ (q.T @ part)
            left[:, rows] = part - basis @ (np.swapaxes(basis, 1, 2) @ part)
        return left

    def moved(self, rest: FloatArray, dpoles: ComplexArray) -> FloatArray:
        """Derivative of the free responses w.r.t. the pole parameters, weighted, shape (B, m, n).

        Parameters
        ----------
        rest : ndarray, shape (B, m)
            Weighted data minus the forced response; the local terms are fitted to it.
        dpoles : ndarray, shape (B, n, n)
            Derivatives of the poles (rows) w.r.t. their parameters (columns).
        """
        out = np.empty((*rest.shape, dpoles.shape[2]))
        for i, rows in enumerate(self._rows):
            amplitudes = self._amplitudes(self._weights(i, rest)[:, self._known :])
            turned = amplitudes[:, :, None] * dpoles
            slope = self._slope[:, rows]
            out[:, rows] = (slope @ (turned if np.iscomplexobj(slope) else turned.real)).real
        return out * self._weight[:, None]

    def fitted(self, rest: FloatArray, where: Segments) -> FloatArray:
        """Local terms fitted to `rest` (B, m), at the rows of other segments (B, N).

        The other segments are the same ones with another resolution.
        """
        columns = local_columns(where, self._poles)
        out = np.empty(columns.shape[:2])
        for i, rows in enumerate(where.rows):
            out[:, rows] = np.einsum("bmk,bk->bm", columns[:, rows], self._weights(i, rest))
        return out

    def _weights(self, i: int, rest: FloatArray) -> FloatArray:
        """Coefficients of the local terms of segment i, fitted to weighted data (B, m)."""
        q, r, norm = self._fixed.parts[i]
        part = rest[:, self._rows[i]]
        inside = np.einsum("bmk,bm->bk", self._bases[i], part - (part @ q) @ q.T)
        free = solve_upper(self._triangles[i], inside)
        known = part @ q - np.einsum("bqk,bk->bq", self._shared[i], free)
        triangle = np.broadcast_to(r, (len(part), *r.shape))
        return np.concatenate([solve_upper(triangle, known) / norm, free / self._norms[i]], axis=1)

    def _amplitudes(self, weights: FloatArray) -> ComplexArray:
        """Convert coefficients of the columns to amplitudes of the exponentials."""
        n = self._poles.shape[1]
        out = weights.astype(np.complex128)
        for i in range(n % 2, n, 2):
            half = weights[:, i + 1] / (self._poles[:, i] - self._poles[:, i + 1])
            out[:, i], out[:, i + 1] = weights[:, i] / 2 + half, weights[:, i] / 2 - half
        return out


def local_columns(segments: Segments, poles: ComplexArray) -> FloatArray:
    """Regressors, and free responses at poles (B, n); shape (B, m, q + n)."""
    return _columns(segments, _decay(segments, poles)[0], poles)


def _decay(segments: Segments, poles: ComplexArray) -> tuple[Any, Any]:
    """Exponentials (B, m, n) of the poles, and their derivatives; real if all poles are."""
    # Real exponentials take a fifth of the time of complex ones.
    rates = poles if poles.imag.any() else poles.real
    decay = np.exp(segments.clock[:, None] * rates[:, None, :])
    slope = segments.clock[:, None] * decay
    if segments.bins is not None:
        mean, turn, kind = segments.bins.bin_means(rates)
        mean, turn = mean.take(kind, axis=1), turn.take(kind, axis=1)
        rows = slice(kind.size)
        slope[:, rows] = slope[:, rows] * mean + decay[:, rows] * turn
        decay[:, rows] *= mean
    return decay, slope


def _columns(segments: Segments, decay: Any, poles: ComplexArray) -> FloatArray:
    fixed = np.broadcast_to(segments.regressors, (len(poles), *segments.regressors.shape))
    return np.concatenate([fixed, _free_columns(decay, poles)], axis=2)


def _free_columns(decay: Any, poles: ComplexArray) -> FloatArray:
    """Free responses, zero those of poles that are over before the first row.

    Beside the other pole of its pair such a pole would be a direction of rounding errors.
    """
    n = poles.shape[1]
    free = np.empty(decay.shape)
    over = np.abs(decay).max(axis=1, initial=0.0) < _OVER
    if n % 2:
        free[:, :, 0] = np.where(over[:, :1], 0.0, decay[:, :, 0].real)
    for i in range(n % 2, n, 2):
        first, second = decay[:, :, i], decay[:, :, i + 1]
        gap = poles[:, i] - poles[:, i + 1]
        free[:, :, i] = (first + second).real / 2
        apart = ((first - second) / gap[:, None]).real
        free[:, :, i + 1] = np.where(over[:, i : i + 2].any(axis=1)[:, None], 0.0, apart)
    return free


def _orthonormal(columns: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Basis (m, k) of columns of norm 1, triangle (k, k), and the original norms (k,)."""
    single, norm = _normalised(columns[None])
    q, r = np.linalg.qr(single[0])
    # A zero column spans nothing, but QR would add a direction for it.
    q[:, ~single[0].any(axis=0)[: q.shape[1]]] = 0.0
    return q, r, norm[0]


def _normalised(columns: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Columns (B, m, k) of norm 1, zero columns unchanged, and their norms (B, k)."""
    norm = np.sqrt(np.einsum("bmk,bmk->bk", columns, columns))
    norm[norm == 0] = 1.0
    return columns / norm[:, None], norm


def solve_upper(r: FloatArray, right: FloatArray) -> FloatArray:
    """Solve R x = b for a batch, R from columns of norm 1; unresolved components are 0."""
    if np.abs(np.einsum("bii->bi", r)).min(initial=1.0) > 1e-12:
        return np.asarray(np.linalg.solve(r, right[:, :, None])[:, :, 0], dtype=np.float64)
    x = np.zeros_like(right)
    for i in range(right.shape[1] - 1, -1, -1):
        rest = right[:, i] - np.einsum("bj,bj->b", r[:, i, i + 1 :], x[:, i + 1 :])
        resolved = np.abs(r[:, i, i]) > 1e-12
        x[:, i] = np.where(resolved, rest / np.where(resolved, r[:, i, i], 1.0), 0.0)
    return x
