r"""Follow separable least squares to the bottom: what is compared must have converged.

A search ends where one more step gains little. What is left then is decided by rounding, and where
structures are compared, or an interval ends at a threshold, so would be the result. Here every
step is a Levenberg-Marquardt step from an orthogonal factorisation (the normal equations square
the condition number), its damping follows the ratio of gained to predicted decrease [1]_, and the
last one is that whose predicted decrease no longer shows in the sum of squares.

The sum of squares has a kink in the dead time at every sample, where the response begins with a
slope. Between two samples it is smooth: a step ends at the next sample and begins anew on its other
side, and a minimum in a kink is where both sides lead back.

References
----------
.. [1] K. Madsen, H. B. Nielsen and O. Tingleff, Methods for Non-Linear Least Squares Problems, 2nd
   ed., Technical University of Denmark 2004, section 3.2 (The Levenberg-Marquardt method).
.. [2] J. Nocedal and S. J. Wright, Numerical Optimization, 2nd ed., Springer 2006, chapter 10
   (Least-squares problems), doi:10.1007/978-0-387-40065-5.
.. [3] D. J. Venzon and S. H. Moolgavkar, A method for computing profile-likelihood-based confidence
   intervals, Appl. Statist. 37 (1988) 87-94, doi:10.2307/2347496.
.. [4] C. T. Kelley, Iterative Methods for Optimization, SIAM 1999, section 2.3 (The chord method is
   Newton's with a Hessian that is kept), doi:10.1137/1.9781611970920.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..arrays import FloatArray, IntArray
from .varpro import Bounds, Problem, Structure, evaluate

_CONVERGED = 1e-14
"""Predicted decrease over the sum of squares at which a fit has converged. What is d variances
above a minimum is sqrt(d) standard errors from it: with 1000 samples, three millionths of one."""
_NEAR = 0.05  # variances: predicted decrease at which Newton's steps take over
_NO_WAY = 0.03  # of the distance to a level, as predicted decrease, at which it is not reached
_IN_ROUNDING = 1e-11  # of the sum of squares: whether so little is a decrease, rounding decides
_DAMPING = 1e-4  # of the first step, in squared columns of the Jacobian
_LONGEST_STEP = 1.0  # of a logarithmic parameter
_MOST_TURNS = 25
_NEWTON_TURNS, _MOST_CELLS = 40, 8
_MOST_HESSIANS = 12
_KEPT = 0.1
"""Part of the step before that a step with the same Hessian may be: then it converges as it is
[4]_, and a Hessian costs as much as a handful of gradients."""
_SMALL = 1e-4  # of a logarithmic parameter, or of a sample: for differences of the gradient
_FLAT = 1e-12  # of the largest curvature: a direction in which rounding bends
_GIVEN_UP = 1e6  # by which a step is shortened at most
_LARGEST = 0.5  # step of a logarithmic parameter, by Newton
_BESIDE = 1e-8  # samples by which a dead time lies beside a sample to be on one side of it
_NOTHING = 1e-10  # of the largest column of the Jacobian: a direction of rounding
_ENDLESS = 1e12  # samples, or logarithms of rates: no step of a fit is as long
_MOST_PINS = 3
_LEVEL = 1e-6  # variances to which a level is met


def polish(
    problem: Problem,
    structure: Structure,
    starts: FloatArray,
    bounds: Bounds,
    dt: float,
    *,
    dead_time_fixed: bool = False,
    level: float | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Follow every start until it is near its minimum; see `settle` for the rest.

    Starts of one structure race: the one that will not get as low as another is left.

    Parameters
    ----------
    problem : Problem
    structure : Structure
    starts : ndarray, shape (B, 1 + n)
        Dead time in s and pole parameters.
    bounds : Bounds
    dt : float
        Sample time in s.
    dead_time_fixed : bool, optional
        Keep the first column as it is (profile likelihood).
    level : float, optional
        A cost of which is asked only whether a minimum lies below it.

    Returns
    -------
    parameters : ndarray, shape (B, 1 + n)
    cost : ndarray, shape (B,)
    """
    x = np.clip(starts, bounds.low, bounds.high)
    if dead_time_fixed:
        x[:, 0] = starts[:, 0]
    else:
        x[:, 0] = _beside(x[:, 0], bounds, dt)
    state = evaluate(problem, structure, x)
    residual, jacobian, cost = state.residual, state.jacobian, state.cost
    count = len(x)
    damping, growth = np.full(count, _DAMPING), np.full(count, 2.0)
    # A dead time that is held: always, or in a kink from both sides of which the way leads back.
    pinned = np.full(count, dead_time_fixed)
    crossed = np.zeros(count, dtype=np.bool_)
    pins = np.where(dead_time_fixed, _MOST_PINS, 0) * np.ones(count, dtype=np.int64)
    active: IntArray = np.arange(count)
    for _ in range(_MOST_TURNS):
        at = x[active]
        low, high = _cell(at, bounds, dt, pinned[active])
        downhill = np.einsum("bmp,bm->bp", jacobian[active], residual[active])
        over = _leaving(at, downhill, low, high, bounds, pinned[active])
        free = ~((at <= low) & (downhill < 0) | (at >= high) & (downhill > 0) | (low >= high))
        step, predicted = _step(residual[active], jacobian[active], free, damping[active])
        trial = np.clip(at + step, low, high)
        # From both sides of a sample the way leads back to it.
        kink = (over != 0) & crossed[active]
        turn = (over != 0) & ~kink
        trial[turn] = at[turn]
        trial[turn, 0] = _other_side(at[turn, 0], over[turn], dt)
        trial[kink] = at[kink]
        moved = evaluate(problem, structure, trial)
        gained = cost[active] - moved.cost
        tiny = predicted <= _IN_ROUNDING * cost[active]
        better = (gained > 0) | (tiny & (gained >= -_IN_ROUNDING * cost[active])) | turn
        up, down = active[better], active[~better & ~kink]
        x[up], cost[up] = trial[better], moved.cost[better]
        residual[up], jacobian[up] = moved.residual[better], moved.jacobian[better]
        usual = better & ~turn
        ratio = gained[usual] / np.maximum(predicted[usual], 1e-300)
        ease = np.clip(1 - (2 * np.clip(ratio, 0.0, 1.0) - 1) ** 3, 1 / 9, 2.0)
        damping[active[usual]] = np.maximum(damping[active[usual]] * ease, 1e-12)
        growth[active[usual]] = 2.0
        damping[down] *= growth[down]
        growth[down] *= 2.0
        crossed[active] = turn
        pinned[active[kink]] = True
        enough = _NEAR / problem.data.size * cost[active]
        if dead_time_fixed and level is not None:
            enough = np.maximum(enough, _NO_WAY * np.abs(cost[active] - level))
        elif not dead_time_fixed:
            enough = np.maximum(enough, _NO_WAY * (cost[active] - cost.min()))
        done = ~turn & ~kink & (predicted <= enough)
        # The others have moved since: look at the kink once more.
        again = done & pinned[active] & (pins[active] < _MOST_PINS)
        pinned[active[again]] = False
        pins[active[again]] += 1
        active = active[~((done & ~again) | (damping[active] > 1e12))]
        if not active.size:
            break
    if not dead_time_fixed:
        x[:, 0] = np.clip(_snapped(x[:, 0], dt), bounds.low[0], bounds.high[0])
    return x, cost


def _cell(
    at: FloatArray, bounds: Bounds, dt: float, pinned: NDArray[np.bool_]
) -> tuple[FloatArray, FloatArray]:
    """Bounds of every row, those of its dead time the samples beside it."""
    low, high = (np.tile(bound, (len(at), 1)) for bound in (bounds.low, bounds.high))
    sample = np.ceil(at[:, 0] / dt)
    low[:, 0] = np.maximum(low[:, 0], (sample - 1 + _BESIDE) * dt)
    high[:, 0] = np.minimum(high[:, 0], (sample - _BESIDE) * dt)
    held = pinned | (low[:, 0] > high[:, 0])
    low[held, 0] = high[held, 0] = at[held, 0]
    return low, high


def _beside(dead_time: FloatArray, bounds: Bounds, dt: float) -> FloatArray:
    """Dead times (B,) within their bounds that are at no sample."""
    sample = np.round(dead_time / dt)
    at_one = np.abs(dead_time / dt - sample) < _BESIDE
    earlier, later = (sample - _BESIDE) * dt, (sample + _BESIDE) * dt
    moved = np.where(earlier >= bounds.low[0], earlier, np.minimum(later, bounds.high[0]))
    return np.where(at_one, moved, dead_time)


def _leaving(
    at: FloatArray,
    downhill: FloatArray,
    low: FloatArray,
    high: FloatArray,
    bounds: Bounds,
    pinned: NDArray[np.bool_],
) -> IntArray:
    """-1 or 1 for rows whose dead time is at a sample, with the way down on its other side."""
    dead_time, way = at[:, 0], downhill[:, 0]
    later = (dead_time >= high[:, 0]) & (way > 0) & (high[:, 0] < bounds.high[0])
    earlier = (dead_time <= low[:, 0]) & (way < 0) & (low[:, 0] > bounds.low[0])
    return np.where(pinned, 0, later.astype(np.int64) - earlier.astype(np.int64))


def _other_side(dead_time: FloatArray, way: IntArray, dt: float) -> FloatArray:
    sample = np.round(dead_time / dt)
    return np.asarray((sample + way * _BESIDE) * dt)


def _snapped(dead_time: FloatArray, dt: float) -> FloatArray:
    """Take back by how much a dead time lies beside a sample to be on a side of it."""
    sample = np.round(dead_time / dt)
    # Plus nothing: no zero is negative.
    return np.where(np.abs(dead_time / dt - sample) <= 2 * _BESIDE, sample * dt + 0.0, dead_time)


def _step(
    residual: FloatArray,
    jacobian: FloatArray,
    free: NDArray[np.bool_],
    damping: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Damped step in the free directions, and the decrease of the linear model."""
    columns = jacobian * free[:, None]
    size = np.sqrt(np.einsum("bmp,bmp->bp", columns, columns))
    moving = size > _NOTHING * size.max(axis=1, keepdims=True)
    columns = columns * moving[:, None]
    size = np.where(moving, size, 1.0)
    scaled = columns / size[:, None]
    count = scaled.shape[2]
    walls = np.sqrt(damping)[:, None, None] * np.eye(count)
    # min |J s - r|^2 + damping |D s|^2 as least squares (Nocedal and Wright, section 10.3).
    # min |J s - r|^2 + damping |D s|^2 as least squares (Nocedal and Wright, section 10.3).
    q, r = np.linalg.qr(np.concatenate([scaled, walls], axis=1))
    rows = residual.shape[1]
    inside = np.einsum("bmk,bm->bk", q[:, :rows], residual)
    step = np.linalg.solve(r, inside[:, :, None])[:, :, 0]
    step = np.where(moving & free, step / size, 0.0)
    longest = np.maximum(np.abs(step[:, 1:]).max(axis=1, initial=0.0) / _LONGEST_STEP, 1.0)
    step = step / longest[:, None]
    change = np.einsum("bmp,bp->bm", columns, step)
    predicted = np.einsum("bm,bm->b", change, 2 * residual - change)
    return step, np.maximum(predicted, 0.0)


def settle(
    problem: Problem,
    structure: Structure,
    start: FloatArray,
    bounds: Bounds,
    dt: float,
    *,
    dead_time_fixed: bool = False,
) -> tuple[FloatArray, float]:
    """End one fit (1 + n,) with Newton's steps, which see the curvature of what is left.

    Where a direction shows little, that is more than what the Jacobian knows of it, and steps of
    Gauss and Newton come to the bottom slowly. The Hessian is made of differences of the gradient,
    which is exact. Returns the parameters and the cost.
    """
    x = start.copy()
    if not dead_time_fixed:
        x[0] = _beside(x[:1], bounds, dt)[0]
    held = np.array([dead_time_fixed])
    for _ in range(_MOST_CELLS):
        low, high = (bound[0] for bound in _cell(x[None], bounds, dt, held))
        x, cost, slope = _newton(problem, structure, x, (low, high), dt)
        over = int(_leaving(x[None], -slope[None], low[None], high[None], bounds, held)[0])
        if not over:
            break
        beside = x.copy()
        beside[0] = _other_side(x[:1], np.array([over]), dt)[0]
        state = evaluate(problem, structure, beside[None])
        if over * float(state.jacobian[0, :, 0] @ state.residual[0]) > 0:
            x = beside
        else:
            # From both sides of the sample the way leads back to it.
            held[0] = True
    if not dead_time_fixed:
        x[0] = np.clip(_snapped(x[:1], dt)[0], bounds.low[0], bounds.high[0])
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
    """Find the dead time at which the minimum over all other parameters is a given cost.

    The end of a profile-likelihood interval, by Newton's steps in all parameters at once [1]_:
    the slopes of the others are zero there, and the cost is `goal`. None where they do not come
    to an end.

    .. [1] D. J. Venzon and S. H. Moolgavkar, A method for computing profile-likelihood-based
       confidence intervals, Appl. Statist. 37 (1988) 87-94, doi:10.2307/2347496.
    """
    x, unit = start.copy(), np.ones(start.size)
    unit[0] = dt
    limits = bounds.low, bounds.high
    others = np.arange(x.size) > 0
    cost, slope, hessian = _curvature(problem, structure, x, unit, limits)
    before, made = 0.0, 1
    for _ in range(_NEWTON_TURNS):
        free = others & ~((x <= limits[0]) & (slope > 0) | (x >= limits[1]) & (slope < 0))
        curvature = hessian[np.ix_(free, free)]
        try:
            # How the minimum over the others moves with the dead time, and how far away it is.
            along, back = np.linalg.solve(
                curvature, np.stack([-hessian[free, 0], -slope[free]], axis=1)
            ).T
        except np.linalg.LinAlgError:
            return None
        if not np.abs([*along, *back]).max(initial=0.0) < _ENDLESS:
            return None  # the response shows in rounding alone
        lower = cost + 0.5 * float(slope[free] @ back)
        steep = float(slope[0] + hessian[0, free] @ back)
        if steep == 0 or not np.isfinite(steep):
            return None
        bend = float(hessian[0, 0] + hessian[0, free] @ along)
        away = _to_level(steep, bend, goal - lower)
        if not abs(away) < _ENDLESS:
            return None
        off = abs(lower - goal) + abs(float(slope[free] @ back))
        if off <= _LEVEL * variance:
            x[0] += away * unit[0]
            return x
        if 0 < before * _KEPT < off:
            # The Hessian of before is another one here.
            if made == _MOST_HESSIANS:
                return None
            cost, slope, hessian = _curvature(problem, structure, x, unit, limits)
            before, made = 0.0, made + 1
            continue
        step = np.zeros(x.size)
        step[0], step[free] = away, back + along * away
        step /= max(1.0, float(np.abs(step[1:]).max(initial=0.0)) / _LARGEST)
        x = np.clip(x + step * unit, *limits)
        (cost,), (slope,) = _slopes(problem, structure, x[None], unit)
        before = off
    return None


def _to_level(slope: float, bend: float, rise: float) -> float:
    """Step along a parabola that rises by so much; along its tangent where it never does."""
    square = slope**2 + 2 * bend * rise
    if square <= 0:
        return rise / slope
    return float(2 * rise / (slope + np.sign(slope) * np.sqrt(square)))


def _newton(
    problem: Problem,
    structure: Structure,
    x: FloatArray,
    bounds: tuple[FloatArray, FloatArray],
    dt: float,
) -> tuple[FloatArray, float, FloatArray]:
    """Parameters, cost, and its slope in a minimum within bounds."""
    unit = np.ones(x.size)
    unit[0] = dt
    low, high = bounds
    damping = 0.0
    cost, slope, hessian = _curvature(problem, structure, x, unit, bounds)
    before, made = 0.0, 1
    for _ in range(_NEWTON_TURNS):
        free = ~((x <= low) & (slope > 0) | (x >= high) & (slope < 0) | (low >= high))
        step = _newton_step(slope, hessian, free, (low - x) / unit, (high - x) / unit)
        step /= (1 + damping) * max(1.0, float(np.abs(step).max()) / _LARGEST)
        predicted = -float(slope @ step)
        if predicted <= 2 * _CONVERGED * cost:
            break
        lost = 0 < _KEPT**2 * before < predicted
        if not lost:
            trial = np.clip(x + step * unit, low, high)
            (reached,), (turned,) = _slopes(problem, structure, trial[None], unit)
            if reached < cost or predicted <= _IN_ROUNDING * cost:
                x, cost, slope, damping, before = trial, float(reached), turned, 0.0, predicted
                continue
        if before == 0:
            # With the Hessian of this place: too long a step.
            damping = max(10 * damping, 1.0)
            if damping > _GIVEN_UP:
                break
        elif made == _MOST_HESSIANS:
            break
        else:
            cost, slope, hessian = _curvature(problem, structure, x, unit, bounds)
            before, made = 0.0, made + 1
    return x, cost, slope


def _newton_step(
    slope: FloatArray,
    hessian: FloatArray,
    free: NDArray[np.bool_],
    low: FloatArray,
    high: FloatArray,
) -> FloatArray:
    """Step (1 + n,) of the free parameters to the minimum of a parabola within bounds."""
    free, step = free.copy(), np.zeros(slope.size)
    while free.any():
        values, vectors = np.linalg.eigh(hessian[np.ix_(free, free)])
        # Where the curvature is that of a hill, the way down is the other one.
        size = np.maximum(np.abs(values), _FLAT * np.abs(values).max() + 1e-300)
        downhill = -slope[free] - hessian[np.ix_(free, ~free)] @ step[~free]
        step[free] = vectors @ ((vectors.T @ downhill) / size)
        beyond = free & ((step < low) | (step > high))
        if not beyond.any():
            break
        # It ends at the bound, and the others go where they are best then.
        step = np.clip(step, low, high)
        free &= ~beyond
    return step


def _curvature(
    problem: Problem,
    structure: Structure,
    x: FloatArray,
    unit: FloatArray,
    bounds: tuple[FloatArray, FloatArray],
) -> tuple[float, FloatArray, FloatArray]:
    """Cost, gradient and Hessian in parameters over their units."""
    # Beside a sample, where the gradient jumps, differences are taken on one side.
    later = np.minimum(x + _SMALL * unit, np.maximum(bounds[1], x))
    earlier = np.maximum(x - _SMALL * unit, np.minimum(bounds[0], x))
    moving = np.flatnonzero(later > earlier)
    rows = np.tile(x, (1 + 2 * moving.size, 1))
    ahead, behind = 1 + np.arange(moving.size), 1 + moving.size + np.arange(moving.size)
    rows[ahead, moving], rows[behind, moving] = later[moving], earlier[moving]
    cost, slopes = _slopes(problem, structure, rows, unit)
    hessian = np.eye(x.size)
    distance = (later - earlier)[moving] / unit[moving]
    bend = (slopes[ahead] - slopes[behind]) / distance[:, None]
    hessian[np.ix_(moving, moving)] = (bend[:, moving] + bend[:, moving].T) / 2
    return float(cost[0]), slopes[0], hessian


def _slopes(
    problem: Problem, structure: Structure, rows: FloatArray, unit: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Costs (B,) and gradients (B, 1 + n) in parameters over their units."""
    state = evaluate(problem, structure, rows)
    return state.cost, -2 * np.einsum("bmp,bm->bp", state.jacobian, state.residual) * unit
