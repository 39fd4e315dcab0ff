"""Differences, low-pass filters and moving means.

Difference and filter are those of [1]_; the five-point stencil is in [2]_, Butterworth filters by
the bilinear transformation in [3]_.

References
----------
.. [1] J. van Helvoirt, O. Bosgra, B. de Jager and M. Steinbuch, Approximate realization of valve
   dynamics with time delay, Proc. 16th IFAC World Congress, 2005, section 3.2.
.. [2] M. Abramowitz and I. A. Stegun, Handbook of Mathematical Functions, Dover 1965, section 25.3
   (numerical differentiation).
.. [3] A. V. Oppenheim and R. W. Schafer, Discrete-Time Signal Processing, 3rd ed., Pearson 2010,
   chapter 7 (Filter design techniques).
"""

from __future__ import annotations

import numpy as np
from scipy.signal import butter, sosfilt, sosfilt_zi, sosfiltfilt

from ..arrays import FloatArray


def central_difference(step: FloatArray) -> FloatArray:
    """Five-point derivative, error O(Ts^4), times the sample time.

    This is the paper's differentiation (section 3.2; it is called "third order" there, but the
    stencil with an error O(Ts^4) has order four). It samples the continuous impulse response, which
    is half a sample earlier than the step-invariant one, and uses two future samples, so an edge
    appears two samples early. The two samples at each end use the three-point and the one-sided
    stencils of order two.
    one-sided stencils of order two.

    Parameters
    ----------
    step : ndarray, shape (N,), N >= 5

    Returns
    -------
    ndarray, shape (N,)
        Ts dS/dt: the change per sample.

    Examples
    --------
    >>> import numpy as np
    >>> from ctrl_realize.numerics.signals.filters import central_difference
    >>> print(central_difference(np.arange(7.0) ** 4)[2:-2])
    [ 32. 108. 256.]
    """
    slope = np.gradient(step, edge_order=2)
    slope[2:-2] = (step[:-4] - 8 * step[1:-3] + 8 * step[3:-1] - step[4:]) / 12
    return slope


def butterworth(order: int, cutoff_hz: float, dt: float) -> FloatArray:
    """Design a digital Butterworth low-pass as second-order sections.

    The cut-off is in Hz and the sample time is a separate argument. Normalised frequencies invite
    the error of the paper, which calls 500 Hz the Nyquist frequency of a record sampled at 1280 Hz:
    its cut-off would then be 64 Hz.

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
    >>> from ctrl_realize.numerics.signals.filters import butterworth_group_delay
    >>> round(butterworth_group_delay(5, 50.0, 7.8125e-4), 2)
    13.12
    """
    lag = np.arange(3)
    sections = butterworth(order, cutoff_hz, dt)
    ahead, behind = (part @ lag / part.sum(axis=1) for part in np.split(sections, 2, axis=1))
    return float((ahead - behind).sum())


def settling_samples(cutoff_hz: float, dt: float) -> int:
    """Duration of the filter's transient in samples: five periods of its cut-off."""
    return int(np.ceil(5 / (cutoff_hz * dt)))


def low_pass(
    values: FloatArray, order: int, cutoff_hz: float, dt: float, *, zero_phase: bool
) -> FloatArray:
    """Filter a signal that is constant at its first value before the first sample.

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


_WIDE = 256
"""Window length from which on running sums are faster than a sum for every window."""


def moving_mean(values: FloatArray, width: int) -> FloatArray:
    """Mean over `width` samples around every sample, zeros beyond the ends.

    Windows of an even number of samples contain one more past than future sample.

    Parameters
    ----------
    values : ndarray, shape (N,)
    width : int

    Notes
    -----
    A wide window consists of the end of one block of `width` samples and the beginning of the next.
    Running sums are computed within blocks only: an outlier affects only the means that contain it,
    unlike in a sum over everything before.

    Examples
    --------
    >>> import numpy as np
    >>> from ctrl_realize.numerics.signals.filters import moving_mean
    >>> print(moving_mean(np.array([0.0, 0.0, 3.0, 3.0, 3.0]), 3))
    [0. 1. 2. 3. 2.]
    """
    if width < _WIDE or values.size <= width:
        return np.convolve(values, np.ones(width) / width, "same")
    ahead = width // 2
    count = -(-(values.size + width) // width)
    padded = np.zeros(count * width)
    padded[ahead : ahead + values.size] = values
    blocks = padded.reshape(count, width)
    following = np.cumsum(blocks[:, ::-1], axis=1)[:, ::-1].ravel()[: values.size]
    leading = np.zeros_like(blocks)
    np.cumsum(blocks[:, :-1], axis=1, out=leading[:, 1:])
    return np.asarray((following + leading.ravel()[width : width + values.size]) / width)
