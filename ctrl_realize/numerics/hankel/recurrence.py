"""Lanczos recurrence for many symmetric Hankel matrices at the same time.

The recurrence is [2]_; its loss of orthogonality is bounded as in [1]_.

References
----------
.. [1] H. D. Simon, The Lanczos algorithm with partial reorthogonalization, Math. Comp. 42 (1984)
   115-142, doi:10.1090/S0025-5718-1984-0725988-X.
.. [2] B. N. Parlett, The Symmetric Eigenvalue Problem, SIAM 1998, chapter 13,
   doi:10.1137/1.9781611971163.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dstein, dsterf

from ..arrays import FloatArray, IntArray
from .matrix import HankelStack

FLOOR = 1e-14
"""Residual relative to the largest eigenvalue that counts as rounding."""


EPSILON = float(np.finfo(float).eps)


def start_vectors(h: FloatArray, size: int) -> FloatArray:
    """Return unit start vectors: first column plus a fixed random one."""
    random = np.random.default_rng(2005).standard_normal(size)
    vectors = np.zeros((h.shape[0], size))
    column = h[:, :size]
    norm = np.linalg.norm(column, axis=1, keepdims=True)
    vectors[:, : column.shape[1]] = column / np.where(norm > 0, norm, 1.0)
    vectors += random / np.linalg.norm(random)
    vectors /= np.linalg.norm(vectors, axis=1, keepdims=True)
    return vectors


class LanczosRecurrence:
    """Three-term recurrence for many Hankel matrices, all members in step.

    After ``steps`` steps, ``H Q^T = Q^T T + beta[-1] q e^T`` for every member, with T from
    ``alpha`` and ``beta``. A member whose Krylov space is exhausted gets a zero vector and is not
    changed any more.

    The basis loses its orthogonality as Ritz values converge. Simon's
    recurrence bounds the loss; before it reaches `loss`, two vectors in a row
    are orthogonalised against all before.

    Parameters
    ----------
    h : ndarray, shape (D, L)
        One sequence a row.
    size : int
        Rows of every matrix.
    capacity : int
        Largest number of steps.
    loss : float
        Largest tolerated inner product of two basis vectors.
    """

    def __init__(self, h: FloatArray, size: int, capacity: int, loss: float) -> None:
        count = h.shape[0]
        self.stack = HankelStack(h, size)
        self.loss = loss
        self.basis = np.empty((count, min(capacity, 48) + 1, size))
        self.basis[:, 0] = start_vectors(h, size)
        self.alpha = np.zeros((count, capacity))
        self.beta = np.zeros((count, capacity))
        self.exhausted_at = np.full(count, capacity + 1)
        self.scale = np.zeros(count)
        self.steps = 0
        # bounds of the inner products of the last two vectors with all before
        self._overlap = np.full((2, count), EPSILON)
        self._once_more = False

    def advance(self) -> None:
        """Do one step."""
        j = self.steps
        if j + 1 == self.basis.shape[1]:
            grown = np.empty((self.basis.shape[0], 2 * j, self.basis.shape[2]))
            grown[:, : j + 1] = self.basis
            self.basis = grown
        w = self.stack(self.basis[:, j])
        self.alpha[:, j] = _subtract_projection(w, self.basis[:, max(0, j - 1) : j + 1])
        norm = _norms(w)
        self.scale = np.maximum(self.scale, np.abs(self.alpha[:, j]) + norm)
        if self._loses_orthogonality(norm):
            self.alpha[:, j] += _subtract_projection(w, self.basis[:, : j + 1])
            norm = _norms(w)
        exhausted = norm <= FLOOR * self.scale
        if exhausted.any():
            norm[exhausted] = 0.0
            self.exhausted_at[exhausted] = np.minimum(self.exhausted_at[exhausted], j + 1)
        self.beta[:, j] = norm
        divisor = np.where(exhausted, np.inf, norm)
        np.divide(w, divisor[:, np.newaxis], out=self.basis[:, j + 1])
        self.steps = j + 1

    def _loses_orthogonality(self, norm: FloatArray) -> bool:
        """Bound the loss of orthogonality of the next vector; return whether to reorthogonalise."""
        # The recurrence of Simon for the inner products, in absolute values, with one bound for
        # all earlier vectors in the place of each product.
        j = self.steps
        before, last = self._overlap
        into = self.scale + np.abs(self.alpha[:, j])
        overlap = into * last + EPSILON * self.scale
        if j:
            overlap += self.beta[:, j - 1] * before
        overlap = np.divide(overlap, norm, out=np.zeros_like(norm), where=norm > 0)
        loses = bool((overlap > self.loss).any())
        if loses or self._once_more:
            self._once_more = loses and not self._once_more
            overlap[:] = EPSILON
            loses = True
        self._overlap = np.stack([last, overlap])
        return loses

    def ritz(self, i: int, count: int) -> tuple[FloatArray, FloatArray, FloatArray, float]:
        """Return the leading Ritz pairs of member i.

        Returns
        -------
        values, residuals : ndarray, shape (k,)
            Ritz values by decreasing magnitude, and ``|H v - value v|``.
        coordinates : ndarray, shape (steps, k)
            Ritz vectors in the basis.
        following : float
            Magnitude of Ritz value k + 1.
        """
        steps = min(self.steps, int(self.exhausted_at[i]))
        values, coordinates = extreme_pairs(
            self.alpha[i, :steps], self.beta[i, : steps - 1], count + 1
        )
        following = float(abs(values[count])) if values.size > count else 0.0
        # |H v - theta v| = beta_j |last entry of the eigenvector of T|: Parlett, chapter 13.
        residuals = self.beta[i, steps - 1] * np.abs(coordinates[-1, :count])
        return values[:count], residuals, coordinates[:, :count], following

    def end_products(self) -> None:
        """Release the memory that only further steps would need."""
        del self.stack

    def vectors(self, i: int, coordinates: FloatArray, out: FloatArray) -> None:
        """Write the Ritz vectors of member i into the rows of `out`."""
        np.matmul(coordinates.T, self.basis[i, : coordinates.shape[0]], out=out)

    def mixture(self, i: int, coordinates: FloatArray) -> FloatArray:
        """Return a start vector that holds all leading directions of member i."""
        vector: FloatArray = coordinates.sum(axis=1) @ self.basis[i, : coordinates.shape[0]]
        vector += 1e-3 * self.basis[i, 0]
        return vector

    def sees_everything(self) -> NDArray[np.bool_]:
        """Determine for which members H vanishes on the complement of the exhausted Krylov space.

        One start vector finds one copy of a multiple eigenvalue: a pulse has 1 and -1 many times. A
        product with a new random vector shows whether there are more.
        """
        known = self.basis[:, : self.steps]
        random = np.random.default_rng(1966).standard_normal(known.shape[2])
        probe = np.tile(random, (known.shape[0], 1))
        for _ in range(2):
            inner = np.matmul(known, probe[:, :, np.newaxis])
            probe -= np.matmul(inner.transpose(0, 2, 1), known)[:, 0]
        probe /= np.linalg.norm(probe, axis=1, keepdims=True)
        rest = np.linalg.norm(self.stack(probe), axis=1)
        seen: NDArray[np.bool_] = rest <= 1e-13 * self.scale
        return seen

    def keep(self, members: IntArray) -> None:
        """Continue with some members only."""
        self.stack = self.stack.take(members)
        kept = np.empty((members.size, *self.basis.shape[1:]))
        kept[:, : self.steps + 1] = self.basis[members, : self.steps + 1]
        self.basis = kept
        self.alpha = self.alpha[members]
        self.beta = self.beta[members]
        self.exhausted_at = self.exhausted_at[members]
        self.scale = self.scale[members]
        self._overlap = self._overlap[:, members]


def _subtract_projection(w: FloatArray, basis: FloatArray) -> FloatArray:
    """Make vectors orthogonal to some basis vectors; return what was in the last of these."""
    inner = np.matmul(basis, w[:, :, np.newaxis])
    w -= np.matmul(inner.transpose(0, 2, 1), basis)[:, 0]
    last: FloatArray = inner[:, -1, 0]
    return last


def _norms(w: FloatArray) -> FloatArray:
    squares: FloatArray = np.einsum("ij,ij->i", w, w)
    return np.sqrt(squares)


def extreme_pairs(
    diagonal: FloatArray, beside: FloatArray, count: int
) -> tuple[FloatArray, FloatArray]:
    """Return the eigenpairs of a tridiagonal matrix with the largest magnitudes.

    All eigenvalues by QR without vectors, then inverse iteration for the few
    vectors that are wanted: half the time of a full decomposition.
    """
    n = diagonal.size
    if n == 1:
        return diagonal.copy(), np.ones((1, 1))
    eigenvalues, failed = dsterf(diagonal, beside)
    if failed == 0:
        # dstein wants them ascending; it orthogonalises close ones itself.
        wanted = np.sort(np.argsort(-np.abs(eigenvalues), kind="stable")[:count])
        chosen = eigenvalues[wanted]
        whole = np.zeros(n, dtype=np.int32)
        whole[0] = n
        vectors, failed = dstein(diagonal, beside, chosen, np.ones(n, dtype=np.int32), whole)
    if failed != 0:
        matrix = np.diag(diagonal) + np.diag(beside, 1) + np.diag(beside, -1)
        chosen, vectors = np.linalg.eigh(matrix)
    order = np.argsort(-np.abs(chosen), kind="stable")[:count]
    return chosen[order], vectors[:, order]
