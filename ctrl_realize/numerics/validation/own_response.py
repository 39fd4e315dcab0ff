"""Response of one record relative to a model that is common to several.

The test of homogeneity is that of [1]_; shift, gain and stretch come from the linear model [2]_
about the common response.

References
----------
.. [1] W. G. Cochran, The combination of estimates from different experiments, Biometrics 10 (1954)
   101-129, doi:10.2307/3001666.
.. [2] S. M. Kay, Fundamentals of Statistical Signal Processing: Estimation Theory, Prentice Hall
   1993, chapter 4 (Linear models).
.. [3] R. D. Cook and S. Weisberg, Residuals and Influence in Regression, Chapman and Hall 1982,
   section 2.2 (Outliers).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple, TypeAlias

import numpy as np
from scipy.special import chdtrc, ndtri, stdtrit

from ..arrays import ComplexArray, FloatArray, unit_columns
from ..engine.modal import parameters_from_poles, respond
from ..engine.problem import KnownFactor
from ..engine.responses import HeldInput
from ..signals.correlation import fit_percent
from ..signals.noise import correlation_time

_TURNS = 6  # of Gauss and Newton at most
_LARGEST_STRETCH = 0.5  # of the logarithm, in one turn
_SETTLED = 1e-3  # samples, and part of the lags
_STRETCH = 0.01  # of the time constants, for a slope by differences: off by 1e-4
_FALSE_NAMES = 0.01  # chance that an outlier is named in a set without one


Moved: TypeAlias = Callable[[float, float], tuple[FloatArray, FloatArray, FloatArray]]
"""Common response (n,), shifted and stretched, and its derivatives by shift and log stretch."""


class OwnResponse(NamedTuple):
    """One record relative to the common model, with standard errors.

    `shift` in s and `gain` (a ratio) are estimated together, with common lags; `lag` is the ratio
    of all time constants with delay and gain free too, and its error is relative. `followed` is the
    fit percentage of the unchanged common model. `gain_alone` is the gain with everything else
    common, the dead time too.
    """

    shift: float
    error: float
    gain: float
    gain_error: float
    lag: float
    lag_error: float
    followed: float
    gain_alone: float
    gain_alone_error: float


def response_slopes(
    drive: HeldInput,
    known: KnownFactor,
    dead_time: float,
    poles: ComplexArray,
    numerator: FloatArray,
    step: float,
    stretch: float = 1.0,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Response (m,) of a model, and what another gain, dead time or time scale would add to it.

    The response is also its derivative with respect to the logarithm of the gain. The others are
    central differences: with respect to the dead time, which is moved by `step` s, and to the
    logarithm of all time constants. These are `stretch` times as long as those of `poles`, with the
    same gain. Before time 0 the response is extrapolated.
    """
    powers = np.arange(numerator.size) - float(poles.size)

    def response(at: float, stretch: float) -> FloatArray:
        parameters = np.append(at, parameters_from_poles(poles / stretch))
        return respond(drive, known, numerator * stretch**powers, parameters)

    at = max(dead_time, step)
    later = (response(at + step, stretch) - response(at - step, stretch)) / (2 * step)
    longer, shorter = (response(at, stretch * (1 + part)) for part in (_STRETCH, -_STRETCH))
    here = response(at, stretch) + (dead_time - at) * later
    return here, later, (longer - shorter) / (2 * _STRETCH)


def homogeneity(values: FloatArray, errors: FloatArray) -> tuple[float, float]:
    """Chi-square of estimates about their weighted mean, and its p-value.

    Estimates with infinite errors are ignored.

    Examples
    --------
    >>> import numpy as np
    >>> chi_square, chance = homogeneity(np.array([1.0, 1.1, 0.9]), np.full(3, 0.1))
    >>> print(round(chi_square, 2), round(chance, 2))
    2.0 0.37
    """
    known = np.isfinite(errors) & np.isfinite(values)
    if known.sum() < 2:
        return 0.0, 1.0
    values, weight = values[known], errors[known] ** -2.0
    centre = float(np.sum(weight * values) / np.sum(weight))
    statistic = float(np.sum(weight * (values - centre) ** 2))
    return statistic, float(chdtrc(values.size - 1, statistic))


def disagreeing(values: FloatArray, errors: FloatArray, least: float) -> list[int]:
    """Positions of estimates that do not agree with the others, the farthest first.

    Each is compared with the mean of the others (deleted residual [3]_). If those
    agree within their errors, these are the yardstick, otherwise their scatter with its few degrees
    of freedom. Bonferroni's correction allows one false name in a hundred sets. At least half of
    the estimates, and two, remain; differences up to `least` are ignored.

    Examples
    --------
    >>> import numpy as np
    >>> disagreeing(np.array([1.0, 1.02, 1.5]), np.full(3, 0.02), 0.1)
    [2]
    >>> disagreeing(np.array([1.0, 1.25, 1.5]), np.full(3, 0.02), 0.1)  # none agree
    []
    """
    kept = np.flatnonzero(np.isfinite(errors) & np.isfinite(values)).tolist()
    fewest = max(len(values) // 2 + 1, 2)
    apart: list[int] = []
    while len(kept) > fewest:
        scores = [_against_others(i, kept, values, errors, least) for i in kept]
        worst = int(np.argmax(scores))
        if scores[worst] <= 1:
            break
        apart.append(kept.pop(worst))
    return apart


def _against_others(
    one: int, kept: list[int], values: FloatArray, errors: FloatArray, least: float
) -> float:
    """Distance of an estimate from the mean of the others, over its critical value."""
    others = [k for k in kept if k != one]
    tail = _FALSE_NAMES / (2 * (len(others) + 1))
    rest = values[others]
    if homogeneity(rest, errors[others])[1] >= _FALSE_NAMES:
        weight = errors[others] ** -2.0
        centre = float(np.sum(weight * rest) / np.sum(weight))
        critical = -ndtri(tail) * np.hypot(errors[one], np.sum(weight) ** -0.5)
    else:
        centre = float(rest.mean())
        scale = max(float(rest.std(ddof=1)), errors[one]) * np.sqrt(1 + 1 / len(others))
        critical = -stdtrit(len(others) - 1, tail) * scale
    return float(abs(values[one] - centre) / max(critical, least))


def own_step_response(
    output: FloatArray, model: FloatArray, start: float, own: FloatArray, dt: float
) -> OwnResponse:
    """Shift, scale and stretch the common response of a step to fit one record best.

    Parameters
    ----------
    output : ndarray, shape (n,)
        The record, per unit of input.
    model : ndarray, shape (N,), N >= n
        Response of the common model.
    start : float
        Sample at which it starts to move.
    own : ndarray, shape (N, q)
        Further effects in each record beside a drift: a level, hum, a free response.
    dt : float
        Sample time in s.
    """
    n = output.size
    line = np.arange(n) / n  # drifts may cancel in the mean of the records
    own = own[:n]

    moved = partial(_moved, model, n, start)
    return matched(output, moved, np.column_stack([line, own]), own, 0.2 * start + 20, dt)


def matched(
    output: FloatArray, moved: Moved, beside: FloatArray, own: FloatArray, reach: float, dt: float
) -> OwnResponse:
    """Shift, scale and stretch a common response to fit one record best.

    Parameters
    ----------
    output : ndarray, shape (n,)
        The record.
    moved : callable
        The common response for a shift in samples and a stretch.
    beside : ndarray, shape (n, p)
        Further effects in the record.
    own : ndarray, shape (n, q)
        Those beside which the gain alone is estimated.
    reach : float
        Largest shift in one turn, in samples.
    dt : float
        Sample time in s.
    """
    (gain, shift, _), (gain_error, error, _), _ = _settled(output, moved, beside, reach, 0.0, 2)
    (*_, lag), (*_, lag_error), settled = _settled(output, moved, beside, reach, shift, 3)
    common = moved(0.0, 1.0)[0]
    alone, errors = _regression(np.column_stack([common, own]), output)
    level = np.linalg.lstsq(beside, output - common, rcond=None)[0]
    followed = float(fit_percent(output, common + beside @ level))
    return OwnResponse(
        shift * dt,
        max(error, 1e-12) * dt,
        gain,
        max(gain_error, 1e-12),
        lag,
        max(lag_error, 1e-12) if settled else np.inf,  # delay, gain and lags may look alike
        followed,
        float(alone[0]),
        max(float(errors[0]), 1e-12),
    )


def _settled(
    output: FloatArray, moved: Moved, beside: FloatArray, reach: float, shift: float, free: int
) -> tuple[tuple[float, ...], tuple[float, ...], bool]:
    """Gain, shift and stretch of a response that fit best, their errors, and whether they settled.

    The first 2 or 3 are `free`; otherwise the stretch is 1. The errors of shift and stretch are
    those of the last turn.
    """
    stretch = 1.0
    for _ in range(_TURNS):
        columns = moved(shift, stretch)[:free]
        solution, errors = _regression(np.column_stack([*columns, beside]), output)
        gain = float(solution[0]) or 1.0
        moves = np.append(solution[1:free] / gain, 0.0)
        shift += float(np.clip(moves[0], -reach, reach))
        stretch *= float(np.exp(np.clip(moves[1], -_LARGEST_STRETCH, _LARGEST_STRETCH)))
        settled = bool(np.abs(moves).max() < _SETTLED)
        if settled:
            break
    relative = (errors[1:3] / abs(gain)).tolist()
    return (gain, shift, stretch), (float(errors[0]), *relative), settled


def _moved(
    model: FloatArray, n: int, start: float, shift: float, stretch: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Delayed and stretched response, and its derivatives w.r.t. shift and log stretch."""
    index = np.arange(n, dtype=np.float64)
    behind = (index - start - shift) / stretch
    at = np.where(behind > 0, start + behind, index - shift)
    everywhere = np.arange(model.size)
    steep = np.interp(at, everywhere, np.gradient(model))
    by_shift = np.where(behind > 0, -steep / stretch, -steep)
    return np.interp(at, everywhere, model), by_shift, -np.maximum(behind, 0.0) * steep


def _regression(columns: FloatArray, output: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Least squares and standard errors, including correlation of the residual."""
    scaled, size = unit_columns(columns)
    solution = np.linalg.lstsq(scaled, output, rcond=None)[0]
    left = output - scaled @ solution
    freedom = max(output.size - columns.shape[1], 1)
    variance = float(left @ left) / freedom * correlation_time(left)
    spread = np.diag(np.linalg.pinv(scaled.T @ scaled))
    return solution / size, np.sqrt(variance * np.maximum(spread, 0.0)) / size
