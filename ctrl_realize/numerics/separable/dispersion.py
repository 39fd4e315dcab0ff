"""The axial-dispersion model (inverse-Gaussian residence time): its modal responses and its fit.

With convection and diffusion, residence times in a pipe or a packed bed have an inverse Gaussian
distribution [1]_, [2]_: with a mean m and a standard deviation c m the transfer function is

    exp((1 - sqrt(1 + 2 c^2 m s)) / c^2),

and 2/c^2 is the Peclet number. Three or four lags with a longer dead time have the same response to
within the noise, which no residual shows; in a fit to the same record, dispersion needs two
parameters instead of four. There may be one lag in series, as of a sensor.

References
----------
.. [1] O. Levenspiel, Chemical Reaction Engineering, 3rd ed., Wiley 1999, chapter 13 (The dispersion
   model).
.. [2] J. L. Folks and R. S. Chhikara, The inverse Gaussian distribution and its statistical
   application - a review, J. Roy. Statist. Soc. B 40 (1978) 263-289.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.special import wofz

from ..arrays import ComplexArray, FloatArray
from .lag_chains import time_moments
from .profile_ends import solve_ends
from .responses import StepSequence
from .structures import PLAUSIBLE, Candidate, Scales
from .varpro import Problem, partial_fractions


def flow_modes(
    time: FloatArray, mean: float, spread: float, poles: ComplexArray
) -> tuple[FloatArray, ComplexArray]:
    r"""Step response of dispersion, and responses of modes in series with it.

    Parameters
    ----------
    time : ndarray, shape (m,)
        Time since the start of the flow, in s; positive.
    mean, spread : float
        Mean residence time in s, and its standard deviation over the mean.
    poles : ndarray, shape (J,)
        In 1/s.

    Returns
    -------
    passed : ndarray, shape (m,)
        Fraction that has left the pipe.
    modes : ndarray, shape (m, J)
        exp(p t) in series with dispersion: the integral of exp(p (t - s)) over the residence times
        s.

    Notes
    -----
    With q = sqrt(1 + 2 c^2 m p), x = t/m and z = (1 -+ q x) / sqrt(2 c^2 x) a mode is
    exp(-(1 - x)^2 / (2 c^2 x)) / 2 times the sum of both erfcx(z); ``p = 0`` is the flow itself.
    """
    x = time[:, None] / mean
    rates = np.append(poles, 0.0)
    q = np.sqrt(1 + 2 * spread**2 * mean * rates.astype(np.complex128))
    root = 1 / (spread * np.sqrt(2 * x))
    envelope = 0.5 * np.exp(-((root * (1 - x)) ** 2))
    early, late = root * (1 - q * x), root * (1 + q * x)
    behind = early.real < 0
    # erfcx(z) = 2 exp(z^2) - erfcx(-z): for negative z it would overflow.
    sign = np.where(behind, -1.0, 1.0)
    whole = np.exp(np.where(behind, rates * mean * x + (1 - q) / spread**2, -np.inf))
    values = whole + envelope * (wofz(1j * late) + sign * wofz(1j * sign * early))
    return values[:, -1].real, values[:, :-1]


_CHARGE = 8.0
"""What a flow must be worth in the criterion: a few lags are more common. Ablation: charge for a
flow."""
_SPREADS = (0.1, 1.2)
"""Standard deviations over means: narrower is no different from many lags, wider from few."""
_MINOR = 0.5  # of the lag behind it: a flow that spreads by less is no different from a second lag
_FREE = 4  # dead time, gain, mean, spread; a lag is one more
_DELAYS, _LAGS = (0.0, 0.4, 0.7, 0.95), (0.05, 0.3, 0.6, 0.9)
"""Starts: parts of a dead time that is too long, and of the whole spread in time."""
_FOLLOWED, _EVALUATIONS = 3, 40  # starts that are improved, and how far: time
_SAME = 0.1  # variances by which two ends are one
_HOPELESS = 300.0  # above what is to be beaten, after the first of them: time
_REACH = 3 * PLAUSIBLE  # excess up to which a flow is followed to its minimum
_SMALL = 1e-5  # step of the numerical derivatives, near the root of the rounding
_PROFILE = np.array([0.7, 1.2, 1.7, 2.3, 3.2])  # standard errors from the optimum


@dataclass(frozen=True, eq=False)
class DispersedFlow:
    """Best fit of dispersion with a dead time; times in s.

    `mean` is that of the residence time, `spread` its standard deviation over the mean, `lag` the
    time constant in series, 0 if there is none. `criterion` includes the penalty on dispersion,
    `delta_bic` is its difference from the best lags.
    """

    dead_time: float
    mean: float
    spread: float
    lag: float
    cost: float
    criterion: float
    delta_bic: float

    @property
    def parameters(self) -> int:
        """Number of free parameters besides gain and dead time."""
        return 3 if self.lag else 2

    @property
    def peclet(self) -> float:
        """Peclet number of the flow, 2/c^2."""
        return 2 / self.spread**2


def fit_flows(
    problem: Problem,
    like: Candidate,
    scales: Scales,
    variance: float,
    penalty: float,
    level: float,
) -> list[DispersedFlow]:
    """Fit dispersion with a dead time, with and without a lag in series.

    Parameters
    ----------
    problem : Problem
        Of a step record.
    like : Candidate
        A model with the dead time and the spread in time for the initial values.
    scales : Scales
        Bounds of the dead time.
    variance, penalty : float
        Variance of the noise, and the penalty on a parameter.
    level : float
        Criterion of the best lags: fits far above it are abandoned.

    Returns
    -------
    list of DispersedFlow
        Only fits whose spread is at least half of the lag in series; otherwise a second lag would
        be equivalent. A short flow with a long lag and a long flow alone are often equally good:
        both are returned. Empty if the spread in time of `like` is less than a sample, or if the
        record has a free response, for which dispersion has no poles.
    """
    if problem.segments is not None or not isinstance(problem.drive, StepSequence):
        return []
    mean, square = time_moments(problem, like)
    if not square > scales.dt**2:
        return []
    target = like.dead_time, mean, float(np.sqrt(square))
    lagging = _FlowFit(problem, problem.drive, scales, True)
    flows = _followed(lagging, target, variance, penalty, level)
    # Without the lag the sum of squares is no smaller: only a parameter can be saved.
    if flows and flows[0].delta_bic - penalty <= PLAUSIBLE:
        plain = _FlowFit(problem, problem.drive, scales, False)
        flows += _followed(plain, target, variance, penalty, level)
    return [flow for flow in flows if flow.spread * flow.mean >= _MINOR * flow.lag]


def _followed(
    fit: _FlowFit,
    target: tuple[float, float, float],
    variance: float,
    penalty: float,
    level: float,
) -> list[DispersedFlow]:
    """Follow the most promising starts while one may reach the level; return the best, if any."""
    best: DispersedFlow | None = None
    for start in sorted(fit.starts(*target), key=fit.cost)[:_FOLLOWED]:
        x = fit.improved(start)
        cost = fit.cost(x)
        again = best is not None and abs(cost - best.cost) < _SAME * variance
        if best is None or cost < best.cost:
            criterion = cost / variance + fit.count * penalty + _CHARGE
            best = DispersedFlow(*fit.times(x), cost, criterion, criterion - level)
        if again or best.delta_bic > _HOPELESS:
            break
    if best is not None and best.delta_bic <= _REACH:
        # Everything that is compared with a limit has converged.
        x = fit.improved(fit.parameters(best), converged=True)
        cost = fit.cost(x)
        criterion = cost / variance + fit.count * penalty + _CHARGE
        best = DispersedFlow(*fit.times(x), cost, criterion, criterion - level)
    return [] if best is None else [best]


def flow_profile(
    problem: Problem, flow: DispersedFlow, scales: Scales, variance: float
) -> tuple[FloatArray, FloatArray]:
    """Misfit over the dead time, as `dead_time_profile`."""
    assert isinstance(problem.drive, StepSequence)
    fit = _FlowFit(problem, problem.drive, scales, flow.lag > 0)
    best = fit.parameters(flow)
    low, high = (float(bound[0]) for bound in fit.bounds)
    found = {float(best[0]): best}
    error = fit.dead_time_error(best, variance)
    for side in (-1, 1):
        x = best
        for distance in _PROFILE:
            at = float(np.clip(best[0] + side * distance * error, low, high))
            if at in found:
                break
            x = found[at] = fit.improved(np.append(at, x[1:]), True, True)
    costs = {at: fit.cost(x) for at, x in found.items()}
    least = min(costs.values())

    def excess(at: float) -> float:
        near = min(found, key=lambda other: abs(other - at))
        found[at] = fit.improved(np.append(at, found[near][1:]), True, True)
        costs[at] = fit.cost(found[at])
        return (costs[at] - least) / variance

    solve_ends(excess, {at: (cost - least) / variance for at, cost in costs.items()})
    dead_time = np.array(sorted(costs))
    cost = np.array([costs[at] for at in dead_time])
    return dead_time * scales.rise, (cost - cost.min()) / variance


@dataclass(frozen=True, eq=False)
class _FlowFit:
    """Least squares over x = (dead time, log mean, log spread, log lag), times over the rise.

    The last is missing if no lag is tried.
    """

    problem: Problem
    drive: StepSequence
    scales: Scales
    lagging: bool

    @property
    def count(self) -> int:
        """Number of parameters, including the gain."""
        return _FREE + self.lagging

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        s = self.scales
        longest, shortest = np.log(3 * s.length / s.rise), np.log(0.1 * s.dt / s.rise)
        low = [s.earliest / s.rise, shortest, np.log(_SPREADS[0]), shortest]
        high = [s.latest / s.rise, longest, np.log(_SPREADS[1]), longest]
        return np.array(low[: self.count - 1]), np.array(high[: self.count - 1])

    def parameters(self, flow: DispersedFlow) -> FloatArray:
        rise = self.scales.rise
        lag = [flow.lag / rise] * self.lagging
        return np.append(flow.dead_time / rise, np.log([flow.mean / rise, flow.spread, *lag]))

    def times(self, x: FloatArray) -> tuple[float, float, float, float]:
        """Dead time, mean, spread and lag; all but the spread in s."""
        rise = self.scales.rise
        lag = float(np.exp(x[3])) * rise if self.lagging else 0.0
        return float(x[0]) * rise, float(np.exp(x[1])) * rise, float(np.exp(x[2])), lag

    def residual(self, x: FloatArray) -> FloatArray:
        """Weighted residual (m,), gain and regressors eliminated."""
        columns = np.column_stack([self._response(x), self.problem.regressors])
        columns = self.problem.weighted(columns)
        q = np.linalg.qr(columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300))[0]
        data = self.problem.weighted_data
        return np.asarray(data - q @ (q.T @ data))

    def cost(self, x: FloatArray) -> float:
        residual = self.residual(x)
        return float(residual @ residual)

    def starts(self, dead_time: float, mean: float, deviation: float) -> Iterator[FloatArray]:
        """Divide mean and variance in time between dead time, dispersion and lag."""
        low, high = self.bounds
        rise = self.scales.rise
        for part in _DELAYS:
            for share in _LAGS if self.lagging else (0.0,):
                lag = share * deviation
                residence = mean - part * dead_time - lag
                if residence > 0:
                    spread = np.sqrt(deviation**2 - lag**2) / residence
                    logs = np.log([residence / rise, spread, *[lag / rise] * self.lagging])
                    yield np.clip(np.append(part * dead_time / rise, logs), low, high)

    def improved(
        self, start: FloatArray, fixed_dead_time: bool = False, converged: bool = False
    ) -> FloatArray:
        """Follow a start towards its minimum, or to it, with free or fixed dead time."""
        kept = start[:1] if fixed_dead_time else start[:0]
        low, high = (bound[kept.size :] for bound in self.bounds)
        inside = 1e-9 * (high - low)

        def residual(x: FloatArray) -> FloatArray:
            return self.residual(np.concatenate([kept, x]))

        found = least_squares(
            residual,
            np.clip(start[kept.size :], low + inside, high - inside),
            bounds=(low, high),
            x_scale="jac",
            jac="3-point" if converged else "2-point",
            ftol=1e-13 if converged else 1e-4,
            xtol=1e-10 if converged else 1e-8,
            max_nfev=_EVALUATIONS,
        )
        return np.concatenate([kept, found.x])

    def dead_time_error(self, x: FloatArray, variance: float) -> float:
        """Standard error of the dead time, in units of the rise, from the curvature."""
        here = self.residual(x)
        moved = [self.residual(x + _SMALL * row) - here for row in np.eye(x.size)]
        jacobian = np.stack(moved, axis=1) / _SMALL
        size = np.maximum(np.linalg.norm(jacobian, axis=0), 1e-300)
        on_dead_time = np.linalg.pinv(jacobian / size)[0] / size[0]
        return float(np.sqrt(variance) * np.linalg.norm(on_dead_time))

    def _response(self, x: FloatArray) -> FloatArray:
        """Unit response in means over the bins, by Simpson's rule for wide bins.

        Where samples are missing, in means over two times, as in `StepSequence`.
        """
        drive = self.drive
        if drive.samples is not None:
            early, late = (self._sampled(x, drive.first + node) for node in drive.nodes)
            return np.asarray((early + late) / 2)
        wide = drive.width > 1
        span = drive.lengths[wide]
        since = np.concatenate(
            [drive.first, drive.first[wide] + span / 2, drive.first[wide] + span]
        )
        every = self._sampled(x, since)
        total, middle, end = np.split(every, [wide.size, wide.size + span.size])
        total[wide] = (total[wide] + 4 * middle + end) / 6
        return total

    def _sampled(self, x: FloatArray, times: FloatArray) -> FloatArray:
        """Unit response at given times."""
        dead_time, *shape = self.times(x)
        since = times - dead_time
        moves = zip(self.drive.moves, self.drive.sizes, strict=True)
        return np.asarray(sum(size * self._step(since - move, *shape) for move, size in moves))

    def _step(self, time: FloatArray, mean: float, spread: float, lag: float) -> FloatArray:
        """Step response of the flow, the lag and the known dynamics."""
        known = self.problem.known
        numerator, poles = known.numerator, known.poles
        if lag:
            numerator, poles = numerator / lag, np.append(poles, -1 / lag)
        residues, gain, _ = partial_fractions(poles[None], numerator, 1)
        values = np.zeros(time.size)
        begun = time > 0
        passed, modes = flow_modes(time[begun], mean, spread, poles)
        values[begun] = gain[0] * passed + (modes @ residues[0, :, 0]).real
        return values
