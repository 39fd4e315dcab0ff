"""Fit of the axial-dispersion model to a step record, and the profile of its dead time.

Three or four lags with a longer dead time have the same response as a flow that disperses [1]_ to
within the noise, which no residual shows; in a fit to the same record, dispersion needs two
parameters instead of four. There may be one lag in series, as of a sensor.

References
----------
.. [1] O. Levenspiel, Chemical Reaction Engineering, 3rd ed., Wiley 1999, chapter 13 (The dispersion
   model).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import FloatArray
from ..engine.profile_ends import solve_ends
from ..engine.responses import StepSequence
from ..engine.structures import PLAUSIBLE, Candidate, Scales
from ..engine.varpro import Problem
from .equal_lags import time_moments
from .flow_search import FlowProblem

_CHARGE = 8.0
"""What a flow must be worth in the criterion: a few lags are more common. Ablation: charge for a
flow."""
_MINOR = 0.5  # of the lag behind it: a flow that spreads by less is no different from a second lag
_FOLLOWED = 3  # starts that are improved: time
_SAME = 0.1  # variances by which two ends are one
_HOPELESS = 300.0  # above what is to be beaten, after the first of them: time
_REACH = 3 * PLAUSIBLE  # excess up to which a flow is followed to its minimum
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
    lagging = FlowProblem(problem, problem.drive, scales, True)
    flows = _followed(lagging, target, variance, penalty, level)
    # Without the lag the sum of squares is no smaller: only a parameter can be saved.
    if flows and flows[0].delta_bic - penalty <= PLAUSIBLE:
        plain = FlowProblem(problem, problem.drive, scales, False)
        flows += _followed(plain, target, variance, penalty, level)
    return [flow for flow in flows if flow.spread * flow.mean >= _MINOR * flow.lag]


def _followed(
    fit: FlowProblem,
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
        x = fit.improved(fit.parameters(*_times(best)), converged=True)
        cost = fit.cost(x)
        criterion = cost / variance + fit.count * penalty + _CHARGE
        best = DispersedFlow(*fit.times(x), cost, criterion, criterion - level)
    return [] if best is None else [best]


def flow_profile(
    problem: Problem, flow: DispersedFlow, scales: Scales, variance: float
) -> tuple[FloatArray, FloatArray]:
    """Misfit over the dead time, as `dead_time_profile`."""
    assert isinstance(problem.drive, StepSequence)
    fit = FlowProblem(problem, problem.drive, scales, flow.lag > 0)
    best = fit.parameters(*_times(flow))
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


def _times(flow: DispersedFlow) -> tuple[float, float, float, float]:
    return flow.dead_time, flow.mean, flow.spread, flow.lag
