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
.. [4] D. A. Harville, Maximum likelihood approaches to variance component estimation and to related
   problems, J. Amer. Statist. Assoc. 72 (1977) 320-338, doi:10.1080/01621459.1977.10480998.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import cholesky, solve_triangular
from scipy.signal import lfilter

from ..arrays import FloatArray, IntArray
from ..constants import SMALLEST, Z_95
from .bins import Bins
from .correlation import autoregression, prediction_filters
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
    rows = []
    for e in residuals:
        centred = e - e.mean()
        rows.append(np.stack([centred[most - i : e.size - i] for i in range(most + 1)]))
    sums = np.sum([lagged @ lagged.T for lagged in rows], axis=0)
    n = sum(lagged.shape[1] for lagged in rows)
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
_JITTER = 1e-9  # of the variance: a covariance of smooth noise is nearly singular
_TURNS = 100  # of expectation and maximisation at most, and
_SAME = 1e-4  # difference of coefficients in a turn, at which they end
_ROUNDING = 1e-9  # part of the largest singular value of derivatives that counts as nothing


def whitening_filter(
    noise: FloatArray, lags: int, wild: float = _WILD, columns: FloatArray | None = None
) -> FloatArray:
    """Polynomial ``1 - a_1 z^-1 - ...`` that makes noise white; for white noise it is 1.

    Autoregression (Burg, smallest BIC up to order `lags`) of noise that is cut at so many standard
    deviations. A model whose parameters have the derivatives `columns` (N, p) has followed a part
    of slow noise: restricted maximum likelihood [4]_, by expectation and maximisation, makes up for
    that. Without it the pole 0.9 of noise beside 240 samples is 0.85. Ablation: noise that a model
    follows.
    """
    limit = wild * mad_sigma(noise)
    tamed = np.clip(noise - np.median(noise), -limit, limit)
    tamed = tamed - tamed.mean()
    order = autoregression(tamed, lags).size
    filters = list(prediction_filters(tamed[:, None], order))
    if columns is not None and order:
        both, p = np.column_stack([columns, tamed]), columns.shape[1]
        for _ in range(_TURNS):
            upper = np.linalg.qr(_whitened(both, filters))[1]
            inverse = np.linalg.pinv(upper[:p, :p], rcond=_ROUNDING)
            followed = columns @ inverse
            sigma = abs(float(upper[p, p])) / np.sqrt(max(noise.size - p, 1))
            before, left = filters[-1][0], tamed - followed @ upper[:p, p]
            signals = np.column_stack([left, sigma * followed])
            filters = list(prediction_filters(signals, order))
            if filters[-1][0].size <= order or np.abs(filters[-1][0] - before).max() <= _SAME:
                break
    return filters[-1][0]


def _whitened(signals: FloatArray, filters: Sequence[tuple[FloatArray, float]]) -> FloatArray:
    """Errors of prediction of signals (N, K); those of the first samples by shorter filters.

    Without these a response that the last filter takes away would seem to be unknown.
    """
    last, least = filters[-1]
    white = lfilter(last, [1.0], signals, axis=0)
    for k, (filter_, left) in enumerate(filters[:-1]):
        white[k] = filter_[::-1] @ signals[: k + 1] * np.sqrt(least / left)
    return np.asarray(white)


def noise_covariance(quiet: FloatArray, longest: int, columns: FloatArray | None) -> FloatArray:
    """Autocovariance of noise over its variance, from lag 0 until it has decayed.

    For white noise this is lag 0 alone.

    Parameters
    ----------
    quiet : ndarray
        Pure noise. Its autoregressive model (Burg, smallest BIC) is used at lags where sample
        covariances are only noise.
    longest : int
        Largest number of lags.
    columns : ndarray or None
        As for `whitening_filter`.
    """
    denominator = whitening_filter(quiet, noise_lags(quiet.size), columns=columns)
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
    if rest.size < _SAMPLES_PER_LAG or not np.ptp(rest):
        return False
    centred = rest - rest.mean()
    pole = float(later[1:] @ later[:-1]) / max(float(later @ later), SMALLEST)
    known = float(centred[1:] @ centred[:-1]) / float(centred @ centred)
    error = Z_95 * np.sqrt(max(1.0 - pole**2, 0.0) / rest.size)
    # Kendall (1954): an estimate with the mean is lower by (1 + 3 r) / n.
    if pole > known + error + (1.0 + 3.0 * pole) / rest.size:
        return False
    steps = [e[1:] - pole * e[:-1] for e in (centred, later)]
    return bool(np.std(steps[1]) <= as_large * np.std(steps[0]))


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
