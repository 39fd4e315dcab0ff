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
from typing import Any, NamedTuple

import numpy as np

from ..arrays import ComplexArray, FloatArray, IntArray
from .responses import StepSequence

ROUNDING = 1e-12
"""Part of a factor, or of a free response that is left at the first row, that counts as nothing."""


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
        return [slice(int(a), int(b)) for a, b in pairwise(self.edges)]

    @cached_property
    def shapes(self) -> int:
        """Number of known shapes of all segments together."""
        return sum(int(self.regressors[rows].any(axis=0).sum()) for rows in self.rows)


class Reduced(NamedTuple):
    """One segment after an orthogonal transformation, local terms first.

    ``left`` (B, k', k) are the rows in which none of them is, ``above`` (B, f, k) those of their
    ``triangle`` (B, f, f).
    """

    triangle: FloatArray
    above: FloatArray
    left: FloatArray


class LocalTerms:
    """Local terms of all segments for B sets of poles, prepared for projection.

    Parameters
    ----------
    segments : Segments
    root_weight : ndarray, shape (m,)
    poles : ndarray, shape (B, n)
        Of the plant; conjugates are neighbours, an odd one comes first.
    """

    def __init__(self, segments: Segments, root_weight: FloatArray, poles: ComplexArray) -> None:
        self._rows, self._known = segments.rows, segments.regressors.shape[1]
        self._poles, self._weight = poles, root_weight
        decay, self.slope = _decay(segments, poles)
        columns = _columns(segments, decay, poles) * root_weight[:, None]
        self._terms = [_with_rows_for_all(columns[:, rows]) for rows in self._rows]

    @cached_property
    def _bases(self) -> list[tuple[FloatArray, FloatArray, FloatArray]]:
        """Of every segment: basis (B, m, f), triangle (B, f, f), and norms (B, f) of its terms."""
        found = []
        for rows, terms in zip(self._rows, self._terms, strict=True):
            single, norm = _normalised(terms)
            basis, upper = np.linalg.qr(single)
            found.append((basis[:, : rows.stop - rows.start], upper, norm))
        return found

    def reduced(self, columns: FloatArray) -> list[Reduced]:
        """Transform weighted columns (B, m, k) of every segment to as few rows as can be."""
        found = []
        for rows, terms in zip(self._rows, self._terms, strict=True):
            batch, length, f = terms.shape
            count = f + columns.shape[2]
            # Of a short segment too as many rows are left, whether terms are zero or not.
            every = np.zeros((batch, count, max(length, count)))
            every[:, :f, :length] = np.swapaxes(terms, 1, 2)
            every[:, f:, : rows.stop - rows.start] = np.swapaxes(columns[:, rows], 1, 2)
            upper = triangle(np.swapaxes(every, 1, 2))
            found.append(Reduced(upper[:, :f, :f], upper[:, :f, f:], upper[:, f:, f:]))
        return found

    def amplitudes(self, part: Reduced, weights: FloatArray) -> ComplexArray:
        """Amplitudes (B, n) of the free responses of a segment, fitted to its first columns.

        They are combined by weights (B, k).
        """
        upper, norm = _normalised(part.triangle)
        right = (part.above[:, :, : weights.shape[1]] @ weights[:, :, None])[:, :, 0]
        return self._amplitudes((solve_upper(upper, right) / norm)[:, self._known :])

    def without(self, columns: FloatArray) -> FloatArray:
        """Project the local terms out of weighted columns (B, m, k)."""
        left = np.empty_like(columns)
        for rows, (basis, _, _) in zip(self._rows, self._bases, strict=True):
            part = columns[:, rows]
            # Repeated: what is nearly within the terms loses digits the first time.
            for _ in range(2):
                part = part - basis @ (np.swapaxes(basis, 1, 2) @ part)
            left[:, rows] = part
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
            slope = self.slope[:, rows]
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
        basis, upper, norm = self._bases[i]
        inside = np.einsum("bmk,bm->bk", basis, rest[:, self._rows[i]])
        return solve_upper(upper, inside) / norm

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
    turns = poles.imag.any(axis=1)
    rates = poles if turns.any() else poles.real
    # The samples of a pole are contiguous, as factorisations have them.
    decay = np.empty((*rates.shape, segments.clock.size), dtype=rates.dtype)
    # Real exponentials take a twentieth of the time of complex ones.
    decay[~turns] = np.exp(poles.real[~turns, :, None] * segments.clock)
    decay[turns] = np.exp(rates[turns, :, None] * segments.clock)
    decay = np.swapaxes(decay, 1, 2)
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
    free = np.empty_like(decay, dtype=np.float64)
    parts = (decay.real, decay.imag) if np.iscomplexobj(decay) else (decay,)
    over = np.max([np.abs(part).max(axis=1, initial=0.0) for part in parts], axis=0) < ROUNDING
    if n % 2:
        free[:, :, 0] = decay[:, :, 0].real
    for i in range(n % 2, n, 2):
        first, second = decay[:, :, i], decay[:, :, i + 1]
        gap = poles[:, i] - poles[:, i + 1]
        free[:, :, i] = (first + second).real / 2
        free[:, :, i + 1] = ((first - second) / gap[:, None]).real
    if over.any():
        early, late = over[:, n % 2 :: 2], over[:, n % 2 + 1 :: 2]
        early[:], late[:] = early & late, early | late
        np.copyto(free, 0.0, where=over[:, None])
    return free


def _with_rows_for_all(terms: FloatArray) -> FloatArray:
    """Terms (B, m, f), in no fewer rows; zero ones have another row, and take none of the data."""
    short = terms.shape[2] - terms.shape[1]
    if short > 0:
        terms = np.pad(terms, ((0, 0), (0, short), (0, 0)))
    # Most have an end that is not zero, which need not be looked for.
    if np.all((terms[:, 0] != 0) | (terms[:, -1] != 0)):
        return terms
    empty = np.asarray(~terms.any(axis=1))
    if not empty.any():
        return terms
    return np.concatenate([terms, np.eye(empty.shape[1]) * empty[:, None]], axis=1)


def _normalised(columns: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Columns (B, m, k) of norm 1, zero columns unchanged, and their norms (B, k)."""
    norm = np.sqrt(np.einsum("bmk,bmk->bk", columns, columns))
    norm[norm == 0] = 1.0
    return columns / norm[:, None], norm


def solve_upper(r: FloatArray, right: FloatArray) -> FloatArray:
    """Solve R x = b for a batch, R from columns of norm 1; unresolved components are 0."""
    if np.abs(np.einsum("bii->bi", r)).min(initial=1.0) > ROUNDING:
        return np.asarray(np.linalg.solve(r, right[:, :, None])[:, :, 0], dtype=np.float64)
    x = np.zeros_like(right)
    for i in range(right.shape[1] - 1, -1, -1):
        rest = right[:, i] - np.einsum("bj,bj->b", r[:, i, i + 1 :], x[:, i + 1 :])
        resolved = np.abs(r[:, i, i]) > ROUNDING
        x[:, i] = np.where(resolved, rest / np.where(resolved, r[:, i, i], 1.0), 0.0)
    return x


def triangle(columns: FloatArray) -> FloatArray:
    """Triangular factor (B, k, k) of columns (B, m, k) with m >= k; fewer rows if m < k."""
    return np.asarray(np.linalg.qr(columns, mode="r"))
