"""Level, quantisation, correlation and sinusoids of the noise of a measured signal.

Noise levels are median absolute deviations [1]_ or winsorised ones [3]_, never below ``q /
sqrt(12)`` of a quantiser [4]_. The correlation time ends its sum as in [2]_, section 3.3.

References
----------
.. [1] F. R. Hampel, The influence curve and its role in robust estimation, J. Amer. Statist. Assoc.
   69 (1974) 383-393, doi:10.1080/01621459.1974.10482962.
.. [2] C. J. Geyer, Practical Markov chain Monte Carlo, Statist. Sci. 7 (1992) 473-483,
   doi:10.1214/ss/1177011137.
.. [3] P. J. Huber and E. M. Ronchetti, Robust Statistics, 2nd ed., Wiley 2009, chapter 5 (Scale
   estimates), doi:10.1002/9780470434697.
.. [4] B. Widrow and I. Kollar, Quantization Noise, Cambridge University Press 2008,
   doi:10.1017/CBO9780511754661.
.. [5] C. Torrence and G. P. Compo, A practical guide to wavelet analysis, Bull. Amer. Meteor. Soc.
   79 (1998) 61-78, doi:10.1175/1520-0477(1998)079<0061:APGTWA>2.0.CO;2.
.. [6] R. E. Kass and A. E. Raftery, Bayes factors, J. Amer. Statist. Assoc. 90 (1995) 773-795,
   doi:10.1080/01621459.1995.10476572.
.. [7] C. Inclan and G. C. Tiao, Use of cumulative sums of squares for retrospective detection of
   changes of variance, J. Amer. Statist. Assoc. 89 (1994) 913-923,
   doi:10.1080/01621459.1994.10476824.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import median_filter
from scipy.optimize import fminbound

from ..arrays import BoolArray, FloatArray, IntArray
from ..constants import PIECE, VERY_STRONG
from ..hankel.matrix import fft_length
from ..rules import Rule

_DITHER = 0.6
"""Noise, rounding included, in quantisation steps, from which means are unbiased: half a step of
its own. The mean of rounded Gaussian values is off by exp(-2 (pi sigma)^2) / pi steps at most [4]_,
chapter on dither: 0.002 of a step at sigma = 0.5, 0.05 at 0.3."""
FAR, _LEAST = 50.0, 0.1
"""Standard deviations of a spike, and part of the range of the other samples. Four among 400 of 100
deviations and half of a response move its dead time by 0.1 samples, smaller ones do not. Ablation:
spikes left out."""
BEYOND = 20.0  # ranges of the other samples, from which on a value is no signal's: no overshoot is
LONG_REST = 50  # samples that are enough to tell the noise, to a tenth, and a slope
_TURNS = 3  # of the line, and of the limits about it
_MOST_OF_A_LINE = 45.0
"""Bound of the energy of a line, in its power in a spectrum behind Hann's window over its samples:
8 at a frequency of the spectrum, 11 between two of them, and leakage of what is beside it."""
_BLOCK = 4096  # samples over which a phase is turned on at a time
_FIRST_LAGS = 2**12  # that are looked at first, to save time
DRIFT_ERRORS = 5.0
"""Standard errors from which on there is a drift, or a bend: one that is lost in the noise does no
harm. Ablation: drift, bend before the step."""
_HARMONICS = 20  # of the rounding error: 97 % of its variance
_FEW = 8  # samples at rest below which the whole record must tell the noise: six are left of a line


def rounding_error(values: FloatArray) -> float:
    """Difference of two values that is attributed to rounding.

    A few units in the last place of the largest, and a billionth of the range: a 24-bit converter,
    the finest there is, has steps of sixty billionths.
    """
    last_place = float(np.spacing(max(np.abs(values.max()), np.abs(values.min()))))
    return max(1e-9 * float(np.ptp(values)), 4 * last_place)


def quantisation_step(values: FloatArray) -> float:
    """Quantisation step; 0 if there is none.

    It is the smallest difference between two values, accepted if the other differences are
    multiples of it.
    """
    gaps = np.diff(np.unique(values))
    gaps = gaps[gaps > rounding_error(values)]
    if gaps.size < 4:
        return 0.0
    step = float(gaps.min())
    multiples = np.divide(gaps, step, out=gaps)
    pieces = np.array_split(multiples, -(-multiples.size // PIECE))
    whole = sum(int(np.sum(np.abs(part - np.round(part)) < 0.05)) for part in pieces)
    few = float(np.median(multiples, overwrite_input=True)) < 50
    return step if whole > 0.9 * multiples.size and few else 0.0


def is_coarse(sigma: float, quantum: float) -> bool:
    """Whether the quantisation is so coarse that averaging does not remove the rounding.

    With noise below half a step the mean of rounded samples depends on the position of the signal
    between two levels (dither).
    """
    return quantum > 0 and sigma < _DITHER * quantum


def mad_sigma(values: FloatArray) -> float:
    """Standard deviation of Gaussian noise from the median absolute deviation."""
    away = values - np.median(values)
    np.abs(away, out=away)
    # 1 / Phi^-1(3/4): that of a Gaussian over its median absolute deviation.
    return 1.4826 * float(np.median(away, overwrite_input=True))


def winsorised_sigma(values: FloatArray, quantum: float, lost: int = 0) -> float:
    """Standard deviation after clipping at two median absolute deviations.

    `lost` degrees of freedom are subtracted. The limit is at least half a quantisation step,
    otherwise a signal that mostly stays on one level would have no noise.
    """
    limit = 2 * max(mad_sigma(values), 0.5 * quantum)
    clipped = np.clip(values - np.median(values), -limit, limit)
    # Two-sigma clipping leaves 0.921 of the variance of a Gaussian.
    return float(np.sqrt(np.sum(clipped**2) / max(values.size - lost, 1))) / 0.96


def rest_noise(
    before: FloatArray, record: FloatArray, quantum: float, rows: IntArray | None = None
) -> tuple[float, float]:
    """Noise level and significant drift of the baseline.

    Parameters
    ----------
    before : ndarray, shape (P,)
        Samples before the step. With fewer than 8, or if they are all equal (a converter that
        does not move, or padding), the noise is estimated from the third differences of the
        record, which are insensitive to anything smooth.
    record : ndarray, shape (N,)
        The whole record.
    quantum : float
        Quantisation step; the noise is at least ``quantum / sqrt(12)``.
    rows : ndarray, shape (P,), optional
        Samples before the step that there are, if others are missing: the slope is in their unit.

    Returns
    -------
    sigma : float
    drift : float
        Slope per sample, 0 if it is below five standard errors, which are larger for slow noise.
    """
    floor = quantum / np.sqrt(12)
    if before.size < _FEW or np.ptp(before) <= rounding_error(record):
        # 1, -3, 3, -1: white noise has 20 times its variance in these differences.
        third = np.diff(record, 3) / np.sqrt(20)
        told = before.size < _FEW or Rule.CONSTANT_REST.on
        return max(winsorised_sigma(third, quantum / np.sqrt(20)), floor) if told else floor, 0.0
    index = np.arange(before.size) if rows is None else rows
    slope, left = _robust_line(before, index.astype(np.float64), quantum)
    sigma = max(winsorised_sigma(left, quantum, lost=2), floor)
    if before.size < LONG_REST:
        # A dozen samples determine sigma to a factor of two: the settled half of the record helps.
        settled = np.diff(record[(before.size + record.size) // 2 :], 3) / np.sqrt(20)
        if settled.size:
            sigma = max(sigma, winsorised_sigma(settled, quantum / np.sqrt(20)))
    spacing = 1.0 if rows is None else float(rows[-1] - rows[0]) / (rows.size - 1)
    return sigma, float(slope) if is_drift(slope * spacing, sigma, left) else 0.0


def is_drift(slope: float, sigma: float, residual: FloatArray) -> bool:
    """Whether a slope per sample exceeds five standard errors, with correlation.

    Parameters
    ----------
    slope, sigma : float
        Of a line, and of the noise about it.
    residual : ndarray, shape (P,)
        Residual of the line, for its correlation.
    """
    error = sigma * np.sqrt(12 * correlation_time(residual) / residual.size**3)
    return bool(abs(slope) > DRIFT_ERRORS * error)


def _robust_line(values: FloatArray, index: FloatArray, quantum: float) -> tuple[float, FloatArray]:
    """Slope per sample, and the residual; outliers are clipped at four standard deviations."""
    tamed = values
    for _ in range(_TURNS):
        line = np.polyval(np.polyfit(index, tamed, 1), index)
        left = values - line
        limit = 4 * max(mad_sigma(left), 0.5 * quantum)
        tamed = line + np.clip(left, -limit, limit)
    return float(line[1] - line[0]) / float(index[1] - index[0]), left


def correlation_time(residual: FloatArray) -> float:
    """Samples per independent sample: 1 + 2 x the sum of the autocorrelation.

    The sum ends where a pair of neighbouring terms is negative (Geyer's initial positive sequence);
    values up to 1.5, the scatter of white noise, count as 1.
    """
    # Geyer (1992), section 3.3: -1 + 2 sum of rho_2m + rho_2m+1 while these pairs are positive.
    time = 2 * float(_correlation(residual).sum(axis=1).sum()) - 1.0
    return time if time > 1.5 else 1.0


_LOST_OF_NOISE = np.linspace(1e-9, 0.43, 200)
"""Part c of the variance of slow noise that a model takes, up to where the other grows no more."""
_SEEN_OF_NOISE = _LOST_OF_NOISE * (
    1.0 + _LOST_OF_NOISE * np.log(_LOST_OF_NOISE) / (1.0 - _LOST_OF_NOISE)
)
"""The same computed with the correlation time of the residual; see `correlation_of_noise`."""


def correlation_of_noise(correlation: float, parameters: float) -> tuple[float, float]:
    """Correlation time of noise whose residual has one of `correlation`, and its variance lost.

    A model with p parameters takes part c = p tau / n of the variance of noise that is correlated
    over tau of n samples, and lowers all its autocorrelations by c (our own computation). Those of
    a first-order autoregression, less c, are positive up to lag ``ln c / ln rho``, and sum to

        tau (1 + c ln c / (1 - c)).

    Noise that is slower than the record tells (c above 0.43) cannot be told from a misfit.

    Parameters
    ----------
    correlation : float
        Correlation time of the residual, in samples; 1 if it is white.
    parameters : float
        Estimated parameters over samples.
    """
    if correlation <= 1.0:
        return correlation, 0.0
    lost = float(np.interp(parameters * correlation, _SEEN_OF_NOISE, _LOST_OF_NOISE))
    return max(lost / parameters, correlation), lost


def _correlation(residual: FloatArray) -> FloatArray:
    """Autocorrelation from lag 0 to where a pair is negative, in pairs: shape (K, 2)."""
    n = residual.size
    centred = residual - residual.sum() / max(n, 1)
    energy = float(centred @ centred)
    if n < 8 or energy == 0:
        return np.zeros((0, 2))
    # The sum mostly ends after a few lags: for a long record these are computed first.
    for lags in (_FIRST_LAGS, n // 2):
        if lags < n // 8 or lags == n // 2:
            correlation = _lagged_products(centred, lags) / energy
            pairs = correlation[: 2 * (correlation.size // 2)].reshape(-1, 2)
            negative = np.flatnonzero(pairs.sum(axis=1) <= 0)
            if negative.size:
                return np.asarray(pairs[: negative[0]])
    return np.asarray(pairs)


def _lagged_products(values: FloatArray, lags: int) -> FloatArray:
    """Sums of ``values[k] values[k + i]`` for i = 0...lags - 1, piece by piece."""
    total = np.zeros(lags)
    size = max(8 * lags, PIECE)
    for start in range(0, values.size, size):
        late = values[start : start + size + lags]
        points = fft_length(late.size + lags)
        product = np.fft.rfft(late, n=points)
        product *= np.conj(np.fft.rfft(values[start : start + size], n=points))
        total += np.fft.irfft(product, n=points)[:lags]
    return total


def rounding_of_level(noise: float, quantum: float) -> float:
    """Standard deviation of the mean of many rounded samples about their level, equally likely.

    The Fourier series of the mean error, each term damped by the noise [4]_: half a step takes it
    away.

    Examples
    --------
    >>> from ctrl_realize.numerics.signals.noise import rounding_of_level
    >>> round(rounding_of_level(0.0, 1.0), 3), round(rounding_of_level(0.5, 1.0), 3)
    (0.288, 0.002)
    """
    k = np.arange(1, 100)
    parts = np.exp(-((2 * np.pi * k * noise / quantum) ** 2)) / (2 * np.pi**2 * k**2)
    return quantum * float(np.sqrt(parts.sum()))


def rounding_of_sums(values: FloatArray, weights: FloatArray, quantum: float) -> FloatArray:
    """Variances (k,) of sums of rounding errors of values (n,), with weights (k, n), without noise.

    The error of a sample is a periodic function of its value, and that of others follows: the
    covariance over all positions of the converter is a Fourier series in their distance [4]_. A
    model does not tell distances of a step and more that well: errors count as independent then.
    Where levels begin is not known either: of several divisions the largest variance is taken.
    """
    found = []
    for begin in (0.0, 0.25, 0.5, 0.75):
        level = np.floor(values / quantum + begin).astype(np.int64)
        first = np.flatnonzero(np.diff(level[order := np.argsort(level)], prepend=-np.inf))
        total = np.zeros(len(weights))
        for k in range(1, _HARMONICS):
            turned = weights * np.exp(2j * np.pi * k * values / quantum)
            sums = np.add.reduceat(turned[:, order], first, axis=1)
            total += np.sum(np.abs(sums) ** 2, axis=1) / (2 * np.pi**2 * k**2)
        found.append(quantum**2 * total)
    return np.asarray(np.max(found, axis=0))


def spikes(output: FloatArray, fitted: FloatArray) -> BoolArray:
    """Samples (N,) that are far from a model, and from all but two of the six next to them.

    Huber's loss bears them once a model is found; they lead its search astray.
    """
    error = output - fitted
    middle = median_filter(output, size=7, mode="mirror")
    alone = output - middle
    noise = max(mad_sigma(error), 0.5 * quantisation_step(output))
    limit = max(FAR * noise, _LEAST * float(np.ptp(middle)), rounding_error(output))
    return np.asarray(np.minimum(np.abs(error), np.abs(alone)) > limit)


def far_value(values: FloatArray, limit: float = BEYOND) -> IntArray:
    """Samples of a single value far beyond all others, as loggers write for missing samples.

    That is, by `limit` ranges of the others.
    """
    there, far = values[np.isfinite(values)], []
    for end in np.unique(there)[[0, -1]] if there.size else ():
        others = there[there != end]
        if others.size and np.abs(others - end).min() > limit * np.ptp(others) > 0:
            far.append(np.flatnonzero(values == end))
    return min(far, key=len, default=np.empty(0, dtype=np.int64))


def largest_excess(values: FloatArray) -> tuple[int, int]:
    """First sample, and the one after the last, between which a series is most above its power.

    Of all intervals the one with the largest sum of squares above their mean: where the cumulative
    sum of squares rises most above its line [7]_.

    Examples
    --------
    >>> import numpy as np
    >>> from ctrl_realize.numerics.signals.noise import largest_excess
    >>> largest_excess(np.array([1.0, -1.0, 1.0, 4.0, -1.0, -5.0, 1.0, 1.0]))
    (3, 6)
    """
    power = values**2
    above = np.concatenate([[0.0], np.cumsum(power - power.mean())])
    stop = int(np.argmax(above - np.minimum.accumulate(above)))
    return int(np.argmin(above[: stop + 1])), stop


def colouring(rest: FloatArray, sigma: float) -> float:
    """Standard deviation of means of 4 and 16 baseline samples, relative to that for white noise.

    1 for white noise and if there are too few samples.
    """
    worst = 1.0
    for width in (4, 16):
        count = rest.size // width
        if count >= 12 and sigma > 0:
            means = rest[: count * width].reshape(count, width).mean(axis=1)
            worst = max(worst, float(means.std()) * np.sqrt(width) / sigma)
    return worst if worst > 1.4 and Rule.COLOUR.on else 1.0


def hum_frequencies(rest: FloatArray, most: int = 3) -> list[float]:
    """Frequencies, in cycles per sample, of sinusoids in the baseline.

    A sinusoid has at least a third of the variance and 20 times the power of its neighbours in the
    spectrum, over three and a half periods or more, and is no swing of slow noise.
    """
    found: list[float] = []
    left = rest - rest.mean()
    n = left.size
    while n >= 64 and len(found) < most:
        power = np.abs(np.fft.rfft(left * np.hanning(n))) ** 2
        power[:4] = 0
        peak = int(np.argmax(power[:-2]))
        low, high = max(peak - 12, 4), peak + 13
        around = np.delete(power[low:high], np.s_[max(peak - 2 - low, 0) : peak + 3 - low])
        if peak < 4 or around.size < 6 or power[peak] < 20 * np.median(around) / np.log(2):
            break
        if _MOST_OF_A_LINE * power[peak] / n < float(left @ left) / 3:
            break  # far too weak, for any frequency between those of the spectrum
        frequency = _refine(left, peak / n)
        if frequency * n < 3.5:
            break  # slower than assumed: too few periods
        wave = sine_pair(np.arange(n), frequency)
        fitted = wave @ np.linalg.lstsq(wave, left, rcond=None)[0]
        if float(fitted @ fitted) < float(left @ left) / 3 or not _is_line(left, fitted):
            break
        found.append(frequency)
        left = left - fitted
    return found


def _is_line(values: FloatArray, wave: FloatArray) -> bool:
    """Whether a sinusoid explains more than first-order autoregressive noise has by itself.

    Slow noise has peaks in its spectrum as well [5]_. The likelihood with the sinusoid is better by
    the penalty of the BIC on its three parameters, and by very strong evidence [6]_ beyond it.
    Ablation: hum against slow noise.
    """
    without, beside = (_innovation_variance(part) for part in (values, values - wave))
    if not without > 0:
        return False
    gain = values.size * np.log(without / max(beside, 1e-30 * without))
    return bool(gain > 3 * np.log(values.size) + VERY_STRONG) or not Rule.HUM_IN_NOISE.on


def _innovation_variance(values: FloatArray) -> float:
    """Variance of what a first-order autoregression does not predict, at its least."""
    past, present = values[:-1], values[1:]
    energy = float(past @ past)
    pole = float(past @ present) / energy if energy else 0.0
    return float(np.mean((present - pole * past) ** 2))


def sine_pair(index: FloatArray, frequency: float) -> FloatArray:
    """Cosine and sine, shape (N, 2), at a frequency in cycles per sample."""
    phase = 2 * np.pi * frequency * index
    return np.stack([np.cos(phase), np.sin(phase)], axis=1)


def _refine(values: FloatArray, frequency: float) -> float:
    """Refine the frequency of a sinusoid: its periodogram has a maximum between two bins."""
    # Turned to the frequency within blocks, and then from block to block.
    whole = values.size // _BLOCK * _BLOCK
    blocks, rest = values[:whole].reshape(-1, _BLOCK), values[whole:]

    def power(f: float) -> float:
        turn = np.exp(-2j * np.pi * f * np.arange(_BLOCK))
        sums = blocks @ turn.real + 1j * (blocks @ turn.imag)
        starts = np.exp(-2j * np.pi * f * _BLOCK * np.arange(len(sums) + 1))
        return float(np.abs(starts[:-1] @ sums + starts[-1] * (turn[: rest.size] @ rest)))

    width = 1.0 / values.size
    low, high = frequency - width, frequency + width
    return float(fminbound(lambda f: -power(f), low, high, xtol=1e-5 * width))
