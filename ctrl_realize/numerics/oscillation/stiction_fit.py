"""Stiction between controller output and process value by a Hammerstein model.

A model of stiction with S and J is followed by linear dynamics; for each pair the linear part is
fitted by least squares, and the pair with the smallest error is taken [1]_ [2]_. Here the stiction
is Kano's [3]_, and the linear part a first-order lag, or an integrator, behind a dead time, with
output errors. Drift is removed from both sides alike. The grids, the sign of the gain and the range
are our own: the controller is a PI controller, so that its phase tells the sign of the process; a
pair is within the range if its squared error over single cycles is not significantly larger than
that of the best pair.

References
----------
.. [1] R. Srinivasan, R. Rengaswamy, S. Narasimhan and R. Miller, Control loop performance
   assessment. 2. Hammerstein model approach for stiction diagnosis, Ind. Eng. Chem. Res. 44 (2005)
   6719-6728.
.. [2] M. Jelali, Estimation of valve stiction in control loops using separable least-squares and
   global search algorithms, Journal of Process Control 18 (2008) 632-642.
.. [3] M. Kano, H. Maruta, H. Kugemoto and K. Shimizu, Practical model and detection algorithm for
   valve stiction, IFAC Symposium on Dynamics and Control of Process Systems, Cambridge 2004.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter

from ..actuators.friction import kano
from ..arrays import FloatArray
from ..constants import Z_95
from .cycles import without_drift

FEWEST_BLOCKS = 6
"""Cycles, whose errors are compared."""
MOST_CYCLES, MOST_PER_CYCLE = 25, 120
"""Of the middle of a record that are used, and samples of a cycle to which it is thinned out."""
_LAGS = np.array([0.0, 0.02, 0.05, 0.1, 0.2, 0.4, 1.0, 3.0])
"""Time constants over the period."""
_LONGEST_DELAY, _DELAYS = 0.6, 40
_COARSE, _JUMPS = np.linspace(0.05, 1.2, 24), np.linspace(0, 1, 6)
"""First grid: S over the swing, and J over S."""
_FINE, _FINE_JUMPS = 0.0125 * np.arange(-10, 11), np.linspace(0, 1, 17)
"""Second grid, about the best S, with the lags about the best one."""
_FINEST = 0.004 * np.arange(-3, 4)
"""Third grid: changes of S and J over the swing."""
_ALIKE = 1.1
"""Errors up to this multiple of the smallest are alike, because the linear part is a rough one."""
_NEAR = 1.5
"""Errors above this multiple of the smallest are not compared cycle by cycle."""


@dataclass(frozen=True)
class StictionFit:
    """Stiction of a Hammerstein model, in the unit of the controller output.

    ``S``, ``J`` with the ends of their ranges; ``swing`` is that of the output, peak to peak
    of its fundamental; ``error`` and ``linear_error`` are the parts of the power of the process
    value that the models with and without stiction leave; ``gain``, ``lag`` (inf for an
    integrator) and ``delay`` in samples are those of the linear part; ``significance`` is the
    mean difference of the errors of a cycle over its standard error.
    """

    S: float
    S_range: tuple[float, float]
    J: float
    J_range: tuple[float, float]
    swing: float
    error: float
    linear_error: float
    significance: float
    gain: float
    lag: float
    delay: int


class _Point(NamedTuple):
    error: float
    stick: float
    jump: float
    gain: float
    lag: float
    delay: int


def fit_stiction(
    output: FloatArray, value: FloatArray, period: float, phase: float, integrating: bool
) -> StictionFit | None:
    """Fit S, J and the linear part to controller output and process value (N,), with drift.

    `phase` is that of the output before the value, in rad, at the oscillation. None if there are
    fewer than `FEWEST_BLOCKS` cycles, or no linear part with the sign of the process fits.
    """
    every = max(int(period // MOST_PER_CYCLE), 1)
    output, value, period = output[::every], value[::every], period / every
    most = round(MOST_CYCLES * period)
    start = max((output.size - most) // 2, 0)
    output, value = output[start : start + most], value[start : start + most]
    if output.size < (FEWEST_BLOCKS + 2) * period:
        return None
    # a PI controller lags by 0 to 90 degrees behind minus the value, for a process of gain > 0
    sign = 1.0 if np.cos(phase - 0.75 * np.pi) > 0 else -1.0
    task = _Task(output, value, period, sign, integrating)
    linear = task.best(0.0, 0.0, task.lags)
    swing = 2 * np.sqrt(2) * float(without_drift(output, period).std())
    points = _searched(task, swing)
    best = min(points, key=_by_error)
    if linear.gain == 0 or best.gain == 0:
        return None
    blocks = task.blocks(best)
    alike = [
        one
        for one in points
        if one.error <= _ALIKE * best.error
        or (one.error <= _NEAR * best.error and _larger(task.blocks(one), blocks) < Z_95)
    ]
    sticks, jumps = [one.stick for one in alike], [one.jump for one in alike]
    return StictionFit(
        best.stick, (min(sticks), max(sticks)), best.jump, (min(jumps), max(jumps)), swing,
        best.error, linear.error, _larger(task.blocks(linear), blocks), best.gain,
        every * best.lag, every * best.delay,
    )  # fmt: skip


def _searched(task: _Task, swing: float) -> list[_Point]:
    """Try pairs of S and J on three grids, each about the best pair of the one before."""
    points = [
        task.best(stick, part * stick, task.lags) for stick in swing * _COARSE for part in _JUMPS
    ]
    center = min(points, key=_by_error)
    near = _about(center.lag, 1.4)
    points += [
        task.best(stick, part * stick, near)
        for stick in center.stick + swing * _FINE
        for part in _FINE_JUMPS
        if stick > 0
    ]
    center = min(points, key=_by_error)
    near = _about(center.lag, 1.2)
    points += [
        task.best(stick, jump, near)
        for stick in center.stick + swing * _FINEST
        for jump in center.jump + swing * _FINEST
        if stick > 0 and 0 <= jump <= stick
    ]
    return points


def _about(lag: float, factor: float) -> list[float]:
    return [lag] if np.isinf(lag) else [lag / factor, lag, lag * factor]


def _by_error(point: _Point) -> float:
    return point.error


def _larger(first: FloatArray, second: FloatArray) -> float:
    """Mean difference of two series over its standard error."""
    difference = first - second
    spread = float(difference.std(ddof=1)) / np.sqrt(difference.size)
    return float(difference.mean()) / spread if spread > 0 else 0.0


class _Task:
    """A record, and the linear parts that are tried."""

    def __init__(
        self, output: FloatArray, value: FloatArray, period: float, sign: float, integrating: bool
    ) -> None:
        self.output, self.period, self.sign = output, period, sign
        self.lags = [np.inf] if integrating else (_LAGS * period).tolist()
        longest = int(_LONGEST_DELAY * period)
        self.delays = np.unique(np.linspace(0, longest, min(longest, _DELAYS) + 1).astype(int))
        self.longest = int(self.delays[-1])
        self.value = without_drift(value, period)[self.longest :]
        self.power = float(self.value @ self.value)

    def best(self, stick: float, jump: float, lags: list[float]) -> _Point:
        """Fit the linear part for one pair of S and J."""
        found = _Point(1.0, stick, jump, 0.0, 0.0, 0)
        position = self._position(stick, jump)
        if self.power == 0 or np.ptp(position) == 0:
            return found
        for lag in lags:
            late = self._lagged(position, lag)
            squares = np.r_[0.0, np.cumsum(late * late)]
            ends = late.size - self.delays
            starts = self.longest - self.delays
            powers = squares[ends] - squares[starts]
            products = np.correlate(late, self.value, mode="valid")[self.longest - self.delays]
            good = (powers > 0) & (self.sign * products > 0)
            if not good.any():
                continue
            gains = np.where(good, products / np.where(good, powers, 1.0), 0.0)
            errors = 1 - gains * products / self.power
            k = int(np.argmin(errors))
            if errors[k] < found.error:
                found = _Point(
                    max(float(errors[k]), 0.0), stick, jump, float(gains[k]), lag,
                    int(self.delays[k]),
                )  # fmt: skip
        return found

    def blocks(self, point: _Point) -> FloatArray:
        """Sums of the squared errors over single cycles."""
        late = self._lagged(self._position(point.stick, point.jump), point.lag)
        start = self.longest - point.delay
        left = self.value - point.gain * late[start : start + self.value.size]
        length = round(self.period)
        count = left.size // length
        return np.asarray((left[: count * length] ** 2).reshape(count, length).sum(axis=1))

    def _position(self, stick: float, jump: float) -> FloatArray:
        return self.output if stick == 0 else kano(self.output, stick, jump)

    def _lagged(self, position: FloatArray, lag: float) -> FloatArray:
        """Response of the lag, or of an integrator, without drift."""
        if np.isinf(lag):
            late = np.cumsum(position - position.mean())
        elif lag > 0:
            decay = np.exp(-1 / lag)
            late = position[0] + lfilter([1 - decay], [1, -decay], position - position[0])
        else:
            late = position
        return without_drift(late, self.period)
