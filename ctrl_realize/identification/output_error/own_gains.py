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

from ..._flags import flagged
from ..._parameters import gain_unit, slope_unit
from ..._wording import chosen
from ...data import Record
from ...numerics.arrays import FloatArray
from ...numerics.constants import Z_95
from ...numerics.validation.own_response import homogeneity
from .averaging import middle_gain
from .record_gains import ONE_POINT, RecordGains, operating_point
from .repeatability import RESPONDS, Repeatability
from .result import OutputErrorFit

_TURNS = 8  # at most; two or three are usual
_SETTLED = 0.25  # standard errors by which a ratio may still move: 3 % of the error in quadrature
_ROUNDING = 1e-4  # the same of the ratio itself, for records without noise

_COMMON = ("gains_differ", "no_common_gain")
"""Flags of fits with a common gain."""


def fit_own_gains(
    records: tuple[Record, ...],
    fit: Callable[[FloatArray, bool], OutputErrorFit],
    start: FloatArray | None,
) -> OutputErrorFit:
    """Fit model and gain ratios in turn.

    Parameters
    ----------
    records : tuple of Record
    fit : callable
        Fit of all records for given ratios (R,), in whole or for the next ratios alone: noise with
        wrong ones is coloured, and seems to hide loads.
    start : ndarray, shape (R,), or None
        Ratios that hold for any dynamics, so that no turns are needed; None: there are none.
    """
    ratios, whole = np.ones(len(records)) if start is None else start, start is not None
    for turn in range(_TURNS):
        result = fit(ratios, whole or turn == _TURNS - 1)
        assert result.repeatability is not None
        found: Repeatability = result.repeatability
        used = found.kept
        errors = found.gain_alone_errors
        moved = ratios * found.gains_alone
        moved = moved / middle_gain(moved[used])
        answers = np.abs(found.gains_alone) > RESPONDS * errors
        turned = ratios / middle_gain(ratios[used])
        if start is None:
            turned = np.where(answers, moved, turned)
        if np.all(np.abs(turned / ratios - 1) <= np.maximum(_SETTLED * errors, _ROUNDING)):
            if whole:
                break
            whole = True
        ratios = turned
    gains = _gains(records, result, found, moved)
    repeats = replace(
        found,
        gains=found.gains * ratios,
        gain_errors=found.gain_errors * ratios,
        gains_alone=found.gains_alone * ratios,
        gain_alone_errors=found.gain_alone_errors * ratios,
        gain_test=(gains.chi_square, gains.p_value),
    )
    flags = [flag for flag in result.flags if flag.code not in _COMMON]
    if gains.differ:
        flags.append(
            flagged(
                "gains_differ.own",
                chi_square=gains.chi_square,
                chance=gains.p_value,
                median=gains.reference,
                schedule=gains.in_words(),
            )
        )
    reason = chosen("records.own_gains", count=int(used.sum()))
    return replace(
        result,
        gains=gains,
        repeatability=repeats,
        flags=tuple(flags),
        choices=(*result.choices, reason),
    )


def at_model_gain(fit: OutputErrorFit) -> tuple[Record, ...]:
    """Records of a fit, with their inputs multiplied by their gains over that of the model."""
    gains = fit.gains
    if gains is None:
        return fit.records
    return tuple(
        record.__replace__(input=ratio * record.input)
        for record, kept, ratio in zip(fit.records, gains.kept, gains.ratios, strict=True)
        if kept
    )


def _gains(
    records: tuple[Record, ...], result: OutputErrorFit, found: Repeatability, ratios: FloatArray
) -> RecordGains:
    """Gains and their errors, from the common gain and the ratios.

    The common gain contains the noise of all records and the error of the dynamics; that of a
    record contains its own noise in place of the former.
    """
    common, used = result.gain, found.kept
    own = found.gain_alone_errors
    pooled = 1.0 / float(np.sum(own[used] ** -2.0))
    beyond = np.sqrt(np.maximum(own**2 - np.where(used, pooled, 0.0), 0.0))
    gains = common * ratios
    size = np.abs(gains)
    low, high = result.estimate.gain_ends
    test = homogeneity((gains / common)[used], (own * size / abs(common))[used])
    points, inputs, outputs = map(np.array, zip(*map(operating_point, records), strict=True))
    alike = np.ptp(points) <= ONE_POINT * np.ptp(inputs)
    if alike:
        points = np.abs(np.diff(inputs)[:, 0])
    ratio = gain_unit(result.output_unit, result.input_unit)
    return RecordGains(
        names=found.names,
        scheduled_over="step height" if alike else "input level",
        operating_points=points,
        input_levels=inputs,
        output_levels=outputs,
        gains=gains,
        errors=size * np.hypot(result.gain_std_given_structure / common, beyond),
        low=gains - size * np.hypot((common - low) / common, Z_95 * beyond),
        high=gains + size * np.hypot((high - common) / common, Z_95 * beyond),
        reference=common,
        chi_square=test[0],
        p_value=test[1],
        outlying=found.outlying,
        input_unit=result.input_unit,
        gain_unit=slope_unit(ratio, "s") if result.integrators else ratio,
    )
