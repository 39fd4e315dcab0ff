r"""Delay differential equations of linear systems, solved with a bound on the error.

The method of steps: what comes out of a delay is known one delay ahead. On each step the state is a
polynomial that meets the equation at the points of the Radau quadrature, of stage order `STAGES`
and stable for stiff cores too [1]_; what is on its way through the delays is kept as the polynomial
of its step. A jump of the input travels through the delays and makes breaking points, sums of
delays later; every one of them is the end of a step, as far as the solution is not smoother than
the polynomials [2]_. All steps are then halved, until the result does not change by more than the
tolerance.

References
----------
.. [1] N. Guglielmi and E. Hairer, Implementing Radau IIA methods for stiff delay differential
   equations, Computing 67 (2001) 1-12, doi:10.1007/s006070170013.
.. [2] A. Bellen and M. Zennaro, Numerical Methods for Delay Differential Equations, Oxford
   University Press 2003, chapters 2 and 3, doi:10.1093/acprof:oso/9780198506546.001.0001.
.. [3] J.-P. Berrut and L. N. Trefethen, Barycentric Lagrange interpolation, SIAM Review 46 (2004)
   501-517, doi:10.1137/S0036144502417715.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from scipy.special import roots_jacobi

from ..arrays import FloatArray, IntArray
from ..state_space.sampling import state_units
from .form import DelayForm

STAGES = 6
"""Points of a step: order 11 at its end, and 6 between."""

MOST_STEPS = 200_000
"""Steps of one solution; they are as short as the shortest delay."""

MOST_BREAKS = 20_000
"""Breaking points that are followed; those that are left are many delays from a jump."""

HALVINGS = 7
"""How often all steps are halved at most."""

SNAP = 1e-10
"""Part of the time span within which two points of time are one."""

MOST_EQUAL = 2000
"""Equal intervals between the times at which a response is drawn."""

_PER_TURN, _PER_PART = 20, 400
"""Times at which a response is drawn, in a turn of 1 rad, of whose peaks 3e-4 are missed at most,
and later in a part of twice the length of the part before."""

Signal = Callable[[FloatArray], FloatArray]
"""Inputs (m, K) at K times; right-continuous."""


class TooManyStepsError(ArithmeticError):
    """The shortest delay, or the tolerance, asks for more steps than are made."""


def response_times(end: float, turn: float, least: int) -> FloatArray:
    """Times from 0 at which a response is drawn that begins fast, and may have a slow end.

    Parameters
    ----------
    end : float
        The last time in s.
    turn : float
        In s, of the fastest motion that is to be seen by 1 rad.
    least : int
        Number of equal intervals. There are more if these are longer than a twentieth of `turn`,
        up to `MOST_EQUAL`; beyond so many they are doubled as often as time is.
    """
    count = int(np.clip(np.ceil(_PER_TURN * end / turn), least, max(least, MOST_EQUAL)))
    near = min(end, count * turn / _PER_TURN)
    # Equal ones in parts: steps that are alike share their matrices.
    ends = np.append(near * 2.0 ** np.arange(np.ceil(np.log2(end / near))), end)
    parts = [np.linspace(0, near, count + 1)]
    parts += [np.linspace(*pair, _PER_PART + 1)[1:] for pair in pairwise(ends)]
    return np.concatenate(parts)


def solve(
    form: DelayForm,
    inputs: Signal,
    times: FloatArray,
    breaks: FloatArray,
    initial_state: FloatArray,
    history: FloatArray,
    tolerance: float,
    *,
    slope: bool = False,
) -> tuple[FloatArray, float]:
    """Solve a continuous system closed through delays.

    Parameters
    ----------
    form : DelayForm
        Delays in s, above 0.
    inputs : callable
    times : ndarray, shape (K,)
        Rising, from 0, in s.
    breaks : ndarray, shape (J,)
        Times from 0 on where the inputs or their slopes jump.
    initial_state : ndarray, shape (n,)
    history : ndarray, shape (q,)
        What went into the delays before time 0, constant.
    tolerance : float
        Largest error, relative to the largest output.
    slope : bool
        Give the derivatives of the outputs instead; jumps are left out.

    Returns
    -------
    outputs : ndarray, shape (p, K)
    error : float
        Their largest change when all steps were halved for the last time.

    Raises
    ------
    TooManyStepsError
    """
    units = state_units(form.A)
    alike = form.A * units / units[:, None], form.B / units[:, None], form.C * units
    form, initial_state = DelayForm(*alike, form.D, form.delays), initial_state / units
    end = float(times[-1])
    points = np.concatenate([times, breaking_points(form, breaks, end)])
    longest = min([end or 1.0, *form.delays, _shortest_time(form)])
    # no longer than the steps that come of themselves, lest halving changes nothing
    longest = min(longest, float(np.diff(np.sort(points)).max(initial=0.0)) or longest)
    before: FloatArray | None = None
    error = np.inf
    for _ in range(HALVINGS):
        mesh = _mesh(points, longest, end)
        outputs = _stepped(form, inputs, times, mesh, initial_state, history, slope=slope)
        if before is not None:
            size = float(np.abs(outputs).max(initial=0.0)) or 1.0
            error = float(np.abs(outputs - before).max(initial=0.0))
            if error <= tolerance * size or not np.isfinite(size):
                break
        before = outputs
        longest /= 2
    return outputs, error


def breaking_points(form: DelayForm, breaks: FloatArray, end: float) -> FloatArray:
    """Times to which jumps travel through the delays, as far as the polynomials see them."""
    close = SNAP * (end or 1.0)
    # Each passage through the core makes the solution smoother by one derivative; a passage through
    # direct terms does not.
    passages = STAGES + 2 if not np.any(form.D[form.outputs :, form.inputs :]) else MOST_BREAKS
    delays = np.array(form.delays)
    found = _distinct(np.concatenate([[0.0], breaks]), close)
    front = found
    for _ in range(passages):
        front = _distinct(np.add.outer(front, delays).ravel(), close)
        front = front[front <= end + close]
        if front.size == 0 or found.size > MOST_BREAKS:
            break
        found = _distinct(np.concatenate([found, front]), close)
    return found


def _distinct(times: FloatArray, close: float) -> FloatArray:
    times = np.sort(times)
    return times[np.diff(times, prepend=-np.inf) > close]


def _shortest_time(form: DelayForm) -> float:
    """Time in which the core turns or grows; what decays fast needs no short steps."""
    poles = np.linalg.eigvals(form.A)
    rate = float(np.maximum(np.abs(poles.imag), poles.real).max(initial=0.0))
    return 2 / rate if rate > 0 else np.inf


def _mesh(points: FloatArray, longest: float, end: float) -> FloatArray:
    points = _distinct(points, SNAP * (end or 1.0))
    points = points[points <= end * (1 + SNAP)]
    gaps = np.diff(points)
    parts = np.maximum(1, np.ceil(gaps / longest * (1 - 1e-9))).astype(np.int64)
    if parts.sum() > MOST_STEPS:
        raise TooManyStepsError(f"{parts.sum()}")
    steps = np.repeat(gaps / parts, parts)
    within = np.arange(parts.sum()) - np.repeat(np.cumsum(parts) - parts, parts)
    starts = np.repeat(points[:-1], parts) + within * steps
    return np.append(starts, points[-1])


def _radau() -> tuple[FloatArray, FloatArray]:
    """Points in (0, 1], the last one 1, and the matrix of integrals of their polynomials."""
    c = np.append((1 + roots_jacobi(STAGES - 1, 1.0, 0.0)[0]) / 2, 1.0)
    powers = np.arange(STAGES)
    values, integrals = c[:, None] ** powers, c[:, None] ** (powers + 1) / (powers + 1)
    weights = np.linalg.solve(values.T, integrals.T).T
    return np.asarray(c, np.float64), np.asarray(weights, np.float64)


POINTS, INTEGRALS = _radau()
NODES = np.concatenate([[0.0], POINTS])
"""Points of a step at which signals are kept, its start among them."""

_BARYCENTRIC = 1 / np.prod(NODES[:, None] - NODES[None, :] + np.eye(NODES.size), axis=1)
"""Weights of the nodes in the barycentric formula of interpolation [3]_."""

_RATIOS = _BARYCENTRIC[None, :] / _BARYCENTRIC[:, None]
SLOPES = _RATIOS / (NODES[:, None] - NODES[None, :] + np.eye(NODES.size))
SLOPES -= np.diag(np.diag(SLOPES))
SLOPES -= np.diag(SLOPES.sum(axis=1))
"""Derivatives at the nodes from the values there."""


def _weights(at: FloatArray) -> FloatArray:
    """Weights of the nodes in the interpolating polynomial, at points (...) of a step."""
    gaps = at[..., None] - NODES
    hit = np.abs(gaps) < 1e-13
    some = hit.any(axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        parts = _BARYCENTRIC / gaps
        weights = parts / parts.sum(axis=-1, keepdims=True)
    weights[some] = hit[some] / hit[some].sum(axis=-1, keepdims=True)
    return np.asarray(weights, dtype=np.float64)


def _stepped(
    form: DelayForm,
    inputs: Signal,
    times: FloatArray,
    mesh: FloatArray,
    state: FloatArray,
    history: FloatArray,
    *,
    slope: bool,
) -> FloatArray:
    """Step through a mesh that holds all breaking points; outputs at `times`."""
    n, m, p, q = form.states, form.inputs, form.outputs, len(form.delays)
    S, K = mesh.size - 1, NODES.size
    lengths = np.diff(mesh)
    # Rounded, so that steps which are alike share their matrices.
    key, same = np.unique(np.round(lengths / lengths.max(initial=0.0), 12), return_inverse=True)
    matrices = [_step_matrices(form, float(lengths[same == k][0])) for k in range(key.size)]
    inner = mesh[:-1, None] + lengths[:, None] * NODES
    # The end of a step belongs to it: a jump there is the next one's.
    inside = np.where(NODES == 1.0, inner - 1e-9 * lengths[:, None], inner)
    u = np.ascontiguousarray(inputs(inside.ravel()).reshape(m, S, K).transpose(1, 2, 0))
    where, weights = _past(form, mesh, lengths, inner)
    z = np.zeros((S + 1, q, K))
    z[-1] = history[:, None]  # index -1: before time 0
    y = np.empty((S, K, p))
    known = np.empty(n + K * (m + q))
    known[:n] = state
    drive = known[n:].reshape(K, m + q)
    channel = np.arange(q)
    for s in range(S):
        drive[:, :m] = u[s]
        drive[:, m:] = (z[where[s], channel] * weights[s]).sum(axis=-1)
        found = matrices[same[s]] @ known
        seen = found[n:].reshape(K, p + q)
        y[s], z[s] = seen[:, :p], seen[:, p:].T
        known[:n] = found[:n]
    at = np.searchsorted(mesh, times + SNAP * (mesh[-1] or 1.0), side="right") - 1
    at = np.clip(at, 0, S - 1)
    weights_there = _weights(np.clip((times - mesh[at]) / lengths[at], 0.0, 1.0))
    if slope:
        weights_there = weights_there @ SLOPES / lengths[at][:, None]
    return np.asarray(np.einsum("tk,tkp->pt", weights_there, y[at]), dtype=np.float64)


def _step_matrices(form: DelayForm, step: float) -> FloatArray:
    """State at the end and signals at the nodes, from the state at the start and what drives."""
    n, width, K = form.states, form.B.shape[1], STAGES + 1
    left = np.eye(STAGES * n) - step * np.kron(INTEGRALS, form.A)
    right = np.zeros((STAGES * n, n + K * width))
    right[:, :n] = np.kron(np.ones((STAGES, 1)), np.eye(n))
    right[:, n + width :] = step * np.kron(INTEGRALS, form.B)
    states = np.vstack([np.eye(n, n + K * width), np.linalg.solve(left, right)])
    signals = np.kron(np.eye(K), form.C) @ states
    signals[:, n:] += np.kron(np.eye(K), form.D)
    return np.vstack([states[states.shape[0] - n :], signals])


def _past(
    form: DelayForm, mesh: FloatArray, lengths: FloatArray, inner: FloatArray
) -> tuple[IntArray, FloatArray]:
    """Steps into which the nodes of each step fall one delay before, and weights of their nodes.

    Returns
    -------
    where : ndarray of int, shape (S, K, q)
        -1 before time 0.
    weights : ndarray, shape (S, K, q, K)
    """
    S, K = inner.shape
    q = len(form.delays)
    where = np.full((S, K, q), -1, dtype=np.int64)
    weights = np.zeros((S, K, q, K))
    middle = inner.mean(axis=1, keepdims=True)
    for i, tau in enumerate(form.delays):
        # Points next to an end belong to the step that the middle of this one falls beside.
        nudged = inner + 1e-7 * (middle - inner) - tau
        at = np.searchsorted(mesh, nudged, side="right") - 1
        at = np.clip(at, 0, S - 1)
        weights[:, :, i] = _weights(np.clip((inner - tau - mesh[at]) / lengths[at], 0.0, 1.0))
        where[:, :, i] = np.where(nudged < 0, -1, at)
    return where, weights
