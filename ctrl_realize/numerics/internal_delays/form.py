r"""A linear system closed through delays, and what interconnections make of it.

A delay-free core with q further inputs w and outputs z, closed by pure delays::

    x'   = A x + B1 u + B2 w          (x[k+1] in discrete time)
    y    = C1 x + D11 u + D12 w
    z    = C2 x + D21 u + D22 w
    w_i(t) = z_i(t - tau_i)

This is the linear fractional form of [1]_, called internal delays there; every interconnection of
such systems is one again. All of them are made of four steps: systems side by side (`append`),
gains at the ends (`through`), a static gain from outputs to inputs (`closed`), and the inverse.

References
----------
.. [1] P. Gahinet and L. F. Shampine, Software for modeling and analysis of linear systems with
   delays, Proc. American Control Conf. 2004, 5600-5605, section 2, doi:10.23919/ACC.2004.1384746.
.. [2] B. N. Parlett and C. Reinsch, Balancing a matrix for calculation of eigenvalues and
   eigenvectors, Numer. Math. 13 (1969) 293-304, doi:10.1007/BF02165404.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import matrix_balance
from scipy.sparse.csgraph import connected_components

from ..arrays import FloatArray

SINGULAR = 1e-13
"""Reciprocal condition below which a loop without delay counts as one that has no solution."""


@dataclass(frozen=True, eq=False)
class DelayForm:
    """Core and delays.

    ``B = [B1 B2]``, ``C = [C1; C2]``, ``D = [[D11 D12], [D21 D22]]``; the last ``len(delays)``
    inputs and outputs are closed through `delays`, in samples or in s.
    """

    A: FloatArray
    B: FloatArray
    C: FloatArray
    D: FloatArray
    delays: tuple[float, ...] = ()

    @property
    def states(self) -> int:
        """States of the core."""
        return int(self.A.shape[0])

    @property
    def inputs(self) -> int:
        """Inputs, the delays' not counted."""
        return int(self.B.shape[1]) - len(self.delays)

    @property
    def outputs(self) -> int:
        """Outputs, the delays' not counted."""
        return int(self.C.shape[0]) - len(self.delays)

    def channels(self, keep: list[int]) -> DelayForm:
        """Keep some of the delays, in this order, with their inputs and outputs."""
        columns = [*range(self.inputs), *(self.inputs + i for i in keep)]
        rows = [*range(self.outputs), *(self.outputs + i for i in keep)]
        D, delays = self.D[np.ix_(rows, columns)], tuple(self.delays[i] for i in keep)
        return DelayForm(self.A, self.B[:, columns], self.C[rows], D, delays)

    def dual(self) -> DelayForm:
        """Transpose the system: what was read is driven, and inputs and outputs change places."""
        A, C, B, D = (np.ascontiguousarray(M.T) for M in (self.A, self.B, self.C, self.D))
        return DelayForm(A, B, C, D, self.delays)


def static(D: FloatArray) -> DelayForm:
    """Make the form of a gain."""
    p, m = D.shape
    return DelayForm(np.zeros((0, 0)), np.zeros((0, m)), np.zeros((p, 0)), D)


def delayed_ends(form: DelayForm, before: Sequence[float], behind: Sequence[float]) -> DelayForm:
    """Put delays at the inputs and outputs of a system, none where they are 0."""
    first, last = ([k for k, tau in enumerate(end) if tau] for end in (before, behind))
    (p, m), i, k = form.D.shape, len(first), len(last)
    B = np.hstack([form.B, form.B[:, first], np.zeros((form.states, k))])
    C = np.vstack([form.C, np.zeros((i, form.states)), form.C[last]])
    D = np.zeros((p + i + k, m + i + k))
    D[:p, :m], D[:p, m : m + i] = form.D, form.D[:, first]
    B[:, first], D[:p, first] = 0.0, 0.0
    D[np.arange(p, p + i), first] = 1.0
    D[p + i :] = D[last]
    C[last], D[last] = 0.0, 0.0
    D[last, np.arange(m + i, m + i + k)] = 1.0
    ends = (*(before[j] for j in first), *(behind[j] for j in last))
    return DelayForm(form.A, B, C, D, (*form.delays, *ends))


def append(first: DelayForm, second: DelayForm) -> DelayForm:
    """Put two systems side by side."""
    m, p = first.inputs, first.outputs
    m2, p2 = second.inputs, second.outputs
    q, q2 = len(first.delays), len(second.delays)
    A, B, C, D = (_beside(getattr(first, k), getattr(second, k)) for k in "ABCD")
    # u of both, then w of both
    columns = [*range(m), *range(m + q, m + q + m2), *range(m, m + q)]
    columns += range(m + q + m2, m + q + m2 + q2)
    rows = [*range(p), *range(p + q, p + q + p2), *range(p, p + q)]
    rows += range(p + q + p2, p + q + p2 + q2)
    delays = first.delays + second.delays
    return DelayForm(A, B[:, columns], C[rows], D[np.ix_(rows, columns)], delays)


def _beside(one: FloatArray, other: FloatArray) -> FloatArray:
    """Block diagonal of two matrices; SciPy's takes four times as long for small ones."""
    (p, m), (q, n) = one.shape, other.shape
    both = np.zeros((p + q, m + n))
    both[:p, :m], both[p:, m:] = one, other
    return both


def through(form: DelayForm, left: FloatArray, right: FloatArray) -> DelayForm:
    """Put gains at the ends: left * system * right."""
    B, C, D, m, p = form.B, form.C, form.D, form.inputs, form.outputs
    D = np.vstack([left @ D[:p], D[p:]])
    D = np.hstack([D[:, :m] @ right, D[:, m:]])
    B, C = np.hstack([B[:, :m] @ right, B[:, m:]]), np.vstack([left @ C[:p], C[p:]])
    return DelayForm(form.A, B, C, D, form.delays)


def closed(form: DelayForm, gain: FloatArray) -> DelayForm:
    """Close a static gain around a system: u = v + gain y, from v to y.

    Raises
    ------
    numpy.linalg.LinAlgError
        I - D11 gain is singular: the loop without delays has no solution, or many.
    """
    m, p = form.inputs, form.outputs
    D1 = form.D[:p]
    loop = D1[:, :m] @ gain
    _check_loops(loop)
    seen = np.linalg.solve(np.eye(p) - loop, np.hstack([form.C[:p], D1]))
    back = gain @ seen
    n = form.states
    # u = v + back [x; v; w]
    into = form.B[:, :m]
    add = form.D[:, :m]
    B, C, D = form.B + into @ back[:, n:], form.C + add @ back[:, :n], form.D + add @ back[:, n:]
    C[:p], D[:p] = seen[:, :n], seen[:, n:]
    return DelayForm(form.A + into @ back[:, :n], B, C, D, form.delays)


def wired(form: DelayForm, gain: FloatArray, outputs: Any, inputs: Any) -> DelayForm:
    """Close a static gain around a system, and keep some outputs and inputs; see `closed`."""
    left, right = np.eye(form.outputs)[outputs], np.eye(form.inputs)[:, inputs]
    return through(closed(form, gain), left, right)


def series(second: DelayForm, first: DelayForm) -> DelayForm:
    """Make the product second * first: `first` acts first."""
    both = append(first, second)
    gain = np.zeros((both.inputs, both.outputs))
    gain[first.inputs :, : first.outputs] = np.eye(second.inputs)
    return wired(both, gain, slice(first.outputs, None), slice(first.inputs))


def parallel(first: DelayForm, second: DelayForm) -> DelayForm:
    """Make the sum of two systems."""
    p, m = first.outputs, first.inputs
    left, right = np.hstack([np.eye(p)] * 2), np.vstack([np.eye(m)] * 2)
    return through(append(first, second), left, right)


def feedback(forward: DelayForm, back: DelayForm, sign: float) -> DelayForm:
    """Close `back` around `forward`: u = r + sign * back(y).

    Raises
    ------
    numpy.linalg.LinAlgError
        The loop without delays has no solution, or many.
    """
    both = append(forward, back)
    gain = np.zeros((both.inputs, both.outputs))
    gain[: forward.inputs, forward.outputs :] = sign * np.eye(forward.inputs)
    gain[forward.inputs :, : forward.outputs] = np.eye(forward.outputs)
    return wired(both, gain, slice(forward.outputs), slice(forward.inputs))


def inverse(form: DelayForm) -> DelayForm:
    """Exchange inputs and outputs.

    Raises
    ------
    numpy.linalg.LinAlgError
        The direct term that no delay holds back is not invertible: the inverse is not proper.
    """
    m, p = form.inputs, form.outputs
    if m != p:
        raise np.linalg.LinAlgError
    direct = form.D[:p, :m]
    _check_regular(direct)
    n = form.states
    # u = direct^-1 (y - C1 x - D12 w)
    found = np.linalg.solve(direct, np.hstack([-form.C[:p], np.eye(p), -form.D[:p, m:]]))
    into, add = form.B[:, :m], form.D[p:, :m]
    A = form.A + into @ found[:, :n]
    B = np.hstack([into @ found[:, n : n + p], form.B[:, m:] + into @ found[:, n + p :]])
    C = np.vstack([found[:, :n], form.C[p:] + add @ found[:, :n]])
    lower = np.hstack([add @ found[:, n : n + p], form.D[p:, m:] + add @ found[:, n + p :]])
    return DelayForm(A, B, C, np.vstack([found[:, n:], lower]), form.delays)


def without_zero_delays(form: DelayForm) -> DelayForm:
    """Close the channels whose delay is 0.

    Raises
    ------
    numpy.linalg.LinAlgError
        Their loop has no solution, or many.
    """
    at = [i for i, delay in enumerate(form.delays) if delay == 0]
    if not at:
        return form
    rest = [i for i, delay in enumerate(form.delays) if delay > 0]
    ordered = form.channels([*at, *rest])
    opened = DelayForm(ordered.A, ordered.B, ordered.C, ordered.D, ordered.delays[len(at) :])
    m, p = form.inputs, form.outputs
    gain = np.zeros((opened.inputs, opened.outputs))
    gain[m:, p:] = np.eye(len(at))
    return wired(opened, gain, slice(p), slice(m))


def _check_regular(matrix: FloatArray) -> None:
    if matrix.size and not 1 / np.linalg.cond(matrix) > SINGULAR:
        raise np.linalg.LinAlgError


def _check_loops(gains: FloatArray) -> None:
    """Refuse gains M for which I - M is singular, whatever the units of the signals are.

    Its determinant is the product of those of the signals that are in loops with one another, and
    the same for other units of these: they are balanced [2]_.
    """
    count, label = connected_components(gains != 0, connection="strong")
    for k in range(count):
        (at,) = np.nonzero(label == k)
        alike, _ = matrix_balance(gains[np.ix_(at, at)], permute=False)
        _check_regular(np.eye(at.size) - alike)
