"""Uncertainty of fitted transfer functions: covariance, poles, and profile of the dead time.

The covariance is the inverse Fisher information [1]_, or the sandwich of [2]_; the interval of the
dead time is the profile likelihood's [3]_.

References
----------
.. [1] S. M. Kay, Fundamentals of Statistical Signal Processing: Estimation Theory, Prentice Hall
   1993, chapters 3 and 7.
.. [2] H. White, A heteroskedasticity-consistent covariance matrix estimator and a direct test for
   heteroskedasticity, Econometrica 48 (1980) 817-838, doi:10.2307/1912934.
.. [3] D. J. Venzon and S. H. Moolgavkar, A method for computing profile-likelihood-based confidence
   intervals, Appl. Statist. 37 (1988) 87-94, doi:10.2307/2347496.
"""

from __future__ import annotations

import numpy as np

from ..arrays import ComplexArray, FloatArray
from ..constants import CHI2_95, Z_95
from .fit import FRFData, RationalFit, refine
from .model import full_jacobian, project

_LEAST_INFORMATION = 1e-10
"""Singular value, over the largest, of scaled columns that is rounding: the data do not determine
the parameter."""


def covariance(data: FRFData, fit: RationalFit, scale: float) -> FloatArray:
    """Invert the information matrix of (poles, dead time, numerator).

    Parameters
    ----------
    data : FRFData
    fit : RationalFit
    scale : float
        Variance of the weighted misfit at a point, real and imaginary part together.

    Returns
    -------
    ndarray, shape (P, P)
        With infinite diagonal entries for parameters that the data do not determine.
    """
    J, root, determined = _inverse_root(data, fit)
    if not determined:
        return np.full((J.shape[1], J.shape[1]), np.inf)
    # Half of the complex variance is in each of the two rows of a point.
    return np.asarray(0.5 * scale * (root @ root.T))


def error_root(data: FRFData, fit: RationalFit, scale: float, *, robust: bool) -> FloatArray:
    """Factor R of the covariance R R' of (poles, dead time, numerator), shape (P, Q).

    A pole far beyond the band makes both coefficients of its factor uncertain by many decades, but
    not the other pole: this is preserved in R, but not in the products of R R'.

    Parameters
    ----------
    data : FRFData
    fit : RationalFit
    scale : float
        As for `covariance`.
    robust : bool
        Compute it from the residuals of the individual points. Also valid if the noise is not
        proportional to the weights (White 1980): poles that depend on a noisy part of the band are
        more uncertain. The excess of `scale` over the mean square of the residuals, due to their
        correlation, is kept.
    """
    J, root, _ = _inverse_root(data, fit)
    if not robust:
        return np.asarray(np.sqrt(0.5 * scale) * root)
    residual = project(
        data.s, data.response, data.weight, fit.theta, fit.order, fit.numerator.size
    ).residual
    freedom = max(residual.size - J.shape[1], 1)
    power = float(residual @ residual)
    excess = 0.5 * scale * freedom / power if power > 0 else 1.0
    # White (1980): inv(J'J) J' diag(e^2) J inv(J'J) as a product R R'.
    part = root @ (root.T @ (J * residual[:, None]).T)
    return np.asarray(np.sqrt(excess * residual.size / freedom) * part)


def pole_deviations(fit: RationalFit, errors: FloatArray) -> tuple[ComplexArray, FloatArray]:
    """Return the poles, slow ones first, and the standard error of each.

    Parameters
    ----------
    fit : RationalFit
    errors : ndarray, shape (P, Q)
        Factor of the covariance of (poles, dead time, numerator); see `error_root`.
    """
    order = fit.order
    poles = np.zeros(order, dtype=np.complex128)
    gradients = np.zeros((order, order), dtype=np.complex128)
    for i in range(0, order - order % 2, 2):
        a0, a1 = np.exp(fit.theta[i]), np.exp(fit.theta[i + 1])
        root = np.sqrt(complex(a1 * a1 / 4 - a0))
        # Coincident poles split with the square root of a change: practically undetermined.
        root = root if abs(root) > 1e-9 * a1 else complex(1e-9 * a1)
        for k, turn in ((i, -root), (i + 1, root)):
            poles[k] = -a1 / 2 + turn
            gradients[k, i] = -a0 / (2 * turn)
            gradients[k, i + 1] = a1 * (-0.5 + a1 / (4 * turn))
        # The smaller one from the product keeps all its digits.
        poles[i + 1] = a0 / poles[i]
    if order % 2:
        w = np.exp(fit.theta[order - 1])
        poles[-1] = gradients[-1, -1] = -w
    error = np.linalg.norm(gradients @ errors[:order], axis=1)
    sequence = np.argsort(np.abs(poles), kind="stable")
    return poles[sequence], error[sequence]


def _inverse_root(data: FRFData, fit: RationalFit) -> tuple[FloatArray, FloatArray, bool]:
    """Return the Jacobian J, R with ``R R' = inv(J' J)``, and whether there is an inverse.

    If there is none, undetermined directions get a very large variance in R, and the others their
    own.
    """
    J = full_jacobian(data.s, data.weight, fit.theta, fit.numerator, fit.order)
    size = np.linalg.norm(J, axis=0)
    size[size == 0] = 1.0
    _, sv, Vt = np.linalg.svd(J / size, full_matrices=False)
    floor = _LEAST_INFORMATION * sv[0]
    return J, (Vt.T / np.maximum(sv, floor)) / size[:, None], bool(sv[-1] > floor)


def profile_interval(
    data: FRFData, fit: RationalFit, count: int, scale: float, std: float
) -> tuple[float, float]:
    """Find the dead times at which the misfit has increased to the 95 % threshold."""
    # Rise of the misfit by chi-square times the variance (Venzon and Moolgavkar 1988).
    allowed = 0.5 * scale * CHI2_95
    best = fit.theta[fit.order]
    ends = []
    for side in (-1.0, 1.0):
        bound = 0.0 if side < 0 else data.max_dead_time
        reach = abs(bound - best)
        step = min(max(Z_95 * std if np.isfinite(std) else 0.1 * reach, 1e-9), reach)
        inside, outside, grown_inside = 0.0, None, 0.0
        start = fit.theta
        for _ in range(12):
            if step <= 0:
                break
            theta = start.copy()
            theta[fit.order] = best + side * step
            moved = refine(data, fit.order, count, theta, frozen_delay=True)
            grown = moved.cost - fit.cost
            if grown < allowed:
                inside, start, grown_inside = step, moved.theta, grown
                if step >= reach:
                    break
                if grown > 0.8 * allowed:
                    break
                ratio = np.sqrt(allowed / max(grown, 1e-3 * allowed))
                wanted = step * min(1.02 * ratio, 3.0)
                step = min(wanted, reach) if outside is None else 0.5 * (step + outside)
            else:
                outside = step
                if outside - inside < 0.05 * outside:
                    break
                # Slightly less than for a parabola, so that the next point is inside.
                ratio = 0.98 * np.sqrt(allowed / grown)
                step = max(step * ratio, inside + 0.1 * (outside - inside))
        if outside is None:
            ends.append(best + side * inside)
        else:
            # Near the minimum the misfit grows quadratically.
            end = 0.5 * (inside + outside)
            if grown_inside > 0.8 * allowed:
                end = min(inside * np.sqrt(allowed / grown_inside), outside)
            ends.append(best + side * end)
    return float(ends[0]), float(ends[1])
