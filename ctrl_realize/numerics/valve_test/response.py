"""Times at which a step response crosses levels, with the standard error from the noise.

A crossing is read off a polynomial that is fitted to the samples about it: a parabola or a
cubic in the window in which the smoothed response is near the level. The error is propagated
from the noise of those samples and of the two levels (first-order propagation, [1]_ section 5.1.2);
the choice of the window is our own. Where the samples are too few for it, the crossing lies
between two of them, and the samples beside these bound it.

References
----------
.. [1] JCGM 100:2008, Evaluation of measurement data: Guide to the expression of uncertainty in
   measurement.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from scipy.special import ndtri

from ..arrays import FloatArray
from ..constants import Z_95
from ..signals.filters import moving_mean
from ..signals.noise import correlation_time, rounding_of_level
from ..signals.onset import first_motion
from .play import slope_of

_REACH = 0.1
"""Half height of the window about a crossing, of the whole change."""
_LOUD = 0.01
"""Noise, of the whole change, from which on it is worth more than the course of the response."""
_BENT = 3.0
"""Standard deviations from its polynomial by which a response is none: its samples are far apart.
"""
_SECOND, _BEGINNING = 15.0, 0.4
"""Standard deviations of the second threshold of an onset, and part of the change that they may be:
with 0.9 of it the dead time of a lag is 7 % too long, and beyond it is none."""
_AT_REST = 2.0
"""Standard deviations up to which a sample is at rest: 2.3 % of those at rest are beyond."""
_REST = 8
"""Samples before a step from which `first_motion` takes the level before it."""
_PEAK = 4
"""Degree of the polynomial through a peak: a parabola is 1.6 % of the overshoot too low."""
_BY_CHANCE = 1e-4
"""Of the peak of a step being noise: a test has some fifty steps, and the worst of them counts."""
_T86 = 1 - float(np.exp(-2))


@dataclass(frozen=True)
class Estimate:
    """A number and its standard error; NaN if it is not known.

    Without noise it lies between ``value - below`` and ``value + above``: the response between two
    samples is not known, and repeats that are sampled alike have this in common.
    """

    value: float
    std: float
    below: float = 0.0
    above: float = 0.0


UNKNOWN = Estimate(float("nan"), float("nan"))


@dataclass(frozen=True)
class Noise:
    """Noise of a signal: standard deviation and samples per independent sample."""

    sigma: float
    correlation: float
    quantum: float

    def of_mean(self, count: int) -> float:
        """Standard error of the mean of `count` neighbouring samples."""
        return self.sigma * float(np.sqrt(min(self.correlation / max(count, 1), 1.0)))

    @property
    def rounding(self) -> float:
        """Error by rounding that no mean reduces."""
        if self.quantum == 0:
            return 0.0
        noise = float(np.sqrt(max(self.sigma**2 - self.quantum**2 / 12, 0.0)))
        return rounding_of_level(noise, self.quantum)


@dataclass(frozen=True, eq=False)
class UnitResponse:
    """Response scaled to 0 before and 1 after; ``shape[0]`` is the sample of the command's step.

    `before` and `after` are the standard errors of the two levels, `noise` the noise, all scaled
    alike; times are in samples.
    """

    shape: FloatArray
    smooth: FloatArray
    noise: Noise
    width: int
    before: float
    after: float

    @classmethod
    def of(cls, output: FloatArray, levels: tuple[Estimate, Estimate], noise: Noise) -> Self:
        """Scale the samples from the step on."""
        (before, after), change = levels, levels[1].value - levels[0].value
        scale = abs(change)
        shape = (output - before.value) / change
        scaled = Noise(noise.sigma / scale, noise.correlation, noise.quantum / scale)
        width = _smoothing(shape, scaled)
        smooth = _smoothed(shape, width)
        return cls(shape, smooth, scaled, width, before.std / scale, after.std / scale)

    def crossing(self, level: float) -> Estimate:
        """Time of the first lasting crossing of a level upwards."""
        width = self._width_at(level)
        smooth = _smoothed(self.shape, width)
        over = smooth >= level
        # a crossing lasts for as long as the window of the smoothing
        lasting = np.convolve(over, np.ones(width), "full")[width - 1 :] >= 0.8 * width
        first = np.flatnonzero(over & lasting[: over.size])
        # nor is a crossing known of a level within the 95 % interval of the final one
        if not first.size or max(4 * self.noise.of_mean(width), Z_95 * self.after) > 1 - level:
            return UNKNOWN
        return self._refined(level, int(first[0]), smooth)

    def settling(self, band: float) -> Estimate:
        """Time from which on the response stays within a band about its final level."""
        width = self._width_at(1 - band)
        smooth, noise = _smoothed(self.shape, width), self.noise.of_mean(width)
        outside = np.flatnonzero(np.abs(smooth - 1) > band)
        # at the end the window of the smoothing is not full
        outside = outside[outside < smooth.size - width]
        if (
            not outside.size
            or outside[-1] + 1 >= smooth.size - width
            or max(6 * noise, Z_95 * self.after) > band
        ):
            return UNKNOWN
        last = int(outside[-1])
        level = 1 + np.sign(smooth[last] - 1) * band
        return self._refined(float(level), last + 1, smooth)

    def overshoot(self) -> Estimate:
        """Height of the peak above the final level; 0 if it is within the noise."""
        top = int(np.argmax(self.smooth))
        error = float(np.hypot(self.noise.of_mean(self.width), self.after))
        # Bonferroni's bound for the largest of all samples.
        least = -float(ndtri(_BY_CHANCE / self.smooth.size)) * error
        peak = float(self.smooth[top]) - 1
        if peak <= max(least, 0.5 * self.noise.quantum):
            return Estimate(0.0, error)
        # The largest of noisy samples is too large: a polynomial through the upper half of the peak
        # is taken, in whose middle the error is 15/8 of that of a mean.
        below = np.flatnonzero(self.smooth <= 1 + 0.5 * peak)
        place = int(np.searchsorted(below, top))
        low = int(below[place - 1]) + 1 if place else 0
        part = self.shape[low : int(below[place]) if place < below.size else None]
        if part.size > 2 * _PEAK:
            along = np.linspace(-1, 1, part.size)
            peak = float(np.max(np.polyval(np.polyfit(along, part, _PEAK), along))) - 1
            error = float(np.hypot(15 / 8 * self.noise.of_mean(part.size), self.after))
        return Estimate(peak, error)

    def first_motion(self) -> Estimate:
        """Visible onset: the rise through one and three thresholds, extrapolated to the baseline.

        The thresholds are five and fifteen standard deviations of the noise. Where these are no
        part of the beginning of the response, noise hides it.
        """
        if _SECOND * self.noise.sigma > _BEGINNING:
            return UNKNOWN
        # with a rest of zero in front, whose level is not that of the first samples of the motion
        output = np.concatenate([np.zeros(_REST), self.shape])
        found = first_motion(output, _REST, self.noise.sigma, self.noise.quantum, 0.0)
        if found is None or found.sign < 0:
            return UNKNOWN
        onset, moved = max(found.onset, 0.0), found.crossing
        # The line through two points of one deviation each, five and fifteen of them high, meets
        # the baseline with an error of sqrt(1.5^2 + 0.5^2) deviations over its slope.
        error = 1.58 * max(moved - onset, 0.5) / 5
        sigma, high = self.noise.sigma, float(self.shape[moved])
        if high < _SECOND * sigma:
            return Estimate(onset, float(np.hypot(error, 0.29)))
        # Beyond both thresholds at once it tells no line: it moves after the last sample at rest.
        still = np.flatnonzero(self.shape[:moved] <= _AT_REST * sigma)
        last = int(still[-1]) if still.size else 0
        onset = max(onset, last)
        return Estimate(onset, error * 5 * sigma / high, onset - last, moved - onset)

    def mean_delay(self) -> float:
        """Area between the response and its final level: dead time plus lags, in samples."""
        return float(np.sum(1 - self.smooth))

    def _width_at(self, level: float) -> int:
        """Window of the smoothing for a level: near the end of the response, little noise."""
        wanted = int(np.ceil(self.noise.correlation * (5 * self.noise.sigma / (1 - level)) ** 2))
        most = int(np.argmax(self.smooth >= _T86)) // 2
        return max(self.width, min(wanted, most) // 2 * 2 + 1) if wanted > 1 else self.width

    def _refined(self, level: float, near: int, smooth: FloatArray) -> Estimate:
        """Fit a polynomial in the window about a crossing of the smoothed response."""
        reach = min(_REACH, 0.7 * abs(1 - level))
        inside = np.abs(smooth - level) <= reach
        low = high = min(near, inside.size - 1)
        while low > 0 and inside[low - 1]:
            low -= 1
        while high + 1 < inside.size and inside[high + 1]:
            high += 1
        low, high = max(min(low, near - 2), 0), min(max(high, near + 1), inside.size - 1)
        index = np.arange(low, high + 1, dtype=np.float64) - near
        part = self.shape[low : high + 1]
        if index.size < 5:
            return self._interpolated(level, near)
        powers = np.arange(3 if index.size < 10 and self.noise.sigma > _LOUD else 4)
        inverse = np.linalg.pinv(index[:, None] ** powers)
        curve = np.polynomial.Polynomial(inverse @ part)
        root = _root(curve, level)
        misfit = float(np.linalg.norm(part - curve(index)) / np.sqrt(index.size - powers.size))
        if not index[0] - 1 <= root <= index[-1] + 1 or misfit > _BENT * self.noise.sigma:
            return self._interpolated(level, near)
        weights = root**powers @ inverse
        own = self.noise.sigma * float(np.linalg.norm(weights) * np.sqrt(self.noise.correlation))
        # the slope of the curve is noisy, that across the window is not
        across = (smooth[high] - smooth[low]) / (high - low)
        steepness = min(abs(float(curve.deriv()(root))), abs(float(across)))
        return Estimate(near + root, self._error(own, level, steepness))

    def _interpolated(self, level: float, near: int) -> Estimate:
        """Interpolate between the two samples of a fast crossing.

        Where the slope rises to one maximum and falls after it, as behind lags or a limited rate,
        the course lies above the lower and below the higher of the chord and the lines through
        the samples before and after, extended.
        """
        # at rest before the step
        here = np.concatenate([np.zeros(2), self.shape, self.shape[-1:]])
        for k in (near + 2, near + 3, near + 1):
            if 3 <= k < here.size - 1 and (here[k - 1] - level) * (here[k] - level) <= 0:
                chord = float(here[k] - here[k - 1])
                if chord:
                    part = float(level - here[k - 1]) / chord
                    # slopes in units of the chord
                    first, before, _, after = (np.diff(here[k - 3 : k + 2]) / chord).tolist()
                    late = part / min(max(before, part, 1e-9), 1.0)
                    early = 1 - (1 - part) / min(max(after, 1 - part, 1e-9), 1.0)
                    if first >= before >= 1:  # the maximum is past: below the line before as well
                        early = max(early, part / before)
                    error = self._error(self.noise.sigma, level, chord)
                    return Estimate(k - 3 + part, error, part - early, late - part)
        return Estimate(float(near), 1.0)

    def _error(self, own: float, level: float, slope: float) -> float:
        levels = np.hypot((1 - level) * self.before, level * self.after)
        own = float(np.hypot(own, self.noise.rounding))
        return float(np.hypot(own, levels) / max(abs(slope), 1e-12))


def steady_noise(parts: list[FloatArray], quantum: float) -> Noise:
    """Noise about the levels of stretches in which nothing moves."""
    residuals = [_about_line(part) for part in parts if part.size >= 4]
    if not residuals:
        return Noise(quantum / np.sqrt(12), 1.0, quantum)
    # The median of the variances: a stretch that still moves does not count.
    variances = [float(one @ one) / (one.size - 2) for one in residuals]
    sigma = max(float(np.sqrt(np.median(variances))), quantum / np.sqrt(12))
    longest = max(residuals, key=lambda one: one.size)
    time = correlation_time(longest) if longest.size >= 30 and np.ptp(longest) > 0 else 1.0
    return Noise(sigma, min(time, longest.size / 4), quantum)


def _about_line(part: FloatArray) -> FloatArray:
    """What is left of a stretch without the line of least squares: its end may still move."""
    index = np.arange(part.size, dtype=np.float64)
    line = np.mean(part) + slope_of(index, part) * (index - index.mean())
    return np.asarray(part - line)


def _root(curve: np.polynomial.Polynomial, level: float) -> float:
    """Where a polynomial crosses a level, nearest to zero; NaN if it does not."""
    roots = (curve - level).roots()
    real = roots[roots.imag == 0].real
    return float(min(real, key=abs, default=np.nan))


def _smoothing(shape: FloatArray, noise: Noise) -> int:
    """Window of the moving mean: 1 % of noise if it stays below a quarter of the rise."""
    wanted = int(np.ceil(noise.correlation * (noise.sigma / _LOUD) ** 2))
    for width in (1, 3, 5, 9, 15, 25, 41, 65, 101, 161, 257, 401):
        smooth = _smoothed(shape, width)
        high = int(np.argmax(smooth >= 0.8)) if (smooth >= 0.8).any() else shape.size
        low = np.flatnonzero(smooth[: high + 1] <= 0.2)
        rise = high - (int(low[-1]) if low.size else 0)
        if width >= wanted or 4 * width > rise:
            return width
    return width


def _smoothed(shape: FloatArray, width: int) -> FloatArray:
    if width == 1:
        return shape
    half = width // 2
    end = np.mean(shape[-max(half, 1) :])
    padded = np.concatenate([np.zeros(half), shape, np.full(half, end)])
    return np.asarray(moving_mean(padded, width)[half : half + shape.size])
