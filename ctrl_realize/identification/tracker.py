"""Gain, dynamics and dead time of a running plant, followed sample by sample."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace

import control as ct
import numpy as np

from ..checks import positive, whole
from ..delayed import DelayedStateSpace
from ..errors import DataError, DelayRangeError, OptionError
from ..numerics.arrays import FloatArray, read_only
from ..numerics.pole_moves import Core, Direction, moved_core, pole_directions, sensitivity_system
from ..numerics.recursive import DelayBank
from ..numerics.time_axis import EXTREME
from ..signals import Record
from ..signals.given import check_complete
from .tracked import DelayTrack, TrackedDelay
from .tracker_checks import check_start, doubt, fraction

SPEED_STD = 0.3
"""How far a pole is expected to move: prior standard deviation of its relative speed."""
_LONGEST = 1e12
MOMENTS = 50
"""Estimates made in one memory."""
RUN_IN = 2
"""Memories that a renewed bank takes before it is asked."""
MOVED, LEAP = 0.04, 0.5
"""Relative move of a pole from which the bank is renewed, and the largest that is then made."""


@dataclass(frozen=True, eq=False)
class _Linearised:
    """A bank of delays about one set of poles, `moved` from those of the starting model.

    Its sums begin at the sample `begin`.
    """

    bank: DelayBank
    core: Core
    directions: list[Direction]
    moved: FloatArray
    begin: int = 0


class DelayTracker:
    """Follow a plant's dead time, gain and pole speeds from its samples as they come.

    Starting from a model of the plant (as `identify` gives it), every candidate delay has its own
    least squares with forgetting; gain, offset and the speeds (and dampings) of the poles are
    free in each. The candidates share one set of regressors, so a sample costs the same
    whatever came before, and a few operations for each candidate.

    Parameters
    ----------
    model : control.StateSpace
        Model to start from: one input, one output, discrete, not unstable. Its own delay does
        not matter.
    max_delay, min_delay : int
        Candidates, in samples.
    memory : float
        Time in s after which a sample counts for 1/e. Ten settling times or more see several
        moves of the input; the estimate trails a change by about as much.
    dynamics : bool, default True
        Let the poles move. A plant of fixed lags is followed more sharply without.

    Raises
    ------
    UnsuitableSystemError
        A model with several channels, a continuous or an unstable one.
    DelayRangeError
        No candidates, or a memory shorter than the largest of them.

    Notes
    -----
    Multiple-model estimation of a delay on line in the row of Tuch, Feuer and Palmor (1994) and
    Orlov et al. (2002). The regressors are simulated, not measured, outputs, so noise does not
    bias the dynamics. Pole moves enter to first order about a model that is renewed when a pole
    has moved by 4 % or more: a second bank then runs beside the first for two memories and
    more, and takes over. Until then the delay may be off by a tenth of the lag per tenth of a
    pole's speed, and beyond 30 % nothing is claimed. Probabilities of delays count exponential
    weights as whole samples, which is on the safe side, and a residual that is slower than
    white as fewer of them.

    Examples
    --------
    >>> import control as ct
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> core = ct.ss([[0.9]], [[1.0]], [[0.1]], [[0.0]], 0.01)
    >>> worn = cr.DelayedStateSpace(core, 7)
    >>> u = np.repeat(np.random.default_rng(0).choice([-1.0, 1.0], 40), 25)
    >>> tracker = cr.DelayTracker(cr.DelayedStateSpace(core, 4), max_delay=20, memory=3.0)
    >>> for sample in zip(u, worn.simulate(u)):
    ...     tracker.update(*sample)
    >>> tracker.estimate().delay, tracker.estimate().tells
    (7, True)
    """

    def __init__(
        self,
        model: ct.StateSpace,
        *,
        max_delay: int,
        memory: float,
        min_delay: int = 0,
        dynamics: bool = True,
    ) -> None:
        core = model.delay_free if isinstance(model, DelayedStateSpace) else model
        check_start(core)
        low = whole(min_delay, "min_delay", 0)
        high = whole(max_delay, "max_delay", 0)
        if high <= low:
            raise DelayRangeError(f"delays {low}...{high} leave nothing to choose from")
        self.dt = float(core.dt)
        span = positive(memory, "memory", "time in s") / self.dt
        if span > _LONGEST:
            raise OptionError(
                f"memory={memory:g} s is {span:.4g} samples; needed are at most {_LONGEST:g}"
            )
        if span <= high:
            raise DelayRangeError(
                f"memory={memory:g} s is {span:.4g} samples, and delays up to {high} samples are "
                "to be seen; needed is a longer memory"
            )
        self._low, self._high, self._span = low, high, span
        self._count = 0
        self._zeros = np.asarray(core.zeros(), dtype=np.complex128)
        matrices = (core.A, core.B[:, 0], core.C[0], float(core.D[0, 0]))
        directions = pole_directions(core.poles(), self.dt) if dynamics else []
        self._now = self._linearised(matrices, directions, np.zeros(len(directions)))
        self._next: _Linearised | None = None
        self._stride = max(1, round(span / MOMENTS))
        self._first = (0.0, 0.0)
        self._variance = 0.0
        self._move_std = np.full(len(directions), np.inf)
        # The residual summed since the last estimate; weighted sums of its squares, and of the
        # squares of its sums from estimate to estimate.
        self._residuals = (0.0, 0.0, 0.0)
        self._best: tuple[int, FloatArray, float] | None = None
        self._places: deque[float] = deque(maxlen=MOMENTS)
        self._told = TrackedDelay(
            0.0, low, low * self.dt, (low, high), 1.0, np.inf, (), np.inf, False, "no samples yet"
        )

    def __repr__(self) -> str:
        return (
            f"<DelayTracker: delays {self._low}...{self._high}, {self._count} samples, "
            f"{self._told!r}>"
        )

    def update(self, u: float, y: float) -> None:
        """Take in the next sample of input and output.

        Raises
        ------
        DataError
            A value that is not finite, or beyond 1e70.
        """
        if not (np.isfinite(u) and np.isfinite(y)):
            raise DataError(f"sample {self._count} is u={u}, y={y}; needed are finite numbers")
        if max(abs(u), abs(y)) > EXTREME:
            raise DataError(
                f"sample {self._count} is u={u:g}, y={y:g}; beyond {EXTREME:g}, where squares "
                "overflow, there is no measurement"
            )
        if self._count == 0:
            # What was before is rest; large offsets would cost digits.
            self._first = (float(u), float(y))
        self._count += 1
        moved, seen = float(u) - self._first[0], float(y) - self._first[1]
        self._now.bank.update(moved, seen)
        if self._next is not None:
            self._next.bank.update(moved, seen)
            if self._count == self._next.begin:
                self._next.bank.restart()
            if self._count >= self._next.begin + RUN_IN * self._span:
                self._now, self._next, self._best = self._next, None, None
        if self._best is not None:
            delay, theta, offset = self._best
            error = seen - offset - self._now.bank.predict(delay, theta)
            keep = self._now.bank.forgetting
            run, squares, blocks = self._residuals
            self._residuals = (run + error, keep * squares + error**2, keep * blocks)
        if self._count % self._stride == 0:
            run, squares, blocks = self._residuals
            self._residuals = (0.0, squares, blocks + run**2)
            self._told = self._solve()
            told = self._told
            self._places.append(told.dead_time / self.dt if told.tells else np.nan)
            self._follow_poles()

    def estimate(self) -> TrackedDelay:
        """Solve for what the samples so far say."""
        return self._solve() if self._count else self._told

    @property
    def model(self) -> DelayedStateSpace:
        """Model of the last estimate, which is its `fit`; zeros as in the starting model."""
        told = self.estimate()
        now = self._now
        made = None
        if self._best is not None and told.gain_ratio:
            moves = self._best[1][1:] / told.gain_ratio
            made = moved_core(now.core, self._zeros, now.directions, moves, self.dt)
        A, B, C, D = now.core if made is None else made[0]
        core = ct.ss(A, B[:, None], told.gain_ratio * C[None], told.gain_ratio * D, self.dt)
        return DelayedStateSpace(core, told.delay, fit=told)

    def run(self, record: Record) -> DelayTrack:
        """Take in a whole record, and return the course of the estimate.

        Raises
        ------
        DataError
            A record with several channels, missing samples, or another sample time.
        """
        check_complete(record, "DelayTracker.run")
        if not record.issiso:
            raise DataError(f"{record!r} has several channels; needed is one input and one output")
        if not np.isclose(record.dt, self.dt, rtol=1e-3, atol=0):
            raise DataError(
                f"the record has the sample time {record.dt:g} s, the model {self.dt:g} s"
            )
        course: list[TrackedDelay] = []
        for u, y in zip(record.input.ravel(), record.output.ravel(), strict=True):
            self.update(float(u), float(y))
            if self._count % self._stride == 0:
                course.append(self._told)
        if not course:
            raise DataError(
                f"the record has {record.n_samples} samples, fewer than the {self._stride} "
                "between two estimates"
            )
        return DelayTrack(
            time=read_only(np.array([t.time for t in course])),
            dead_time=read_only(np.array([t.dead_time for t in course])),
            low=read_only(np.array([t.interval[0] for t in course], dtype=np.float64)),
            high=read_only(np.array([t.interval[1] for t in course], dtype=np.float64)),
            gain_ratio=read_only(np.array([t.gain_ratio for t in course])),
            tells=np.array([t.tells for t in course]),
            dt=self.dt,
        )

    def _linearised(
        self, core: Core, directions: list[Direction], moved: FloatArray
    ) -> _Linearised:
        bank = DelayBank(
            *sensitivity_system(*core, directions),
            self._low,
            self._high,
            float(np.exp(-1.0 / self._span)),
        )
        return _Linearised(bank, core, directions, moved)

    def _follow_poles(self) -> None:
        """Start a bank about the moved poles, to take over when it has seen enough."""
        now = self._now
        if self._next is not None or self._best is None or not now.directions:
            return
        theta = self._best[1]
        moves = theta[1:] / theta[0] if theta[0] else np.zeros(theta.size - 1)
        clear = np.abs(moves) > np.maximum(MOVED, 4 * self._move_std)
        if not np.any(clear) or self._told.reason.startswith(("nothing", "the output")):
            return
        step = np.clip(np.where(clear, moves, 0.0), -LEAP, LEAP)
        made = moved_core(now.core, self._zeros, now.directions, step, self.dt)
        if made is not None:
            fresh = self._linearised(*made, now.moved + step)
            wait = fresh.bank.settling()
            if wait is not None:
                self._next = replace(fresh, begin=self._count + wait + self._high + 1)

    def _solve(self) -> TrackedDelay:
        now = self._now
        bank = now.bank
        q = 1 + len(now.directions)
        if self._count < bank.high + 10 * q:
            return replace(
                self._told,
                time=(self._count - 1) * self.dt,
                reason=f"only {self._count} samples yet",
            )
        prior = np.eye(1, q)[0]
        spread = np.array([1.0, *(SPEED_STD for _ in now.directions)])
        found = bank.solve(prior, self._variance / spread**2)
        best = int(np.argmin(found.misfit))
        freedom = max(bank.weight**2 / bank.weight_squared - q - 1, 1.0)
        self._variance = found.misfit[best] / bank.weight * (1 + (q + 1) / freedom)
        self._best = (bank.low + best, found.theta[best], float(found.offset[best]))
        # Never below what sums of squares can resolve in double precision.
        noise = max(self._variance * self._inflation(), 1e-14 * found.power, 1e-300)
        # beyond a thousand nothing is left of a chance, and the quotient might overflow
        distance = np.minimum(found.misfit - found.misfit[best], 1e3 * noise) / noise
        chance = np.exp(-distance / 2)
        below = np.cumsum(chance) / chance.sum()
        interval = (
            bank.low + int(np.searchsorted(below, 0.025)),
            bank.low + min(int(np.searchsorted(below, 0.975)), below.size - 1),
        )
        theta = found.theta[best]
        gain_std = float(np.sqrt(noise * found.inverse[best, 0, 0]))
        gain = float(theta[0])
        moves = theta[1:] / gain if gain else np.zeros(q - 1)
        spreads = noise * np.diag(found.inverse[best])[1:]
        self._move_std = np.sqrt(spreads) / abs(gain) if gain else np.full(q - 1, np.inf)
        speeds = [i for i, (what, _, _) in enumerate(now.directions) if what == "speed"]
        ratios = tuple(float(np.exp(now.moved[i] + np.clip(moves[i], -2, 2))) for i in speeds)
        clear = gain / gain_std if gain_std > 0 else np.inf
        explained = float(found.power - found.misfit[best])
        reason = doubt(explained / noise, clear, bank.low + best, interval, (self._low, self._high))
        place = bank.low + best + fraction(found.misfit, best)
        moved = float(np.abs(moves[speeds]).max(initial=0.0))
        if not reason and moved > SPEED_STD:
            reason = (
                f"a pole has moved by {100 * np.expm1(moved):.0f} %, too far for the model that "
                "changes are counted from; it is being renewed"
            )
        return TrackedDelay(
            time=(self._count - 1) * self.dt,
            delay=bank.low + best,
            dead_time=place * self.dt,
            interval=self._with_trail(interval, place),
            gain_ratio=gain,
            gain_std=gain_std,
            speed_ratios=ratios,
            noise_std=float(np.sqrt(self._variance)),
            tells=not reason,
            reason=reason,
        )

    def _inflation(self) -> float:
        """Return by how much correlation of the residual lowers the number of samples.

        Sums of B white samples have B times the variance of one; slow errors of the model show
        in the sums long before they show from sample to sample.
        """
        _, squares, blocks = self._residuals
        return max(blocks / squares, 1.0) if squares > 0 else 1.0

    def _with_trail(self, interval: tuple[int, int], place: float) -> tuple[int, int]:
        """Widen an interval by the way that the delay has gone within one memory.

        Samples are one memory old on average, so while the delay moves the estimate is behind by
        about that way.
        """
        before = self._places[0] if self._places else np.nan
        way = 0.0 if np.isnan(before) else place - before
        low = max(interval[0] + int(np.floor(min(way, 0.0))), self._low)
        return low, min(interval[1] + int(np.ceil(max(way, 0.0))), self._high)
