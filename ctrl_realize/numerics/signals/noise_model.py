"""Autoregressive noise models, and prewhitening of records.

Least squares treats all errors as independent. Slow noise, or oscillating noise such as the ripple
of a motor, is much weaker in the fast part of a response, where a delay shows, than an effective
sample size accounts for: means over bins are decorrelated first [1]_, by the autoregressive model
of the output in steady state.

References
----------
.. [1] A. C. Aitken, On least squares and linear combination of observations, Proc. Roy. Soc.
   Edinburgh 55 (1935) 42-48.
.. [2] G. Schwarz, Estimating the dimension of a model, Ann. Statist. 6 (1978) 461-464,
   doi:10.1214/aos/1176344136.
.. [3] P. Stoica and R. Moses, Spectral Analysis of Signals, Prentice Hall 2005, section 3.9.3 (the
   Burg method).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import cholesky, solve_triangular
from scipy.signal import lfilter

from ..arrays import FloatArray, IntArray
from ..constants import SMALLEST, Z_95
from .bins import Bins
from .correlation import autoregression
from .noise import mad_sigma

MOST_LAGS = 25  # of the autoregression
_SAMPLES_PER_LAG = 20  # each coefficient is then known to a fifth: 1 / sqrt(20)


def noise_lags(samples: int) -> int:
    """Order of an autoregressive noise model that so many samples can determine."""
    return max(min(MOST_LAGS, samples // _SAMPLES_PER_LAG), 1)


def coloured_criterion(residuals: Sequence[FloatArray]) -> tuple[float, int]:
    """Bayesian information criterion of segments with common noise, and the chosen order.

    ``e[k] = a_1 e[k-1] + ... + a_r e[k-r] + w[k]`` with white w: r minimises ``n log(mean w^2) + r
    log n``, and the minimum is returned. For all orders the same n samples are used, those after
    `noise_lags` others of their segment. Means are subtracted.
    """
    most = noise_lags(min(e.size for e in residuals))
    rows, targets = [], []
    for e in residuals:
        centred = e - e.mean()
        rows.append(np.stack([centred[most - i : e.size - i] for i in range(most + 1)]))
        targets.append(rows[-1][0])
    sums = np.sum([lagged @ lagged.T for lagged in rows], axis=0)
    n = sum(target.size for target in targets)
    floor = 1e-300
    found = [(n * float(np.log(max(sums[0, 0] / n, floor))), 0)]
    scale = max(float(np.trace(sums)) / (most + 1), floor)
    for r in range(1, most + 1):
        own = sums[1 : r + 1, 1 : r + 1] + 1e-13 * scale * np.eye(r)
        left = float(sums[0, 0] - sums[0, 1 : r + 1] @ np.linalg.solve(own, sums[0, 1 : r + 1]))
        found.append((n * float(np.log(max(left / n, 1e-13 * scale / n))) + r * np.log(n), r))
    return min(found)


_WILD = 4.0  # standard deviations of which one of 16 000 Gaussian samples is beyond: cut
_NOTHING = 1e-6  # relative size of a response that has decayed
_SLOWEST = 0.99  # pole of noise: slower noise is a drift over 200 samples
_JITTER = 1e-9  # of the variance: a covariance of smooth noise is nearly singular


def whitening_filter(noise: FloatArray, lags: int, wild: float = _WILD) -> FloatArray:
    """Polynomial ``1 - a_1 z^-1 - ...`` that makes noise white; for white noise it is 1.

    Autoregression (Burg, smallest BIC up to order `lags`) of noise that is cut at so many standard
    deviations.
    """
    limit = wild * mad_sigma(noise)
    tamed = np.clip(noise - np.median(noise), -limit, limit)
    return np.concatenate([[1.0], -autoregression(tamed, lags)])


def noise_covariance(quiet: FloatArray, longest: int) -> FloatArray:
    """Autocovariance of noise over its variance, from lag 0 until it has decayed.

    For white noise this is lag 0 alone.

    Parameters
    ----------
    quiet : ndarray
        Pure noise. Its autoregressive model (Burg, smallest BIC) is used at lags where sample
        covariances are only noise.
    longest : int
        Largest number of lags.
    """
    denominator = whitening_filter(quiet, noise_lags(quiet.size))
    if denominator.size == 1:
        return np.ones(1)
    slowest = float(np.abs(np.roots(denominator)).max(initial=0.0))
    alive = np.log(_NOTHING) / np.log(min(max(slowest, 1e-3), 1 - 1e-9))
    pulse = np.zeros(int(min(alive, longest)) + denominator.size)
    pulse[0] = 1.0
    power = np.abs(np.fft.rfft(lfilter([1.0], denominator, pulse), 2 * pulse.size)) ** 2
    covariance: FloatArray = np.fft.irfft(power)[: pulse.size]
    return np.asarray(covariance / covariance[0])


def continues(rest: FloatArray, later: FloatArray, as_large: float) -> bool:
    """Whether a louder residual is the slow noise of a short rest, as its samples tell.

    A rest of a few correlation times shows part of the variance of AR(1) noise alone, but its pole
    r, with a standard error of sqrt((1 - r^2) / n), and that of the steps ``e[k] - r e[k-1]``,
    which may be `as_large` as those at rest. A misfit has a slower residual than the noise at rest.
    Ablation: louder noise that goes on.
    """
    centred = rest - rest.mean()
    if not centred.any() or rest.size < _SAMPLES_PER_LAG:
        return False
    pole = float(later[1:] @ later[:-1]) / max(float(later @ later), SMALLEST)
    known = float(centred[1:] @ centred[:-1]) / float(centred @ centred)
    error = Z_95 * np.sqrt(max(1.0 - pole**2, 0.0) / rest.size)
    # Kendall (1954): an estimate with the mean is lower by (1 + 3 r) / n.
    if pole > known + error + (1.0 + 3.0 * pole) / rest.size:
        return False
    steps = [e[1:] - pole * e[:-1] for e in (centred, later)]
    return bool(np.std(steps[1]) <= as_large * np.std(steps[0]))


def first_order_covariance(residual: FloatArray, parameters: int) -> FloatArray:
    """Autocovariance, as `noise_covariance`, of AR(1) noise of which a model has taken its part.

    A model with p parameters takes part ``c = (p / n) (1 + rho) / (1 - rho)`` of the variance of
    noise with pole rho, and lowers its autocorrelations by c (`correlation_of_noise`): that at one
    sample is then ``r = (rho - c) / (1 - c)``, a quadratic equation for rho. Where no pole gives so
    small a one, the nearest does.

    Parameters
    ----------
    residual : ndarray, shape (n,)
    parameters : int
        Estimated parameters p.
    """
    r = float(residual[1:] @ residual[:-1]) / max(float(residual @ residual), SMALLEST)
    part = parameters / residual.size
    middle = 0.5 * (1.0 - part + r * (1.0 + part))
    square = middle**2 - part - r * (1.0 - part)
    pole = np.clip(middle - np.sqrt(max(square, 0.0)), 0.0, _SLOWEST)
    covariance: FloatArray = pole ** np.arange(residual.size, dtype=np.float64)
    return covariance[: max(int(np.sum(covariance > _NOTHING)), 1)]


def whitener(bins: Bins, covariance: FloatArray) -> FloatArray:
    """Lower triangle (m, m) that makes means over bins independent with unit variance.

    Parameters
    ----------
    bins : Bins
        Of m bins.
    covariance : ndarray
        Of single samples relative to their variance, from lag 0 until it has decayed.
    """
    # Variance of a sum of k samples, minus its asymptotic growth: bounded for long bins.
    lag = np.arange(covariance.size + 1)
    plain = np.concatenate([[0.0], np.cumsum(covariance)])
    moment = np.concatenate([[0.0], np.cumsum(lag[:-1] * covariance)])
    spread = 2 * lag * (plain - plain[-1]) - 2 * moment
    growth = 2 * plain[-1] - 1
    start, stop = bins.first[:, None], (bins.first + bins.width)[:, None]

    def apart(one: IntArray, other: IntArray) -> FloatArray:
        gap: IntArray = np.abs(one - other.T)
        return np.asarray(spread[np.minimum(gap, covariance.size)])

    # The covariance of two sums follows from the four gaps between their ends.
    among = apart(stop, start) + apart(start, stop) - apart(stop, stop) - apart(start, start)
    among = 0.5 * among + np.diag(growth * bins.width)
    among = among / (bins.width[:, None] * bins.width) + _JITTER * np.eye(bins.width.size)
    lower = cholesky(among, lower=True)
    return np.asarray(solve_triangular(lower, np.eye(len(lower)), lower=True))
