"""Checks of a fit with coloured residual, by one step of generalised least squares."""

from __future__ import annotations

import numpy as np
from scipy.special import ndtr

from ..._wording import in_time
from ...numerics.arrays import FloatArray
from ...numerics.constants import Z_95
from ...numerics.validation.white_step import WhiteStep, white_step
from ...results import Flag
from .loop_flags import RARE
from .result import OutputErrorFit

_OFF = 0.2  # relative difference of gains or total delays that is worth a flag: presentation


def generalised_step(
    fit: OutputErrorFit, output: FloatArray, drive: FloatArray
) -> WhiteStep | None:
    """One step of generalised least squares, from a fit with coloured residual."""
    if not np.all(fit.poles) or not fit.gain:
        return None
    lead = fit.gain * float(np.real(np.prod(-fit.poles) / np.prod(-fit.zeros)))
    numerator = lead * np.atleast_1d(np.real(np.poly(fit.zeros)))[::-1]
    step = white_step(output, drive, fit.dt, fit.dead_time, fit.poles, numerator)
    reach = max(fit.total_delay, fit.dead_time)
    # Farther away, one step of a linearisation is not a valid estimate.
    return step if step is None or abs(step.dead_time - fit.dead_time) <= reach else None


def coloured_flags(fit: OutputErrorFit, step: WhiteStep) -> list[Flag]:
    """Flags for what generalised least squares say otherwise than output error."""
    return [*_unresolved(fit, step), *_noncausal(step)]


def _unresolved(fit: OutputErrorFit, step: WhiteStep) -> list[Flag]:
    gains = abs(step.gain - fit.gain) + Z_95 * step.gain_error
    totals = abs(step.total - fit.total_delay) + Z_95 * step.total_error
    if gains <= _OFF * abs(fit.gain) and totals <= _OFF * abs(fit.total_delay):
        return []
    gain, total = Z_95 * step.gain_error, Z_95 * step.total_error
    return [
        Flag(
            "gain_not_resolved",
            "the disturbances are coloured: weighted accordingly, gain and total delay are "
            f"{step.gain:.3g} +- {gain:.2g} and {in_time(step.total)} -+ {in_time(total)}: "
            "neither is well determined; use a longer record, or one with smaller "
            "disturbances",
        )
    ]


def _noncausal(step: WhiteStep) -> list[Flag]:
    if not step.dead_time_error or ndtr(step.dead_time / step.dead_time_error) >= RARE:
        return []
    error = Z_95 * step.dead_time_error
    return [
        Flag(
            "noncausal",
            "the disturbances are coloured: weighted accordingly, the dead time is negative, "
            f"-{in_time(-step.dead_time)} +- {in_time(error)}: the output leads the input. Causes "
            "are an unmeasured signal that acts on both, feedback, or different clocks of input "
            "and output; dead time and lags are not those of the plant",
        )
    ]
