r"""Transfer functions with dead time, fitted to frequency responses.

The model is :math:`G(s) = e^{-s\tau}\, b(s) / a(s)`. The denominator is a product of first- and
second-order factors with positive coefficients, parametrised by their logarithms, so that every
model is stable and real, and real poles become complex ones continuously. The numerator enters
linearly and is eliminated (variable projection [2]_, [3]_). The likelihood is that of [1]_, [4]_.

Numerators are expressed in the basis of partial products of the factors, slow ones first, which is
well conditioned over many decades, unlike powers of s. The basis functions are also the states of a
cascade of the sections, so a state-space model needs no conversion.

References
----------
.. [1] R. Pintelon and L. Van Biesen, Identification of transfer functions with time delay and its
   application to cable fault location, IEEE Trans. Instrum. Meas. 39 (1990) 479-484.
.. [2] G. H. Golub and V. Pereyra, The differentiation of pseudo-inverses and nonlinear least
   squares problems whose variables separate, SIAM J. Numer. Anal. 10 (1973) 413-432,
   doi:10.1137/0710036.
.. [3] L. Kaufman, A variable projection method for solving separable nonlinear least squares
   problems, BIT 15 (1975) 49-57, doi:10.1007/BF01932995.
.. [4] R. Pintelon and J. Schoukens, System Identification: A Frequency Domain Approach, 2nd ed.,
   Wiley 2012, chapter 9, doi:10.1002/9781118287422.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ctrl_realize.numerics.arrays import ComplexArray, FloatArray


@dataclass(frozen=True, eq=False)
class Projection:
    """The best numerator for given poles and dead time, and the residual.

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

    Conjugate pairs and pairs of real poles give ``log a0, log a1`` of ``s^2 + a1 s + a0``; for an
    odd number the remaining real pole gives ``log w`` of ``s + w``, at the end. Pairs are sorted by
    ``a0``.

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
    """Return the poles that belong to `theta`, slow ones first."""
    poles: list[complex] = []
    for log_a0, log_a1 in theta[: order - order % 2].reshape(-1, 2):
        a1, a0 = np.exp(log_a1), np.exp(log_a0)
        root = np.sqrt(complex(a1 * a1 / 4 - a0))
        # The larger root first: the smaller one from the product keeps all its digits.
        large = -(a1 / 2 + root)
        poles += [large, a0 / large]
    if order % 2:
        poles.append(complex(-np.exp(theta[order - 1])))
    found = np.array(poles, dtype=np.complex128)
    return found[np.argsort(np.abs(found), kind="stable")]


def basis_functions(
    s: ComplexArray, theta: FloatArray, order: int, count: int
) -> tuple[ComplexArray, ComplexArray]:
    """Evaluate the basis and its derivatives w.r.t. the pole parameters.

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
    factors = _factors(s, theta, order)
    product = np.ones_like(s)
    # logs[i] = d log(current product) / d theta_i for the sections still in it
    logs = np.zeros((order, s.size), dtype=np.complex128)
    for i, factor, root in factors:
        product = product / factor
        logs[i] = (factor - 1) / factor
        if root:
            logs[i + 1] = -(np.exp(theta[i + 1]) / root**2) * s / factor
    basis = np.empty((s.size, count), dtype=np.complex128)
    derivatives = np.zeros((order, s.size, count), dtype=np.complex128)
    column = 0
    for i, factor, root in factors:
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


def _factors(
    s: ComplexArray, theta: FloatArray, order: int
) -> list[tuple[int, ComplexArray, float]]:
    """Evaluate the sections, slow ones first: place in `theta`, values, and sqrt(a0) or 0."""
    found = []
    for i in range(0, order - order % 2, 2):
        a0, a1 = np.exp(theta[i]), np.exp(theta[i + 1])
        found.append((theta[i] / 2, i, 1 + (a1 * s + s * s) / a0, float(np.sqrt(a0))))
    if order % 2:
        found.append((theta[order - 1], order - 1, 1 + s / np.exp(theta[order - 1]), 0.0))
    found.sort(key=lambda section: section[0])
    return [(i, values, root) for _, i, values, root in found]


def _basis(s: ComplexArray, theta: FloatArray, order: int, count: int) -> ComplexArray:
    """Evaluate the basis alone."""
    factors = _factors(s, theta, order)
    product = np.ones_like(s)
    for _, factor, _ in factors:
        product = product / factor
    columns = []
    for _, factor, root in factors:
        columns.append(product)
        if root:
            columns.append(product * s / root)
        product = product * factor
    columns.append(product)
    return np.stack(columns[:count], axis=1)


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
    stacked = stacked_parts(design)
    scale = np.linalg.norm(stacked, axis=0)
    scale[scale == 0] = 1.0
    Q, R = np.linalg.qr(stacked / scale)
    target = stacked_parts((weight * response)[:, None])[:, 0]
    projected = Q.T @ target
    numerator = np.linalg.lstsq(R, projected, rcond=None)[0] / scale
    residual = target - Q @ projected
    moved = turn[None, :] * (derivatives @ numerator)
    moved = np.vstack([moved, (-s * (design @ numerator))[None]])
    slopes = -stacked_parts(moved.T)
    # Kaufman (1975): only the part P D of the Jacobian, with P = I - Q Q' and D = -d(basis) b.
    slopes -= Q @ (Q.T @ slopes)
    return Projection(numerator=numerator, residual=residual, jacobian=slopes)


def projected_cost(
    s: ComplexArray,
    response: ComplexArray,
    weight: FloatArray,
    theta: FloatArray,
    order: int,
    count: int,
) -> float:
    """Return the weighted misfit that `project` leaves, without its derivatives."""
    basis = _basis(s, theta[:order], order, count)
    design = stacked_parts((weight * np.exp(-s * theta[order]))[:, None] * basis)
    scale = np.linalg.norm(design, axis=0)
    scale[scale == 0] = 1.0
    Q, _ = np.linalg.qr(design / scale)
    target = stacked_parts((weight * response)[:, None])[:, 0]
    residual = target - Q @ (Q.T @ target)
    return float(residual @ residual)


def full_jacobian(
    s: ComplexArray,
    weight: FloatArray,
    theta: FloatArray,
    numerator: FloatArray,
    order: int,
) -> FloatArray:
    """Differentiate the weighted model w.r.t. poles, dead time and numerator, in this order."""
    basis, derivatives = basis_functions(s, theta[:order], order, numerator.size)
    turn = weight * np.exp(-s * theta[order])
    design = turn[:, None] * basis
    moved = turn[:, None] * (derivatives @ numerator).T
    delayed = (-s * (design @ numerator))[:, None]
    return stacked_parts(np.hstack([moved, delayed, design]))


def chain_state_space(
    theta: FloatArray, numerator: FloatArray, order: int
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Convert the model without its dead time to a cascade of sections, the fast ones first.

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
    # Same order of sections as in the basis, also for equal ones.
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


def stacked_parts(values: NDArray[Any]) -> FloatArray:
    """Stack real parts on top of imaginary parts."""
    return np.concatenate([values.real, values.imag])
