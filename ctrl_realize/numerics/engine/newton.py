"""Final convergence of fits by Newton's method, which includes the curvature of the residual.

The Hessian is computed from differences of the exact gradient, and kept as long as the iteration
converges (chord method [1]_); a step ends at the bounds. The end of a profile-likelihood interval
is solved for in all parameters at once [2]_.

References
----------
.. [1] C. T. Kelley, Iterative Methods for Optimization, SIAM 1999, section 2.3 (The chord method is
   Newton's with a Hessian that is kept), doi:10.1137/1.9781611970920.
.. [2] D. J. Venzon and S. H. Moolgavkar, A method for computing profile-likelihood-based confidence
   intervals, Appl. Statist. 37 (1988) 87-94, doi:10.2307/2347496.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TypeAlias

import numpy as np

from ..arrays import BoolArray, FloatArray
from .descend import IN_ROUNDING, beside_a_sample, cell, leaving, other_side, snapped
from .eliminate import compress
from .problem import Bounds, Problem, Structure

_CONVERGED = 1e-14
"""Predicted decrease over the sum of squares at which a fit has converged. What is d variances
above a minimum is sqrt(d) standard errors from it: with 1000 samples, three millionths of one."""
_TURNS, _MOST_CELLS = 40, 8  # at most: steps in a cell between two samples, and cells
_MOST_HESSIANS = 4
"""In a cell, and on the way to a level. What converges needs no more; along a flat valley twelve
lowered the misfit by thousandths of a variance, in a tenth of the time of a fit."""
_KEPT = 0.1
"""Part of the step before that a step with the same Hessian may be: then it converges as it is
[1]_, and a Hessian costs as much as a handful of gradients."""
_SMALL = 1e-4  # of a logarithmic parameter, or of a sample: for differences of the gradient
_FLAT = 1e-12  # of the largest curvature: a direction in which rounding bends
_GIVEN_UP = 1e6  # by which a step is shortened at most
_LARGEST = 0.5  # step of a logarithmic parameter
_ENDLESS = 1e12  # samples, or logarithms of rates: no step of a fit is as long
_LEVEL = 1e-6  # variances to which a level is met

Slopes: TypeAlias = Callable[[FloatArray], tuple[FloatArray, FloatArray]]
"""Costs (B,) and their exact gradients (B, n) at parameters (B, n)."""


def settle(
    problem: Problem,
    structure: Structure,
    start: FloatArray,
    bounds: Bounds,
    dt: float,
    *,
    dead_time_fixed: bool = False,
) -> tuple[FloatArray, float]:
    """Bring one fit (1 + n,) to convergence by Newton's method.

    If a direction is poorly determined, the curvature of the residual exceeds that of the Jacobian,
    and Gauss-Newton steps converge slowly. The Hessian is computed from differences of the exact
    gradient. Returns the parameters and the cost.
    """
    x = start.copy()
    if not dead_time_fixed:
        x[0] = beside_a_sample(x[:1], bounds, dt)[0]
    held, slopes = np.array([dead_time_fixed]), partial(_slopes, problem, structure)
    for _ in range(_MOST_CELLS):
        low, high = (bound[0] for bound in cell(x[None], bounds, dt, held))
        x, cost, slope = minimum(slopes, x, (low, high), units(x, dt))
        over = int(leaving(x[None], -slope[None], low[None], high[None], bounds, held)[0])
        if not over:
            break
        beside = x.copy()
        beside[0] = other_side(x[:1], np.array([over]), dt)[0]
        state = compress(problem, structure, beside[None])
        if over * float(state.jacobian[0, :, 0] @ state.residual[0]) > 0:
            x = beside
        else:
            # On both sides of the sample the cost decreases towards it.
            held[0] = True
    if not dead_time_fixed:
        x[0] = np.clip(snapped(x[:1], dt)[0], bounds.low[0], bounds.high[0])
    return x, cost


def solve_level(
    problem: Problem,
    structure: Structure,
    start: FloatArray,
    bounds: Bounds,
    dt: float,
    goal: float,
    variance: float,
) -> FloatArray | None:
    """Find the dead time at which the minimum over all other parameters has a given cost.

    The end of a profile-likelihood interval, by Newton's method in all parameters at once [2]_: the
    derivatives w.r.t. the others are zero there, and the cost is `goal`. None if it does not
    converge.
    """
    x, unit = start.copy(), units(start, dt)
    limits = bounds.low, bounds.high
    slopes = partial(_slopes, problem, structure)
    others = np.arange(x.size) > 0
    cost, slope, hessian = _curvature(slopes, x, unit, limits)
    before, made = 0.0, 1
    for _ in range(_TURNS):
        free = others & ~((x <= limits[0]) & (slope > 0) | (x >= limits[1]) & (slope < 0))
        curvature = hessian[np.ix_(free, free)]
        try:
            # Derivative of the conditional minimum w.r.t. the dead time, and distance to it.
            along, back = np.linalg.solve(
                curvature, np.stack([-hessian[free, 0], -slope[free]], axis=1)
            ).T
        except np.linalg.LinAlgError:
            return None
        if not np.abs([*along, *back]).max(initial=0.0) < _ENDLESS:
            return None  # the response has the size of rounding
        lower = cost + 0.5 * float(slope[free] @ back)
        steep = float(slope[0] + hessian[0, free] @ back)
        if steep == 0 or not np.isfinite(steep):
            return None
        bend = float(hessian[0, 0] + hessian[0, free] @ along)
        # Along a parabola; along its tangent if it does not reach the level.
        square = steep**2 + 2 * bend * (goal - lower)
        mean = (steep + np.sign(steep) * np.sqrt(square)) / 2 if square > 0 else steep
        away = float((goal - lower) / mean)
        if not abs(away) < _ENDLESS:
            return None
        off = abs(lower - goal) + abs(float(slope[free] @ back))
        if off <= _LEVEL * variance:
            x[0] += away * unit[0]
            return x
        if 0 < before * _KEPT < off:
            # The previous Hessian is not valid here.
            if made == _MOST_HESSIANS:
                return None
            cost, slope, hessian = _curvature(slopes, x, unit, limits)
            before, made = 0.0, made + 1
            continue
        step = np.zeros(x.size)
        step[0], step[free] = away, back + along * away
        step /= max(1.0, float(np.abs(step[1:]).max(initial=0.0)) / _LARGEST)
        x = np.clip(x + step * unit, *limits)
        (cost,), (slope,) = slopes(x[None])
        slope = slope * unit
        before = off
    return None


def minimum(
    slopes: Slopes, x: FloatArray, bounds: tuple[FloatArray, FloatArray], unit: FloatArray
) -> tuple[FloatArray, float, FloatArray]:
    """Parameters (n,), cost, and its scaled gradient at a minimum within bounds.

    `unit` (n,) are the sizes of the parameters in which steps and differences are measured.
    """
    low, high = bounds
    damping = 0.0
    cost, slope, hessian = _curvature(slopes, x, unit, bounds)
    before, made = 0.0, 1
    for _ in range(_TURNS):
        free = ~((x <= low) & (slope > 0) | (x >= high) & (slope < 0) | (low >= high))
        step = _newton_step(slope, hessian, free, (low - x) / unit, (high - x) / unit)
        step /= (1 + damping) * max(1.0, float(np.abs(step).max()) / _LARGEST)
        predicted = -float(slope @ step)
        if predicted <= 2 * _CONVERGED * cost:
            break
        lost = 0 < _KEPT**2 * before < predicted
        if not lost:
            trial = np.clip(x + step * unit, low, high)
            (reached,), (turned,) = slopes(trial[None])
            turned = turned * unit
            if reached < cost or predicted <= IN_ROUNDING * cost:
                x, cost, slope, damping, before = trial, float(reached), turned, 0.0, predicted
                continue
        if before == 0:
            # With the Hessian of this point: the step is too long.
            damping = max(10 * damping, 1.0)
            if damping > _GIVEN_UP:
                break
        elif made == _MOST_HESSIANS:
            break
        else:
            cost, slope, hessian = _curvature(slopes, x, unit, bounds)
            before, made = 0.0, made + 1
    return x, cost, slope


def _newton_step(
    slope: FloatArray, hessian: FloatArray, free: BoolArray, low: FloatArray, high: FloatArray
) -> FloatArray:
    """Step (1 + n,) of the free parameters to the minimum of a parabola within bounds."""
    free, step = free.copy(), np.zeros(slope.size)
    while free.any():
        values, vectors = np.linalg.eigh(hessian[np.ix_(free, free)])
        # For negative curvature the direction is reversed.
        size = np.maximum(np.abs(values), _FLAT * np.abs(values).max() + 1e-300)
        downhill = -slope[free] - hessian[np.ix_(free, ~free)] @ step[~free]
        step[free] = vectors @ ((vectors.T @ downhill) / size)
        beyond = free & ((step < low) | (step > high))
        if not beyond.any():
            break
        # It ends at the bound, and the other parameters are optimised for it.
        step = np.clip(step, low, high)
        free &= ~beyond
    return step


def _curvature(
    slopes: Slopes, x: FloatArray, unit: FloatArray, bounds: tuple[FloatArray, FloatArray]
) -> tuple[float, FloatArray, FloatArray]:
    """Cost, gradient and Hessian in scaled parameters."""
    # Near a sample, where the gradient jumps, one-sided differences are used.
    later = np.minimum(x + _SMALL * unit, np.maximum(bounds[1], x))
    earlier = np.maximum(x - _SMALL * unit, np.minimum(bounds[0], x))
    moving = np.flatnonzero(later > earlier)
    rows = np.tile(x, (1 + 2 * moving.size, 1))
    ahead, behind = 1 + np.arange(moving.size), 1 + moving.size + np.arange(moving.size)
    rows[ahead, moving], rows[behind, moving] = later[moving], earlier[moving]
    cost, steep = slopes(rows)
    steep = steep * unit
    hessian = np.eye(x.size)
    distance = (later - earlier)[moving] / unit[moving]
    bend = (steep[ahead] - steep[behind]) / distance[:, None]
    hessian[np.ix_(moving, moving)] = (bend[:, moving] + bend[:, moving].T) / 2
    return float(cost[0]), steep[0], hessian


def _slopes(
    problem: Problem, structure: Structure, rows: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Costs (B,) and gradients (B, 1 + n)."""
    state = compress(problem, structure, rows)
    return state.cost, -2 * np.einsum("bmp,bm->bp", state.jacobian, state.residual)


def units(x: FloatArray, dt: float) -> FloatArray:
    """A sample time for the dead time, 1 for logarithms."""
    unit = np.ones(x.size)
    unit[0] = dt
    return unit
