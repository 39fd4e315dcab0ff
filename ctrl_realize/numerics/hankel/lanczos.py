"""Leading eigenpairs of symmetric Hankel matrices: Lanczos on all of them at once.

The singular values of a symmetric matrix are the magnitudes of its
eigenvalues, so one symmetric eigenproblem replaces the SVD of Kung's
algorithm. Many Hankel matrices (one for each candidate delay) go through the
recurrence together; every product is an FFT, every step is a handful of
array operations over all of them.

The recurrence is stopped by the residual ``|H v - lambda v|`` of each wanted pair, not by a number
of steps. Matrices that do not converge, or break down before the whole spectrum is found, are
solved by a dense solver or by ARPACK. Bases shared between delays and randomised range finders are
faster, but errors of up to 10 % were measured on unfiltered data.

References
----------
.. [1] B. N. Parlett, The Symmetric Eigenvalue Problem, SIAM 1998, chapter 13 (Lanczos algorithms),
   doi:10.1137/1.9781611971163.
.. [2] H. D. Simon, The Lanczos algorithm with partial reorthogonalization, Math. Comp. 42 (1984)
   115-142, doi:10.1090/S0025-5718-1984-0725988-X.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse.linalg import LinearOperator, eigsh

from ..arrays import FloatArray, IntArray
from .matrix import HankelStack, hankel_matrix
from .recurrence import FLOOR, LanczosRecurrence

DENSE_SIZE = 64
"""Up to this size a dense solver is as fast."""

DENSE_FALLBACK_SIZE = 1500
"""Up to this size the fallback is dense (1 s, 50 MB), beyond it is ARPACK."""

MAX_STEPS = 320
"""Steps after which the fallback takes over; unfiltered noise needs some 90 at order 8."""

BASIS_BYTES = 96e6
"""Memory that the basis of one run may take; fewer steps are allowed where it is short."""

CHUNK_BYTES = 8e6
"""Size of 32 basis vectors for all members that run together."""

PROBES = 5
"""Number of matrices that are tested before all are solved."""

LONGEST_WAIT = 10
"""Number of steps between two tests of the residuals."""

LOOK_COST = 2e5
"""Numbers in the vectors of a step that costs as much as a look."""

TWINS = 1e-10
"""Relative difference of magnitudes up to which eigenvalues are twins."""

LOSS_OVER_TOL = 1e-3
"""Tolerated loss of orthogonality, relative to the tolerance of the residuals."""


@dataclass(frozen=True, eq=False)
class EigenPairs:
    """Leading eigenpairs of a stack of symmetric Hankel matrices.

    ``H[d] @ vectors[d, i] == values[d, i] * vectors[d, i]``; the rows of
    ``vectors[d]`` are orthonormal and ``abs(values[d])`` decreases. Beyond
    the numerical rank, values and vectors are zero.

    Attributes
    ----------
    values : ndarray, shape (D, k)
    vectors : ndarray, shape (D, k, r)
    following : ndarray, shape (D,)
        Lower estimate of the magnitude of eigenvalue ``k + 1``.
    """

    values: FloatArray
    vectors: FloatArray
    following: FloatArray


def leading_eigenpairs(h: FloatArray, size: int, count: int, *, tol: float = 1e-9) -> EigenPairs:
    """Compute the eigenvalues of largest magnitude of many Hankel matrices.

    Parameters
    ----------
    h : ndarray, shape (D, L)
        One sequence a row; entry (i, j) of matrix d is ``h[d, i + j]``, and
        zero where the row ends before ``2 size - 1`` entries.
    size : int
        Rows of every matrix.
    count : int
        Wanted pairs, at most `size`.
    tol : float
        Largest residual, relative to the smallest wanted eigenvalue.

    Notes
    -----
    Deterministic: the start vector is half the first column and half a
    fixed random vector. (A start in the range of H saves steps; a pure
    eigenvector as a start would miss the others.)
    """
    result = _Result.empty(h.shape[0], size, count)
    small = size <= DENSE_SIZE or 4 * count >= size
    # Several members at a time hide Python's overhead; too many leave the cache.
    chunk = int(np.clip(CHUNK_BYTES // (8 * size * 32), 1, 64))
    for members in np.array_split(np.arange(h.shape[0]), -(-h.shape[0] // chunk)):
        piece = h[members[0] : members[-1] + 1, : 2 * size - 1]
        # Powers of two scale without rounding, so data times c stay comparable bit by bit.
        scale = np.ldexp(1.0, np.frexp(np.abs(piece).max(axis=1))[1])
        piece = piece / scale[:, np.newaxis]
        part = result.part(members)
        if small:
            for d in range(members.size):
                part.put(d, *_dense(piece[d], size, count))
        else:
            _lanczos(piece, count, size, tol, part)
        part.values *= scale[:, np.newaxis]
        part.following *= scale
    return EigenPairs(result.values, result.vectors, result.following)


def largest_magnitude(h: FloatArray, size: int) -> FloatArray:
    """Return the 2-norms of symmetric Hankel matrices to three digits.

    Parameters
    ----------
    h : ndarray, shape (D, L)
        One sequence a row, as in `leading_eigenpairs`.
    size : int
        Rows of every matrix.
    """
    return np.abs(leading_eigenpairs(h, size, 1, tol=1e-3).values[:, 0])


@dataclass
class _Result:
    """Collects pairs as they converge."""

    values: FloatArray
    vectors: FloatArray
    following: FloatArray

    @classmethod
    def empty(cls, members: int, size: int, count: int) -> _Result:
        return cls(np.zeros((members, count)), np.zeros((members, count, size)), np.zeros(members))

    def part(self, members: IntArray) -> _Result:
        """Return the positions of consecutive members."""
        rows = slice(int(members[0]), int(members[-1]) + 1)
        return _Result(self.values[rows], self.vectors[rows], self.following[rows])

    def put(self, d: int, values: FloatArray, vectors: FloatArray, following: float) -> None:
        """Store pairs up to the numerical rank; `vectors` may be in their final place already."""
        magnitude = np.abs(values)
        rounding = vectors.shape[1] * np.finfo(float).eps * magnitude.max()
        rank = int(np.count_nonzero(magnitude > rounding))
        self.values[d, :rank] = values[:rank]
        self.vectors[d, :rank] = vectors[:rank]
        self.vectors[d, rank:] = 0.0
        self.following[d] = following


def _lanczos(h: FloatArray, count: int, size: int, tol: float, result: _Result) -> None:
    """Run some matrices together; hand what does not converge to the fallback."""
    members = np.arange(h.shape[0])
    room = int(BASIS_BYTES // (8 * size * members.size))
    capacity = min(size - 1, MAX_STEPS, max(room, 2 * count + 6))
    run = LanczosRecurrence(h, size, capacity, LOSS_OVER_TOL * tol)
    pace = _Pace(count + 2, LOOK_COST / (size * members.size))
    while members.size and run.steps < capacity:
        run.advance()
        exhausted = run.exhausted_at <= run.steps
        if run.steps < pace.next_look and not exhausted.all():
            continue
        for i in np.unique(np.linspace(0, members.size - 1, PROBES).astype(np.intp)):
            excess = _excess(*run.ritz(int(i), count)[:2], tol)
            if excess > 1:
                break
        pace.set(run.steps, excess)
        if excess > 1:
            continue
        doubtful = exhausted & ~run.sees_everything() if exhausted.any() else exhausted
        pairs = [run.ritz(i, count) for i in range(members.size)]
        left = [i for i, pair in enumerate(pairs) if _excess(*pair[:2], tol) > 1]
        if not left:
            run.end_products()
        for i in sorted(set(range(members.size)) - set(left)):
            d = int(members[i])
            values, _, coordinates, following = pairs[i]
            if doubtful[i] or _has_twins(values, following):
                _fall_back(h[d], size, count, run.mixture(i, coordinates), result, d)
            else:
                # directly to their place: for a million samples there is no memory for a copy
                vectors = result.vectors[d, : values.size]
                run.vectors(i, coordinates, vectors)
                result.put(d, values, vectors, following)
        members = members[left]
        if left:
            run.keep(np.array(left))
    starts = [run.mixture(i, run.ritz(i, count)[2]) for i in range(members.size)]
    del run  # the basis is the largest thing here, and ARPACK makes its own
    for d, start in zip(members.tolist(), starts, strict=True):
        _fall_back(h[d], size, count, start, result, d)


def _excess(values: FloatArray, residuals: FloatArray, tol: float) -> float:
    """Return the largest residual relative to the tolerance."""
    magnitude = np.abs(values)
    asked = max(tol * float(magnitude[-1]), FLOOR * float(magnitude[0]))
    largest = float(residuals.max())
    return largest / asked if asked > 0 else float(largest > 0)


def _has_twins(values: FloatArray, following: float) -> bool:
    """Whether two eigenvalues have the same magnitude, which noise excludes.

    A pulse on top of a smooth response has 1 and -1 many times, and one
    start vector finds one of each.
    """
    magnitude = np.append(np.abs(values), following)
    return bool((magnitude[1:] > (1 - TWINS) * magnitude[:-1]).any())


class _Pace:
    """Determines when to test the residuals again: they decrease about geometrically."""

    def __init__(self, first: int, longest: float) -> None:
        self.next_look = first
        self._longest = max(1.0, min(longest, LONGEST_WAIT))
        self._looked = 0
        self._excess = np.inf

    def set(self, steps: int, excess: float) -> None:
        since, pause = steps - self._looked, min(2.0, self._longest)
        if 1 < excess < self._excess < np.inf:
            needed = since * np.log(excess) / np.log(self._excess / excess)
            pause = min(max(0.6 * needed, pause), self._longest)
        self.next_look, self._looked, self._excess = steps + int(pause), steps, excess


def _fall_back(
    h: FloatArray, size: int, count: int, start: FloatArray, result: _Result, d: int
) -> None:
    """Solve one matrix without the recurrence: dense, or ARPACK with restarts when large."""
    if size <= DENSE_FALLBACK_SIZE:
        result.put(d, *_dense(h, size, count))
        return
    stack = HankelStack(h[np.newaxis], size)
    operator = LinearOperator(
        (size, size), matvec=lambda v: stack(v.reshape(1, -1))[0].copy(), dtype=np.float64
    )
    # ARPACK restarts Lanczos. One pair more than wanted: users are warned when there is no gap.
    values, vectors = eigsh(operator, k=count + 1, which="LM", v0=start)
    order = np.argsort(-np.abs(values), kind="stable")
    leading = order[:count]
    following = float(abs(values[order[count]]))
    result.put(d, values[leading], np.ascontiguousarray(vectors[:, leading].T), following)


def _dense(h: FloatArray, size: int, count: int) -> tuple[FloatArray, FloatArray, float]:
    """Solve one matrix in full."""
    values, vectors = np.linalg.eigh(hankel_matrix(h, size, size))
    order = np.argsort(-np.abs(values), kind="stable")
    following = float(abs(values[order[count]])) if count < size else 0.0
    return values[order[:count]], np.ascontiguousarray(vectors[:, order[:count]].T), following
