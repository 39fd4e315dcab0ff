"""Flags of what a sensor or its recorder did: held or stuck values, outliers, gaps."""

from __future__ import annotations

import numpy as np

from ..._wording import in_time
from ...numerics.arrays import FloatArray
from ...numerics.signals.noise import winsorised_sigma
from ...numerics.validation.held_output import held_share, longest_hold, stuck_samples
from ...numerics.validation.limits import at_limit
from ...results import Flag
from .result import OutputErrorFit

_HELD = 0.5
"""Fraction of moving samples that repeat the previous one, above which an output counts as held;
noise of one quantisation step repeats 28 %. Ablation: held output."""
# The following thresholds for flags are a matter of presentation.
_BEYOND = 20.0  # ranges: no overshoot goes as far
_OUTLIER = 5.0  # standard deviations: Gaussian noise has none of a million samples beyond
_MANY = 0.002  # of the samples beyond, from which on they are named
_GAP = 3.0  # usual distances of samples that a gap has at least
_OF_THE_ONSET = 0.2  # part of the time to the first sample of the response that it takes at least
_STAYS = 0.5  # part of a lead that the next sample keeps; what a switch radiates is gone by then
_REST = 8  # samples that noise before a lead is taken from at least
_LEAD = 5  # samples next to the step that are looked at, and do not count as rest


def sensor_flags(fit: OutputErrorFit, output: FloatArray, fitted: FloatArray) -> list[Flag]:
    """Look for samples of one record (N,) that its plant does not explain."""
    flags = [] if at_limit(output) else _stuck(fit, output, fitted)
    if np.isfinite(fit.onset):
        return flags + _onset_in_gap(fit) + _lead(fit, output, fitted)
    return flags + outliers(output, fitted, fit.residual if fit.at_noise_level else None)


def outliers(output: FloatArray, fitted: FloatArray, sigma: float | None) -> list[Flag]:
    """Report a code for missing samples, or samples that are far off the model.

    `sigma` is the standard deviation of the noise; None if the residual is more than noise.
    """
    code = missing_code(output)
    if code:
        return [Flag("outliers", code)]
    if sigma is None:
        return []
    outlying = float(np.mean(np.abs(output - fitted) > _OUTLIER * sigma))
    if outlying <= _MANY:
        return []
    return [
        Flag(
            "outliers",
            f"{100 * outlying:.2g} % of the samples are outliers, {_OUTLIER:g} "
            "standard deviations or "
            "more from the model",
        )
    ]


def missing_code(output: FloatArray) -> str:
    """Find a single value far beyond all others, as loggers write for missing samples."""
    low, high = np.percentile(output, [1, 99])
    far = np.flatnonzero(
        (output < low - _BEYOND * (high - low)) | (output > high + _BEYOND * (high - low))
    )
    if not far.size or high == low or np.ptp(output[far]) > 0:
        return ""
    return (
        f"{far.size} sample(s), the first at index {far[0]}, are {output[far[0]]:g}, at least "
        f"{_BEYOND:g} times the range of the other samples away from them: if this value "
        'marks missing data, replace it by NaN (Record(..., missing="keep")) before the fit, '
        "which it distorts"
    )


def held_flags(output: FloatArray, fitted: FloatArray, dt: float) -> tuple[list[Flag], float]:
    """Test whether an output is held between samples, and return the hold time in s."""
    share = held_share(output, fitted)
    if share <= _HELD:
        return [], 0.0
    hold = dt * longest_hold(output, fitted)
    flag = Flag(
        "held_output",
        f"while the output moves, {100 * share:.0f} % of its samples repeat the previous one: "
        "the output is held (by an analyser, or by the dead band of a historian) and "
        f"recorded late; the dead time may be up to {in_time(hold)} shorter",
    )
    return [flag], hold


def _stuck(fit: OutputErrorFit, output: FloatArray, fitted: FloatArray) -> list[Flag]:
    first, last = stuck_samples(output, fitted)
    if first == last:
        return []
    end = " (the end of the record)" if last == output.size - 1 == fit.time.size - 1 else ""
    return [
        Flag(
            "stuck_output",
            f"{last - first + 1} samples, from {fit.time[first]:.6g} s to {fit.time[last]:.6g} s"
            f"{end}, are exactly {output[first]:.6g}, while others repeat the one before them "
            "seldom: the sensor or its connection was dead; replace them by NaN "
            '(Record(..., missing="keep")), since they count as measurements',
        )
    ]


def _onset_in_gap(fit: OutputErrorFit) -> list[Flag]:
    """Report a gap in which a step response begins."""
    data = fit.data
    if data.motion is None or data.rows.size == data.input.size:
        return []
    begun = data.before(data.edges[0][0] + data.motion.crossing)
    if not 0 < begun < data.rows.size:
        return []
    first, last = (int(data.rows[k]) for k in (begun - 1, begun))
    usual = float(np.median(np.diff(data.rows)))
    if last - first < max(_GAP * usual, _OF_THE_ONSET * data.motion.crossing):
        return []
    step = data.edges[0][0]
    ends = " and ".join(in_time(max(row - step, 0) * data.dt) for row in (first, last))
    return [
        Flag(
            "onset_in_gap",
            f"there are no samples between {ends} after the step, where the response begins: the "
            "record does not determine the dead time more closely",
        )
    ]


def _lead(fit: OutputErrorFit, output: FloatArray, fitted: FloatArray) -> list[Flag]:
    """Report an output that moves no later than in the sample in which its input steps.

    An input that is held from that sample on acts on the next one at the earliest.
    """
    data = fit.data
    if data.motion is None:
        return []
    step = data.edges[0][0]
    k = data.before(step)
    if k < _REST + _LEAD or k + 1 >= output.size or data.rows[k] != step:
        return []
    moved = (output - fitted) * data.motion.sign
    moved = moved[: k + 2] - np.median(moved[: k - _LEAD + 1])
    rest = moved[: k - _LEAD + 1]
    # A rest may be padded, or quieter than what follows.
    least = _OUTLIER * max(winsorised_sigma(rest, data.quantum), data.sigma, fit.residual)
    goes_on = (output[k + 1] - fitted[k]) * data.motion.sign
    if moved[k] <= least or goes_on < _STAYS * moved[k]:
        return []
    samples = next((n for n in range(1, _LEAD) if moved[k - n] <= least), _LEAD)
    return [
        Flag(
            "noncausal",
            f"the output has moved by {100 * moved[k] / data.motion.span:.2g} % of the response in "
            "the sample in which the input steps, which an input that is held from there on "
            f"cannot do: it leads the input by {samples} sample(s) or more. Mostly the "
            "input is stored after the output; advance it by so many samples, or remove a filter "
            "that uses later samples: dead time and fast lags are not those of the plant",
        )
    ]
