"""Leading eigenpairs of symmetric Hankel matrices: Lanczos on all of them at once.

The singular values of a symmetric matrix are the magnitudes of its
eigenvalues, so one symmetric eigenproblem replaces the SVD of Kung's
algorithm. Many Hankel matrices (one for each candidate delay) go through the
recurrence together [1]_; every product is an FFT, every step is a handful of
array operations over all of them. Every new vector is made orthogonal to all before.

The recurrence is stopped by the residual ``|H v - lambda v|`` of each wanted pair, not by a number
of steps. Where a Krylov space is exhausted, it goes on from a random vector orthogonal to it, until
a product with such a vector vanishes: one start vector finds one copy of a multiple eigenvalue.
Matrices that do not converge, or have eigenvalues of equal magnitude, are solved by a dense solver
or by ARPACK. Bases shared between delays and randomised range finders are faster, but errors of up
to 10 % were measured on unfiltered data.

References
----------
.. [1] B. N. Parlett, The Symmetric Eigenvalue Problem, SIAM 1998, chapter 13 (Lanczos algorithms),
   doi:10.1137/1.9781611971163.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh_tridiagonal
from scipy.sparse.linalg import LinearOperator, eigsh

from ..arrays import FloatArray, IntArray
from .matrix import HankelStack, hankel_matrix

DENSE_SIZE = 64
"""Up to this size a dense solver is as fast."""

DENSE_FALLBACK_SIZE = 1500
"""Up to this size the fallback is dense (1 s, 50 MB), beyond it is ARPACK."""

MAX_STEPS = 320
"""Steps after which the fallback takes over; unfiltered noise needs some 90 at order 8."""

BASIS_BYTES = 96e6
"""Memory that the basis of one run may take; fewer steps are allowed where it is short."""

CHUNK_BYTES = 4e6
"""Size of 32 basis vectors for all members that run together."""

LOOK_EVERY, LOOK_COST = 6, 2e5
"""Steps between two tests of the residuals; numbers in the vectors of a step from which on a test
costs little beside it, so that every step is followed by one."""

TWINS = 1e-10
"""Relative difference of magnitudes up to which eigenvalues are twins."""

FLOOR, NOTHING = 1e-14, 1e-13
"""Residual, and product with a random vector, relative to the largest eigenvalue, that count as
rounding."""

CANCELLED = 0.1
"""Part of a vector that is left by a projection below which it is projected once more: each step
multiplies what is not orthogonal by the inverse of that part."""


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

    def part(self, members: IntArray) -> EigenPairs:
        """Return the positions of consecutive members."""
        rows = slice(int(members[0]), int(members[-1]) + 1)
        return EigenPairs(self.values[rows], self.vectors[rows], self.following[rows])

    def put(self, d: int, values: FloatArray, vectors: FloatArray, following: float) -> None:
        """Store pairs up to the numerical rank; `vectors` may be in their final place already."""
        magnitude = np.abs(values)
        rounding = vectors.shape[1] * np.finfo(float).eps * magnitude.max()
        rank = int(np.count_nonzero(magnitude > rounding))
        self.values[d, :rank] = values[:rank]
        self.vectors[d, :rank] = vectors[:rank]
        self.vectors[d, rank:] = 0.0
        self.following[d] = following


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
    # arrays that take pairs as they converge
    values, following = np.zeros((len(h), count)), np.zeros(len(h))
    result = EigenPairs(values, np.zeros((len(h), count, size)), following)
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
        np.multiply(part.values, scale[:, np.newaxis], out=part.values)
        np.multiply(part.following, scale, out=part.following)
    return result


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


def _lanczos(h: FloatArray, count: int, size: int, tol: float, result: EigenPairs) -> None:
    """Run some matrices together; hand what does not converge to the fallback."""
    members = h.shape[0]
    room = int(BASIS_BYTES // (8 * size * members))
    capacity = min(size - 1, MAX_STEPS, max(room, 2 * count + 6))
    every = 1 if size * members > LOOK_COST else LOOK_EVERY
    product, random = HankelStack(h, size), np.random.default_rng(2005)
    basis = np.empty((members, capacity + 1, size))
    basis[:, 0] = start_vectors(h, random.standard_normal(size))
    diagonal, beside = np.zeros((2, members, capacity))
    scale, renewed, complete = np.zeros(members), np.zeros(members, bool), np.zeros(members, bool)
    left = list(range(members))
    for steps in range(1, capacity + 1):
        known = basis[:, :steps]
        w = product(known[:, -1])
        before = _norms(w)
        scale = np.maximum(scale, before)
        diagonal[:, steps - 1] = _subtract_projection(w, known)
        if (_norms(w) < CANCELLED * before).any():
            _subtract_projection(w, known)
        norm = _norms(w)
        exhausted = norm <= FLOOR * scale
        complete |= renewed & (before <= NOTHING * scale)
        beside[:, steps - 1] = np.where(exhausted, 0.0, norm)
        divisor = np.where(exhausted, np.inf, norm)
        np.divide(w, divisor[:, np.newaxis], out=basis[:, steps])
        renewed = exhausted & ~complete
        if renewed.any():
            basis[renewed, steps] = _beside(known[renewed], random.standard_normal(size))
        if steps < count + 2 or (steps - count - 2) % every:
            continue
        while left and (complete[left[-1]] or not exhausted[left[-1]]):
            d = left[-1]
            values, coordinates = _ritz(diagonal[d, :steps], beside[d, : steps - 1], count + 1)
            # |H v - theta v| = beta_j |last entry of the eigenvector of T|: Parlett, chapter 13.
            residuals = beside[d, steps - 1] * np.abs(coordinates[-1, :count])
            if _excess(values[:count], residuals, tol) > 1:
                break
            left.pop()
            if _has_twins(values):
                _fall_back(h[d], size, count, basis[d, 0], result, d)
            else:
                # directly to their place: for a million samples there is no memory for a copy
                vectors = result.vectors[d, :count]
                np.matmul(coordinates[:, :count].T, basis[d, :steps], out=vectors)
                result.put(d, values[:count], vectors, float(abs(values[count])))
        if not left:
            return
    starts = basis[left, 0]
    del basis, known  # the basis is the largest thing here, and ARPACK makes its own
    for d, start in zip(left, starts, strict=True):
        _fall_back(h[d], size, count, start, result, d)


def start_vectors(h: FloatArray, random: FloatArray) -> FloatArray:
    """Return unit start vectors: first column plus a random one."""
    vectors = np.zeros((h.shape[0], random.size))
    column = h[:, : random.size]
    norm = np.linalg.norm(column, axis=1, keepdims=True)
    vectors[:, : column.shape[1]] = column / np.where(norm > 0, norm, 1.0)
    vectors += random / np.linalg.norm(random)
    vectors /= np.linalg.norm(vectors, axis=1, keepdims=True)
    return vectors


def _subtract_projection(w: FloatArray, basis: FloatArray) -> FloatArray:
    """Make vectors orthogonal to some basis vectors; return what was in the last of these."""
    inner = np.matmul(basis, w[:, :, np.newaxis])
    w -= np.matmul(inner.transpose(0, 2, 1), basis)[:, 0]
    last: FloatArray = inner[:, -1, 0]
    return last


def _beside(basis: FloatArray, random: FloatArray) -> FloatArray:
    """Return unit vectors orthogonal to some basis vectors, from a random one."""
    w = np.tile(random, (basis.shape[0], 1))
    for _ in range(2):
        _subtract_projection(w, basis)
    return w / _norms(w)[:, np.newaxis]


def _norms(w: FloatArray) -> FloatArray:
    squares: FloatArray = np.einsum("ij,ij->i", w, w)
    return np.sqrt(squares)


def _ritz(diagonal: FloatArray, beside: FloatArray, count: int) -> tuple[FloatArray, FloatArray]:
    """Return the eigenpairs of a tridiagonal matrix with the largest magnitudes."""
    pairs = eigh_tridiagonal(diagonal, beside, check_finite=False)
    values, vectors = (np.asarray(part, dtype=np.float64) for part in pairs)
    order = np.argsort(-np.abs(values), kind="stable")[:count]
    return values[order], vectors[:, order]


def _excess(values: FloatArray, residuals: FloatArray, tol: float) -> float:
    """Return the largest residual relative to the tolerance."""
    magnitude = np.abs(values)
    asked = max(tol * float(magnitude[-1]), FLOOR * float(magnitude[0]))
    largest = float(residuals.max())
    return largest / asked if asked > 0 else float(largest > 0)


def _has_twins(values: FloatArray) -> bool:
    """Whether two eigenvalues have the same magnitude, which noise excludes.

    A pulse on top of a smooth response has 1 and -1 many times, and one
    start vector finds one of each.
    """
    magnitude = np.abs(values)
    return bool((magnitude[1:] > (1 - TWINS) * magnitude[:-1]).any())


def _fall_back(
    h: FloatArray, size: int, count: int, start: FloatArray, result: EigenPairs, d: int
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
    result.put(d, *_leading(*eigsh(operator, k=count + 1, which="LM", v0=start), count))


def _dense(h: FloatArray, size: int, count: int) -> tuple[FloatArray, FloatArray, float]:
    """Solve one matrix in full."""
    return _leading(*np.linalg.eigh(hankel_matrix(h, size, size)), count)


def _leading(
    values: FloatArray, vectors: FloatArray, count: int
) -> tuple[FloatArray, FloatArray, float]:
    """Eigenvalues of the largest magnitudes, their vectors as rows, and the next magnitude."""
    order = np.argsort(-np.abs(values), kind="stable")
    following = float(abs(values[order[count]])) if count < values.size else 0.0
    return values[order[:count]], np.ascontiguousarray(vectors[:, order[:count]].T), following
