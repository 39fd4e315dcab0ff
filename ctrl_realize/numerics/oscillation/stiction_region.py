"""Confidence region of S and J in a Hammerstein model of a loop.

S is a threshold: the error changes with it only where a slip comes a sample earlier or later. The
likelihood ratio of a threshold, n log(error / smallest error), is below 7.35 at the truth in 95 %
[1]_; for other parameters, as J, this is on the safe side. n is divided by the correlation time of
the residual, the sum of its autocorrelation function up to the first zero. Where that is above 2,
valve or process are not those of the model, and the statistics are void; then all pairs with an
error up to 10 % larger are taken, which is our own and no confidence region. The region is grown
on a grid from the best pair; its ends are those of the cells about the pairs that are below.

References
----------
.. [1] B. E. Hansen, Sample splitting and threshold estimation, Econometrica 68 (2000) 575-603,
   table I, doi:10.1111/1468-0262.00124.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import compress

import numpy as np

from ..arrays import FloatArray
from ..signals.correlation import correlation
from .stiction_model import StickingLoop, Trial

THRESHOLD = 7.35
INDEPENDENT = 2.0
"""Correlation time of the residual in samples, up to which the intervals are those of 95 %."""
_ALIKE = 1.1
_STICK, _JUMP = 0.016, 0.12
"""Cells of the first grid: of S over the swing, of J over S."""
_FEWEST_CELLS, _MOST_CELLS, _HALVINGS = 5, 400, 2
_NEIGHBOURS = [(i, j) for i in range(-2, 3) for j in range(-2, 3) if (i, j) != (0, 0)]


class Region:
    """Pairs of S and J about the best one that fit about as well."""

    def __init__(self, loop: StickingLoop, best: Trial, swing: float) -> None:
        self.loop, self.best = loop, best
        left = loop.residual(best)
        self.correlation_time = correlation_time(left)
        self.limit = float(np.exp(THRESHOLD * self.correlation_time / left.size))
        if self.correlation_time > INDEPENDENT:
            self.limit = max(self.limit, _ALIKE)
        self.cell = (_STICK * swing, _JUMP * best.stick)
        for halved in range(_HALVINGS + 1):
            self.inside = self._grown()
            sticks = {round(one.stick / self.cell[0]) for one in self.inside}
            jumps = {round(one.jump / self.cell[1]) for one in self.inside}
            fine = len(sticks) >= _FEWEST_CELLS, len(jumps) >= _FEWEST_CELLS
            if halved == _HALVINGS or all(fine) or len(self.inside) > _MOST_CELLS / 4:
                break
            stick, jump = self.cell
            self.cell = (stick if fine[0] else 0.5 * stick, jump if fine[1] else 0.5 * jump)

    def ends(self, others: Sequence[Trial]) -> tuple[tuple[float, float], tuple[float, float]]:
        """Ends of S and of J; `others` were tried elsewhere."""
        found = self.inside + [one for one in others if self._is_inside(one)]
        sticks, jumps = [one.stick for one in found], [one.jump for one in found]
        low, high = min(sticks) - self.cell[0], max(sticks) + self.cell[0]
        least, most = max(min(jumps) - self.cell[1], 0.0), min(max(jumps) + self.cell[1], high)
        return (float(max(low, 0.0)), float(high)), (float(least), float(most))

    def _grown(self) -> list[Trial]:
        known: dict[tuple[int, int], Trial] = {(0, 0): self.best}
        center, fresh = self.best, {(0, 0)}
        while fresh and len(known) < _MOST_CELLS:
            wanted = {(i + di, j + dj) for i, j in fresh for di, dj in _NEIGHBOURS} - known.keys()
            places = sorted(wanted)
            table = np.array(places, dtype=np.float64).reshape(-1, 2)
            sticks = center.stick + self.cell[0] * table[:, 0]
            jumps = center.jump + self.cell[1] * table[:, 1]
            inside = (jumps >= 0) & (jumps <= sticks)
            if not inside.any():
                break
            best, period = self.best, self.loop.period
            lags = sorted({*near(best.lag, 1.1, period), *near(best.lag, 1.25, period)})
            delays = near_delays(self.loop, best.delay, 2)
            trials = self.loop.best(sticks[inside], jumps[inside], lags, delays, [best.start])
            tried = dict(zip(compress(places, inside), trials, strict=True))
            known |= tried
            self.best = min(self.best, *trials)
            fresh = {place for place, one in tried.items() if self._is_inside(one)}
        return [one for one in known.values() if self._is_inside(one)]

    def _is_inside(self, trial: Trial) -> bool:
        return trial.error <= self.limit * self.best.error


def near(lag: float, factor: float, period: float) -> list[float]:
    """Lags about one; above zero at least a little of the period."""
    if np.isinf(lag):
        return [lag]
    return [0.0, 0.02 * period] if lag == 0 else [lag / factor, lag, lag * factor]


def near_delays(loop: StickingLoop, delay: int, reach: int) -> list[int]:
    """Delays about one."""
    return list(range(max(delay - reach, 0), min(delay + reach, loop.longest) + 1))


def correlation_time(residual: FloatArray) -> float:
    """Sum of the autocorrelation function over all lags up to the first zero, at least 1."""
    rho = correlation(residual, residual, min(residual.size // 4, 1000))
    below = np.flatnonzero(rho <= 0)
    last = int(below[0]) if below.size else rho.size
    return float(max(1 + 2 * rho[1:last].sum(), 1.0))
