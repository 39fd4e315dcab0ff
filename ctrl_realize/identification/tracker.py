"""Gain, dynamics and dead time of a running plant, followed sample by sample."""

from __future__ import annotations

from collections import deque
from dataclasses import replace

import control as ct
import numpy as np

from ..delayed import DelayedStateSpace
from ..errors import DataError
from ..numerics.arrays import FloatArray
from ..numerics.blas_threads import single_threaded
from ..numerics.pole_moves import Core, Direction, moved_core, pole_directions, sensitivity_system
from ..numerics.recursive import DelayBank
from ..numerics.running_residual import RunningResidual
from ..numerics.time_axis import EXTREME
from ..signals import Record
from ..signals.given import check_complete
from .tracked import DelayTrack, TrackedDelay, track_of
from .tracker_checks import check_candidates, check_memory, check_start
from .tracker_solution import LinearisedBank, Solution, solve

MOMENTS = 50
"""Estimates made in one memory."""
RUN_IN = 2
"""Memories that a renewed bank takes before it is asked."""
MOVED, LEAP = 0.04, 0.5
"""Relative move of a pole from which the bank is renewed, and the largest that is then made."""
CLEAR_MOVE = 4.0
"""Standard deviations that such a move must have."""
SAMPLES_EACH = 10
"""Samples for each parameter, behind the largest delay, before anything is solved."""


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
    Multiple-model estimation of a delay on line after Tuch, Feuer and Palmor (1994) and
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
        self._low, self._high = check_candidates(min_delay, max_delay)
        self.dt = float(core.dt)
        self._span = check_memory(memory, self.dt, self._high)
        self._forgetting = float(np.exp(-1.0 / self._span))
        self._stride = max(1, round(self._span / MOMENTS))
        self._zeros = np.asarray(core.zeros(), dtype=np.complex128)
        matrices = (core.A, core.B[:, 0], core.C[0], float(core.D[0, 0]))
        directions = pole_directions(core.poles(), self.dt) if dynamics else []
        self._now = self._linearised(matrices, directions, np.zeros(len(directions)))
        self._next: LinearisedBank | None = None
        self._count = 0
        self._first = (0.0, 0.0)
        self._residual = RunningResidual(self._forgetting)
        # The last moment at which the sums were solved.
        self._variance = 0.0
        self._solution: Solution | None = None
        self._told = self._nothing_yet()
        # Delays of the last memory, NaN where nothing was told.
        self._places: deque[float] = deque(maxlen=MOMENTS)

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
            A value that is no number, not finite, or beyond 1e70.
        """
        try:
            if np.ndim(u) or np.ndim(y):
                raise TypeError
            u, y = float(u), float(y)
        except (TypeError, ValueError):
            raise DataError(
                f"sample {self._count} is u={u!r}, y={y!r}; needed is one number each (run takes "
                "a whole record)"
            ) from None
        if not (np.isfinite(u) and np.isfinite(y)):
            raise DataError(f"sample {self._count} is u={u}, y={y}; needed are finite numbers")
        if max(abs(u), abs(y)) > EXTREME:
            raise DataError(
                f"sample {self._count} is u={u:g}, y={y:g}; beyond {EXTREME:g}, where squares "
                "overflow, there is no measurement"
            )
        if self._count == 0:
            # What was before is rest; large offsets would cost digits.
            self._first = (u, y)
        self._count += 1
        moved, seen = u - self._first[0], y - self._first[1]
        self._now.bank.update(moved, seen)
        if self._next is not None:
            self._next.bank.update(moved, seen)
            self._renew(self._next)
        if self._solution is not None:
            reply = self._now.bank.predict(self._solution.delay, self._solution.theta)
            self._residual.add(seen - self._solution.offset - reply)
        if self._count % self._stride == 0:
            self._residual.close_sum()
            self._keep(self._solve())

    def estimate(self) -> TrackedDelay:
        """Tell what the samples so far say; asking changes nothing."""
        return self._latest()[1]

    @property
    def model(self) -> DelayedStateSpace:
        """Model of the present estimate, which is its `fit`; zeros as in the starting model."""
        found, told = self._latest()
        core = self._now.core
        if found is not None and found.gain:
            made = moved_core(core, self._zeros, self._now.directions, found.moves, self.dt)
            core = core if made is None else made[0]
        A, B, C, D = core
        gain = told.gain_ratio
        return DelayedStateSpace(
            ct.ss(A, B[:, None], gain * C[None], gain * D, self.dt), told.delay, fit=told
        )

    @single_threaded
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
        return track_of(course, self.dt)

    def _linearised(
        self, core: Core, directions: list[Direction], moved: FloatArray
    ) -> LinearisedBank:
        system = sensitivity_system(*core, directions)
        bank = DelayBank(*system, self._low, self._high, self._forgetting)
        return LinearisedBank(bank, core, directions, moved)

    def _renew(self, fresh: LinearisedBank) -> None:
        """Let a bank that is run in count from its first whole sample, and then take over."""
        if self._count == fresh.begin:
            fresh.bank.restart()
        if self._count >= fresh.begin + RUN_IN * self._span:
            self._now, self._next, self._solution = fresh, None, None

    def _solve(self) -> Solution | None:
        """Solve for what the samples so far say; None while there are too few."""
        if self._count < self._high + SAMPLES_EACH * self._now.n_parameters:
            return None
        return solve(self._now, self._variance, self._residual.inflation)

    def _latest(self) -> tuple[Solution | None, TrackedDelay]:
        """Return what holds now: what was kept, where no sample has come since."""
        if self._count % self._stride == 0:
            return self._solution, self._told
        found = self._solve()
        return found, self._tell(found)

    def _keep(self, found: Solution | None) -> None:
        """Go on from what was found, and start a bank about moved poles where they have moved."""
        self._told = self._tell(found)
        self._places.append(self._told.dead_time / self.dt if self._told.tells else np.nan)
        if found is None:
            return
        self._solution, self._variance = found, found.variance
        if self._next is None:
            self._follow_poles(found)

    def _follow_poles(self, found: Solution) -> None:
        """Start a bank about the moved poles, to take over when it has seen enough."""
        now = self._now
        clear = np.abs(found.moves) > np.maximum(MOVED, CLEAR_MOVE * found.move_std)
        if not np.any(clear) or not found.sees_reply:
            return
        step = np.clip(np.where(clear, found.moves, 0.0), -LEAP, LEAP)
        made = moved_core(now.core, self._zeros, now.directions, step, self.dt)
        if made is None:
            return
        fresh = self._linearised(*made, now.moved + step)
        wait = fresh.bank.settling()
        if wait is not None:
            self._next = replace(fresh, begin=self._count + wait + self._high + 1)

    def _nothing_yet(self) -> TrackedDelay:
        low = self._low
        return TrackedDelay(
            time=max(self._count - 1, 0) * self.dt,
            delay=low,
            dead_time=low * self.dt,
            interval=(low, self._high),
            gain_ratio=1.0,
            gain_std=np.inf,
            speed_ratios=(),
            noise_std=np.inf,
            tells=False,
            reason=f"only {self._count} samples yet" if self._count else "no samples yet",
        )

    def _tell(self, found: Solution | None) -> TrackedDelay:
        if found is None:
            return self._nothing_yet()
        return TrackedDelay(
            time=(self._count - 1) * self.dt,
            delay=found.delay,
            dead_time=found.place * self.dt,
            interval=self._with_trail(found.interval, found.place),
            gain_ratio=found.gain,
            gain_std=found.gain_std,
            speed_ratios=found.speed_ratios,
            noise_std=float(np.sqrt(found.variance)),
            tells=not found.reason,
            reason=found.reason,
        )

    def _with_trail(self, interval: tuple[int, int], place: float) -> tuple[int, int]:
        """Widen an interval by the way that the delay has gone within one memory.

        Samples are one memory old on average, so while the delay moves the estimate is behind by
        about that way.
        """
        before = self._places[0] if self._places else np.nan
        way = 0.0 if np.isnan(before) else place - before
        low = max(interval[0] + int(np.floor(min(way, 0.0))), self._low)
        return low, min(interval[1] + int(np.ceil(max(way, 0.0))), self._high)
