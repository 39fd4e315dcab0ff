"""Non-Gaussianity and nonlinearity of a signal by its bicoherence.

The indices are those of Choudhury, Shah and Thornhill [1]_. The squared bicoherence of a linear
Gaussian process is zero, that of a linear non-Gaussian one flat. A waveform whose half cycles are
alike has no even harmonics, and its bicoherence is that of the noise. The signal is thinned out so
that segments hold some cycles; this is our own.

References
----------
.. [1] M. A. A. S. Choudhury, S. L. Shah and N. F. Thornhill, Diagnosis of poor control-loop
   performance using higher-order statistics, Automatica 40 (2004) 1719-1728.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import resample_poly

from ..arrays import FloatArray

NGI_LIMIT, NLI_LIMIT = 0.001, 0.01
FEWEST_SEGMENTS = 12
_Z_ONE_SIDED = 1.645
"""One-sided 95 % point of the normal distribution."""
_SEGMENT = 64
_PER_CYCLE = 10
"""Samples of a cycle after thinning out: six cycles in a segment, five harmonics."""


@dataclass(frozen=True)
class Bicoherence:
    """Non-Gaussianity and nonlinearity index, and the number of segments."""

    non_gaussianity: float
    nonlinearity: float
    segments: int


def bicoherence(signal: FloatArray, period: float) -> Bicoherence | None:
    """Return the indices of `signal` (N,); None if it is too short for `FEWEST_SEGMENTS`."""
    fewer = int(period // _PER_CYCLE)
    values = resample_poly(signal - signal.mean(), 1, fewer) if fewer > 1 else signal
    starts = np.arange(0, values.size - _SEGMENT + 1, _SEGMENT // 2)
    if starts.size < FEWEST_SEGMENTS:
        return None
    parts = np.stack([values[k : k + _SEGMENT] for k in starts])
    parts = (parts - parts.mean(axis=1, keepdims=True)) * np.hanning(_SEGMENT)
    spectrum = np.fft.fft(parts, axis=1)
    first, second = _principal_domain()
    product = spectrum[:, first] * spectrum[:, second]
    third = spectrum[:, first + second]
    power = (np.abs(product) ** 2).mean(axis=0) * (np.abs(third) ** 2).mean(axis=0)
    cross = np.abs((product * third.conj()).mean(axis=0)) ** 2
    # where nothing is but rounding, there is no coherence
    squared = np.where(power > 1e-12 * power.max(), cross / np.maximum(power, 1e-300), 0.0)
    count = squared.size
    # mean of `count` squared bicoherences of Gaussian noise, each chi squared of two over 2 K
    bound = (_Z_ONE_SIDED + np.sqrt(4 * count - 1)) ** 2 / (4 * starts.size * count)
    mean, spread = float(squared.mean()), float(squared.std())
    nonlinear = abs(float(squared.max()) - (mean + 2 * spread))
    return Bicoherence(mean - float(bound), nonlinear, starts.size)


def _principal_domain() -> tuple[np.ndarray, np.ndarray]:
    """Pairs of frequencies 0 < f2 <= f1 with f1 + f2 below half of the sampling rate."""
    first, second = np.meshgrid(np.arange(1, _SEGMENT // 2), np.arange(1, _SEGMENT // 2))
    inside = (second <= first) & (first + second < _SEGMENT // 2) & (2 * first + second < _SEGMENT)
    return first[inside], second[inside]
