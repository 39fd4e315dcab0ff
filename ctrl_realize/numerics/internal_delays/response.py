"""Frequency responses and characteristic matrices of systems closed through delays.

One decomposition of the core serves all frequencies [1]_; the delays are closed at each by a system
of equations of the order of their number. Where parts of the response cancel, at frequencies of
high gain within a loop, core and delays are solved together instead (a rule of our own).

References
----------
.. [1] A. J. Laub, Efficient multivariable frequency response computations, IEEE Trans. Automat.
   Control 26 (1981) 407-408.
"""

from __future__ import annotations

from contextlib import suppress

import numpy as np

from ..arrays import ComplexArray, whole_power
from ..state_space.responses import Schur, frequency_response
from .form import DelayForm

CANCELS = 1e4
"""Ratio of a part of the response to the whole from which on all is solved together: four digits
are lost up to there, of sixteen."""

NEAR_POLE = 1e-7
"""Relative distance to a pole of the core below which all is solved together."""

ROUNDED = 1e-12
"""Points this close inside the unit circle count as on it: z^-d is formed for all of them."""

CHUNK = 4096
"""Points for which matrices are made at a time."""


def turns(
    delays: tuple[float, ...], points: ComplexArray, *, discrete: bool
) -> tuple[ComplexArray, ComplexArray]:
    """Compute what the delays do at points of the z-plane (or s-plane), kept within range.

    Returns
    -------
    held, late : ndarray, shape (K, q)
        ``late / held`` is z^-d (or exp(-s tau)), and the larger of both has size 1 (to rounding).
    """
    if not delays:
        none = np.ones((points.size, 0), dtype=np.complex128)
        return none, none
    with np.errstate(over="ignore", invalid="ignore", under="ignore"):
        if discrete:
            size = np.abs(points) >= 1 - ROUNDED
            inside = np.where(size, 1 / np.where(size, points, 1.0), points)
            turned = np.stack([whole_power(inside, int(k)) for k in delays], axis=1)
            held = np.where(size[:, None], 1.0, turned)
            late = np.where(size[:, None], turned, 1.0)
        else:
            exponent = points[:, None] * np.asarray(delays, dtype=np.float64)
            size = exponent.real >= 0
            held = np.where(size, 1.0, np.exp(np.where(size, 0.0, exponent)))
            late = np.where(size, np.exp(np.where(size, -exponent, 0.0)), 1.0)
    return np.asarray(held), np.asarray(late)


def characteristic_matrices(
    form: DelayForm, points: ComplexArray, *, discrete: bool, ends: bool = False
) -> ComplexArray:
    """Stack ``[[x I - A, -B2], [-late C2, held - late D22]]``, shape (K, n + q, n + q).

    Singular at the poles of the system and nowhere else. With `ends` bordered by the inputs and
    outputs, of which there must be as many: singular at the zeros.
    """
    n, q = form.states, len(form.delays)
    m, p = form.inputs, form.outputs
    held, late = turns(form.delays, points, discrete=discrete)
    size = n + q + (m if ends else 0)
    out = np.zeros((points.size, size, size), dtype=np.complex128)
    inner = slice(n, n + q)
    out[:, :n, :n] = points[:, None, None] * np.eye(n) - form.A
    out[:, :n, inner] = -form.B[:, m:]
    out[:, inner, :n] = -late[:, :, None] * form.C[p:]
    out[:, inner, inner] = held[:, :, None] * np.eye(q) - late[:, :, None] * form.D[p:, m:]
    if ends:
        out[:, :n, n + q :] = -form.B[:, :m]
        out[:, inner, n + q :] = -late[:, :, None] * form.D[p:, :m]
        out[:, n + q :, :n] = form.C[:p]
        out[:, n + q :, inner] = form.D[:p, m:]
        out[:, n + q :, n + q :] = form.D[:p, :m]
    return out


def solved_response(form: DelayForm, points: ComplexArray, *, discrete: bool) -> ComplexArray:
    """Evaluate the transfer matrix by one system of equations for core and delays a point."""
    n, m, p = form.states, form.inputs, form.outputs
    out = np.empty((p, m, points.size), dtype=np.complex128)
    seen = np.hstack([form.C[:p], form.D[:p, m:]])
    for start in range(0, points.size, CHUNK):
        part = slice(start, start + CHUNK)
        matrices = characteristic_matrices(form, points[part], discrete=discrete)
        _, late = turns(form.delays, points[part], discrete=discrete)
        right = np.zeros((late.shape[0], matrices.shape[1], m), dtype=np.complex128)
        right[:, :n] = form.B[:, :m]
        right[:, n:] = late[:, :, None] * form.D[p:, :m]
        out[:, :, part] = np.moveaxis(seen @ solve_each(matrices, right), 0, -1)
    return out + form.D[:p, :m, None]


def solve_each(matrices: ComplexArray, right: ComplexArray) -> ComplexArray:
    """Solve several sets of equations; NaN for a singular one."""
    try:
        return np.asarray(np.linalg.solve(matrices, right))
    except np.linalg.LinAlgError:
        out = np.full(right.shape, np.nan, dtype=np.complex128)
        for k, (M, r) in enumerate(zip(matrices, right, strict=True)):
            with suppress(np.linalg.LinAlgError):
                out[k] = np.linalg.solve(M, r)
        return out


def response(
    form: DelayForm, schur: Schur, points: ComplexArray, *, discrete: bool
) -> ComplexArray:
    """Evaluate the transfer matrix, shape (p, m, K); not finite at a pole.

    Parameters
    ----------
    form : DelayForm
    schur : Schur
        Of its A.
    points : ndarray, shape (K,)
        z with delays in samples, or s with delays in s.
    discrete : bool
        Which of them.
    """
    m, p = form.inputs, form.outputs
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        core = frequency_response(schur, form.B, form.C, form.D, points)
        if not form.delays:
            return core
        held, late = turns(form.delays, points, discrete=discrete)
        out, largest = _closed(core, held, late, p, m)
        doubtful = ~np.isfinite(out).all(axis=(0, 1)) | (largest > CANCELS).any(axis=(0, 1))
    for pole in np.diag(schur[0]):
        doubtful |= np.abs(points - pole) < NEAR_POLE * max(1.0, abs(pole))
    if doubtful.any():
        out[:, :, doubtful] = solved_response(form, points[doubtful], discrete=discrete)
    return out


def _closed(
    core: ComplexArray, held: ComplexArray, late: ComplexArray, p: int, m: int
) -> tuple[ComplexArray, ComplexArray]:
    """Close the delays around the core's response, and tell how much its parts cancel."""
    q = held.shape[1]
    direct = core[:p, :m]
    if q == 1:
        # (held - late M22) w = late M21 u
        inner = held[:, 0] - late[:, 0] * core[p, m]
        by_delay = core[:p, m:] * (late[:, 0] * core[p:, :m] / inner)
        inner_size = np.abs(held[:, 0]) + np.abs(core[p, m] * late[:, 0])
        lost = (inner_size / np.abs(inner))[None, None, :]
    else:
        loop = held[:, :, None] * np.eye(q) - late[:, :, None] * np.moveaxis(core[p:, m:], -1, 0)
        right = late[:, :, None] * np.moveaxis(core[p:, :m], -1, 0)
        finite = np.isfinite(loop).all(axis=(1, 2)) & np.isfinite(right).all(axis=(1, 2))
        w = np.full(right.shape, np.nan, dtype=np.complex128)
        w[finite] = solve_each(loop[finite], right[finite])
        by_delay = np.moveaxis(np.moveaxis(core[:p, m:], -1, 0) @ w, 0, -1)
        residual = np.abs(loop).sum(axis=2).max(axis=1)
        lost = residual[None, None, :] / CANCELS
    out = direct + by_delay
    part = np.abs(direct) + np.abs(by_delay)
    largest = np.where(part > 0, part / np.abs(out), 0.0)
    return out, np.maximum(largest, np.where(np.isfinite(lost), lost, 0.0))
