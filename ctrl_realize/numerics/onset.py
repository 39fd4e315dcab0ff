"""Two quick looks at a delay: where a cross-correlation sets in, and how steep the phase falls."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter
from scipy.special import ndtri

from .arrays import FloatArray
from .correlation import autoregression, correlation


@dataclass(frozen=True, eq=False)
class CorrelationOnset:
    """Cross-correlation of the whitened input with the output, filtered alike.

    ``onset`` is the first lag where ``|rho| > bound`` (-1 if there is none) and `peak` the lag of
    the largest; `rho` and `bound` have shape (lags + 1,).
    """

    rho: FloatArray
    bound: FloatArray
    onset: int
    peak: int


def correlation_onset(
    drive: FloatArray, output: FloatArray, lags: int, confidence: float
) -> CorrelationOnset:
    """Correlate input and output after the input is made white.

    Whitened, the correlation is the pulse response up to a factor (Box and Jenkins, Time Series
    Analysis, chapter 11); the bound holds for all lags together.

    Parameters
    ----------
    drive, output : ndarray, shape (N,)
    lags : int
        Lags 0...lags.
    confidence : float
        Chance that nothing is seen where nothing is.
    """
    c = autoregression(drive, min(20, drive.size // 20))
    whiten = np.concatenate([[1.0], -c])
    white = lfilter(whiten, [1.0], drive - drive.mean())[c.size :]
    alike = lfilter(whiten, [1.0], output - output.mean())[c.size :]
    rho = correlation(alike, white, lags)
    # An input that is held for samples on end is silent between its moves when whitened: then few
    # products make up a lag, and their own squares tell how far it scatters (White 1980).
    drive2, output2 = (white - white.mean()) ** 2, (alike - alike.mean()) ** 2
    pairs = np.array([drive2[: white.size - k] @ output2[k:] for k in range(lags + 1)])
    total = float(drive2.sum() * output2.sum())
    spread = np.sqrt(np.maximum(pairs / total if total > 0 else 0.0, 1 / white.size))
    bound = -ndtri((1 - confidence) / 2 / (lags + 1)) * spread
    # What whitening has left of the input's own correlation shows a late response early as well.
    left = np.abs(correlation(white, white, lags))
    left[left < 4 / np.sqrt(white.size)] = 0.0
    bound += [left[1 : lags + 1 - k] @ np.abs(rho[k + 1 :]) for k in range(lags + 1)]
    seen = np.flatnonzero(np.abs(rho) > bound)
    onset = int(seen[0]) if seen.size else -1
    return CorrelationOnset(rho, bound, onset, int(np.abs(rho).argmax()))


def phase_slope(omega: FloatArray, phase: FloatArray, share: float) -> tuple[float, float]:
    """Fit a line to the phase over the top of the band: its negative slope in s, and the std.

    Parameters
    ----------
    omega : ndarray, shape (K,), K >= 3
        Rising, rad/s.
    phase : ndarray, shape (K,)
        Unwrapped, rad.
    share : float
        Part of the band, counted from its upper end in rad/s; at least three points are taken.
    """
    count = max(int(np.count_nonzero(omega >= omega[-1] - share * np.ptp(omega))), 3)
    x, y = omega[-count:], phase[-count:]
    x0 = x - x.mean()
    slope = float(x0 @ y / (x0 @ x0))
    rest = y - y.mean() - slope * x0
    variance = float(rest @ rest) / max(count - 2, 1) / float(x0 @ x0)
    return -slope, float(np.sqrt(variance))
