"""All structures of a transfer function with dead time on one frequency response."""

from __future__ import annotations

import numpy as np

from .arrays import ComplexArray, FloatArray
from .rational import chain_state_space, factor_parameters, poles_of
from .rational_fit import FRFData, RationalFit, delay_grid, refine, starting_points


def dead_time_bound(response: ComplexArray, omega: FloatArray, sigma: FloatArray) -> float:
    """Bound the dead time by the steepest slope of the phase, in s.

    Parameters
    ----------
    response : ndarray, shape (K,)
    omega : ndarray, shape (K,)
        Rising, in rad/s.
    sigma : ndarray, shape (K,)
        Standard deviation of the response; points with more than 30 % are left out.
    """
    clear = sigma < 0.3 * np.abs(response) if np.any(sigma < 0.3 * np.abs(response)) else sigma > 0
    if clear.sum() < 4:
        clear = np.ones(omega.size, dtype=bool)
    w, phase = omega[clear], np.unwrap(np.angle(response[clear]))
    slopes = [0.0]
    # From low frequencies upwards: unwrapping goes wrong first where points lie far apart, and
    # lags add to the slope there, so the steepest one bounds the dead time from above.
    for stop in [*(w[0] * 2.0 ** np.arange(1, 1 + np.log2(w[-1] / w[0]))), w[-1]]:
        for part in (w <= stop, (w <= stop) & (w >= 0.5 * stop)):
            if part.sum() >= 4:
                slopes.append(-float(np.polyfit(w[part], phase[part], 1)[0]))
    # Half a turn at the highest frequency for noise and for phases that lead.
    return 1.1 * max(slopes) + np.pi / float(w[-1])


def fit_structures(
    data: FRFData, pairs: list[tuple[int, int]]
) -> dict[tuple[int, int], RationalFit]:
    """Fit every structure, each from its own starts and from its neighbours' solutions.

    Parameters
    ----------
    data : FRFData
    pairs : list of tuple of int
        (order, relative degree), smaller ones first.
    """
    fits: dict[tuple[int, int], RationalFit] = {}
    starts: dict[int, list[FloatArray]] = {}
    fastest = np.abs(data.s).max()
    for n, r in pairs:
        if n not in starts:
            starts[n] = starting_points(data, n, delay_grid(data, n))
        tried = list(starts[n])
        if (n, r - 1) in fits:
            tried.append(fits[n, r - 1].theta)
        if (n - 1, r - 1) in fits:
            smaller = fits[n - 1, r - 1]
            poles = np.append(poles_of(smaller.theta, n - 1), -3.0 * fastest)
            tried.append(np.append(factor_parameters(poles), smaller.theta[n - 1]))
        attempts = [refine(data, n, n + 1 - r, start) for start in tried]
        fits[n, r] = min(attempts, key=lambda fit: fit.cost)
    return fits


def residual_variance(data: FRFData, fit: RationalFit, freedom: int, noise_known: bool) -> float:
    """Return the variance of the weighted residual, with what its correlation costs.

    Residuals that are alike at neighbouring frequencies count for fewer points. Known noise is
    never scaled down: a lucky fit is no reason to trust it more.
    """
    A, B, C, D = chain_state_space(fit.theta, fit.numerator, fit.order)
    eye = np.eye(fit.order)
    states = np.linalg.solve(data.s[:, None, None] * eye - A, B.astype(complex))
    model = (C @ states)[:, 0, 0] + D[0, 0]
    residual = data.weight * (data.response - model * np.exp(-data.s * fit.theta[fit.order]))
    power = float(np.sum(np.abs(residual) ** 2))
    neighbours = float(np.sum((residual[1:] * residual[:-1].conj()).real))
    correlation = float(np.clip(neighbours / power if power > 0 else 0.0, 0.0, 0.95))
    if correlation < 2 / np.sqrt(residual.size):
        correlation = 0.0
    scale = 2 * power / max(freedom, 1)
    if noise_known:
        scale = max(scale, 1.0)
    return scale * (1 + correlation) / (1 - correlation)
