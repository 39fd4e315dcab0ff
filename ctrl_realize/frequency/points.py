"""Points of a frequency response: values, standard deviations, and the hold of a sampled input.

References
----------
.. [1] G. K. Smyth, Linear models and empirical Bayes methods for assessing differential expression
   in microarray experiments, Stat. Appl. Genet. Mol. Biol. 3 (2004) article 3, section 6.2,
   doi:10.2202/1544-6115.1027.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import control as ct
import numpy as np
from scipy.special import digamma, polygamma

from .._checks import check_type, one_of, rising
from .._flags import Flag, flagged
from .._wording import plainly
from ..data import MeasuredFRF
from ..errors import DataError, OptionError, UnsuitableSystemError
from ..numerics.arrays import BoolArray, ComplexArray, FloatArray
from ..numerics.constants import SMALLEST
from .comparison import hertz

_SMOOTHED_POINTS = 9
"""Number of neighbours over which standard deviations are smoothed; odd."""
_MANY_POINTS = 50
"""Least number of points for smoothing."""
_SIGNIFICANT = 6.0
"""Least ratio of mean power to that of noise, in ``1 / sqrt(points)``, for a significant signal."""
_WIDEST = 1e15
"""Largest ratio of two frequencies."""


@dataclass(frozen=True, eq=False)
class FRFPoints:
    """Increasing frequencies, responses, and standard deviations up to a factor.

    `noise_known` says that `sigma` is the measured standard deviation itself, `assumed` that it is
    proportional to the response because nothing is known about it.
    """

    frequency_hz: FloatArray
    response: ComplexArray
    sigma: FloatArray
    noise_known: bool
    assumed: bool = False


def frf_points(
    frf: Any, weighting: str, band_hz: tuple[float, float] | None, *, below_hz: float = np.inf
) -> FRFPoints:
    """Choose the usable points of an FRF and give each its standard deviation.

    Parameters
    ----------
    frf : control.FrequencyResponseData
    weighting : {"auto", "std", "relative", "uniform"}
    band_hz : tuple of float or None
        Ends of the band, included.
    below_hz : float
        Frequency from which on points are left out.
    """
    points = measured_points(frf)
    weighting = one_of(weighting, "weighting", ("auto", "std", "relative", "uniform"))
    frequency = points.frequency_hz
    usable = (frequency > SMALLEST) & (np.abs(points.response) > SMALLEST)
    usable &= np.isfinite(points.response) & (frequency < below_hz)
    if band_hz is not None:
        low, high = rising(band_hz, "band_hz", "frequencies in Hz")
        usable &= (frequency >= low) & (frequency <= high)
    different = np.unique(frequency[usable]).size
    if different < 3:
        limit = f", below {below_hz:.4g} Hz" if np.isfinite(below_hz) else ""
        raise DataError(
            f"{different} frequencies with usable points (above 0 Hz{limit}, non-zero and inside "
            "the band); expected at least 3"
        )
    span = float(frequency[usable].max() / frequency[usable].min())
    if span > _WIDEST:
        raise DataError(
            f"the frequencies span a ratio of {span:.3g}; expected at most {_WIDEST:g} (check "
            "the unit and the values)"
        )
    points = points.only(usable)
    sigma, known = _sigma(points, weighting)
    if known:
        _check_signal(points.response, sigma)
    assumed = weighting == "auto" and not known and points.coherence is None
    return FRFPoints(points.frequency_hz, points.response, sigma, known, assumed)


def _check_signal(response: ComplexArray, sigma: FloatArray) -> None:
    """Refuse points that are only noise, as those of an input without excitation."""
    power = float(np.mean(np.abs(response / sigma) ** 2))
    if power < 1 + _SIGNIFICANT / np.sqrt(response.size):
        raise DataError(
            f"the response is {plainly(np.sqrt(power), 2)} times its standard deviation, as for "
            "pure noise: the input does not excite the output at these frequencies; choose "
            "another band or measure longer (a periodic input: spectral_frf with period=)"
        )


def _sigma(points: MeasuredPoints, weighting: str) -> tuple[FloatArray, bool]:
    """Return the standard deviation of each point, and whether it was measured."""
    response, std, coherence = points.response, points.std, points.coherence
    if weighting in ("auto", "std") and std is not None and np.any(std > 0):
        # no measurement is accurate to the last digits
        usual = float(np.median(std[std > 0]))
        least = max(1e-3 * usual, 1e-14 * float(np.abs(response).max()))
        # A deviation of zero is one that was not measured, as of a single repeat.
        std = np.maximum(np.where(std > 0, std, usual), least)
        return _smoothed(std, points.repeats), True
    if weighting == "std":
        raise OptionError("weighting='std', but the FRF has no standard deviation")
    if weighting == "uniform":
        return np.full(response.size, np.sqrt(np.mean(np.abs(response) ** 2))), False
    sigma = np.abs(response)
    if coherence is not None:
        part = np.clip(coherence, 1e-3, 1 - 1e-6)
        sigma = sigma * np.sqrt((1 - part) / part)
    return np.asarray(sigma, dtype=np.float64), False


def _smoothed(std: FloatArray, repeats: float | None) -> FloatArray:
    """Smooth uncertain standard deviations along frequency.

    Of many points each is replaced by the mean of its neighbours. Of fewer, the number of repeats
    tells how much their logarithms are biased and scatter: they are moved towards that mean as far
    as this explains their distances from it [1]_.
    """
    many = std.size >= _MANY_POINTS
    if not many and repeats is None:
        return std
    half = (min(_SMOOTHED_POINTS, std.size) - 1) // 2
    kernel = np.full(2 * half + 1, 1 / (2 * half + 1))
    log = np.log(std)
    mean = np.convolve(np.pad(log, half, mode="reflect"), kernel, mode="valid")
    if many or repeats is None:
        return np.asarray(np.exp(mean))
    low = 0.5 * float(digamma(repeats - 1) - np.log(repeats - 1))
    scatter = 0.25 * float(polygamma(1, repeats - 1))
    beyond = max(float(np.mean((log - mean) ** 2)) / (1 - kernel[0]) - scatter, 0.0)
    return np.asarray(np.exp(mean - low + beyond / (beyond + scatter) * (log - mean)))


@dataclass(frozen=True, eq=False)
class MeasuredPoints:
    """Increasing frequencies (K,) and measured values, (K,) or, of several channels, (p, m, K)."""

    frequency_hz: FloatArray
    response: ComplexArray
    coherence: FloatArray | None
    std: FloatArray | None
    repeats: float | None = None
    """Number of repeats behind `std`; None if it counts as known."""

    @property
    def omega(self) -> FloatArray:
        """The same frequencies in rad/s."""
        return 2 * np.pi * self.frequency_hz

    def only(self, kept: BoolArray) -> MeasuredPoints:
        """Select the marked points."""
        coherence, std = (
            None if beside is None else beside[kept] for beside in (self.coherence, self.std)
        )
        hz, response = self.frequency_hz[kept], self.response[kept]
        return MeasuredPoints(hz, response, coherence, std, self.repeats)


def measured_points(frf: Any) -> MeasuredPoints:
    """Return the points of a single-channel FRF, with coherence and std if there are any."""
    expected = "a MeasuredFRF or a control FRD"
    check_type(frf, ct.FrequencyResponseData, "frf", expected, UnsuitableSystemError)
    check_single_channel(frf, "frf")
    order = np.argsort(frf.omega, kind="stable")
    measured = isinstance(frf, MeasuredFRF)
    coherence, std = (
        None if beside is None else np.reshape(beside, -1)[order]
        for beside in ((frf.coherence, frf.std) if measured else (None, None))
    )
    frequency_hz = np.asarray(frf.omega, dtype=np.float64)[order] / (2 * np.pi)
    response = np.asarray(frf.frdata[0, 0], dtype=np.complex128)[order]
    repeats = frf.repeats if measured else None
    return MeasuredPoints(frequency_hz, response, coherence, std, repeats)


def below_nyquist(
    points: MeasuredPoints, dt: float | None, whose: str
) -> tuple[MeasuredPoints, tuple[Flag, ...]]:
    """Leave out points that a system with sample time `dt` does not tell from others; tell it."""
    if not dt:
        return points, ()
    below = points.frequency_hz < 0.5 / dt
    if below.all():
        return points, ()
    count, nyquist = np.count_nonzero(~below), hertz(0.5 / dt)
    return points.only(below), (
        flagged("beyond_nyquist", count=count, nyquist=nyquist, whose=whose),
    )


def check_single_channel(system: Any, what: str) -> None:
    """Refuse several inputs or outputs."""
    if (system.noutputs, system.ninputs) != (1, 1):
        raise UnsuitableSystemError(
            f"{what} has {system.ninputs} inputs and {system.noutputs} outputs; expected one "
            f"channel, such as {what}[i, j]"
        )


def sampled_every(frf: Any) -> float | None:
    """Sample time of the records behind a response, in s; None if not known."""
    return frf.sample_time if isinstance(frf, MeasuredFRF) else None


def held_every(frf: Any, hold: str | None, dt: float | None) -> float | None:
    """Sample time in s of the hold that a response contains; None if there is none.

    Parameters
    ----------
    frf : control.FrequencyResponseData
    hold : {"auto", "zoh", None}
    dt : float or None
        Sample time of the hold if `frf` has none.
    """
    if hold is None:
        return None
    hold = one_of(hold, "hold", ("auto", "zoh"))
    known = sampled_every(frf)
    if known is None and hold == "zoh" and dt is None:
        raise OptionError("hold='zoh' needs dt, the sample time of the held input in s")
    return dt if known is None and hold == "zoh" else known
