"""Flags of what a sensor or its recorder did: held or stuck values, outliers, gaps."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..._flags import Flag, flagged
from ..._wording import in_time, plainly
from ...numerics.arrays import FloatArray
from ...numerics.constants import FAR_OUTLIER, SMALLEST
from ...numerics.signals.jumps import swapped
from ...numerics.signals.noise import BEYOND, far_value, winsorised_sigma
from ...numerics.validation.held_output import (
    held_share,
    holds_in_motion,
    longest_hold,
    straight_lines,
    stuck_samples,
    updates,
)
from ...numerics.validation.limits import at_limit
from .result import OutputErrorFit

_HELD = 0.5
"""Fraction of moving samples that repeat the previous one, above which an output counts as held;
noise of one quantisation step repeats 28 %. Ablation: held output."""
# The following thresholds for flags are a matter of presentation.
_MANY = 0.002  # of the samples beyond, from which on they are named
_GAP = 3.0  # usual distances of samples that a gap has at least
_OF_THE_ONSET = 0.2  # part of the time to the first sample of the response that it takes at least
_STAYS = 0.5  # part of a lead that the next sample keeps; what a switch radiates is gone by then
_REST = 8  # samples that noise before a lead is taken from at least
_LEAD = 5  # samples next to the step that are looked at, and do not count as rest


def sensor_flags(fit: OutputErrorFit, output: FloatArray, fitted: FloatArray) -> Iterator[Flag]:
    """Look for samples of one record (N,) that its plant does not explain."""
    first, last = stuck_samples(output, fitted)
    if first != last and not at_limit(output):
        at_end = last == output.size - 1 == fit.time.size - 1
        yield flagged(
            "stuck_output",
            count=last - first + 1,
            first=fit.time[first],
            last=fit.time[last],
            end=" (the end of the record)" if at_end else "",
            value=output[first],
        )
    if swapped(fit.data.input[fit.data.rows], output):
        yield flagged("swapped")
    if np.isfinite(fit.onset):
        yield from _onset_in_gap(fit)
        yield from _lead(fit, output, fitted)
    else:
        noise = max(fit.residual, SMALLEST) if fit.at_noise_level else np.inf
        yield from outliers(output, (output - fitted) / noise, fit.time)


def outliers(output: FloatArray, off: FloatArray, time: FloatArray) -> Iterator[Flag]:
    """Report a code for missing samples, or samples that are far off the model.

    `off` (N,) is the residual in standard deviations of the noise, at `time` in s; zero if the
    residual is more than noise.
    """
    share, worst = float(np.mean(np.abs(off) > FAR_OUTLIER)), int(np.argmax(np.abs(off)))
    if code := missing_code(output):
        yield code
    elif share > _MANY:
        most = f"{plainly(abs(off[worst]), 2)} at {in_time(time[worst])}"
        yield flagged("outliers", share=100 * share, limit=FAR_OUTLIER, most=most)


def missing_code(output: FloatArray) -> Flag | None:
    """Find a single value far beyond all others, as loggers write for missing samples."""
    far = far_value(output)
    if not far.size:
        return None
    value = output[far[0]]
    return flagged("outliers.code", count=far.size, first=far[0], value=value, limit=BEYOND)


def held_output(
    output: FloatArray, fitted: FloatArray, dt: float, low: float
) -> tuple[float, Flag] | None:
    """Test whether an output is held, and return what the least dead time `low` in s becomes."""
    share = held_share(output, fitted)
    if share <= _HELD:
        return None
    hold = dt * longest_hold(output, fitted)
    low = max(low - hold, 0.0)
    least = in_time(low)
    return low, flagged("held_output", share=100 * share, hold=in_time(hold), least=least)


def stored_output(
    output: FloatArray, drive: FloatArray, dt: float, low: float
) -> tuple[float, Flag] | None:
    """Test whether an output is stored when it has changed enough; return as `held_output`.

    Of straight lines that of a rest ends later than the response begins, by less than the next one
    is long: of a parabola, by half of it.
    """
    corners = straight_lines(output, drive)
    if corners.size:
        low = max(low - dt * float(holds_in_motion(output, corners)[0]), 0.0)
        count, least = corners.size - 1, in_time(low)
        return low, flagged("held_output.lines", count=count, least=least)
    new = updates(output, drive[None])
    if new.all():
        return None
    hold = dt * float(holds_in_motion(output, np.flatnonzero(new)).max())
    told = flagged("held_output.few", count=np.count_nonzero(new), hold=in_time(hold))
    return max(low - hold, 0.0), told


def _onset_in_gap(fit: OutputErrorFit) -> Iterator[Flag]:
    """Report a gap in which a step response begins."""
    data = fit.data
    if data.motion is None or data.rows.size == data.input.size:
        return
    step = data.edges[0][0]
    begun = data.before(step + data.motion.crossing)
    if not 0 < begun < data.rows.size:
        return
    first, last = (int(data.rows[k]) for k in (begun - 1, begun))
    usual = float(np.median(np.diff(data.rows)))
    if last - first >= max(_GAP * usual, _OF_THE_ONSET * data.motion.crossing):
        ends = " and ".join(in_time(max(row - step, 0) * data.dt) for row in (first, last))
        yield flagged("onset_in_gap", ends=ends)


def _lead(fit: OutputErrorFit, output: FloatArray, fitted: FloatArray) -> Iterator[Flag]:
    """Report an output that moves no later than in the sample in which its input steps.

    An input that is held from that sample on acts on the next one at the earliest.
    """
    data = fit.data
    if data.motion is None:
        return
    step = data.edges[0][0]
    k = data.before(step)
    if k < _REST + _LEAD or k + 1 >= output.size or data.rows[k] != step:
        return
    moved = (output - fitted) * data.motion.sign
    moved = moved[: k + 2] - np.median(moved[: k - _LEAD + 1])
    before = moved[: k - _LEAD + 1]
    # A rest may be padded, or quieter than what follows.
    least = FAR_OUTLIER * max(winsorised_sigma(before, data.quantum), data.sigma, fit.residual)
    goes_on = (output[k + 1] - fitted[k]) * data.motion.sign
    if moved[k] > least and goes_on >= _STAYS * moved[k]:
        samples = next((n for n in range(1, _LEAD) if moved[k - n] <= least), _LEAD)
        yield flagged("noncausal", part=100 * moved[k] / data.motion.span, samples=samples)
