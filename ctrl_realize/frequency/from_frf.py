"""Unit-pulse response from a measured frequency response."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal

import control as ct
import numpy as np

from .._checks import integer, one_of, positive
from .._flags import Flag, flagged
from ..data.frf_operands import same_time
from ..data.impulse_estimate import ImpulseEstimate
from ..errors import DataError
from ..numerics.arrays import ComplexArray, FloatArray
from ..numerics.blas_threads import single_threaded
from ..numerics.rational.spectra import hold_response
from ..numerics.regression.fir import cautious_std, fit_kernel
from ..numerics.regression.normal_equations import NormalEquations
from .points import FRFPoints, frf_points, held_every

_BLOCK = 256
"""Number of points whose rows are in memory at the same time."""
_STILL_ALIVE = 0.02
"""Relative to the largest response, at the highest frequency."""
_TAIL = 0.05
"""Relative to the largest Markov parameter, in the last tenth."""
_UNEXPLAINED = 0.02
"""Fraction of the power of the response."""
_LEAST_NOISE = 1e-3
"""Least relative error of an FRF: hold and aliases are approximate, and with smaller errors the
prior would leave the frequencies between the points undetermined."""


@single_threaded
def impulse_from_frf(
    frf: ct.FrequencyResponseData,
    dt: float,
    length: int,
    *,
    kernel: Literal["TC", "SS"] = "SS",
    weighting: Literal["auto", "std", "relative", "uniform"] = "auto",
    hold: Literal["auto", "zoh"] | None = "auto",
    band_hz: tuple[float, float] | None = None,
) -> ImpulseEstimate:
    r"""Estimate the unit-pulse response that belongs to a frequency response.

    Regularised least squares: the Markov parameters whose transform is closest to the measured
    points, with a prior of decay (and smoothness) whose parameters maximise the marginal
    likelihood. The frequencies need not be uniform: there is no interpolation and no inverse FFT,
    and therefore no circular wrap-around and no ringing.

    Parameters
    ----------
    frf : MeasuredFRF
        One input, one output.
    dt : float
        Sample time of the response in s.
    length : int
        Number of Markov parameters; the response must have decayed within it.
    kernel : {"TC", "SS"}
        Prior; "SS" is smooth, "TC" allows a jump at lag 0 (see `impulse_from_io`).
    weighting : {"auto", "std", "relative", "uniform"}
        As for `fit_frf`, but "auto" is "std" if there is one, otherwise "uniform".
    hold : {"auto", "zoh", None}
        None: the FRF is that of the plant itself, and the hold of a step-invariant model is added.
        "zoh": it was estimated from samples of a held input and contains the hold. "auto": the
        latter if the FRF has a sample time, as from `spectral_frf`.
    band_hz : tuple of float, optional
        Use only points in this band.

    Returns
    -------
    ImpulseEstimate
        Step-invariant, with `std`; for `realize` and `estimate_delay`.

    Raises
    ------
    DataError
        Too few points, or none below the Nyquist frequency of `dt`.
    UnsuitableSystemError
        An FRF with several inputs or outputs.
    OptionError
        Invalid options.

    Notes
    -----
    Outside of the measured band the estimate is determined by the prior alone. Two flags report
    when this matters: ``"ends_early"`` if the response is still significant at the highest
    frequency (the pulse response is then smoother than that of the plant, without features shorter
    than half a period of that frequency), and ``"starts_late"`` if the lowest frequency is above
    one period in `length` (gain and slow modes are then extrapolated). ``"cut_off"`` and
    ``"unexplained"`` report that `length` is too short, the latter also that the data are noisy. If
    a model of low order is sufficient, `fit_frf` is easier to use.

    Prior and tuning are those of [1]_, for data in the frequency domain as in [2]_.

    References
    ----------
    .. [1] T. Chen, H. Ohlsson and L. Ljung, On the estimation of transfer functions,
       regularizations and Gaussian processes - revisited, Automatica 48 (2012) 1525-1535,
       doi:10.1016/j.automatica.2012.05.026.
    .. [2] J. Lataire and T. Chen, Transfer function and transient estimation by Gaussian process
       regression in the frequency domain, Automatica 72 (2016) 217-229,
       doi:10.1016/j.automatica.2016.06.009.

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> f = np.linspace(0.05, 25, 200)
    >>> s = 2j * np.pi * f
    >>> frf = cr.MeasuredFRF(np.exp(-0.1 * s) / (0.1 * s + 1) ** 2, f)
    >>> g = cr.impulse_from_frf(frf, 0.02, 80)
    >>> print(f"{g.markov.sum():.3f}", np.abs(g.markov[:5]).max() < 0.002)
    1.000 True
    """
    kernel = one_of(kernel, "kernel", ("TC", "SS"))
    step = positive(dt, "dt", "sample time in s")
    count = integer(length, "length", 8)
    weighting = one_of(weighting, "weighting", ("auto", "std", "relative", "uniform"))
    points = frf_points(frf, weighting, band_hz, below_hz=0.5 / step)
    if weighting == "auto" and not points.noise_known:
        points = frf_points(frf, "uniform", band_hz, below_hz=0.5 / step)
    held = held_every(frf, hold, step)
    omega = 2 * np.pi * points.frequency_hz
    response, sigma = points.response, points.sigma
    if held is not None and not same_time(held, step):
        response = response / hold_response(omega, held) * hold_response(omega, step)
    elif held is None:
        response = response * hold_response(omega, step)
        if points.noise_known:
            # Aliases from beyond the Nyquist frequency, which the hold does not describe, have
            # about this size for a plant that falls with 1/omega.
            image = omega / (2 * np.pi / step - omega)
            sigma = np.hypot(sigma, np.abs(response) * image**2)
    if 2 * omega.size < 16:
        raise DataError(f"{omega.size} points are too few for a pulse response; 8 are needed")
    # Scaled by a power of two near the size of the response, so that nothing is rounded.
    unit = 2.0 ** round(float(np.log2(np.median(np.abs(response)))))
    equations = _equations(omega * step, response / unit, unit / sigma, count)
    fit = fit_kernel(equations, count, kernel)
    markov = unit * fit.markov[0]
    variance = fit.noise_variance / equations.power[0, 0]
    return ImpulseEstimate(
        markov,
        step,
        std=unit * cautious_std(equations, count, fit)[0],
        noise_std=np.array([np.sqrt(fit.noise_variance) * float(np.median(sigma))]),
        method=f"{kernel} kernel on {omega.size} points, {fit.effective:.0f} free parameters",
        rows=2 * omega.size,
        flags=tuple(_flags(points, response, markov, step, variance)),
        name=str(frf.name or ""),
    )


def _equations(
    angle: FloatArray, response: ComplexArray, weight: FloatArray, count: int
) -> NormalEquations:
    """Sum the normal equations of ``response = sum_k markov[k] exp(-1j angle k)``."""
    lags = np.arange(count)
    gram, cross = np.zeros((count, count)), np.zeros((count, 1))
    # Blocks of points, to limit the memory.
    for first in range(0, angle.size, _BLOCK):
        part = slice(first, first + _BLOCK)
        turned = weight[part, None] * np.exp(-1j * angle[part, None] * lags)
        rows = np.concatenate([turned.real, turned.imag])
        target = weight[part] * response[part]
        gram += rows.T @ rows
        cross[:, 0] += rows.T @ np.concatenate([target.real, target.imag])
    power = np.array([[(1 + _LEAST_NOISE**2) * float(np.sum(np.abs(weight * response) ** 2))]])
    return NormalEquations(gram, cross, power, 2 * angle.size, 2 * angle.size)


def _flags(
    points: FRFPoints, response: ComplexArray, markov: FloatArray, dt: float, variance: float
) -> Iterator[Flag]:
    """Flag estimates with little support in the data; `variance` is relative to the power."""
    unexplained = variance * 2 * response.size
    if unexplained > _UNEXPLAINED:
        yield flagged("unexplained", share=100 * unexplained)
    f = points.frequency_hz
    size = np.abs(response)
    last = float(np.median(size[f >= 0.9 * f[-1]]) / size.max())
    if f[-1] < 0.45 / dt and last > _STILL_ALIVE:
        yield flagged("ends_early", highest=f[-1], share=100 * last, nyquist=0.5 / dt)
    duration = markov.size * dt
    if f[0] * duration > 1:
        yield flagged("starts_late", lowest=f[0], periods=f[0] * duration, duration=duration)
    tail = markov[-max(2, markov.size // 10) :]
    left = float(np.abs(tail).max() / np.abs(markov).max())
    if left > _TAIL:
        yield flagged("cut_off", share=100 * left)
