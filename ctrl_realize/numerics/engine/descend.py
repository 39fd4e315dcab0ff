"""Improve starts of a separable fit: a fast search, and a descent close to the minimum.

A search (`fit_batch`) of Levenberg-Marquardt steps [3]_ ends when a step gains little. The
remaining difference depends on rounding, and would affect the comparison of structures and the ends
of intervals: `descend` follows promising ends on, with bounds and with kinks at samples.

Every step of a descent comes from an orthogonal factorisation (the normal equations
square the condition number), with a damping that depends on the ratio of actual to predicted
decrease [1]_, [2]_. Newton's method continues from there (`newton`).

As a function of the dead time the sum of squares has a kink where the response starts at a sample.
Between two samples it is smooth, so a step ends at the next sample and continues on its other side;
a kink is a minimum if the cost decreases towards it on both sides. That is our own rule.

References
----------
.. [1] K. Madsen, H. B. Nielsen and O. Tingleff, Methods for Non-Linear Least Squares Problems, 2nd
   ed., Technical University of Denmark 2004, section 3.2 (The Levenberg-Marquardt method).
.. [2] J. Nocedal and S. J. Wright, Numerical Optimization, 2nd ed., Springer 2006, chapter 10
   (Least-squares problems), doi:10.1007/978-0-387-40065-5.
.. [3] D. W. Marquardt, An algorithm for least-squares estimation of nonlinear parameters, J. SIAM
   11 (1963) 431-441, doi:10.1137/0111030.
"""

from __future__ import annotations

import numpy as np

from ..arrays import BoolArray, FloatArray, IntArray
from .eliminate import compress
from .local_terms import triangle
from .problem import Bounds, Problem, Structure

IN_ROUNDING = 1e-11
"""Part of the sum of squares: whether so little is a decrease, rounding decides."""
BESIDE = 1e-8
"""Distance in samples from a sample at which a dead time counts as being on one side of it."""
_NEAR = 0.05  # variances: predicted decrease at which Newton's steps take over
_NO_WAY = 0.03  # of the distance to a level, as predicted decrease, at which it is not reached
_DAMPING = 1e-4  # of the first step, in squared columns of the Jacobian
_LONGEST_STEP = 1.0  # of a logarithmic parameter
_MOST_TURNS = 100
_NOTHING = 1e-10  # of the largest column of the Jacobian: a direction of rounding
_MOST_PINS = 3
_LONGEST_OF_A_SEARCH = 1.5  # step of a logarithmic parameter
_MOST_FAILURES = 4  # in a row, before a start is given up
_TURNS_FOR_ALL = 8  # iterations after which starts that are far behind are given up
_HOPELESS = 1.5
_STEEPEST = 1e145  # slope of a residual: the sum of its squares is a number still


def descend(
    problem: Problem,
    structure: Structure,
    starts: FloatArray,
    bounds: Bounds,
    dt: float,
    *,
    dead_time_fixed: bool = False,
    level: float | None = None,
    floor: float = 0.0,
) -> tuple[FloatArray, FloatArray]:
    """Follow every start until it is near its minimum; `newton.settle` does the rest.

    Starts of one structure compete: those that cannot reach the best are abandoned.

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
        A cost; it is only tested whether a minimum lies below it.
    floor : float, optional
        Standard deviation of a residual below which its decrease tells nothing.

    Returns
    -------
    parameters : ndarray, shape (B, 1 + n)
    cost : ndarray, shape (B,)
    """
    x = np.clip(starts, bounds.low, bounds.high)
    if dead_time_fixed:
        x[:, 0] = starts[:, 0]
    else:
        x[:, 0] = beside_a_sample(x[:, 0], bounds, dt)
    state = compress(problem, structure, x)
    residual, jacobian, cost = state.residual, state.jacobian, state.cost
    count = len(x)
    damping, growth = np.full(count, _DAMPING), np.full(count, 2.0)
    # A fixed dead time: given, or at a kink towards which the cost decreases on both sides.
    pinned = np.full(count, dead_time_fixed)
    crossed = np.zeros(count, dtype=np.bool_)
    at_kink = np.full(count, np.inf)
    pins = np.where(dead_time_fixed, _MOST_PINS, 0) * np.ones(count, dtype=np.int64)
    # A dead time that has crossed samples one after the other may cross several at once.
    reach, heading = np.zeros(count), np.zeros(count, dtype=np.int64)
    active: IntArray = np.arange(count)
    for _ in range(_MOST_TURNS):
        at = x[active]
        low, high = cell(at, bounds, dt, pinned[active], reach[active])
        downhill = np.einsum("bmp,bm->bp", jacobian[active], residual[active])
        over = leaving(at, downhill, low, high, bounds, pinned[active])
        free = ~((at <= low) & (downhill < 0) | (at >= high) & (downhill > 0) | (low >= high))
        step, predicted = _step_to(
            residual[active], jacobian[active], free, damping[active], low[:, 0] - at[:, 0],
            high[:, 0] - at[:, 0],
        )  # fmt: skip
        trial = np.clip(at + step, low, high)
        wide = reach[active] > 0
        trial[wide, 0] = beside_a_sample(trial[wide, 0], bounds, dt)
        # On both sides of a sample the cost decreases towards it.
        kink = (over != 0) & crossed[active]
        turn = (over != 0) & ~kink
        trial[turn] = at[turn]
        trial[turn, 0] = other_side(at[turn, 0], over[turn], dt)
        trial[kink] = at[kink]
        moved = compress(problem, structure, trial)
        gained = cost[active] - moved.cost
        tiny = predicted <= IN_ROUNDING * cost[active]
        better = (gained > 0) | (tiny & (gained >= -IN_ROUNDING * cost[active])) | turn
        up, down = active[better], active[~better & ~kink & ~wide]
        onward = turn & (over == heading[active])
        reach[active] = np.where(
            onward | (wide & better), 2 * reach[active] + 1, reach[active] // 4
        )
        heading[active[over != 0]] = over[over != 0]
        x[up], cost[up] = trial[better], moved.cost[better]
        residual[up], jacobian[up] = moved.residual[better], moved.jacobian[better]
        usual = better & ~turn
        expected = predicted[usual]
        ratio = np.minimum(gained[usual], expected) / np.maximum(expected, 1e-300)
        ease = np.clip(1 - (2 * np.clip(ratio, 0.0, 1.0) - 1) ** 3, 1 / 9, 2.0)
        damping[active[usual]] = np.maximum(damping[active[usual]] * ease, 1e-12)
        growth[active[usual]] = 2.0
        damping[down] *= growth[down]
        growth[down] *= 2.0
        crossed[active] = turn
        pinned[active[kink]], at_kink[active[kink]] = True, cost[active[kink]]
        enough = _NEAR * np.maximum(cost[active] / problem.data.size, floor**2)
        if level is not None:
            enough = np.maximum(enough, _NO_WAY * np.abs(cost[active] - level))
        elif not dead_time_fixed:
            enough = np.maximum(enough, _NO_WAY * (cost[active] - cost.min()))
        done = ~turn & ~kink & (better | ~wide) & (predicted <= enough)
        # Where the other parameters have changed since, the kink is tested once more.
        again = done & pinned[active] & (pins[active] < _MOST_PINS)
        again &= at_kink[active] - cost[active] > enough
        pinned[active[again]] = False
        pins[active[again]] += 1
        active = active[~((done & ~again) | (damping[active] > 1e12))]
        if not active.size:
            break
    if not (dead_time_fixed or bounds.smooth):
        x[:, 0] = np.clip(snapped(x[:, 0], dt), bounds.low[0], bounds.high[0])
    return x, cost


def _step_to(
    residual: FloatArray,
    jacobian: FloatArray,
    free: BoolArray,
    damping: FloatArray,
    low: FloatArray,
    high: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Damped step; where the dead time would leave its bounds, the best one with it at a bound."""
    step, predicted = _step(residual, jacobian, free, damping)
    reached = np.clip(step[:, 0], low, high)
    cut = free[:, 0] & (reached != step[:, 0])
    if cut.any():
        move = reached[cut, None] * jacobian[cut, :, 0]
        others = free[cut]
        others[:, 0] = False
        step[cut], gained = _step(residual[cut] - move, jacobian[cut], others, damping[cut])
        step[cut, 0] = reached[cut]
        gained += np.einsum("bm,bm->b", move, 2 * residual[cut] - move)
        predicted[cut] = np.maximum(gained, 0.0)
    return step, predicted


def _step(
    residual: FloatArray, jacobian: FloatArray, free: BoolArray, damping: FloatArray
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
    rows = residual.shape[1]
    whole = np.zeros((len(columns), rows + count, count + 1))
    whole[:, :rows, :count], whole[:, :rows, count] = scaled, residual
    whole[:, rows:, :count] = walls
    r = triangle(whole)
    step = np.linalg.solve(r[:, :count, :count], r[:, :count, count:])[:, :, 0]
    step = np.where(moving & free, step / size, 0.0)
    excess = np.maximum(np.abs(step[:, 1:]).max(axis=1, initial=0.0) / _LONGEST_STEP, 1.0)
    step = step / excess[:, None]
    change = np.einsum("bmp,bp->bm", columns, step)
    predicted = np.maximum(np.einsum("bm,bm->b", change, 2 * residual - change), 0.0)
    long = np.flatnonzero(excess > 1.0)
    if long.size:
        # A direction in which the misfit is flat would shorten the step in all others. A dead time,
        # in s, is never one: its steps end at the next sample.
        others = free[long] & (np.abs(step[long]) < [np.inf] + (count - 1) * [_LONGEST_STEP])
        held, gained = _step(residual[long], jacobian[long], others, damping[long])
        more = gained > predicted[long]
        step[long[more]], predicted[long[more]] = held[more], gained[more]
    return step, predicted


def cell(
    at: FloatArray, bounds: Bounds, dt: float, pinned: BoolArray, beyond: FloatArray | float = 0.0
) -> tuple[FloatArray, FloatArray]:
    """Bounds of every row; those of its dead time are `beyond` samples from the neighbouring."""
    low, high = (np.tile(bound, (len(at), 1)) for bound in (bounds.low, bounds.high))
    if bounds.smooth:
        low[pinned, 0] = high[pinned, 0] = at[pinned, 0]
        return low, high
    sample = np.ceil(at[:, 0] / dt)
    low[:, 0] = np.maximum(low[:, 0], (sample - 1 - beyond + BESIDE) * dt)
    high[:, 0] = np.minimum(high[:, 0], (sample + beyond - BESIDE) * dt)
    held = pinned | (low[:, 0] > high[:, 0])
    low[held, 0] = high[held, 0] = at[held, 0]
    return low, high


def beside_a_sample(dead_time: FloatArray, bounds: Bounds, dt: float) -> FloatArray:
    """Dead times (B,) within their bounds that do not coincide with a sample."""
    if bounds.smooth:
        return dead_time
    sample = np.round(dead_time / dt)
    at_one = np.abs(dead_time / dt - sample) < BESIDE
    earlier, later = (sample - BESIDE) * dt, (sample + BESIDE) * dt
    moved = np.where(earlier >= bounds.low[0], earlier, np.minimum(later, bounds.high[0]))
    return np.where(at_one, moved, dead_time)


def leaving(
    at: FloatArray,
    downhill: FloatArray,
    low: FloatArray,
    high: FloatArray,
    bounds: Bounds,
    pinned: BoolArray,
) -> IntArray:
    """-1 or 1 for rows with a dead time at a sample beyond which the cost decreases."""
    dead_time, way = at[:, 0], downhill[:, 0]
    later = (dead_time >= high[:, 0]) & (way > 0) & (high[:, 0] < bounds.high[0])
    earlier = (dead_time <= low[:, 0]) & (way < 0) & (low[:, 0] > bounds.low[0])
    return np.where(pinned, 0, later.astype(np.int64) - earlier.astype(np.int64))


def other_side(dead_time: FloatArray, way: IntArray, dt: float) -> FloatArray:
    """Dead times (B,) beyond the sample that is reached, -1 (earlier) or 1 (later)."""
    return np.asarray((np.round(dead_time / dt) + way * BESIDE) * dt)


def snapped(dead_time: FloatArray, dt: float) -> FloatArray:
    """Remove the offset of a dead time from a sample."""
    sample = np.round(dead_time / dt)
    # Adding zero avoids a negative zero.
    return np.where(np.abs(dead_time / dt - sample) <= 2 * BESIDE, sample * dt + 0.0, dead_time)


def fit_batch(
    problem: Problem,
    structure: Structure,
    starts: FloatArray,
    bounds: Bounds,
    *,
    most_iterations: int = 30,
    tolerance: float = 1e-4,
) -> tuple[FloatArray, FloatArray]:
    """Improve every start.

    Parameters
    ----------
    starts : ndarray, shape (B, 1 + n)
        Dead time in s and pole parameters.
    most_iterations : int
        Limit for all starts together.
    tolerance : float
        A start has converged if an iteration lowers its cost by less than this part.

    Returns
    -------
    parameters : ndarray, shape (B, 1 + n)
    cost : ndarray, shape (B,)
    """
    x = np.clip(starts, bounds.low, bounds.high)
    state = compress(problem, structure, x)
    residual, jacobian, cost = state.residual, state.jacobian, state.cost
    damping = np.full(x.shape[0], 1e-2)
    failures = np.zeros(x.shape[0], dtype=np.int64)
    active: IntArray = np.arange(x.shape[0])
    for turn in range(most_iterations):
        step, short = _damped_step(
            x[active], residual[active], jacobian[active], damping[active], bounds
        )
        trial = np.clip(x[active] + step, bounds.low, bounds.high)
        state = compress(problem, structure, trial)
        new = state.cost
        better = new < cost[active]
        settled = better & short & (cost[active] - new < tolerance * new)
        up, down = active[better], active[~better]
        x[up], cost[up] = trial[better], new[better]
        residual[up], jacobian[up] = state.residual[better], state.jacobian[better]
        damping[up] = np.maximum(0.2 * damping[up], 1e-9)
        damping[down] *= 8.0
        failures[up] = 0
        failures[down] += 1
        hopeless = (turn >= _TURNS_FOR_ALL) & (cost[active] > _HOPELESS * cost.min())
        active = active[~(settled | hopeless | (failures[active] >= _MOST_FAILURES))]
        if not active.size:
            break
    return x, cost


def _damped_step(
    x: FloatArray, residual: FloatArray, jacobian: FloatArray, damping: FloatArray, bounds: Bounds
) -> tuple[FloatArray, BoolArray]:
    """Levenberg-Marquardt steps in the free directions, and which of them were not limited."""
    # The dead time is relative to its range, so that the steps do not depend on the unit of time.
    unit = np.ones(x.shape[1])
    unit[0] = max(float(bounds.high[0] - bounds.low[0]), 1e-300)
    # A response of the size of rounding has derivatives whose squares overflow.
    jacobian = np.clip(jacobian * unit, -_STEEPEST, _STEEPEST)
    downhill = np.einsum("bmp,bm->bp", jacobian, residual)
    free = ~((x <= bounds.low) & (downhill < 0) | (x >= bounds.high) & (downhill > 0))
    normal = np.swapaxes(jacobian, 1, 2) @ jacobian
    normal = normal * (free[:, :, None] & free[:, None, :])
    diagonal = np.einsum("bii->bi", normal)
    scale = np.maximum(diagonal, 1e-9 * diagonal.max(axis=1, keepdims=True) + 1e-300)
    damped = normal + np.where(free, damping[:, None] * scale, 1.0)[:, :, None] * np.eye(x.shape[1])
    step = np.linalg.solve(damped, np.where(free, downhill, 0.0)[:, :, None])[:, :, 0] * unit
    longest = np.where(np.arange(x.shape[1]), _LONGEST_OF_A_SEARCH, np.inf)
    return np.clip(step, -longest, longest), np.all(np.abs(step) <= longest, axis=1)
