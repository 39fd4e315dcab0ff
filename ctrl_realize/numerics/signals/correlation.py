"""Correlations of residuals, their bounds, and prediction of a residual from its past.

Whiteness after [1]_, independence of the input after [2]_, autoregression by the recursion of Burg
[3]_ with the order of [5]_, predictions as in [4]_.

References
----------
.. [1] G. M. Ljung and G. E. P. Box, On a measure of lack of fit in time series models, Biometrika
   65 (1978) 297-303, doi:10.1093/biomet/65.2.297.
.. [2] L. Ljung, System Identification: Theory for the User, 2nd ed., Prentice Hall 1999, section
   16.6 (Residual analysis).
.. [3] P. Stoica and R. Moses, Spectral Analysis of Signals, Prentice Hall 2005, section 3.9.3 (the
   Burg method).
.. [4] L. Ljung, System Identification: Theory for the User, 2nd ed., Prentice Hall 1999, section
   3.2 (Prediction).
.. [5] G. Schwarz, Estimating the dimension of a model, Ann. Statist. 6 (1978) 461-464,
   doi:10.1214/aos/1176344136.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.special import gammaincc, ndtri

from ..arrays import FloatArray, later
from ..hankel.matrix import fft_length


def correlation(late: FloatArray, early: FloatArray, lags: int) -> FloatArray:
    """Correlate two signals: coefficient of ``late[k + i]`` and ``early[k]`` for i = 0...lags.

    Parameters
    ----------
    late, early : ndarray, shape (N,)
        Means are subtracted.
    lags : int, < N

    Returns
    -------
    ndarray, shape (lags + 1,)
        Sums over all pairs divided by the product of the signals' norms; zero where a signal is
        constant.
    """
    x, y = late - late.mean(), early - early.mean()
    points = fft_length(x.size + lags)
    product = np.fft.rfft(x, n=points) * np.conj(np.fft.rfft(y, n=points))
    sums: FloatArray = np.fft.irfft(product, n=points)[: lags + 1]
    norm = float(np.sqrt((x @ x) * (y @ y)))
    return sums / norm if norm > 0 else np.zeros(lags + 1)


def whiteness(rho: FloatArray, samples: int) -> float:
    """Return the p-value of the Ljung-Box test of whiteness.

    Parameters
    ----------
    rho : ndarray, shape (L,)
        Autocorrelation at lags 1...L.
    samples : int
    """
    L = rho.size
    # Ljung and Box (1978): Q = n (n + 2) sum r_k^2 / (n - k) has the mean L and the variance
    # 2 L (1 + (2 L - 5) / n), here those of a multiple of chi-square: 1.4 % of 2000 white signals
    # of 100 samples have a value below 1 % at 25 lags, with L degrees of freedom 2.9 %.
    Q = samples * (samples + 2) * float(np.sum(rho**2 / (samples - np.arange(1, L + 1))))
    wider = 1 + max(2 * L - 5, 0) / samples
    return float(gammaincc(L / (2 * wider), Q / (2 * wider)))


def cross_bound(residual: FloatArray, drive: FloatArray, lags: int, confidence: float) -> float:
    """Bound of the correlation of a residual with an input that it does not depend on.

    Both may be coloured: the variance is ``sum rho_e rho_u / N`` (Ljung, System Identification,
    2nd ed., section 16.6), summed over `lags` lags to both sides.
    """
    own = correlation(residual, residual, lags)
    other = correlation(drive, drive, lags)
    variance = max(1.0 + 2.0 * float(own[1:] @ other[1:]), 0.0) / residual.size
    return float(-ndtri((1 - confidence) / 2) * np.sqrt(variance))


def fit_percent(measured: FloatArray, modelled: FloatArray) -> FloatArray:
    """Return ``100 (1 - |y - model| / |y - mean y|)`` for every row: 100 is perfect, 0 a mean."""
    spread = np.linalg.norm(measured - measured.mean(axis=-1, keepdims=True), axis=-1)
    miss = np.linalg.norm(measured - modelled, axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(100.0 * (1.0 - miss / spread))


def autoregression(signal: FloatArray, most: int) -> FloatArray:
    """Fit ``e[k] = sum c_i e[k-i]`` with the order of least BIC, 0...most; shape (order,)."""
    N, best = signal.size, (0.0, np.ones(1))
    for filter_, left in prediction_filters((signal - signal.mean())[:, None], most):
        bic = N * np.log(left) + (filter_.size - 1) * np.log(N)
        best = (bic, filter_) if bic < best[0] else best
    return -best[1][1:]


def prediction_filters(signals: FloatArray, most: int) -> Iterator[tuple[FloatArray, float]]:
    """Polynomials ``1 - c_1 z^-1 - ...`` of orders 0...most, and the variance that each leaves.

    Common to all signals (N, K); the variance is relative to theirs. Burg's recursion: stable at
    every order, so that no prediction diverges. It ends where nothing is left.
    """
    forward = backward = signals
    power = float(np.vdot(forward, forward))
    filter_, left = np.ones(1), 1.0
    yield filter_, left
    for _ in range(most):
        ahead, behind = forward[1:], backward[:-1]
        energy = float(np.vdot(ahead, ahead) + np.vdot(behind, behind))
        if energy <= 1e-28 * power:
            break
        # Burg: the reflection coefficient that minimises the forward and backward prediction
        # errors.
        reflection = -2.0 * float(np.vdot(ahead, behind)) / energy
        forward, backward = ahead + reflection * behind, behind + reflection * ahead
        longer = np.append(filter_, 0.0)
        filter_ = longer + reflection * longer[::-1]
        left *= max(1.0 - reflection**2, 1e-28)
        yield filter_, left


def predict_ahead(signal: FloatArray, coefficients: FloatArray, steps: int) -> FloatArray:
    """Predict ``e[k]`` from samples up to ``k - steps`` by an autoregression.

    The first ``order + steps - 1`` samples, without a complete past, are predicted as zero: with
    zeros in place of the past, an oscillatory autoregression would respond with a transient.

    Parameters
    ----------
    signal : ndarray, shape (N,)
    coefficients : ndarray, shape (order,)
    steps : int, >= 1

    Returns
    -------
    ndarray, shape (N,)
    """
    if not coefficients.size:
        return np.zeros(signal.size)
    weights = coefficients  # of e[k], e[k - 1], ... in the prediction of e[k + 1], e[k + 2], ...
    for _ in range(min(steps, signal.size) - 1):
        weights = weights[0] * coefficients + np.append(weights[1:], 0.0)
    ahead = np.convolve(signal, weights)[: signal.size]
    ahead[: coefficients.size - 1] = 0.0
    return later(ahead, steps)
