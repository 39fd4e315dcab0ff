r"""Multivariable models in second-order sections; their derivatives as filtered signals.

A model is a sum of sections with two states each,

    x_i[k+1] = A_i x_i[k] + B_i v[k],   y[k] = sum_i C_i x_i[k] + D v[k],
    A_i = [[0, 1], [-a2, -a1]],

which represents two real poles as well as a complex pair. Every derivative of the output is a
signal filtered by ``1 / (z^2 + a1 z + a2)``: a few second-order filters, where derivatives w.r.t.
all entries of A would need n^2 simulations. For an odd order the last section has one state: its
a2, the first row of its B and the first column of its C are zero.

Derivatives by filters as in [1]_.

References
----------
.. [1] L. Ljung, System Identification: Theory for the User, 2nd ed., Prentice Hall 1999, section
   10.3 (Computing gradients).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag
from scipy.signal import lfilter

from ..arrays import ComplexArray, FloatArray, Matrices

_SHAKEN = 1e-8
"""Relative change of A if it has no full set of eigenvectors, or equal poles."""


@dataclass(frozen=True, eq=False)
class Sections:
    """Denominators `a` (q, 2), `B` (q, 2, m), `C` (p, q, 2), `D` (p, m).

    `single`: the last section has one state.
    """

    a: FloatArray
    B: FloatArray
    C: FloatArray
    D: FloatArray
    single: bool

    @property
    def poles(self) -> ComplexArray:
        """Poles, two for each section and one for a single one."""
        middle = -self.a[:, 0] / 2
        root = np.sqrt((middle**2 - self.a[:, 1]).astype(np.complex128))
        found = np.stack([middle + root, middle - root], axis=1).ravel()
        if self.single:
            found = np.append(found[:-2], -self.a[-1, 0])
        return np.asarray(found, dtype=np.complex128)

    def matrices(self) -> Matrices:
        """Return A, B, C, D, without the unused states of a single section."""
        p, q, _ = self.C.shape
        A = block_diag(*[np.array([[0.0, 1.0], [-a2, -a1]]) for a1, a2 in self.a])
        B, C = self.B.reshape(2 * q, -1), self.C.reshape(p, 2 * q)
        kept = np.ones(2 * q, dtype=np.bool_)
        if self.single:
            kept[-2] = False
        return A[np.ix_(kept, kept)], B[kept], C[:, kept], self.D

    def moved(self, step: FloatArray) -> Sections:
        """Add a step in the parameters, in the order of `free`."""
        parts = np.split(step, np.cumsum([self.a.size, self.B.size, self.C.size]))
        a, B, C, D = (
            old + new.reshape(old.shape)
            for old, new in zip((self.a, self.B, self.C, self.D), parts, strict=True)
        )
        return Sections(a, B, C, D, self.single)

    def free(self, *, feedthrough: bool, poles: bool = True) -> NDArray[np.bool_]:
        """Mark the parameters that may move: a, B, C, D; without `poles` B and D alone."""
        a, B, C = (np.ones(x.shape, dtype=np.bool_) for x in (self.a, self.B, self.C))
        if self.single:
            a[-1, 1], B[-1, 0], C[:, -1, 0] = False, False, False
        if not poles:
            a[:], C[:] = False, False
        D = np.full(self.D.shape, feedthrough)
        return np.concatenate([x.ravel() for x in (a, B, C, D)])


def in_sections(A: FloatArray, B: FloatArray, C: FloatArray, D: FloatArray) -> Sections:
    """Convert a model to sections: complex pairs, and pairs of neighbouring real poles."""
    poles, vectors = np.linalg.eig(A)
    apart = np.abs(poles[:, None] - poles + 9 * np.eye(len(A)))
    if apart.min(initial=1.0) < _SHAKEN or np.linalg.cond(vectors) > 1 / _SHAKEN:
        change = np.random.default_rng(0).standard_normal(A.shape)
        poles, vectors = np.linalg.eig(A + _SHAKEN * max(np.abs(A).max(), 1.0) * change)
    left, right = np.linalg.solve(vectors, B), C @ vectors
    p, m = D.shape
    a, rows, columns = [], [], []
    order = np.argsort(poles.real)
    real = [int(i) for i in order if poles[i].imag == 0]
    upper = [int(i) for i in order if poles[i].imag > 0]
    pairs = [(i, int(np.argmin(np.abs(poles - poles[i].conj())))) for i in upper]
    pairs += zip(real[0::2], real[1::2], strict=False)
    for i, j in pairs:
        one, two = poles[i], poles[j]
        basis = np.array([[1.0, 1.0], [one, two]])
        a.append([-(one + two).real, (one * two).real])
        rows.append((basis @ left[[i, j]]).real)
        columns.append((right[:, [i, j]] @ np.linalg.inv(basis)).real)
    single = len(real) % 2 == 1
    if single:
        last = real[-1]
        a.append([-poles[last].real, 0.0])
        rows.append(np.vstack([np.zeros(m), left[last].real]))
        columns.append(np.column_stack([np.zeros(p), right[:, last].real]))
    gains = np.reshape(columns, (-1, p, 2)).swapaxes(0, 1)
    return Sections(np.reshape(a, (-1, 2)), np.reshape(rows, (-1, 2, m)), gains, D, single)


@dataclass(frozen=True, eq=False)
class Motion:
    """Signals of a model with zero initial state, and those for its derivatives.

    `states` (q, 2, T); `driven` (q, 2, 2, m, T): states for an entry (row, input) of B;
    `bent` (q, 2, 2, T): states by a1 and a2; `free` (q, 2, 2, T): states for an initial one.
    """

    states: FloatArray
    driven: FloatArray
    bent: FloatArray
    free: FloatArray

    def output(self, model: Sections, v: FloatArray) -> FloatArray:
        """Output (p, T)."""
        return np.asarray(np.tensordot(model.C, self.states, 2) + model.D @ v)

    def slopes(self, model: Sections, v: FloatArray, output: int, part: slice) -> FloatArray:
        """Derivatives of one output in all parameters, (parameters, samples of the part)."""
        c = model.C[output]
        p = model.C.shape[0]
        count = self.states[..., part].shape[-1]
        bent = np.einsum("qs,qsat->qat", c, self.bent[..., part])
        driven = np.einsum("qs,qsrjt->qrjt", c, self.driven[..., part])
        own = np.zeros((p, c.size, count))
        own[output] = self.states[..., part].reshape(-1, count)
        direct = np.zeros((p, v.shape[0], count))
        direct[output] = v[:, part]
        return np.concatenate([x.reshape(-1, count) for x in (bent, driven, own, direct)])

    def started(self, model: Sections, initial: FloatArray) -> Motion:
        """Signals of the model for a nonzero initial state (2 q,)."""
        each = initial.reshape(-1, 2)
        states = self.states + np.einsum("qsrt,qr->qst", self.free, each)
        bent = [_bent(a1, a2, x) for (a1, a2), x in zip(model.a, states, strict=True)]
        return replace(self, states=states, bent=np.array(bent).reshape(self.bent.shape))

    def starts(self, model: Sections) -> FloatArray:
        """Outputs (p, 2 q, T) for every initial state."""
        p, q, _ = model.C.shape
        found = np.einsum("pqs,qsrt->pqrt", model.C, self.free).reshape(p, 2 * q, -1)
        # Products of decayed values would be denormal numbers, which are slow.
        found[np.abs(found) < 1e-100] = 0.0
        return np.asarray(found)


def motion(model: Sections, v: FloatArray) -> Motion:
    """Filter the inputs (m, T) through every section."""
    T, q = v.shape[1], len(model.a)
    # An initial state is a pulse one sample before the record.
    inputs = np.zeros((v.shape[0] + 1, T + 1))
    inputs[:-1, 1:], inputs[-1, 0] = v, 1.0
    driven, states, bent, free = [], [], [], []
    for (a1, a2), B in zip(model.a, model.B, strict=True):
        moved = _resolvent(a1, a2, inputs)[..., 1:]
        mine = moved[:, :, :-1]
        x = np.einsum("srjt,rj->st", mine, B)
        driven.append(mine)
        states.append(x)
        bent.append(_bent(a1, a2, x))
        free.append(moved[:, :, -1])
    return Motion(
        np.reshape(states, (q, 2, T)),
        np.reshape(driven, (q, 2, 2, v.shape[0], T)),
        np.reshape(bent, (q, 2, 2, T)),
        np.reshape(free, (q, 2, 2, T)),
    )


def _bent(a1: float, a2: float, states: FloatArray) -> FloatArray:
    """Derivatives (2, 2, T) of the states (2, T) of a section in a1 and a2."""
    back = _resolvent(a1, a2, states)[:, 1]  # what enters the second state
    return np.asarray(-back[:, ::-1])


def _resolvent(a1: float, a2: float, signal: FloatArray) -> FloatArray:
    """Signals (..., T) behind ``(z I - A_i)^-1``, shape (2, 2, ..., T): state, entry."""
    late = np.asarray(lfilter([0.0, 1.0], [1.0, a1, a2], signal, axis=-1))
    found = np.zeros((2, 2, *late.shape))
    (own, later), (other, same) = found
    later[..., 1:] = late[..., :-1]
    own[:], other[:], same[:] = late + a1 * later, -a2 * later, late
    return found
