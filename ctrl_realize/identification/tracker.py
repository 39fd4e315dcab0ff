"""Gain, dynamics and dead time of a running plant, followed sample by sample."""

from __future__ import annotations

from collections import deque
from dataclasses import replace

import control as ct
import numpy as np

from ..checks import positive, whole
from ..delayed import DelayedStateSpace
from ..errors import DataError, DelayRangeError, OptionError, UnsuitableSystemError
from ..numerics.arrays import FloatArray, read_only
from ..numerics.recursive import DelayBank, pole_directions, sensitivity_system
from ..signals import Record
from ..signals.record import check_complete
from .tracked import DelayTrack, TrackedDelay

SPEED_STD = 0.3
"""How far a pole is expected to move: prior standard deviation of its relative speed."""
SIGNIFICANT = 16.0
"""Fall of the misfit in noise variances below which nothing was seen: four sigma."""

MOMENTS = 50
"""Estimates made in one memory."""


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
    bias the dynamics. Pole moves enter to first order about the starting model (at 10 % the
    delay is off by about one sample in a plant whose lags take 130): beyond 30 % nothing is
    claimed. Probabilities of delays count exponential weights as whole samples
    and correlation of the residual by its first lag, both on the safe side.

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
        _check_model(core)
        low = whole(min_delay, "min_delay", 0)
        high = whole(max_delay, "max_delay", 0)
        if high <= low:
            raise DelayRangeError(f"delays {low}...{high} leave nothing to choose from")
        self.dt = float(core.dt)
        span = positive(memory, "memory", "time in s") / self.dt
        if span <= high:
            raise DelayRangeError(
                f"memory={memory:g} s is {span:.4g} samples, and delays up to {high} samples are "
                "to be seen; needed is a longer memory"
            )
        self._core = core
        self._directions = pole_directions(core.poles(), self.dt) if dynamics else []
        system = sensitivity_system(
            core.A, core.B[:, 0], core.C[0], float(core.D[0, 0]), self._directions
        )
        self._bank = DelayBank(*system, low, high, float(np.exp(-1.0 / span)))
        self._stride = max(1, round(span / MOMENTS))
        self._count = 0
        self._first = (0.0, 0.0)
        self._variance = 0.0
        self._residuals = (0.0, 0.0, 0.0)  # last residual, sums of e[k]^2 and e[k] e[k-1]
        self._best: tuple[int, FloatArray, float] | None = None
        self._places: deque[float] = deque(maxlen=MOMENTS)
        self._told = TrackedDelay(
            0.0, low, low * self.dt, (low, high), 1.0, np.inf, (), np.inf, False, "no samples yet"
        )

    def update(self, u: float, y: float) -> None:
        """Take in the next sample of input and output.

        Raises
        ------
        DataError
            A value that is not finite.
        """
        if not (np.isfinite(u) and np.isfinite(y)):
            raise DataError(f"sample {self._count} is u={u}, y={y}; needed are finite numbers")
        if self._count == 0:
            # What was before is rest; large offsets would cost digits.
            self._first = (float(u), float(y))
        self._count += 1
        moved, seen = float(u) - self._first[0], float(y) - self._first[1]
        self._bank.update(moved, seen)
        if self._best is not None:
            delay, theta, offset = self._best
            error = seen - offset - self._bank.predict(delay, theta)
            last, squares, products = self._residuals
            keep = self._bank.forgetting
            self._residuals = (error, keep * squares + error**2, keep * products + error * last)
        if self._count % self._stride == 0:
            self._told = self._solve()
            told = self._told
            self._places.append(told.dead_time / self.dt if told.tells else np.nan)

    def estimate(self) -> TrackedDelay:
        """Solve for what the samples so far say."""
        return self._solve() if self._count else self._told

    @property
    def model(self) -> DelayedStateSpace:
        """The starting model with the delay and gain of the last estimate; its `fit` is that."""
        told = self.estimate()
        return DelayedStateSpace(self._core * told.gain_ratio, told.delay, fit=told)

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

    def _solve(self) -> TrackedDelay:
        bank = self._bank
        q = 1 + len(self._directions)
        if self._count < bank.high + 10 * q:
            return replace(
                self._told,
                time=(self._count - 1) * self.dt,
                reason=f"only {self._count} samples yet",
            )
        prior = np.eye(1, q)[0]
        spread = np.array([1.0, *(SPEED_STD for _ in self._directions)])
        found = bank.solve(prior, self._variance / spread**2)
        best = int(np.argmin(found.misfit))
        freedom = max(bank.weight**2 / bank.weight_squared - q - 1, 1.0)
        self._variance = found.misfit[best] / bank.weight * (1 + (q + 1) / freedom)
        self._best = (bank.low + best, found.theta[best], float(found.offset[best]))
        # Never below what sums of squares can resolve in double precision.
        noise = max(self._variance * self._inflation(), 1e-14 * found.power, 1e-300)
        distance = (found.misfit - found.misfit[best]) / noise
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
        ratios = tuple(
            float(np.exp(np.clip(move, -2, 2)))
            for (what, _, _), move in zip(self._directions, moves, strict=True)
            if what == "speed"
        )
        explained = float(found.power - found.misfit[best])
        reason = self._doubt(explained, noise, best, interval, gain, gain_std)
        place = bank.low + best + _fraction(found.misfit, best)
        moved = max((abs(np.log(ratio)) for ratio in ratios), default=0.0)
        if not reason and moved > SPEED_STD:
            reason = (
                f"a pole has moved by {100 * np.expm1(moved):.0f} %, too far for a first-order "
                "change of the starting model; start again from a new one"
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
        """Return by how much correlation of the residual lowers the number of samples."""
        _, squares, products = self._residuals
        if squares <= 0:
            return 1.0
        rho = float(np.clip(products / squares, 0.0, 0.99))
        return (1 + rho) / (1 - rho)

    def _with_trail(self, interval: tuple[int, int], place: float) -> tuple[int, int]:
        """Widen an interval by the way that the delay has gone within one memory.

        Samples are one memory old on average, so while the delay moves the estimate is behind by
        about that way.
        """
        before = self._places[0] if self._places else np.nan
        way = 0.0 if np.isnan(before) else place - before
        low = max(interval[0] + int(np.floor(min(way, 0.0))), self._bank.low)
        return low, min(interval[1] + int(np.ceil(max(way, 0.0))), self._bank.high)

    def _doubt(
        self,
        explained: float,
        noise: float,
        best: int,
        interval: tuple[int, int],
        gain: float,
        gain_std: float,
    ) -> str:
        """Say why the data cannot tell the delay; empty when they can."""
        bank = self._bank
        low, high = bank.low, bank.high
        if explained < SIGNIFICANT * noise:
            return "nothing moved within the memory that stands out of the noise"
        if abs(gain) < 3 * gain_std:
            return "the output does not follow the input"
        if low + best == high:
            return f"the best delay is max_delay={high}; try a larger one"
        if best == 0 and low > 0:
            return f"the best delay is min_delay={low}; try a smaller one"
        if interval[1] - interval[0] > (high - low) / 2:
            return f"any delay from {interval[0]} to {interval[1]} samples fits"
        return ""


def _fraction(misfit: FloatArray, best: int) -> float:
    """Return where a parabola through the least misfit and its neighbours is lowest, -0.5...0.5."""
    if not 0 < best < misfit.size - 1:
        return 0.0
    before, here, after = misfit[best - 1 : best + 2]
    bend = before - 2 * here + after
    return float(np.clip((before - after) / (2 * bend), -0.5, 0.5)) if bend > 0 else 0.0


def _check_model(core: ct.StateSpace) -> None:
    if not isinstance(core, ct.StateSpace) or not core.issiso():
        raise UnsuitableSystemError("the model to start from must be a system of one channel")
    if not core.isdtime(strict=True) or core.dt is True:
        raise UnsuitableSystemError(
            "the model to start from must be discrete, with its sample time"
        )
    worst = np.abs(core.poles()).max(initial=0.0)
    if worst > 1 + 1e-9:
        raise UnsuitableSystemError(
            f"the model to start from is unstable (a pole at |z| = {worst:.6g}), so its output "
            "cannot be followed by simulation"
        )
    if not np.any(core.C) and not np.any(core.D):
        raise OptionError("the model to start from is zero")
