"""On-line tracking of gain, dynamics and dead time of a running plant."""

from __future__ import annotations

from collections import deque

import control as ct
import numpy as np

from ..._checks import positive
from ...data import Record
from ...delayed import DelayedStateSpace
from ...errors import DataError, UnsuitableSystemError
from ...numerics.blas_threads import single_threaded
from ...numerics.regression.recursive import RunningResidual
from .banks import Banks, Start
from .checks import (
    check_candidates,
    check_forgetting_time,
    check_record,
    check_sample,
    model_noise,
    starting_core,
)
from .estimate import EXCESS, EXCESS_AFTER_MOVES, Solution, excess_residual, solve
from .results import TrackHistory, TrackPoint, track_of

MOMENTS = 50
"""Number of estimates per forgetting time."""
SAMPLES_EACH = 10
"""Samples for each parameter, after the largest delay, before the first estimate."""
SHARE_OF_LAG = 20
"""Fraction of the slowest lag over which the noise of the residual is measured if nothing else is
known about it: the error of a wrong model hardly changes within it."""


class DelayTracker:
    """Track dead time, gain and pole speeds of a plant sample by sample.

    Starting from a model of the plant (from `identify`, for instance), recursive least squares with
    exponential forgetting are computed for every candidate delay, with gain, offset and the speeds
    (and dampings) of the poles as parameters. The candidates share one set of regressors, so the
    cost of a sample is constant, with a few operations for each candidate.

    Parameters
    ----------
    model : control.StateSpace
        Starting model: one input, one output, discrete, not unstable. Its delay is not used.
    max_delay, min_delay : int
        Candidate delays, in samples.
    forgetting_time : float
        Time in s after which the weight of a sample has fallen to 1/e. Ten settling times or more
        include several moves of the input; the estimate lags a change by about this time.
    dynamics : bool, default True
        Estimate the poles too. For a plant with constant lags, False gives narrower intervals.
    noise_std : float, optional
        Standard deviation of the residual of the model. Default: that of the model's `fit`, or else
        the smallest residual observed while the delay was resolved. If the residual is three times
        as large, the track is lost.
    drift_time : float, optional
        Time constant in s of a high-pass filter on input and output, for outputs with a drifting
        disturbance (a random walk). Changes within this time are kept: the sum of the plant's lags
        is a good choice. Without it, a drift of three times the noise is taken for a lost track. A
        model with an integrator needs it: what a load adds to its output does not die away.

    Raises
    ------
    UnsuitableSystemError
        A model with several channels, a continuous or an unstable one.
    DelayRangeError
        No candidates, or a forgetting time shorter than the largest of them.

    Notes
    -----
    On-line estimation of a delay as in [1]_ (for informative inputs see [2]_), here by a bank of
    candidates [3]_, each with least squares and a forgetting factor [4]_. The regressors are
    simulated outputs, so noise does not bias the dynamics. The moves of the poles are linearised
    about a model that is renewed when a pole has moved by 4 % or more: a second bank then runs
    beside the first for at least two forgetting times before it replaces it. Until then the error
    of the delay may be a tenth of the lag per tenth of the pole's speed, and beyond 30 % no
    estimate is given. A delay outside of the candidates, poles that change abruptly and a drifting
    disturbance give a large residual: no estimate is given, and `TrackPoint.lost` is true until
    `reset`. The probabilities of delays treat exponentially weighted samples as whole ones, which
    is conservative, and reduce the number of samples if the residual is coloured.

    References
    ----------
    .. [1] J. Tuch, A. Feuer and Z. J. Palmor, Time delay estimation in continuous linear
       time-invariant systems, IEEE Trans. Automat. Control 39 (1994) 823-827.
    .. [2] Y. Orlov, L. Belkoura, J. P. Richard and M. Dambrine, On identifiability of linear
       time-delay systems, IEEE Trans. Automat. Control 47 (2002) 1319-1324,
       doi:10.1109/TAC.2002.801202.
    .. [3] D. T. Magill, Optimal adaptive estimation of sampled stochastic processes, IEEE Trans.
       Automat. Control 10 (1965) 434-439, doi:10.1109/TAC.1965.1098191.
    .. [4] L. Ljung, System Identification: Theory for the User, 2nd ed., Prentice Hall 1999,
       section 11.2 (recursive least squares).

    Examples
    --------
    >>> import control as ct
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> core = ct.ss([[0.9]], [[1.0]], [[0.1]], [[0.0]], 0.01)
    >>> worn = cr.DelayedStateSpace(core, 7)
    >>> u = np.repeat(np.random.default_rng(0).choice([-1.0, 1.0], 40), 25)
    >>> tracker = cr.DelayTracker(cr.DelayedStateSpace(core, 4), max_delay=20, forgetting_time=3.0)
    >>> for sample in zip(u, worn.simulate(u)):
    ...     tracker.update(*sample)
    >>> tracker.estimate().delay, tracker.estimate().resolved
    (7, True)
    """

    def __init__(
        self,
        model: ct.StateSpace,
        *,
        max_delay: int,
        forgetting_time: float,
        min_delay: int = 0,
        dynamics: bool = True,
        noise_std: float | None = None,
        drift_time: float | None = None,
    ) -> None:
        core = starting_core(model)
        self._low, self._high = check_candidates(min_delay, max_delay)
        self.dt = float(core.dt)
        self._span = check_forgetting_time(forgetting_time, self.dt, self._high)
        self._stride = max(1, round(self._span / MOMENTS))
        self._noise_std = model_noise(model, noise_std)
        self._keep_of_drift: float | None = None
        if drift_time is not None:
            passed = positive(drift_time, "drift_time", "time constant in s")
            self._keep_of_drift = float(np.exp(-self.dt / passed))
        self._dynamics = dynamics
        self._start = _parts(core)
        self._begin()

    def _begin(self) -> None:
        """Initialise for a core, without samples."""
        delays, fixed = (self._low, self._high), not self._dynamics
        self._banks = Banks(self._start, dt=self.dt, delays=delays, span=self._span, fixed=fixed)
        self._count = 0
        self._first = (0.0, 0.0)
        self._before, self._passed = (0.0, 0.0), (0.0, 0.0)
        # Smallest residual of the starting model over a forgetting time with a resolved delay.
        self._least = np.inf
        slowest = float(np.abs(np.linalg.eigvals(self._start[0][0])).max(initial=0.0))
        lag = -1 / np.log(slowest) if 0 < slowest < 1 else 1.0
        # Neighbouring noise samples may be correlated, by filters and converters.
        self._lag, self._well_sampled = lag, lag >= 3 * SHARE_OF_LAG
        self._residual = RunningResidual(
            float(np.exp(-1.0 / self._span)), max(1, round(min(lag, self._span) / SHARE_OF_LAG))
        )
        # Sample at which the sums were last solved.
        self._variance = 0.0
        self._solution: Solution | None = None
        self._point = self._point_of(None)
        # Delays within the last forgetting time; NaN where the delay was not resolved.
        self._recent_delays: deque[float] = deque(maxlen=MOMENTS)

    def __repr__(self) -> str:
        return (
            f"<DelayTracker: delays {self._low}...{self._high}, {self._count} samples, "
            f"{self._point!r}>"
        )

    def update(self, u: float, y: float) -> None:
        """Process the next sample of input and output.

        Raises
        ------
        DataError
            A value that is not a finite number, or is beyond 1e70.
        """
        u, y = check_sample(u, y, self._count)
        if self._count == 0:
            # Before the first sample: steady state; large offsets would cost digits.
            self._first = (u, y)
        self._count += 1
        moved, seen = u - self._first[0], y - self._first[1]
        if self._keep_of_drift is not None:
            moved, seen = self._high_passed(moved, seen, self._keep_of_drift)
        if self._banks.update(moved, seen, self._count):
            self._solution = None
        if self._solution is not None:
            response = self._banks.now.bank.predict(self._solution.delay, self._solution.theta)
            self._residual.add(seen - self._solution.offset - response)
        if self._count % self._stride == 0:
            self._residual.close_sum()
            self._keep(self._solve())

    def _high_passed(self, u: float, y: float, keep: float) -> tuple[float, float]:
        """Filter both signals by (1 - z^-1) / (1 - keep z^-1), which keeps their relation."""
        (u_before, y_before), (u_out, y_out) = self._before, self._passed
        self._before = u, y
        self._passed = keep * u_out + u - u_before, keep * y_out + y - y_before
        return self._passed

    def reset(self, model: ct.StateSpace | None = None) -> None:
        """Discard all samples and restart, if the track is lost or the plant was changed.

        Parameters
        ----------
        model : control.StateSpace, optional
            New starting model with the same sample time; default: the original one. Gain and speeds
            are relative to it.

        Raises
        ------
        UnsuitableSystemError
            A model with another sample time, or one that is not suitable for a tracker.
        """
        if model is not None:
            core = starting_core(model)
            if not np.isclose(core.dt, self.dt, rtol=1e-6, atol=0.0):
                raise UnsuitableSystemError(
                    f"the model has the sample time {core.dt:g} s, the tracker {self.dt:g} s"
                )
            self._noise_std = model_noise(model, None) or self._noise_std
            self._start = _parts(core)
        self._begin()

    def estimate(self) -> TrackPoint:
        """Return the present estimate; the state of the tracker is not changed."""
        return self._latest()[1]

    @property
    def model(self) -> DelayedStateSpace:
        """Present plant model, with the estimate as its `fit`; zeros are unchanged."""
        found, point = self._latest()
        A, B, C, D = self._banks.core_at(found)
        gain = point.gain_ratio
        core = ct.ss(A, B[:, None], gain * C[None], gain * D, self.dt)
        return DelayedStateSpace(core, point.delay, fit=point)

    @single_threaded
    def track(self, record: Record) -> TrackHistory:
        """Process a whole record, and return the history of the estimate.

        Raises
        ------
        DataError
            A record with several channels, missing samples, or another sample time.
        """
        check_record(record, self.dt)
        points: list[TrackPoint] = []
        for u, y in zip(record.input.ravel(), record.output.ravel(), strict=True):
            self.update(float(u), float(y))
            if self._count % self._stride == 0:
                points.append(self._point)
        if not points:
            raise DataError(
                f"the record has {record.n_samples} samples, fewer than the {self._stride} "
                "between two estimates"
            )
        return track_of(points, self.dt)

    def _solve(self) -> Solution | None:
        """Solve for the present estimate; None while there are too few samples."""
        if self._count < self._high + SAMPLES_EACH * self._banks.now.n_parameters:
            return None
        return solve(self._banks.now, self._variance, self._residual.inflation)

    def _latest(self) -> tuple[Solution | None, TrackPoint]:
        """Return the present solution: the stored one if no sample has been added since."""
        if self._count % self._stride == 0:
            return self._solution, self._point
        found = self._solve()
        return found, self._point_of(found)

    def _keep(self, found: Solution | None) -> None:
        """Update the state from a solution, and start a new bank if the poles have moved."""
        self._point = point = self._point_of(found)
        full = self._count >= self._span
        if found is not None and full and point.resolved and not self._banks.moved:
            self._least = min(self._least, float(np.sqrt(found.variance)))
        self._recent_delays.append(point.dead_time / self.dt if point.resolved else np.nan)
        if found is not None:
            self._solution, self._variance = found, found.variance
            self._banks.follow(found, self._count)

    def _point_of(self, found: Solution | None) -> TrackPoint:
        time, low = max(self._count - 1, 0) * self.dt, self._low
        if found is None:
            reason = f"only {self._count} samples yet" if self._count else "no samples yet"
            return TrackPoint(time, low, low * self.dt, (low, self._high), self.dt, reason)
        excess = self._excess_residual(found)
        return TrackPoint(
            time,
            found.delay,
            found.delay_estimate * self.dt,
            self._widened(found.interval, found.delay_estimate),
            self.dt,
            reason=found.reason or excess or self._banks.pending,
            gain_ratio=found.gain,
            gain_std=found.gain_std,
            pole_speed_ratios=found.pole_speed_ratios,
            noise_std=float(np.sqrt(found.variance)),
            lost=bool(excess),
        )

    def _excess_residual(self, found: Solution) -> str:
        """Report that the residual exceeds the noise of the model."""
        noise = self._noise_std or self._least
        moved = self._banks.moved
        if moved and not np.isfinite(noise) and self._well_sampled:
            noise = self._residual.noise_std
        # The noise observed so far may have been unusually small.
        limit = EXCESS_AFTER_MOVES if moved and noise != self._least else EXCESS
        return excess_residual(found, noise, limit)

    def _widened(self, interval: tuple[int, int], delay_estimate: float) -> tuple[int, int]:
        """Widen an interval by the change of the delay over one forgetting time, and for a pending
        move of the poles.

        The mean age of the samples is one forgetting time, so the estimate lags a moving delay by
        about this change.
        """
        before = self._recent_delays[0] if self._recent_delays else np.nan
        change = 0.0 if np.isnan(before) else delay_estimate - before
        off = abs(self._banks.step_made) * self._lag
        low = max(interval[0] + int(np.floor(min(change, 0.0) - off)), self._low)
        return low, min(interval[1] + int(np.ceil(max(change, 0.0) + off)), self._high)


def _parts(core: ct.StateSpace) -> Start:
    """Return the matrices of a core, and its zeros: a system itself cannot be pickled."""
    matrices = core.A, core.B[:, 0], core.C[0], float(core.D[0, 0])
    return matrices, np.asarray(core.zeros(), dtype=np.complex128)
