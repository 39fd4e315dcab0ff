"""Results of a delay tracker: at one time, and over a record."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..._wording import in_time
from ...numerics.arrays import BoolArray, FloatArray, locked
from ...results import Flag, IntervalKind, ModelFit, Result


@dataclass(frozen=True, eq=False)
class TrackPoint(ModelFit):
    """Estimate of a delay tracker at one time.

    ``dead_time`` is ``delay * dt`` with the delay interpolated between samples; if `resolved` is
    true it lies inside ``interval``. Otherwise `reason` states what is missing,
    and the numbers are only the best guess.

    Attributes
    ----------
    time : float
        Time of the last sample in s, relative to the first one.
    delay : int
        Best delay in samples.
    dead_time : float
        Best dead time in s.
    interval : tuple of float
        In s: dead times with a probability of 95 %, and the change of the delay during the last
        forgetting time, because the estimate lags a moving delay by about that.
    delay_interval : tuple of int
        The same in whole samples, each of which stands for the dead times within half of one.
    lost : bool
        The residual is much larger than that of the model: the delay is outside of the candidates,
        the dynamics have changed too much, or another disturbance acts on the output.
        `DelayTracker.reset` restarts the tracker.
    gain_ratio, gain_std : float
        Gain relative to the starting model, and its standard deviation.
    pole_speed_ratios : tuple of float
        Speed of each real pole and pole pair, relative to the starting model; 1 is unchanged.
    noise_std : float
        Standard deviation of the residual.
    reason : str
    choices : tuple of str
    flags : tuple of Flag

    Examples
    --------
    >>> import control as ct
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> core = ct.ss([[0.9]], [[1.0]], [[0.1]], [[0.0]], 0.01)
    >>> u = np.repeat(np.random.default_rng(0).choice([-1.0, 1.0], 40), 25)
    >>> tracker = cr.DelayTracker(cr.DelayedStateSpace(core, 4), max_delay=20, forgetting_time=3.0)
    >>> for sample in zip(u, cr.DelayedStateSpace(core, 7).simulate(u)):
    ...     tracker.update(*sample)
    >>> now = tracker.estimate()
    >>> print(now.delay, now.delay_interval, now.interval, round(now.gain_ratio, 3))
    7 (6, 7) (0.055, 0.075) 0.996
    """

    time: float
    delay: int
    dead_time: float
    delay_interval: tuple[int, int]
    dt: float
    reason: str
    gain_ratio: float = 1.0
    gain_std: float = float("inf")
    pole_speed_ratios: tuple[float, ...] = ()
    noise_std: float = float("inf")
    lost: bool = False
    choices: tuple[str, ...] = ()
    flags: tuple[Flag, ...] = ()
    order = None
    records = ()

    @property
    def resolved(self) -> bool:
        """Whether the delay is known."""
        return not self.reason

    @property
    def interval_kind(self) -> IntervalKind:
        """``"tracked"``: for the samples within the forgetting time."""
        return "tracked"

    @property
    def residual_std(self) -> float:
        """The same as `noise_std`."""
        return self.noise_std

    _method = "tracked model"

    @property
    def interval(self) -> tuple[float, float]:
        """Interval of the dead time in s; a whole delay stands for those within half a sample."""
        low, high = self.delay_interval
        low_end, high_end = max(low - 0.5, 0.0) * self.dt, (high + 0.5) * self.dt
        return min(low_end, self.dead_time), max(high_end, self.dead_time)

    @property
    def dead_time_interval(self) -> tuple[float, float] | None:
        """The same as `interval`; None if the delay is not resolved."""
        return self.interval if self.resolved else None

    def _title(self) -> str:
        return f"Tracked delay at {self.time:.6g} s"

    def _rows(self) -> list[tuple[str, str]]:
        low, high = self.delay_interval
        ratio = f"{self.gain_ratio:.4g} +- {2 * self.gain_std:.2g}"
        return [
            ("delay", f"{self.delay} samples ({low} to {high}), {in_time(self.dead_time, 4)}"),
            ("gain", f"{ratio} times that of the initial model"),
            ("pole speed ratios", ", ".join(f"{s:.3g}" for s in self.pole_speed_ratios) or "kept"),
            ("residual std", f"{self.noise_std:.3g}"),
            ("resolved", "yes" if self.resolved else f"no: {self.reason}"),
        ]

    def __repr__(self) -> str:
        reason = "" if self.resolved else f", not resolved: {self.reason}"
        return f"<TrackPoint {self.delay} {self.delay_interval} at {self.time:.6g} s{reason}>"


@dataclass(frozen=True, eq=False)
class TrackHistory(Result):
    """History of a tracked delay: all arrays have one entry for each time in `time`.

    Where ``resolved`` is false there is no estimate; `low` and `high` are then only the candidates
    that remain.

    Attributes
    ----------
    time : ndarray, shape (K,)
        From the first sample, in s.
    dead_time : ndarray, shape (K,)
        In s, interpolated between samples.
    low, high : ndarray, shape (K,)
        Ends of the 95 % interval in s.
    gain_ratio : ndarray, shape (K,)
        Gain relative to that of the starting model.
    resolved : ndarray of bool, shape (K,)
        Whether the samples within the forgetting time determine the delay.
    lost : ndarray of bool, shape (K,)
        Where the residual was much larger than that of the model, see `TrackPoint`.
    dt : float
        Sample time in s.

    Examples
    --------
    >>> import control as ct
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> core = ct.ss([[0.9]], [[1.0]], [[0.1]], [[0.0]], 0.01)
    >>> u = np.repeat(np.random.default_rng(0).choice([-1.0, 1.0], 40), 25)
    >>> record = cr.Record(0.01 * np.arange(u.size), u, cr.DelayedStateSpace(core, 7).simulate(u))
    >>> tracker = cr.DelayTracker(cr.DelayedStateSpace(core, 4), max_delay=20, forgetting_time=3.0)
    >>> track = tracker.track(record)
    >>> print(track.time[[0, 20, -1]], track.resolved[[0, 20, -1]], track.delay[[0, 20, -1]])
    [0.05 1.25 9.95] [False False  True] [0.         7.8695741  6.97755342]
    """

    time: FloatArray
    dead_time: FloatArray
    low: FloatArray
    high: FloatArray
    gain_ratio: FloatArray
    resolved: BoolArray
    lost: BoolArray
    dt: float

    @property
    def delay(self) -> FloatArray:
        """Delay in samples, not rounded."""
        return self.dead_time / self.dt

    _heading = "Tracked delay"

    def _rows(self) -> list[tuple[str, str]]:
        resolved = np.flatnonzero(self.resolved)
        share = f"{resolved.size} of {self.time.size} points"
        if self.lost.any():
            share += f", track lost at {int(self.lost.sum())}"
        if resolved.size == 0:
            return [("resolved", share)]
        first, last = resolved[0], resolved[-1]
        return [
            ("resolved", share),
            ("first", f"{self.delay[first]:.2f} samples at {self.time[first]:.6g} s"),
            ("last", f"{self.delay[last]:.2f} samples at {self.time[last]:.6g} s"),
            ("gain", f"{self.gain_ratio[first]:.4g} to {self.gain_ratio[last]:.4g}"),
        ]

    def __repr__(self) -> str:
        return f"<TrackHistory: {self.time.size} points, resolved at {int(self.resolved.sum())}>"


def track_of(points: Sequence[TrackPoint], dt: float) -> TrackHistory:
    """Collect single estimates in the arrays of a history."""
    names = ("time", "dead_time", "gain_ratio", "resolved", "lost")
    found = {name: locked(np.array([getattr(one, name) for one in points])) for name in names}
    ends = np.array([one.interval for one in points])
    return TrackHistory(low=locked(ends[:, 0]), high=locked(ends[:, 1]), dt=dt, **found)
