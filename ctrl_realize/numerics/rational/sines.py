"""Least-squares sines: amplitude, phase, offset and, optionally, frequency.

Several channels of one record share one frequency. The frequency enters nonlinearly, the
rest linearly, so it is eliminated by variable projection: Gauss-Newton on the frequency
alone, the linear part solved exactly in every step (Kaufman's simplification of the Jacobian).
This is the four-parameter sine fit of IEEE Std 1057 [1]_, [2]_, [3]_, for many records in one call.

References
----------
.. [1] IEEE Std 1057, IEEE Standard for Digitizing Waveform Recorders.
.. [2] G. Golub and V. Pereyra, Separable nonlinear least squares: the variable projection method
   and its applications, Inverse Problems 19 (2003) R1-R26, doi:10.1088/0266-5611/19/2/201.
.. [3] L. Kaufman, A variable projection method for solving separable nonlinear least squares
   problems, BIT 15 (1975) 49-57, doi:10.1007/BF01932995.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import ComplexArray, FloatArray

_MAX_ITERATIONS = 30  # time; the sines of a stepped-sine record take 4 to 6


@dataclass(frozen=True, eq=False)
class SineFit:
    r"""Sines of a common frequency in the channels of many records.

    Channel ``c`` of record ``b`` is
    ``real(phasor[b, c] * exp(1j * omega[b] * t)) + offset[b, c] + slope[b, c] * t + noise``,
    with the time ``t`` as given.

    Parameters
    ----------
    omega : ndarray, shape (B,)
        Frequencies in rad/s.
    phasor : ndarray of complex, shape (B, C)
        Amplitude and phase at ``t = 0``.
    offset, slope : ndarray, shape (B, C)
        Level at ``t = 0``, and drift per second (0 if not fitted).
    noise_variance : ndarray, shape (B, C)
        Variance of the residual, corrected for the fitted parameters.
    phasor_covariance : ndarray, shape (B, C, 2, 2)
        Covariance of real and imaginary part of `phasor`, at the frequency found.
    """

    omega: FloatArray
    phasor: ComplexArray
    offset: FloatArray
    slope: FloatArray
    noise_variance: FloatArray
    phasor_covariance: FloatArray


def fit_sines(
    time: FloatArray,
    signals: FloatArray,
    omega: FloatArray,
    *,
    free_frequency: bool = True,
    drift: bool = False,
    mask: FloatArray | None = None,
) -> SineFit:
    """Fit one sine per record to all its channels by least squares.

    Parameters
    ----------
    time : ndarray, shape (N,) or (B, N)
        Sample times in s.
    signals : ndarray, shape (B, C, N)
        Records x channels x samples.
    omega : ndarray, shape (B,)
        Frequency in rad/s; with `free_frequency` the start value, which must be within about
        half of ``2 pi / (length of the record)``.
    free_frequency : bool, default True
        Estimate the frequency that is common to the channels of a record.
    drift : bool, default False
        Fit a linear drift instead of a constant offset.
    mask : ndarray of 0 and 1, shape (B, N), optional
        Samples to use; default: all.

    Notes
    -----
    For channels with different noise the common frequency is that of weighted least squares:
    the channels are weighted by the residuals of the first pass.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.arange(200) / 100
    >>> y = 0.5 + 2 * np.cos(2 * np.pi * 3.1 * t + 0.3)
    >>> fit = fit_sines(t, y[None, None], np.array([2 * np.pi * 3.0]))
    >>> print(np.round(fit.omega / (2 * np.pi), 9), np.round(np.angle(fit.phasor), 9))
    [3.1] [[0.3]]
    """
    n_records, n_channels, n_samples = signals.shape
    times = np.broadcast_to(time, (n_records, n_samples))
    kept = np.ones((n_records, n_samples)) if mask is None else mask
    count = kept.sum(axis=1)
    # Time is relative to the mean of the samples used: offset, drift and phase are nearly
    # orthogonal.
    centre = (kept * times).sum(axis=1) / count
    local = times - centre[:, None]
    span = np.ptp(np.where(kept > 0, local, 0.0), axis=1)
    data = signals * kept[:, None, :]

    omega = np.array(omega, dtype=np.float64)
    weights = np.ones((n_records, n_channels))
    n_columns = 4 if drift else 3
    freedom = np.maximum(count - n_columns - (0.5 if free_frequency else 0.0), 1.0)[:, None]

    at = _project(local, data, omega, kept, drift)
    if free_frequency:
        floor = np.finfo(float).eps ** 2 * (data**2).sum(axis=2) + np.finfo(float).tiny
        for iteration in range(_MAX_ITERATIONS):
            if iteration in (0, 2):
                weights = 1.0 / np.maximum((at.residual**2).sum(axis=2) / freedom, floor)
            step = _frequency_step(local, at, weights)
            # A step longer than a fraction of the line width would leave the minimum.
            limit = 1.0 / span
            step = np.clip(step, -limit, limit)
            omega = omega + step
            at = _project(local, data, omega, kept, drift)
            if iteration > 2 and np.all(np.abs(step) * span < 1e-11):
                break

    return _collect(omega, at, freedom, centre)


def dominant_frequency(signals: FloatArray, dt: float) -> FloatArray:
    """Find the strongest line of each record, as initial frequency of a sine fit.

    Parameters
    ----------
    signals : ndarray, shape (B, N)
        One channel of each record.
    dt : float
        Sample time in s.

    Returns
    -------
    ndarray, shape (B,)
        Frequency of the highest peak of the zero-padded, windowed spectrum in rad/s.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.arange(500) / 100
    >>> print(dominant_frequency(np.sin(2 * np.pi * 4.0 * t)[None], 0.01) / (2 * np.pi))
    [4...]
    """
    n_samples = signals.shape[1]
    window = np.hanning(n_samples + 2)[1:-1]
    centred = signals - (signals @ window / window.sum())[:, None]
    n_fft = 1 << (8 * n_samples - 1).bit_length()
    spectrum = np.abs(np.fft.rfft(centred * window, n_fft, axis=1))
    peak = np.clip(np.argmax(spectrum[:, 1:], axis=1) + 1, 1, spectrum.shape[1] - 2)
    rows = np.arange(signals.shape[0])
    left, middle, right = (spectrum[rows, peak + shift] for shift in (-1, 0, 1))
    bend = left - 2 * middle + right
    offset = np.where(bend < 0, 0.5 * (left - right) / np.where(bend < 0, bend, 1.0), 0.0)
    return np.asarray((peak + np.clip(offset, -0.5, 0.5)) * 2 * np.pi / (n_fft * dt))


@dataclass(frozen=True, eq=False)
class _Projection:
    """Columns of the model (B, N, P), their QR factors, coefficients (B, C, P), and residual."""

    columns: FloatArray
    basis: FloatArray
    triangle: FloatArray
    coefficients: FloatArray
    residual: FloatArray


def _project(
    local: FloatArray, data: FloatArray, omega: FloatArray, kept: FloatArray, drift: bool
) -> _Projection:
    """Solve for the linear parameters: level and slope, cosine and sine last."""
    angle = omega[:, None] * local
    level = [np.ones_like(angle), local] if drift else [np.ones_like(angle)]
    design = np.stack([*level, np.cos(angle), np.sin(angle)], axis=2) * kept[:, :, None]
    basis, triangle = np.linalg.qr(design)
    projected = data @ basis
    coefficients = np.linalg.solve(triangle[:, None], projected[..., None])[..., 0]
    left = data - projected @ basis.transpose(0, 2, 1)
    return _Projection(design, basis, triangle, coefficients, left)


def _frequency_step(local: FloatArray, at: _Projection, weights: FloatArray) -> FloatArray:
    """Gauss-Newton step of the common frequency."""
    cosine, sine = at.columns[:, :, -2] * local, at.columns[:, :, -1] * local
    slope = at.coefficients[..., -1:] * cosine[:, None]
    slope -= at.coefficients[..., -2:-1] * sine[:, None]
    slope -= (slope @ at.basis) @ at.basis.transpose(0, 2, 1)
    curvature = (weights * (slope**2).sum(axis=2)).sum(axis=1)
    gradient = (weights * (slope * at.residual).sum(axis=2)).sum(axis=1)
    return np.asarray(gradient / np.maximum(curvature, np.finfo(float).tiny))


def _collect(
    omega: FloatArray, at: _Projection, freedom: FloatArray, centre: FloatArray
) -> SineFit:
    """Convert the result from centred time back to the caller's, with its covariance."""
    coefficients = at.coefficients
    noise_variance = (at.residual**2).sum(axis=2) / freedom
    phasor_local = coefficients[..., -2] - 1j * coefficients[..., -1]
    turn = np.exp(-1j * omega * centre)
    slope = coefficients[..., 1] if coefficients.shape[2] == 4 else np.zeros(noise_variance.shape)
    offset = coefficients[..., 0] - slope * centre[:, None]

    # The corner of the triangle is that of what the level leaves of cosine and sine.
    root = np.linalg.inv(at.triangle[:, -2:, -2:]) * [[1.0], [-1.0]]
    rotation = np.stack(
        [np.stack([turn.real, -turn.imag], -1), np.stack([turn.imag, turn.real], -1)], axis=1
    )
    turned = (rotation @ root) @ (rotation @ root).transpose(0, 2, 1)
    return SineFit(
        omega=omega,
        phasor=phasor_local * turn[:, None],
        offset=offset,
        slope=slope,
        noise_variance=noise_variance,
        phasor_covariance=noise_variance[..., None, None] * turned[:, None],
    )
