"""Confidence intervals of the margins of a loop from measured data.

The errors of the points are assumed to be independent, Gaussian and equal in all directions of the
plane; their standard deviation is known, or estimated from a number of repeats. Around each
measured value there is a disk for the true one, and the intervals of the margins are determined
from these disks. The derivative at the measured crossover would not be sufficient: noise lets a
flat loop cross the unit circle many times, and the derivative at one crossing does not account for
the others.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ...numerics.arrays import BoolArray, ComplexArray, FloatArray, IntArray, runs
from ...numerics.statistics import circle_quantile, upper_quantile
from .data_loops import DataLoop
from .margin_result import Margins

Interval = tuple[float, float]
Stretch = tuple[float, float, bool]
"""Lowest and highest value in a range of frequencies, and whether it must contain one."""

TAIL = 0.025
"""Probability beyond each end of an interval."""

NEAR = np.geomspace(1e-8, 0.1, 280)
"""Relative distances from a crossover at which the curve is evaluated, for the smallest noise."""


@dataclass(frozen=True)
class _Tube:
    """Measured curve and the radius of its disks.

    On a noise-free curve a margin depends on one direction of the error only, and 1.96 standard
    deviations of it (Student's quantile for few repeats) are exact to first order; noise beside the
    crossover makes the interval wider, never narrower.
    """

    omega: FloatArray
    values: ComplexArray
    spread: FloatArray
    alone: float
    together: float

    @property
    def radius(self) -> FloatArray:
        return self.alone * self.spread

    def runs(
        self, distance: FloatArray, side: FloatArray, meets: BoolArray
    ) -> Iterator[tuple[IntArray, bool]]:
        """Ranges of frequency in which the true curve may cross a line, and whether it must.

        Outside of these ranges all disks together (`together`) determine the side of the line. Of
        each range the points whose disks meet the line, if there are any.
        """
        near = distance <= self.together * self.spread
        for start, stop in zip(*runs(near), strict=True):
            inside = start > 0 and stop < self.omega.size
            crosses = inside and side[start - 1] * side[stop] < 0
            at = np.arange(start, stop)[meets[start:stop]]
            if at.size:
                yield at, bool(crosses)


def margin_intervals(loop: DataLoop, plain: Margins) -> dict[str, Interval]:
    """95 % intervals of the margins of measured data.

    Phase and delay margin: disks that meet the unit circle. Gain margin: disks that meet the
    negative real axis. The true crossover is at one frequency, and the disk at that frequency has
    to contain the true value, whatever the noise elsewhere. Modulus margin: `closest_approach`.
    """
    tube = _tube(loop, np.concatenate([plain.gain_crossovers, plain.phase_crossovers]))
    found = {}
    phases, waits = _phase_margins(tube)
    if plain.phase_margins.size:
        low, high = _nearest(phases)
        found["phase_margin"] = (float(np.degrees(low)), float(np.degrees(high)))
    if plain.gain_margins.size:
        low, high = _nearest(_log_gain_margins(tube))
        found["gain_margin"] = (float(np.exp(low)), float(np.exp(high)))
    found["modulus_margin"] = closest_approach(loop)
    if plain.stable and np.isfinite(plain.delay_margin):
        found["delay_margin"] = _nearest(waits)
    return found


def closest_approach(loop: DataLoop) -> Interval:
    r"""Interval of at least 95 % for ``min |1 + L|``.

    The smallest of many distances measured with errors is biased downwards, the more so the flatter
    the minimum; an interval around it would not cover the true value. Here each point bounds its
    own distance :math:`\theta_i`, from the measured distance r and the standard deviation s in any
    direction:

    .. math:: \sqrt{r_i^2 - a s_i^2} - z s_i \le \theta_i \le r_i + z' s_i.

    The smallest lower bound is valid if that of the truly closest point is: z = 1.96. The smallest
    upper bound is valid if all of them are: z' is for 0.025 / K with K points. With ``a = -2 log
    0.025 - z^2`` the bound is exact at distance 0 and far away, and conservative between (r is
    Rice-distributed). If s was estimated from repeats, quantiles of Student's and of the F
    distribution are used.
    """
    spread = _spread(loop, loop.points.omega)
    most = upper_quantile(TAIL / loop.points.omega.size, loop.points.repeats)
    high = float(np.min(np.abs(1 + loop.points.response) + most * spread))
    # Between the points the interpolated curve is used, with the error of its neighbours.
    omega, values = loop.dense()
    beside, z = _spread(loop, omega), upper_quantile(TAIL, loop.points.repeats)
    # The circle is for the standard deviation of both directions together.
    bend = 2 * circle_quantile(1 - TAIL, loop.points.repeats) ** 2 - z**2
    inner = np.sqrt(np.maximum(np.abs(1 + values) ** 2 - bend * beside**2, 0))
    return max(0.0, float(np.min(inner - z * beside))), high


def _spread(loop: DataLoop, omega: FloatArray) -> FloatArray:
    """Standard deviation in one direction of the plane; `std` is that of both together."""
    assert loop.points.std is not None
    beside = np.interp(np.log(omega), np.log(loop.points.omega), loop.points.std)
    return np.asarray(beside / np.sqrt(2), dtype=np.float64)


def _tube(loop: DataLoop, crossovers: FloatArray) -> _Tube:
    grid, _ = loop.dense()
    around = np.outer(crossovers, np.concatenate([1 - NEAR, [1.0], 1 + NEAR])).ravel()
    omega = np.unique(np.concatenate([grid, around]))
    omega = omega[(omega >= loop.points.omega[0]) & (omega <= loop.points.omega[-1])]
    tails = TAIL, TAIL / (2 * loop.points.omega.size)
    one, every = (upper_quantile(tail, loop.points.repeats) for tail in tails)
    return _Tube(omega, loop(omega), _spread(loop, omega), one, every)


def _phase_margins(tube: _Tube) -> tuple[list[Stretch], list[Stretch]]:
    """Phase margins in rad and delay margins in s of each range that may meet the circle."""
    size, radius = np.abs(tube.values), tube.radius
    meets = np.abs(size - 1) <= radius
    cosine = (size**2 + 1 - radius**2) / (2 * size)
    arc = np.arccos(np.clip(cosine, -1, 1))
    phases: list[Stretch] = []
    waits: list[Stretch] = []
    for at, crosses in tube.runs(np.abs(size - 1), size - 1, meets):
        # The phases of a range are relative to one of them, so that no range is cut at 180 deg.
        first = at[np.argmin(np.abs(size[at] - 1))]
        middle = np.angle(-tube.values[first]) + np.angle(tube.values[at] / tube.values[first])
        low, high = middle - arc[at], middle + arc[at]
        phases.append((float(low.min()), float(high.max()), crosses))
        # A negative phase lead is a lag of almost a turn; if -1 itself is within reach the loop may
        # be on the stability boundary.
        later = np.where(high < 0, 2 * np.pi, 0.0)
        dead_time = np.maximum(low + later, 0) / tube.omega[at], (high + later) / tube.omega[at]
        waits.append((float(dead_time[0].min()), float(dead_time[1].max()), crosses))
    return phases, waits


def _log_gain_margins(tube: _Tube) -> list[Stretch]:
    """Logarithms of the gain margin of each range that may meet the negative real axis."""
    x, y, radius = tube.values.real, tube.values.imag, tube.radius
    half = np.sqrt(np.maximum(radius**2 - y**2, 0))
    meets = (np.abs(y) <= radius) & (half - x > 0)
    distance = np.where(x < 0, np.abs(y), np.abs(tube.values))
    found: list[Stretch] = []
    for at, crosses in tube.runs(distance, y, meets):
        smallest = float(np.min(-x[at] - half[at]))
        high = -np.log(smallest) if smallest > 0 else float("inf")
        found.append((float(-np.log(np.max(half[at] - x[at]))), float(high), crosses))
    return found


def _nearest(stretches: list[Stretch]) -> Interval:
    """Interval of the value nearest to 0, among values of which each range has one or more."""
    close = [0.0 if low <= 0 <= high else min(abs(low), abs(high)) for low, high, _ in stretches]
    far = [max(abs(low), abs(high)) for low, high, _ in stretches]
    sure = [bound for bound, (_, _, crosses) in zip(far, stretches, strict=True) if crosses]
    most = min(sure) if sure else max(far)
    kept = [part for part, bound in zip(stretches, close, strict=True) if bound <= most]
    low, high = min(part[0] for part in kept), max(part[1] for part in kept)
    return max(low, -most), min(high, most)
