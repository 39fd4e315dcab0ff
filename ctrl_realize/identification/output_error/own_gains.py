"""Joint fit of several records with common dynamics and a gain for each of them.

A record with gain ratio g answers like the common model to g times its input, so that for given
ratios this is the fit with a common gain.

Step records are multiples of one response: their ratios come from the rank-one approximation of all
records (see `averaging`), whatever the dynamics are. For other inputs fit and ratios, which are
linear regressions on the response of the model, are repeated in turn until the ratios stay: a
stationary point of the sum of squares over all parameters (block coordinate descent [1]_). Between
records of one kind of input ratios and dynamics are orthogonal: two or three turns are enough, and
the interval of the dead time is that for known ratios.

References
----------
.. [1] J. Nocedal and S. J. Wright, Numerical Optimization, 2nd ed., Springer 2006, section 9.3
   (Coordinate and pattern-search methods).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..._flags import Flag, flagged
from ...data import Record
from ...numerics.arrays import FloatArray
from ...numerics.constants import Z_95
from ...numerics.validation.own_response import disagreeing, homogeneity
from .averaging import middle_gain
from .record_gains import (
    ONE_POINT,
    RecordGains,
    levels_of_input,
    levels_of_output,
    middle_of_input,
)
from .repeatability import Repeatability
from .result import OutputErrorFit

_TURNS = 8  # at most; two or three are usual
_SETTLED = 0.25  # standard errors by which a ratio may still move: 3 % of the error in quadrature
_ROUNDING = 1e-4  # the same of the ratio itself, for records without noise
_RESPONDS = 5.0
"""Standard errors that a gain must be away from zero to be one, as for an output that leaves its
rest. A record below that does not respond."""
_LATER = 1.0
"""Samples by which dead times may differ in any case: the trigger falls between two samples."""
_SLOWER = 0.1
"""Part by which time constants may differ in any case. The likelihood of real records resolves less
than a percent, at which no two of them have the same."""

_COMMON = ("gains_differ", "no_common_gain")
"""Flags of fits with a common gain."""


def unlike_records(found: Repeatability, used: tuple[int, ...], dt: float) -> tuple[int, ...]:
    """Positions of records, among those used, whose response is not a multiple of the others'.

    They do not respond, or their dead time or time constants disagree with those of the others.
    """
    answers = np.abs(found.gains_alone) > _RESPONDS * found.gain_alone_errors
    silent = [i for i in used if not answers[i]]
    rest = np.array([i for i in used if answers[i]], dtype=np.int64)
    if rest.size == 0:
        return ()
    late = disagreeing(found.delays[rest], found.errors[rest], _LATER * dt)
    slow = disagreeing(np.log(found.lags[rest]), found.lag_errors[rest], np.log1p(_SLOWER))
    return tuple(sorted({*silent, *rest[late].tolist(), *rest[slow].tolist()}))


def fit_own_gains(
    records: tuple[Record, ...],
    fit: Callable[[FloatArray], OutputErrorFit],
    start: FloatArray | None,
) -> OutputErrorFit:
    """Fit model and gain ratios in turn.

    Parameters
    ----------
    records : tuple of Record
    fit : callable
        Fit of all records for given ratios (R,).
    start : ndarray, shape (R,), or None
        Ratios that hold for any dynamics, so that no turns are needed; None: there are none.
    """
    ratios = np.ones(len(records)) if start is None else start
    for _ in range(_TURNS):
        result = fit(ratios)
        found = _compared(result)
        used = np.array([name not in found.outlying for name in found.names])
        errors = found.gain_alone_errors
        moved = ratios * found.gains_alone
        moved = moved / middle_gain(moved[used])
        answers = np.abs(found.gains_alone) > _RESPONDS * errors
        turned = ratios / middle_gain(ratios[used])
        if start is None:
            turned = np.where(answers, moved, turned)
        if np.all(np.abs(turned / ratios - 1) <= np.maximum(_SETTLED * errors, _ROUNDING)):
            break
        ratios = turned
    gains = _gains(records, result, found, moved, used)
    repeats = replace(
        found,
        gains=found.gains * ratios,
        gain_errors=found.gain_errors * ratios,
        gains_alone=found.gains_alone * ratios,
        gain_alone_errors=found.gain_alone_errors * ratios,
        gain_test=(gains.chi_square, gains.p_value),
    )
    kept = [flag for flag in result.flags if flag.code not in _COMMON]
    reason = f"gain of the model: the median of {int(used.sum())} records, each with its own"
    return replace(
        result,
        gains=gains,
        repeatability=repeats,
        flags=(*kept, *_flags(gains)),
        choices=(*result.choices, reason),
    )


def _compared(result: OutputErrorFit) -> Repeatability:
    assert result.repeatability is not None
    return result.repeatability


def at_model_gain(fit: OutputErrorFit) -> tuple[Record, ...]:
    """Records of a fit, with their inputs multiplied by their gains over that of the model."""
    gains = fit.gains
    if gains is None:
        return fit.records
    return tuple(
        Record(record.time, ratio * record.input, record.output, name=record.name)
        for record, name, ratio in zip(fit.records, gains.names, gains.ratios, strict=True)
        if name not in gains.outlying
    )


def _gains(
    records: tuple[Record, ...],
    result: OutputErrorFit,
    found: Repeatability,
    ratios: FloatArray,
    used: NDArray[np.bool_],
) -> RecordGains:
    """Gains and their errors, from the common gain and the ratios.

    The common gain contains the noise of all records and the error of the dynamics; that of a
    record contains its own noise in place of the former.
    """
    common = result.gain
    own = found.gain_alone_errors
    pooled = 1.0 / float(np.sum(own[used] ** -2.0))
    beyond = np.sqrt(np.maximum(own**2 - np.where(used, pooled, 0.0), 0.0))
    gains = common * ratios
    size = np.abs(gains)
    low, high = result.estimate.gain_ends
    test = homogeneity((gains / common)[used], (own * size / abs(common))[used])
    inputs = np.array([levels_of_input(record) for record in records])
    points = np.array([middle_of_input(record) for record in records])
    alike = np.ptp(points) <= ONE_POINT * np.ptp(inputs)
    if alike:
        points = np.abs(np.diff(inputs)[:, 0])
    return RecordGains(
        names=found.names,
        scheduled_over="step height" if alike else "input level",
        operating_points=points,
        input_levels=inputs,
        output_levels=np.array([levels_of_output(record) for record in records]),
        gains=gains,
        errors=size * np.hypot(result.gain_std_given_structure / common, beyond),
        low=gains - size * np.hypot((common - low) / common, Z_95 * beyond),
        high=gains + size * np.hypot((high - common) / common, Z_95 * beyond),
        reference=common,
        chi_square=test[0],
        p_value=test[1],
        outlying=found.outlying,
    )


def _flags(gains: RecordGains) -> tuple[Flag, ...]:
    """Say where one model is not enough, and what the gain is elsewhere."""
    if not gains.differ:
        return ()
    return (
        flagged(
            "gains_differ.own",
            chi_square=gains.chi_square,
            chance=gains.p_value,
            median=gains.reference,
            schedule=gains.in_words(),
        ),
    )
