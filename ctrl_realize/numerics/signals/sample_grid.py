"""A uniform grid on which samples at irregular times have a row each.

Our own rule. Regular samples with gaps keep their own step. Otherwise the step is the greatest
common divisor of the distances of time stamps that were written with a few decimals, and stamps of
full precision are rounded to a fiftieth of the usual step, an error of 1 % of it at most. On
simulated records with a jitter of 10 % of a sample, the dead time of a grid of the usual step is
four to six times as far off, and that of a tenth of it up to three times.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import FloatArray, IntArray
from .time_axis import UNIFORM_WITHIN, without_rounding

_DECIMALS = range(10)  # of stamps in s; 1 ns is the finest clock there is
_WHOLE = 1e-3  # of the last decimal: rounding of stamps of 1e9 s is 2e-7 s
_FINER = 50  # times as fine as the usual step
_LARGEST = 2.0**53  # whole number that a float holds exactly
_TURNS = 4  # of the step of regular samples, each from steps over longer gaps
_NEXT_TO_ANOTHER = 0.05  # share of samples one step behind another, with many missing
_ROUNDED = 0.01  # of the usual step of irregular samples, by which it may be rounded


def grid_step(stamps: FloatArray, most: int) -> float:
    """Step of the coarsest uniform grid that holds all time stamps, in s.

    Parameters
    ----------
    stamps : ndarray, shape (N,), N >= 2
        Strictly increasing, in s.
    most : int
        Largest number of rows of the grid.

    Examples
    --------
    >>> import numpy as np
    >>> from ctrl_realize.numerics.signals.sample_grid import grid_step
    >>> grid_step(np.array([0.0, 10.0, 30.0, 40.0, 45.0]), 1000)
    5.0
    """
    regular = regular_step(stamps)
    if regular:
        return regular
    span = float(stamps[-1] - stamps[0])
    divisor = _common_divisor(stamps)
    if divisor and span / divisor < most:
        return divisor
    fine = min(usual_step(stamps) / _FINER, float(np.diff(stamps).min()))
    return max(fine, span / max(most - 1, 1))


def grid_rows(stamps: FloatArray, start: float, step: float) -> IntArray:
    """Nearest rows of time stamps on the grid ``start + k step``."""
    return np.floor((stamps - start) / step + 0.5).astype(np.int64)


def usual_step(stamps: FloatArray) -> float:
    """Median step of samples, as short a number as their jitter allows, in s.

    Examples
    --------
    >>> import numpy as np
    >>> from ctrl_realize.numerics.signals.sample_grid import usual_step
    >>> usual_step(np.array([0.0, 1.0013, 2.0012, 3.0020, 4.0002]))
    1.0
    """
    steps = np.diff(stamps)
    low, usual, high = (float(q) for q in np.quantile(steps, [0.05, 0.5, 0.95]))
    if high - low > _ROUNDED * usual and 0.5 * usual < steps.min() and steps.max() < 1.5 * usual:
        usual = float(steps.mean())  # stamps are rounded, and none is missing: so is the median
    within = min((high - low) / 2, _ROUNDED * usual)
    short = (float(f"{usual:.{digits}g}") for digits in range(1, 7))
    return next((one for one in short if abs(one - usual) < within), without_rounding(usual))


def regular_step(stamps: FloatArray) -> float:
    """Step of regular samples some of which are missing; 0 if they are not regular.

    Examples
    --------
    >>> import numpy as np
    >>> from ctrl_realize.numerics.signals.sample_grid import regular_step
    >>> regular_step(np.array([0, 2, 4, 5, 7, 9, 11]) / 3) * 3, regular_step(np.array([0, 1, 2.4]))
    (1.0, 0.0)
    """
    starts = np.quantile(np.diff(stamps), [0.5, _NEXT_TO_ANOTHER])
    return next(filter(None, (_refined_step(stamps, float(one)) for one in starts)), 0.0)


def _refined_step(stamps: FloatArray, step: float) -> float:
    """Step of regular samples near a first value; 0 if they are not regular."""
    steps = np.diff(stamps)
    for _ in range(_TURNS):
        counts = np.floor(steps / step + 0.5)
        if counts.min() < 1:
            return 0.0
        # Steps over several samples tell the step the better, once it is nearly known.
        sure = np.abs(steps / step - counts) < 5 * UNIFORM_WITHIN
        if not sure.any():
            return 0.0
        step = float(steps[sure].sum() / counts[sure].sum())
    rows = np.concatenate([[0.0], np.cumsum(np.floor(steps / step + 0.5))])
    step = float((stamps[-1] - stamps[0]) / rows[-1])
    if np.abs(stamps - stamps[0] - step * rows).max() > UNIFORM_WITHIN * step:
        return 0.0
    return without_rounding(step)


def _common_divisor(stamps: FloatArray) -> float:
    """Greatest common divisor of the distances of stamps with a few decimals; 0 without."""
    for decimals in _DECIMALS:
        units = (stamps - np.floor(stamps[0])) * 10.0**decimals
        whole = np.round(units)
        if whole[-1] >= _LARGEST:
            break
        if np.abs(units - whole).max() <= _WHOLE:
            apart = np.diff(whole.astype(np.int64))
            return float(np.gcd.reduce(apart)) / 10.0**decimals
    return 0.0


def filled(values: FloatArray) -> FloatArray:
    """Values (N,) that hold where one is missing; before the first one they are missing still."""
    known = ~np.isnan(values)
    last = np.maximum.accumulate(np.where(known, np.arange(values.size), -1))
    return np.asarray(np.where(last < 0, np.nan, values[np.maximum(last, 0)]))


def held(stamps: NDArray[Any], values: NDArray[Any], time: NDArray[Any]) -> FloatArray:
    """Last value (..., N) at every time (M,), NaN before the first stamp."""
    last = np.searchsorted(stamps, time, side="right") - 1
    return np.where(last < 0, np.nan, np.asarray(values, np.float64)[..., np.maximum(last, 0)])
