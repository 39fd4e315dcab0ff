"""Poles of a frequency response by vector fitting: a linear problem that needs no start."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .arrays import ComplexArray, FloatArray
from .rational import stacked_parts


def trial_poles(low: float, high: float, order: int, *, resonant: bool) -> ComplexArray:
    """Spread stable poles logarithmically over a band in rad/s."""
    if order == 1:
        return np.array([-np.sqrt(low * high)], dtype=np.complex128)
    if not resonant:
        return -np.geomspace(low, high, order).astype(np.complex128)
    centres = np.geomspace(low, high, order // 2 + order % 2)
    pairs = centres[order % 2 :]
    poles = np.ravel([(-0.05 + 1j) * pairs, (-0.05 - 1j) * pairs])
    return np.concatenate([poles, -centres[: order % 2].astype(np.complex128)])


def relocate_poles(
    s: ComplexArray, response: ComplexArray, weight: FloatArray, poles: ComplexArray
) -> ComplexArray:
    """Move poles towards those of the response: one step of vector fitting.

    The linear problem ``N(s) - sigma(s) H(s) = H(s)`` is that of Sanathanan and Koerner, written
    in partial fractions (Gustavsen and Semlyen 1999); the zeros of ``1 + sigma`` are the new
    poles. Unstable ones are mirrored.

    Parameters
    ----------
    s, response : ndarray, shape (K,)
    weight : ndarray, shape (K,)
    poles : ndarray, shape (n,)
        Stable; conjugates need not be adjacent.

    Returns
    -------
    ndarray, shape (n,)
    """
    n = poles.size
    real: NDArray[np.bool_] = poles.imag == 0
    upper = poles[poles.imag > 0]
    A = np.zeros((n, n))
    b = np.zeros(n)
    columns = []
    place = 0
    for p in poles[real]:
        A[place, place], b[place] = p.real, 1.0
        columns.append(1 / (s - p))
        place += 1
    for p in upper:
        block = [[p.real, p.imag], [-p.imag, p.real]]
        A[place : place + 2, place : place + 2] = block
        b[place] = 2.0
        columns.append(1 / (s - p) + 1 / (s - p.conjugate()))
        columns.append(1j / (s - p) - 1j / (s - p.conjugate()))
        place += 2
    fractions = np.stack(columns, axis=1)
    design = np.hstack([fractions, -response[:, None] * fractions]) * weight[:, None]
    stacked = stacked_parts(design)
    scale = np.linalg.norm(stacked, axis=0)
    solution = np.linalg.lstsq(
        stacked / scale, stacked_parts((weight * response)[:, None])[:, 0], rcond=1e-12
    )[0]
    sigma = (solution / scale)[n:]
    moved = np.linalg.eigvals(A - np.outer(b, sigma)).astype(np.complex128)
    # Keep away from the axis: a pole on it would make the next problem singular.
    floor = 1e-4 * np.abs(moved) + 1e-12 * np.abs(s).max()
    return np.asarray(-np.maximum(np.abs(moved.real), floor) + 1j * moved.imag)
