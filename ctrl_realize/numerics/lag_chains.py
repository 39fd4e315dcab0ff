"""Chains of nearly equal lags: many lags in a row, as tanks in series, by three parameters.

A response that many lags have smoothed is imitated by fewer lags and a longer dead time. The free
structures end at five poles; the chain goes on, because its lags share one time constant, as in
Strejc's evaluation of step responses. They are spread evenly around it. That real lags are not
spread so evenly is in the error of the delay: without it, its interval would be narrower than
anything that is known.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .arrays import FloatArray
from .pole_factors import parameters_from_poles
from .separable_fit import Problem, Structure, evaluate
from .structure_search import Candidate, Scales

SHORTEST, LONGEST = 4, 8
"""Shorter ones have few parameters when they are free; of longer ones rounding shows."""

_PARAMETERS = 2 + 2  # the lag and how many, delay and gain; the spread is bounded
_FIRST_SPREAD, _LEAST_SPREAD, _MOST_SPREAD = 0.01, 0.0064, 0.25  # squares of half the range
_UNEVEN = 0.15  # by which real lags are taken to stray from the even spread
_ITERATIONS = 12
_SMALL = 1e-4  # step of the numerical derivatives of pole parameters
_WORSE = 100.0  # in the criterion: a longer chain will not come back from there


@dataclass(frozen=True, eq=False)
class LagChain:
    """Best fit of a chain of lags, with the standard error of its delay in s."""

    candidate: Candidate
    criterion: float
    error: float


def fit_chains(
    problem: Problem, like: Candidate, scales: Scales, variance: float, penalty: float
) -> list[LagChain]:
    """Fit chains of four to eight lags, as long as they get better.

    Parameters
    ----------
    problem : Problem
    like : Candidate
        A model whose delay and spread in time (mean and variance of the impulse response) are
        where the chains start.
    scales : Scales
        Bounds of the delay.
    variance : float
        Of the noise.
    penalty : float
        What the criterion charges for a parameter.

    Returns
    -------
    list of LagChain
        Empty where `like` has no positive spread, as with an inverse response.
    """
    state = evaluate(problem, like.structure, like.parameters[None])
    mean, spread = _moments(like, state.numerator[0])
    chains: list[LagChain] = []
    if not spread > 0:
        return chains
    for order in range(SHORTEST, LONGEST + 1):
        lag = float(np.sqrt(spread / order))
        start = np.array([mean - order * lag, np.log(lag), _FIRST_SPREAD])
        candidate, x = _fit(problem, order, start, scales)
        value = candidate.cost / variance + _PARAMETERS * penalty
        if chains and value > chains[-1].criterion + _WORSE:
            break
        chains.append(LagChain(candidate, value, _error(problem, candidate, x, variance)))
    return chains


def still_improving(chains: Sequence[LagChain]) -> bool:
    """Tell whether the longest chain is not the end: the parabola of the last three goes down."""
    if not chains or chains[-1].candidate.structure.order < LONGEST:
        return False
    first, middle, last = (chain.criterion for chain in chains[-3:])
    bend = first - 2 * middle + last
    return last < middle and (bend <= 0 or (middle - last) / bend > 1.0)


def chain_profile(chain: LagChain, scales: Scales) -> tuple[FloatArray, FloatArray]:
    """Misfit over the delay, as `delay_profile`; with so few parameters it is a parabola."""
    delay = chain.candidate.delay
    grid = np.clip(delay + chain.error * np.linspace(-3, 3, 13), scales.earliest, scales.latest)
    grid = np.unique(np.append(grid, delay))
    return grid, ((grid - delay) / chain.error) ** 2


def _moments(like: Candidate, numerator: FloatArray) -> tuple[float, float]:
    """Mean and variance in time of the impulse response, from the cumulants of poles and zeros."""
    zeros = np.roots(numerator[::-1])
    mean = like.delay + float(np.sum(1 / zeros).real - np.sum(1 / like.poles).real)
    return mean, float(np.sum(like.poles**-2.0).real - np.sum(zeros**-2.0).real)


def _fit(
    problem: Problem, order: int, start: FloatArray, scales: Scales
) -> tuple[Candidate, FloatArray]:
    """Levenberg-Marquardt in delay, logarithm of the lag, and spread."""
    structure = Structure(order, order)
    low = np.array([scales.earliest, -np.inf, _LEAST_SPREAD])
    high = np.array([scales.latest, np.inf, _MOST_SPREAD])
    x, damping = np.clip(start, low, high), 1e-3
    parameters, residual, jacobian = _evaluate(problem, structure, x)
    cost = float(residual @ residual)
    for _ in range(_ITERATIONS):
        normal, downhill = jacobian.T @ jacobian, jacobian.T @ residual
        free = ~((x <= low) & (downhill < 0) | (x >= high) & (downhill > 0))
        damped = normal[np.ix_(free, free)]
        damped = damped + np.diag(damping * np.diag(damped) + 1e-300)
        step = np.zeros(3)
        step[free] = np.linalg.solve(damped, downhill[free])
        trial = np.clip(x + step / max(1.0, abs(float(step[1]))), low, high)
        moved = _evaluate(problem, structure, trial)
        new = float(moved[1] @ moved[1])
        if not new < cost:
            damping *= 10
            continue
        settled = cost - new < 1e-4 * new
        x, cost, damping = trial, new, 0.1 * damping
        parameters, residual, jacobian = moved
        if settled:
            break
    return Candidate(structure, parameters, cost), x


def _error(problem: Problem, candidate: Candidate, x: FloatArray, variance: float) -> float:
    """Standard error of the delay: what noise does to it, and what uneven lags do."""
    order = candidate.structure.order
    state = evaluate(problem, candidate.structure, candidate.parameters[None])
    jacobian = _evaluate(problem, candidate.structure, x)[2]
    size = np.sqrt((jacobian**2).sum(axis=0))
    on_delay = np.linalg.pinv(jacobian / size)[0] / size[0]
    rates = _rates(order, x[1], x[2])
    uneven = rates * np.exp(_SMALL * np.eye(order))
    moves = np.stack([parameters_from_poles(-r.astype(np.complex128)) for r in uneven], axis=1)
    moves = (moves - candidate.parameters[1:, None]) * (_UNEVEN / _SMALL)
    by_lags = on_delay @ state.jacobian[0][:, 1:] @ moves
    return float(np.sqrt(variance * (on_delay @ on_delay) + by_lags @ by_lags))


def _evaluate(
    problem: Problem, structure: Structure, x: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Parameters, residual, and its derivatives by delay, logarithm of the lag, and spread."""
    parameters = np.append(x[:1], _pole_parameters(structure.order, x[1], x[2]))
    state = evaluate(problem, structure, parameters[None])
    by_delay, by_poles = state.jacobian[0][:, :1], state.jacobian[0][:, 1:]
    further = _pole_parameters(structure.order, x[1] + _SMALL, x[2])
    wider = _pole_parameters(structure.order, x[1], (1 + _SMALL) * x[2])
    moves = np.stack([further - parameters[1:], (wider - parameters[1:]) / x[2]], axis=1) / _SMALL
    return parameters, state.residual[0], np.concatenate([by_delay, by_poles @ moves], axis=1)


def _pole_parameters(order: int, log_lag: float, spread: float) -> FloatArray:
    return parameters_from_poles(-_rates(order, log_lag, spread).astype(np.complex128))


def _rates(order: int, log_lag: float, spread: float) -> FloatArray:
    rates: FloatArray = (1 + np.sqrt(spread) * np.linspace(-1, 1, order)) * np.exp(-log_lag)
    return rates
