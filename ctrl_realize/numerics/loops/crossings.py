"""Crossings and closest points of a frequency response that can be evaluated anywhere.

Everything is based on a function of frequency, not on a polynomial: each crossing is bracketed on a
sufficiently fine grid, then computed by root finding on the curve itself.

Encirclements as in [1]_, roots as in [2]_.

References
----------
.. [1] K. J. Astrom and R. M. Murray, Feedback Systems, 2nd ed., Princeton University Press 2021,
   section 10.2 (the Nyquist criterion).
.. [2] M. Dowell and P. Jarratt, A modified regula falsi method for computing the root of an
   equation, BIT 11 (1971) 168-174.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..arrays import BoolArray, ComplexArray, FloatArray, IntArray

Curve = Callable[[FloatArray], ComplexArray]

POINTS_PER_TURN = 16  # of the phase of a delay: 0.4 rad, less than what `follow` asks for
MAX_REFINEMENTS = 24  # halvings: an interval is then a ten-millionth of what it was
SMOOTH = 2  # halvings behind which few curves are left to be asked whether they are rounding
MAX_STEPS = 100  # of a search for a root; smooth curves take six to eight


def frequency_grid(low: float, top: float, features: ComplexArray, turn_time: float) -> FloatArray:
    """Place frequencies at which a response may change quickly.

    Parameters
    ----------
    low, top : float
        First and last frequency in rad/s, 0 < low < top.
    features : ndarray, shape (F,)
        Poles and zeros in the s-plane, rad/s; points are gathered around those near the
        imaginary axis.
    turn_time : float
        Delay in s; it gets 16 points per turn of its phase.

    Returns
    -------
    ndarray, shape (K,)
        Increasing frequencies from `low` to `top`.
    """
    decades = max(np.log10(top / low), 0.1)
    parts = [
        np.geomspace(low, top, int(40 * decades) + 2),
        np.linspace(low, top, int(POINTS_PER_TURN * turn_time * top / (2 * np.pi)) + 200),
    ]
    spread = np.sinh(np.linspace(-4, 4, 41))
    for s in features:
        centre, width = abs(s.imag), abs(s.real)
        if low < centre < top and width < centre:
            parts.append(centre + max(width, 1e-9 * centre) * spread)
    grid = np.unique(np.concatenate(parts))
    grid = grid[(grid >= low) & (grid <= top)]
    # Points equal up to rounding would spoil the bracket of a nearby minimum.
    apart = np.diff(grid, prepend=-np.inf) > 1e-9 * grid
    return np.asarray(grid[apart], dtype=np.float64)


def follow(
    curve: Curve, grid: FloatArray, largest_turn: float = 0.5, values: ComplexArray | None = None
) -> tuple[FloatArray, ComplexArray]:
    """Refine a grid until the curve turns by less than `largest_turn` rad between its points.

    Intervals whose ends differ by more than a factor of 2 in magnitude are halved too. A curve
    through zero would need infinitely many points; the refinement stops after 24 halvings, and
    where the values are rounding, which no halving would make smooth. `values` are those of the
    curve on the grid, if they are known.

    Returns
    -------
    grid : ndarray, shape (K,)
    values : ndarray, shape (K,)
        ``curve(grid)``.
    """
    values = curve(grid) if values is None else values
    for halvings in range(MAX_REFINEMENTS):
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = values[1:] / values[:-1]
            growth = np.abs(np.log(np.abs(ratio)))
            coarse = (np.abs(np.angle(ratio)) > largest_turn) | (growth > 0.7)
        coarse &= np.isfinite(ratio) & (np.diff(grid) > 1e-13 * grid[1:])
        if halvings >= SMOOTH:
            coarse[coarse] = ~_rounded(curve, grid, values, np.flatnonzero(coarse), largest_turn)
        if not coarse.any():
            break
        middle = 0.5 * (grid[:-1] + grid[1:])[coarse]
        at = np.flatnonzero(coarse) + 1
        grid = np.insert(grid, at, middle)
        values = np.insert(values, at, curve(middle))
    return grid, values


def _rounded(
    curve: Curve, grid: FloatArray, values: ComplexArray, at: IntArray, turn: float
) -> BoolArray:
    """Whether the curve jumps at both ends of intervals: far below its terms it is rounding.

    Within a thousandth of an interval a smooth curve turns by a thousandth of half a turn at most.
    A zero or pole on the axis may be at one end.
    """
    ends = np.stack([at, at + 1])
    inside = grid[ends] + np.array([[1e-3], [-1e-3]]) * (grid[at + 1] - grid[at])
    with np.errstate(divide="ignore", invalid="ignore"):
        moved = np.abs(curve(inside.ravel()).reshape(ends.shape) / values[ends] - 1)
    return np.asarray(np.all(moved > turn / 4, axis=0))


def half_turns(values: ComplexArray) -> float:
    """Count half turns about 0 along a curve whose neighbours differ by less than half a turn.

    The curve starts near the real axis (where a real system is at frequency 0), and half turns are
    counted from there.
    """
    steps = np.angle(values[1:] / values[:-1])
    start = float(np.angle(values[0]))
    offset = start - np.pi * np.round(start / np.pi)
    return float((offset + steps.sum()) / np.pi)


def encircled(values: ComplexArray, rest: float = 0.0) -> tuple[int, bool]:
    """Count the turns about 0 against the positive sense, and say whether that is doubtful.

    `rest` is a turn in rad that is known beside the curve.
    """
    if np.any(values == 0) or not np.isfinite(values).all():
        return 0, True
    steps = np.abs(np.angle(values[1:] / values[:-1]))
    turns = half_turns(values) + rest / np.pi
    # A real system starts on the real axis, unless a closed-loop pole is at frequency 0.
    start = abs(float(np.sin(np.angle(values[0]))))
    doubtful = bool(np.any(steps > 2.0) or abs(turns - round(turns)) > 0.1 or start > 0.5)
    return max(0, -round(turns)), doubtful


def _roots(
    function: Callable[[FloatArray], FloatArray], low: FloatArray, high: FloatArray
) -> FloatArray:
    """Roots between pairs of ends of unlike signs: regula falsi, as Dowell and Jarratt mend it."""
    if low.size == 0:
        return low
    a, b, at_a, at_b = low, high, function(low), function(high)
    # Very close to zero, rounding may have caused the sign change; there is no root to find.
    unlike = np.sign(at_a) * np.sign(at_b) <= 0
    for _ in range(MAX_STEPS):
        with np.errstate(divide="ignore", invalid="ignore"):
            x = b - at_b * (b - a) / (at_b - at_a)
        x = np.where((x - a) * (x - b) <= 0, x, 0.5 * (a + b))
        moved, at_x = np.abs(x - b), function(x)
        behind = np.sign(at_x) == np.sign(at_b)
        a, at_a = np.where(behind, a, b), np.where(behind, 0.5 * at_a, at_b)
        b, at_b = x, at_x
        if np.all((moved <= 1e-15 * x) | (at_x == 0) | ~unlike):
            break
    return b[unlike & np.isfinite(at_b)]


def unit_crossings(curve: Curve, grid: FloatArray, values: ComplexArray) -> FloatArray:
    """Frequencies where the magnitude crosses 1 (gain crossovers), increasing."""
    above = np.abs(values) > 1
    at = np.flatnonzero(above[1:] != above[:-1])

    def level(omega: FloatArray) -> FloatArray:
        return np.log(np.abs(curve(omega)))

    return _roots(level, grid[at], grid[at + 1])


def negative_axis_crossings(curve: Curve, grid: FloatArray, values: ComplexArray) -> FloatArray:
    """Frequencies where the curve crosses the negative real axis (phase crossovers), increasing."""
    below = values.imag < 0
    with np.errstate(invalid="ignore"):  # a loop of gain 0 has no direction
        unit = values / np.abs(values)
    left = (unit[1:] + unit[:-1]).real < 0
    at = np.flatnonzero((below[1:] != below[:-1]) & left)

    def height(omega: FloatArray) -> FloatArray:
        point = curve(omega)
        with np.errstate(invalid="ignore"):  # far below its terms a loop is rounded to 0
            return np.asarray(point.imag / np.abs(point), dtype=np.float64)

    return _roots(height, grid[at], grid[at + 1])


def smallest_distance(
    curve: Curve, grid: FloatArray, values: ComplexArray | None = None
) -> tuple[float, float]:
    """Smallest magnitude of a curve, and the frequency where it is reached.

    The grid is first refined until neighbours differ by less than a factor of 2; every local
    minimum within 30 % of the smallest value is then narrowed by nested grids.
    """
    grid, values = follow(curve, grid, values=values)
    size = np.abs(values)
    padded = np.concatenate([[np.inf], size, [np.inf]])
    lows = np.flatnonzero((size <= padded[:-2]) & (size <= padded[2:]))
    lows = lows[size[lows] <= 1.3 * size.min()]
    lows = lows[np.argsort(size[lows])][:64]
    left = grid[np.maximum(lows - 1, 0)]
    right = grid[np.minimum(lows + 1, grid.size - 1)]
    share = np.linspace(0, 1, 9)[:, None]
    rows = np.arange(lows.size)
    for _ in range(11):
        points = left + (right - left) * share
        heights = np.abs(curve(points.ravel())).reshape(points.shape)
        best = np.argmin(heights, axis=0)
        left, right = points[np.maximum(best - 1, 0), rows], points[np.minimum(best + 1, 8), rows]
    column = int(np.argmin(heights[best, rows]))
    return float(heights[best[column], column]), float(points[best[column], column])
