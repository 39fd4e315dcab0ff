"""Butterworth low-pass filters, causal and zero-phase."""

from __future__ import annotations

import numpy as np
from scipy.signal import butter, sosfilt, sosfilt_zi, sosfiltfilt

from .arrays import FloatArray


def butterworth(order: int, cutoff_hz: float, dt: float) -> FloatArray:
    """Design a digital Butterworth low-pass as second-order sections.

    The cut-off is in Hz and the sample rate is given beside it. Normalised frequencies invite
    the error of the paper, which calls 500 Hz the Nyquist frequency of a record sampled at
    1280 Hz: its filter would then cut at 64 Hz.

    Returns
    -------
    ndarray, shape (sections, 6)
    """
    return np.asarray(butter(order, cutoff_hz, fs=1 / dt, output="sos"), dtype=np.float64)


def butterworth_group_delay(order: int, cutoff_hz: float, dt: float) -> float:
    """Group delay at zero frequency of the causal filter, in samples.

    For one section b(z)/a(z) it is the difference of the centroids of b and a.

    Examples
    --------
    >>> from ctrl_realize.numerics.filters import butterworth_group_delay
    >>> round(butterworth_group_delay(5, 50.0, 7.8125e-4), 2)
    13.12
    """
    lag = np.arange(3)
    sections = butterworth(order, cutoff_hz, dt)
    numerators, denominators = sections[:, :3], sections[:, 3:]
    delays = numerators @ lag / numerators.sum(axis=1) - denominators @ lag / denominators.sum(
        axis=1
    )
    return float(delays.sum())


def settling_samples(cutoff_hz: float, dt: float) -> int:
    """Samples after which the filter has forgotten: five periods of its cut-off."""
    return int(np.ceil(5 / (cutoff_hz * dt)))


def low_pass(
    values: FloatArray, order: int, cutoff_hz: float, dt: float, *, zero_phase: bool
) -> FloatArray:
    """Filter a signal that starts at rest at its first value.

    Parameters
    ----------
    values : ndarray, shape (N,)
    order : int
    cutoff_hz, dt : float
        Cut-off in Hz and sample time in s.
    zero_phase : bool
        Forward and backward instead of forward only.
    """
    sos = butterworth(order, cutoff_hz, dt)
    if zero_phase:
        pad = min(values.size - 1, settling_samples(cutoff_hz, dt))
        return np.asarray(sosfiltfilt(sos, values, padtype="constant", padlen=pad))
    state = sosfilt_zi(sos) * values[0]
    return np.asarray(sosfilt(sos, values, zi=state)[0])
