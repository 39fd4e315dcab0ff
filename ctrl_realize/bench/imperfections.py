"""Imperfections of measured records: noise, spikes, rounding."""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy.signal import firwin, lfilter, oaconvolve

from ..numerics.arrays import FloatArray


def band_limited_noise(
    n_samples: int, std: float, rng: np.random.Generator, *, limited: bool
) -> FloatArray:
    """Draw Gaussian noise, filtered by the anti-aliasing filter if `limited`.

    The filter is flat up to 1/2.56 of the sample rate, as in FFT analysers; it is linear-phase, and
    its delay is compensated. `std` is that of the noise in the record.
    """
    if std == 0.0:
        return np.zeros(n_samples)
    if not limited:
        return std * rng.standard_normal(n_samples)
    taps = _anti_aliasing_taps()
    white = rng.standard_normal(n_samples + taps.size - 1)
    return np.asarray(std * oaconvolve(white, taps, mode="valid"))


@cache
def _anti_aliasing_taps() -> FloatArray:
    """Return a linear-phase low-pass that preserves the variance of white noise."""
    taps = firwin(101, 2 / 2.56, window=("kaiser", 6.0))
    return np.asarray(taps / np.sqrt(np.sum(taps**2)))


def slow_disturbance(
    n_samples: int, std: float, time_constant: float, dt: float, rng: np.random.Generator
) -> FloatArray:
    """Draw a stationary Gauss-Markov process: white noise behind a lag, sampled exactly."""
    if std == 0.0:
        return np.zeros(n_samples)
    pole = np.exp(-dt / time_constant)
    driving = std * rng.standard_normal(n_samples)
    driving[1:] *= np.sqrt(1 - pole**2)
    return np.asarray(lfilter([1.0], [1.0, -pole], driving))


def drive_spikes(
    n_samples: int, mean_count: float, height: float, rng: np.random.Generator
) -> FloatArray:
    """Draw short peaks, one or two samples long, of either sign and up to `height`."""
    spikes = np.zeros(n_samples)
    for start in rng.integers(0, n_samples, size=rng.poisson(mean_count)):
        length = int(rng.integers(1, 3))
        spikes[start : start + length] += rng.choice([-1.0, 1.0]) * height * rng.uniform(0.3, 1.0)
    return spikes


def converted(volts: FloatArray, bits: int | None, full_scale: float) -> FloatArray:
    """Quantise volts by an AD converter of `bits` over -+ `full_scale`; None does not round."""
    if bits is None:
        return volts
    step = 2 * full_scale / 2**bits
    return np.asarray(np.clip(np.round(volts / step) * step, -full_scale, full_scale))
