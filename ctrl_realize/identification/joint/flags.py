"""Flags of a joint fit: what contradicts what, and where."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.stats import chi2

from ..._flags import Flag, flagged
from ..._wording import in_time, interval_in_time
from ...frequency.comparison import hertz
from ...frequency.disagreement import FAR
from ...numerics.joint.fit import BY_CHANCE
from ...numerics.rational.bands import running_median, widest_run
from ...numerics.signals.noise import largest_excess
from ..output_error.flags import model_flags
from .result import JointFit

_NO_MODEL = ("phase_leads", "structured_misfit")  # flags of a response that none follows
_SMOOTHED_POINTS = 3  # a single bad point is not a band


def joint_flags(fit: JointFit, latest: float | None) -> tuple[Flag, ...]:
    """List the flags of the joint model, and that of a contradiction first."""
    length, gain_ends = fit.data.length, fit.gain_interval
    of_model = model_flags(fit.estimate, fit.data.dt, length, latest, gain_ends)
    return (*_contradiction(fit), *of_model)


def _contradiction(fit: JointFit) -> Iterator[Flag]:
    agreed = fit.agreement
    if not agreed.contradicts:
        yield from _left_alone(fit)
        return
    limit = float(chi2.isf(BY_CHANCE, agreed.parameters))
    limit = min(limit, 0.999 * max(agreed.record_rise, agreed.frf_rise))
    where = [_points_outside(fit)] if agreed.frf_rise > limit else []
    where += [_times_outside(fit)] if agreed.record_rise > limit else []
    yield flagged(
        "frf_contradicts_records",
        statistic=agreed.statistic,
        parameters=agreed.parameters,
        chance=agreed.p_value,
        where=", and ".join(where),
        difference=_difference(fit),
    )


def _left_alone(fit: JointFit) -> Iterator[Flag]:
    """Report a frequency response that no model follows: its noise is what that leaves."""
    other = fit.frf_fit
    codes = [flag.code for flag in other.flags if flag.code in _NO_MODEL]
    model, measured = fit.response(2 * np.pi * other.frequency_hz), other.measured
    error = float(np.linalg.norm(model - measured) / np.linalg.norm(measured))
    if codes and error >= FAR:
        named = ", ".join(codes)
        yield flagged("frf_contradicts_records.alone", codes=named, error=100 * error)


def _points_outside(fit: JointFit) -> str:
    agreed, other = fit.agreement, fit.frf_fit
    hz, measured = other.frequency_hz, other.measured
    model = fit.response(2 * np.pi * hz)
    worst = int(np.argmax(np.abs(model - measured) / agreed.radius))
    ratio = model[worst] / measured[worst]
    said = (
        f"is outside of the 95 % circles of {int(agreed.outside.sum())} of {hz.size} points of "
        f"the frequency response, by most at {hertz(hz[worst])} "
        f"({20 * np.log10(abs(ratio)):+.2g} dB, {np.degrees(np.angle(ratio)):+.2g} deg)"
    )
    off = running_median(agreed.outside.astype(np.float64), _SMOOTHED_POINTS) > 0.5
    if not off.any():
        return said
    band = hz[widest_run(off, hz)]
    return f"{said}, mainly from {hertz(band[0])} to {hertz(band[-1])}"


def _times_outside(fit: JointFit) -> str:
    shift = np.abs(fit.agreement.shift)
    first, stop = largest_excess(shift)
    times = fit.time[first], fit.time[stop - 1]
    return (
        f"is up to {shift.max() / fit.record_fit.residual:.2g} residuals of the records away from "
        f"their own model, mainly at {interval_in_time(*times)}"
    )


def _difference(fit: JointFit) -> str:
    """Say whether another gain or another dead time explains the contradiction."""
    agreed = fit.agreement
    (ratio, by_gain), (later, by_delay) = agreed.gain_ratio, agreed.later
    if max(by_gain, by_delay) < BY_CHANCE:
        return (
            "Neither another gain nor another dead time explains it (best ratio of gains "
            f"{ratio:.3g}): the dynamics differ"
        )
    if by_gain >= by_delay:
        return (
            f"A gain of the frequency response of {ratio:.3g} times that of the records explains "
            f"it (p = {by_gain:.2g})"
        )
    side = "longer" if later > 0 else "shorter"
    return (
        f"A dead time of the frequency response that is {in_time(abs(later))} {side} than that of "
        f"the records explains it (p = {by_delay:.2g})"
    )
