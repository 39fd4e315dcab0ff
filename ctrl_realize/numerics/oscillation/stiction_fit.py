"""Stiction between controller output and process value by a Hammerstein model.

A model of stiction with S and J is followed by linear dynamics; for each pair the linear part is
fitted by least squares, and the pair with the smallest error is taken [1]_ [2]_. Here the stiction
is Kano's [3]_, and the linear part a first-order lag, or an integrator, behind a dead time, with
output errors. The grids and the sign of the gain are our own: the controller is a PI controller, so
that its phase tells the sign of the process.

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

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import FloatArray
from ..constants import Z_95
from .cycles import resolution, without_drift
from .stiction_model import StickingLoop, Trial
from .stiction_region import INDEPENDENT, Region, near, near_delays

FEWEST_BLOCKS = 6
"""Cycles, whose errors are compared."""
MOST_CYCLES, MOST_SAMPLES = 25, 6000
"""Of the middle of a record that are used."""
_LAGS = np.array([0.0, 0.02, 0.05, 0.1, 0.2, 0.4, 1.0, 3.0])
"""Time constants over the period."""
_PER_CYCLE, _DELAYS = 40, 20
"""Samples of a cycle and dead times in the first search."""
_STICKS: FloatArray = np.r_[0.01:0.2:0.02, 0.2 * 1.012 ** np.arange(180.0)]
"""First grid: S over the swing of the fundamental."""
_JUMPS, _JUMPS_OF_LEVEL = np.linspace(0, 1, 8), np.linspace(0, 1, 21)
"""First grid: J over S. A level remembers slips: a J that is wrong by 2 % of S is as bad as any."""
_VALLEYS, _APART, _STARTS = 3, 0.03, 2
"""Best pairs of the first grid that are followed, and their distance in S over the swing."""
_STEPS = 8
_NARROW, _NARROW_JUMPS = 0.002 * np.arange(-16, 17), 0.04 * np.arange(-5, 6)
"""Grid, over S, for a stem that is at rest once and not in every cycle. If S is half a per cent too
large, it misses a slip, after which it may never slip again: a smaller error is easily missed."""


@dataclass(frozen=True)
class StictionFit:
    """Stiction of a Hammerstein model, in the unit of the controller output.

    ``S``, ``J`` with the ends of their 95 % confidence intervals; they are only ranges of similar
    errors where ``correlation_time`` of the residual, in samples, is above 2. ``swing`` is that of
    the output, peak to peak of its fundamental; ``error`` and ``linear_error`` are the parts of the
    power of the process value that the models with and without stiction leave; ``gain``, ``lag``
    (inf for an integrator) and ``delay`` in samples are those of the linear part; ``significance``
    is the mean difference of the errors of a cycle over its standard error.
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
    correlation_time: float

    @property
    def independent(self) -> bool:
        """Whether the errors of the samples are, so that the intervals hold what they promise."""
        return self.correlation_time <= INDEPENDENT


def fit_stiction(
    output: FloatArray, value: FloatArray, period: float, sign: float, integrating: bool
) -> StictionFit | None:
    """Fit S, J and the linear part to controller output and process value (N,), with drift.

    `sign` is that of the gain. None if there are fewer than `FEWEST_BLOCKS` cycles, or no linear
    part with this sign fits.
    """
    most = min(round(MOST_CYCLES * period), max(MOST_SAMPLES, round((FEWEST_BLOCKS + 4) * period)))
    start = max((output.size - most) // 2, 0)
    output, value = output[start : start + most], value[start : start + most]
    if output.size < (FEWEST_BLOCKS + 2) * period:
        return None
    swing = 2 * float(np.sqrt(2) * without_drift(output, period).std())
    if swing == 0:
        return None
    every = max(output.size // MOST_SAMPLES, 1)
    coarse = max(int(period // _PER_CYCLE), every)
    rough = StickingLoop(output, value, period, sign, coarse)
    loop = StickingLoop(output, value, period, sign, every)
    lags = [np.inf] if integrating else (_LAGS * rough.period).tolist()
    if rough.power == 0:
        return None
    valleys = sorted(
        _followed(loop, seed, swing, coarse / every, starts)
        for starts, levels in ((loop.every_cycle, _STICKS[::3]), (loop.once, _STICKS))
        if len(starts)
        for seed in _valleys(rough, levels, swing, lags, starts[:_STARTS])
    )
    best = min(_once(loop, one, swing) for one in valleys[:2])
    linear = loop.linear([each * coarse / every for each in lags], range(loop.longest + 1))
    if linear.gain == 0 or best.gain == 0:
        return None
    region = Region(loop, best, swing)
    best, margin = region.best, resolution(output)
    sticks, jumps = region.ends(valleys)
    significance = _larger(_blocks(loop, linear), _blocks(loop, best))
    # Without stiction the errors have a minimum of their own, apart from the region of the best.
    if significance <= Z_95:
        sticks, jumps = (0.0, sticks[1]), (0.0, jumps[1])
    return StictionFit(
        best.stick, (max(sticks[0] - margin, 0.0), sticks[1] + margin), best.jump, jumps, swing,
        best.error, linear.error, significance, best.gain,
        every * best.lag, every * best.delay, region.correlation_time,
    )  # fmt: skip


def _valleys(
    loop: StickingLoop, levels: FloatArray, swing: float, lags: Sequence[float], starts: range
) -> list[Trial]:
    """Best pairs of the first grid, with S over the swing at `levels`, apart from one another."""
    parts = _JUMPS_OF_LEVEL if np.isinf(lags[0]) else _JUMPS
    sticks = swing * np.repeat(levels, parts.size)
    jumps = sticks * np.tile(parts, levels.size)
    delays = np.unique(np.linspace(0, loop.longest, _DELAYS).astype(int)).tolist()
    found: list[Trial] = []
    for one in sorted(loop.best(sticks, jumps, lags, delays, starts)):
        if all(abs(one.stick - other.stick) > _APART * swing for other in found):
            found.append(one)
            if len(found) == _VALLEYS:
                break
    return found


def _followed(
    loop: StickingLoop, seed: Trial, swing: float, thinner: float, starts: Sequence[int]
) -> Trial:
    """Search about a pair on smaller and smaller grids; `thinner` is the ratio of the samples."""
    lag, delay = seed.lag * thinner, round(seed.delay * thinner)
    best = seed._replace(error=np.inf, lag=lag, delay=delay)
    stick_step, jump_step, factor = 0.007 * swing, 0.1 * seed.stick, 1.3
    reach = max(round(thinner), 2)
    for _ in range(_STEPS):
        delays = near_delays(loop, best.delay, reach)
        new = min(_about(loop, best, (stick_step, jump_step), factor, delays, starts))
        starts = [new.start]
        far = abs(new.stick - best.stick) > stick_step or abs(new.jump - best.jump) > jump_step
        if not far or new.error >= best.error:
            stick_step, jump_step, factor = 0.6 * stick_step, 0.7 * jump_step, factor**0.6
        best, reach = min(best, new), min(reach, 2)
    return best


def _about(
    loop: StickingLoop,
    best: Trial,
    steps: tuple[float, float],
    factor: float,
    delays: Sequence[int],
    starts: Sequence[int],
) -> list[Trial]:
    """Try a grid about a pair."""
    sticks, jumps = np.meshgrid(
        best.stick + steps[0] * np.arange(-2, 3), best.jump + steps[1] * np.arange(-2, 3)
    )
    inside = (sticks > 0) & (jumps >= 0) & (jumps <= sticks)
    lags = near(best.lag, factor, loop.period)
    return loop.best(sticks[inside], jumps[inside], lags, delays, starts)


def _once(loop: StickingLoop, best: Trial, swing: float) -> Trial:
    """Search about a pair for one that fits if the stem is put to rest only once."""
    sticks, parts = np.meshgrid(best.stick * (1 + _NARROW), best.jump / best.stick + _NARROW_JUMPS)
    inside = (parts >= 0) & (parts <= 1)
    sticks, jumps = sticks[inside], (sticks * parts)[inside]
    delays = near_delays(loop, best.delay, 2)
    found = min(loop.best(sticks, jumps, [best.lag], delays, loop.once))
    steps, factor = (0.001 * best.stick, 0.02 * best.stick), 1.1
    for _ in range(_STEPS // 2):
        delays = near_delays(loop, found.delay, 2)
        found = min(found, *_about(loop, found, steps, factor, delays, [found.start]))
        steps, factor = (0.7 * steps[0], 0.7 * steps[1]), factor**0.7
    return min(best, found)


def _blocks(loop: StickingLoop, trial: Trial) -> FloatArray:
    """Sums of the squared errors over single cycles."""
    left, length = loop.residual(trial), round(loop.period)
    count = left.size // length
    return np.asarray((left[: count * length] ** 2).reshape(count, length).sum(axis=1))


def _larger(first: FloatArray, second: FloatArray) -> float:
    """Mean difference of two series over its standard error."""
    difference = first - second
    spread = float(difference.std(ddof=1) / np.sqrt(difference.size))
    return float(difference.mean()) / spread if spread > 0 else 0.0
