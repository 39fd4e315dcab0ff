"""Least squares on lagged signals, ARX models, and their pulse response.

``A(q) y = B(q) u + e`` with ``A = I + A_1 q^-1 + ...`` is linear in its coefficients. Its pulse
response is ``A^-1 B``: with many lags this is the observer/Kalman filter identification (OKID)
of Juang [1]_, whose observer turns a plant that rings for long into a short regression.

References
----------
.. [1] J.-N. Juang, M. Phan, L. G. Horta and R. W. Longman, Identification of observer/Kalman filter
   Markov parameters: theory and experiments, J. Guidance 16 (1993) 320-329, doi:10.2514/3.21006.
.. [2] L. Ljung, System Identification: Theory for the User, 2nd ed., Prentice Hall 1999, sections
   4.2 (ARX models) and 10.1 (least squares).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_solve, eigh, solve_triangular

from ..arrays import FloatArray
from .normal_equations import NormalEquations, normal_equations

RANK_TOLERANCE = 1e-11
"""Eigenvalues of the scaled Gram matrix below this fraction of the largest are rounding."""


@dataclass(frozen=True, eq=False)
class LeastSquares:
    """Solution of normal equations.

    ``coefficients`` (q, p); ``inverse_root`` (q, q) is W with ``inv(gram) = W W^T``, and
    ``noise`` (p, p) the covariance of the residuals, so that coefficient i of target a has the
    standard deviation ``sqrt(noise[a, a] * (W @ W.T)[i, i])``.
    """

    coefficients: FloatArray
    inverse_root: FloatArray
    noise: FloatArray

    @property
    def std(self) -> FloatArray:
        """Standard deviations of the coefficients, shape (q, p)."""
        spread = (self.inverse_root**2).sum(axis=1)
        return np.asarray(np.sqrt(np.outer(spread, np.diag(self.noise))))


def excited_directions(gram: FloatArray) -> int:
    """Count the directions of parameter space that the data determine."""
    # rounding of the sums can leave a square just below zero
    scale = np.sqrt(np.maximum(np.diag(gram), 0.0))
    if not np.any(scale > 0):
        return 0
    scale = np.where(scale > 0, scale, np.inf)
    values = eigh(gram / np.outer(scale, scale), eigvals_only=True)
    return int(np.count_nonzero(values > RANK_TOLERANCE * values[-1]))


def least_squares(equations: NormalEquations) -> LeastSquares:
    """Solve normal equations of full rank (see `excited_directions`)."""
    scale = np.sqrt(np.diag(equations.gram))
    C = np.linalg.cholesky(equations.gram / np.outer(scale, scale))
    coefficients = cho_solve((C, True), equations.cross / scale[:, None]) / scale[:, None]
    W = solve_triangular(C, np.diag(1 / scale), lower=True).T
    explained = solve_triangular(C, equations.cross / scale[:, None], lower=True)
    misfit = equations.power - explained.T @ explained
    # Rounding of the sums; a negative variance would make the std NaN.
    floor = 1e-15 * np.diag(equations.power)
    misfit[np.diag_indices_from(misfit)] = np.maximum(np.diag(misfit), floor)
    freedom = max(equations.freedom - scale.size, 1)
    return LeastSquares(coefficients, W, misfit / freedom)


@dataclass(frozen=True, eq=False)
class ArxFit:
    """ARX model ``y[k] + sum A_i y[k-i] = sum B_j u[k-j] + e``.

    ``a`` (na, p, p) contains A_1 ..., ``b`` (nb, p, m) contains B_0 ..., `noise` (p, p) the
    covariance of e, `rows` the number of equations and `solution` the regression, with the lags of
    y before those of u.
    """

    a: FloatArray
    b: FloatArray
    solution: LeastSquares


def arx_equations(
    inputs: FloatArray, outputs: FloatArray, na: int, nb: int, *, offset: bool = True
) -> NormalEquations:
    """Sum up the regression of an ARX model; sums of several records can be added.

    Parameters
    ----------
    inputs, outputs : ndarray, shapes (m, N), (p, N)
        NaN removes the rows that contain it.
    na, nb : int
        Lags 1 ... na of y and 0 ... nb - 1 of u.
    offset : bool, default True
        Include an unknown constant in every output.
    """
    lags = max(na + 1, nb)
    both = np.concatenate([outputs, inputs])
    equations = normal_equations(both, outputs, lags, offset=offset)
    p, m = outputs.shape[0], inputs.shape[0]
    past = [a * lags + i for i in range(1, na + 1) for a in range(p)]
    drive = [(p + j) * lags + i for i in range(nb) for j in range(m)]
    return equations.take(past + drive)


def solve_arx(equations: NormalEquations, na: int, nb: int) -> ArxFit:
    """Solve the regression of `arx_equations`."""
    solution = least_squares(equations)
    p = equations.power.shape[0]
    m = (equations.gram.shape[0] - na * p) // nb
    theta, cut = solution.coefficients, na * p
    a = -theta[:cut].reshape(na, p, p).transpose(0, 2, 1)
    b = theta[cut:].reshape(nb, m, p).transpose(0, 2, 1)
    return ArxFit(a, b, solution)


def arx_markov(fit: ArxFit, count: int) -> FloatArray:
    """Compute the pulse response A^-1 B of an ARX model, shape (p, m, count)."""
    nb, p, m = fit.b.shape
    drive = np.zeros((count, p, m))
    drive[:nb] = fit.b[:count]
    return _divide(fit.a, drive).transpose(1, 2, 0)


def arx_state_space(fit: ArxFit) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Write A^-1 B in observer form: q p states for q lags, matrices A, B, C, D."""
    nb, p, m = fit.b.shape
    count = max(fit.a.shape[0], nb - 1)
    a = np.zeros((count, p, p))
    a[: fit.a.shape[0]] = fit.a
    b = np.zeros((count + 1, p, m))
    b[:nb] = fit.b
    # Observer form: x1+ = -a1 x1 + x2 + (b1 - a1 b0) u, and so on; y = x1 + b0 u.
    A = np.eye(count * p, k=p)
    A[:, :p] -= a.reshape(count * p, p)
    B = (b[1:] - a @ b[0]).reshape(count * p, m)
    return A, B, np.eye(p, count * p), b[0]


def arx_markov_std(fit: ArxFit, count: int) -> FloatArray:
    """Compute the standard deviations of `arx_markov` to first order, shape (p, m, count).

    ``dH = A^-1 (dB - dA H)``, with the covariance of the coefficients from the regression.
    """
    na, p, _ = fit.a.shape
    nb, _, m = fit.b.shape
    H = arx_markov(fit, count).transpose(2, 0, 1)
    inverse = _divide(fit.a, np.concatenate([np.eye(p)[None], np.zeros((count - 1, p, p))]))
    # Targets are correlated through their noise: L combines the rows of A and B.
    L = _root(fit.solution.noise)
    mixed = inverse @ L
    variance = np.zeros((p, m, count))
    W = fit.solution.inverse_root
    for j in range(m):
        # Column i: what one unit of regressor i adds to the equation error, as a series.
        source = np.zeros((count, W.shape[0]))
        for lag in range(1, min(na, count - 1) + 1):
            source[lag:, (lag - 1) * p : lag * p] = H[: count - lag, :, j]
        for i in range(min(nb, count)):
            source[i, na * p + i * m + j] = 1.0
        weighted = source @ W
        points = 2 * count
        transform = np.fft.rfft(weighted, n=points, axis=0)
        for a in range(p):
            for row in range(p):
                response = np.fft.rfft(mixed[:, a, row], n=points)
                spread = np.fft.irfft(response[:, None] * transform, n=points, axis=0)[:count]
                variance[a, j] += (spread**2).sum(axis=1)
    return np.asarray(np.sqrt(variance))


def _root(covariance: FloatArray) -> FloatArray:
    """Return L with ``L L^T = covariance``, which is singular for equal outputs."""
    scale = np.sqrt(np.diag(covariance))
    size = np.where(scale > 0, scale, 1.0)
    values, vectors = eigh(covariance / np.outer(size, size))
    return np.asarray(scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0)))


def _divide(a: FloatArray, series: FloatArray) -> FloatArray:
    """Solve A(q) X = series for X, all as series in q^-1 of shape (count, p, columns)."""
    out = series.copy()
    for k in range(1, out.shape[0]):
        reach = min(k, a.shape[0])
        out[k] -= np.einsum("iab,ibc->ac", a[:reach], out[k - 1 :: -1][:reach])
    return out
