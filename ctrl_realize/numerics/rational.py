r"""Transfer functions with dead time, fitted to frequency responses.

The model is :math:`G(s) = e^{-s\tau}\, b(s) / a(s)`. The denominator is a product of factors of
first and second order with positive coefficients, kept as logarithms, so that every model is
stable and real and conjugate poles go into each other without a seam. The numerator enters
linearly and is eliminated (variable projection).

Numerators are written in the basis of partial products of the factors, slow ones first, which
stays well conditioned over many decades, where powers of s do not. The basis functions are at
the same time the states of a chain of the sections, so a state-space model needs no conversion.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .arrays import ComplexArray, FloatArray


@dataclass(frozen=True, eq=False)
class Projection:
    """The best numerator for given poles and dead time, and what it leaves.

    Parameters
    ----------
    numerator : ndarray, shape (m + 1,)
        Coefficients of the basis functions.
    residual : ndarray, shape (2 K,)
        Weighted misfit, real parts above imaginary parts.
    jacobian : ndarray, shape (2 K, P)
        Derivative of the residual by `theta`, Kaufman's approximation.
    """

    numerator: FloatArray
    residual: FloatArray
    jacobian: FloatArray


def factor_parameters(poles: ComplexArray) -> FloatArray:
    """Return the logarithms of the factors' coefficients for stable poles.

    Conjugate pairs and pairs of real poles give ``log a0, log a1`` of ``s^2 + a1 s + a0``;
    with an odd number, a real pole is left and gives ``log w`` of ``s + w``, at the end.
    Pairs come with rising ``a0``.

    Parameters
    ----------
    poles : ndarray, shape (n,)
        With negative real parts, conjugates together.
    """
    upper = poles[poles.imag > 0]
    real = np.sort(-poles[poles.imag == 0].real)[::-1]
    pairs = [(abs(p) ** 2, -2 * p.real) for p in upper]
    single = real[-1:] if real.size % 2 else real[:0]
    paired = real[: real.size - single.size]
    pairs += [(float(x * y), float(x + y)) for x, y in zip(paired[::2], paired[1::2], strict=True)]
    pairs.sort()
    return np.log(np.array([*np.ravel(pairs), *single], dtype=np.float64))


def poles_of(theta: FloatArray, order: int) -> ComplexArray:
    """Return the poles that `theta` stands for, slow ones first."""
    poles: list[complex] = []
    for log_a0, log_a1 in theta[: order - order % 2].reshape(-1, 2):
        a1, a0 = np.exp(log_a1), np.exp(log_a0)
        root = np.sqrt(complex(a1 * a1 / 4 - a0))
        # The larger root first: the smaller one from the product has all its digits.
        large = -(a1 / 2 + root)
        poles += [large, a0 / large]
    if order % 2:
        poles.append(complex(-np.exp(theta[order - 1])))
    found = np.array(poles, dtype=np.complex128)
    return found[np.argsort(np.abs(found), kind="stable")]


def basis_functions(
    s: ComplexArray, theta: FloatArray, order: int, count: int
) -> tuple[ComplexArray, ComplexArray]:
    """Evaluate the basis and its derivatives by the pole parameters.

    Parameters
    ----------
    s : ndarray, shape (K,)
        Points on the imaginary axis.
    theta : ndarray
        Pole parameters of `factor_parameters` in its first `order` entries.
    order : int
        Number of poles.
    count : int
        Number of basis functions, at most ``order + 1``.

    Returns
    -------
    basis : ndarray, shape (K, count)
    derivatives : ndarray, shape (order, K, count)
    """
    sections, slopes, owners = [], [], []
    ranks = []
    for i in range(0, order - order % 2, 2):
        a0, a1 = np.exp(theta[i]), np.exp(theta[i + 1])
        q = 1 + (a1 * s + s * s) / a0
        sections.append((q, np.sqrt(a0)))
        slopes.append(((1 - q) / q, (a1 / a0) * s / q))
        owners.append(i)
        ranks.append(theta[i] / 2)
    if order % 2:
        w = np.exp(theta[order - 1])
        f = 1 + s / w
        sections.append((f, 0.0))
        slopes.append(((1 - f) / f, f))
        owners.append(order - 1)
        ranks.append(theta[order - 1])
    sequence = np.argsort(ranks, kind="stable")

    product = np.ones_like(s)
    for k in sequence:
        product = product / sections[k][0]
    # logs[i] = d log(current product) / d theta_i for the sections still in it
    logs = np.zeros((order, s.size), dtype=np.complex128)
    for k in sequence:
        i = owners[k]
        logs[i] = -slopes[k][0]
        if sections[k][1]:
            logs[i + 1] = -slopes[k][1]
    basis = np.empty((s.size, count), dtype=np.complex128)
    derivatives = np.zeros((order, s.size, count), dtype=np.complex128)
    column = 0
    for k in sequence:
        factor, root = sections[k]
        i = owners[k]
        if column < count:
            basis[:, column] = product
            derivatives[:, :, column] = logs * product
            column += 1
        if root and column < count:
            tap = product * s / root
            basis[:, column] = tap
            derivatives[:, :, column] = logs * tap
            derivatives[i, :, column] -= 0.5 * tap
            column += 1
        product = product * factor
        logs[i] = 0.0
        if root:
            logs[i + 1] = 0.0
    if column < count:
        basis[:, column] = product
    return basis, derivatives


def project(
    s: ComplexArray,
    response: ComplexArray,
    weight: FloatArray,
    theta: FloatArray,
    order: int,
    count: int,
) -> Projection:
    """Solve for the numerator at given poles and dead time.

    Parameters
    ----------
    s, response : ndarray, shape (K,)
        Points ``j omega`` and measured response.
    weight : ndarray, shape (K,)
        One over the standard deviation.
    theta : ndarray, shape (order + 1,)
        Pole parameters and dead time.
    order, count : int
        Poles, and coefficients of the numerator.
    """
    basis, derivatives = basis_functions(s, theta[:order], order, count)
    turn = weight * np.exp(-s * theta[order])
    design = turn[:, None] * basis
    stacked = _stack(design)
    scale = np.linalg.norm(stacked, axis=0)
    scale[scale == 0] = 1.0
    Q, R = np.linalg.qr(stacked / scale)
    target = _stack((weight * response)[:, None])[:, 0]
    projected = Q.T @ target
    numerator = np.linalg.lstsq(R, projected, rcond=None)[0] / scale
    residual = target - Q @ projected
    moved = turn[None, :] * (derivatives @ numerator)
    moved = np.vstack([moved, (-s * (design @ numerator))[None]])
    slopes = -_stack(moved.T)
    slopes -= Q @ (Q.T @ slopes)
    return Projection(numerator=numerator, residual=residual, jacobian=slopes)


def full_jacobian(
    s: ComplexArray,
    weight: FloatArray,
    theta: FloatArray,
    numerator: FloatArray,
    order: int,
) -> FloatArray:
    """Differentiate the weighted model by poles, dead time and numerator, in this order."""
    basis, derivatives = basis_functions(s, theta[:order], order, numerator.size)
    turn = weight * np.exp(-s * theta[order])
    design = turn[:, None] * basis
    moved = turn[:, None] * (derivatives @ numerator).T
    delayed = (-s * (design @ numerator))[:, None]
    return _stack(np.hstack([moved, delayed, design]))


def chain_state_space(
    theta: FloatArray, numerator: FloatArray, order: int
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Write the model without its dead time as a chain of sections, the fast ones first.

    Returns
    -------
    A, B, C, D : ndarray, shapes (n, n), (n, 1), (1, n), (1, 1)
    """
    blocks: list[tuple[float, FloatArray, FloatArray]] = []
    for i in range(0, order - order % 2, 2):
        a0, a1 = np.exp(theta[i]), np.exp(theta[i + 1])
        w = float(np.sqrt(a0))
        A = np.array([[0.0, w], [-w, -float(a1)]])
        blocks.append((float(theta[i]) / 2, A, np.array([[0.0], [w]])))
    if order % 2:
        w = float(np.exp(theta[order - 1]))
        blocks.append((float(theta[order - 1]), np.array([[-w]]), np.array([[w]])))
    # Same order of sections as in the basis: ties must fall alike.
    blocks = [blocks[k] for k in np.argsort([b[0] for b in blocks], kind="stable")]

    A, B = np.zeros((order, order)), np.zeros((order, 1))
    starts = np.cumsum([0] + [b[1].shape[0] for b in blocks])
    for k, (_, part, kick) in enumerate(blocks):
        rows = slice(starts[k], starts[k + 1])
        A[rows, rows] = part
        if k + 1 < len(blocks):
            A[rows, starts[k + 1]] = kick[:, 0]
        else:
            B[rows] = kick
    C = np.zeros((1, order))
    C[0, : min(order, numerator.size)] = numerator[:order]
    D = np.full((1, 1), numerator[order] if numerator.size > order else 0.0)
    return A, B, C, D


def _stack(values: NDArray[Any]) -> FloatArray:
    return np.concatenate([values.real, values.imag])


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
    stacked = _stack(design)
    scale = np.linalg.norm(stacked, axis=0)
    solution = np.linalg.lstsq(
        stacked / scale, _stack((weight * response)[:, None])[:, 0], rcond=1e-12
    )[0]
    sigma = (solution / scale)[n:]
    moved = np.linalg.eigvals(A - np.outer(b, sigma)).astype(np.complex128)
    # Keep away from the axis: a pole on it would make the next problem singular.
    floor = 1e-4 * np.abs(moved) + 1e-12 * np.abs(s).max()
    return np.asarray(-np.maximum(np.abs(moved.real), floor) + 1j * moved.imag)
