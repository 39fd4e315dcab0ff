"""Average step records of one plant, and measure the differences between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..._wording import named
from ...data import Record, StepResponse
from ...errors import DataError
from ...numerics.arrays import FloatArray
from ...numerics.constants import Z_95
from ...numerics.output_error.result import OutputErrorEstimate
from ...numerics.signals.noise import mad_sigma
from ...numerics.validation.own_response import OwnResponse, homogeneity, own_step_response
from ..step.steps import unit_step
from .repeatability import Repeatability, distinct

_TRIM = 0.1  # at each end: 97 % efficient in Gaussian noise; one record of ten may be an outlier
_SAME_AMPLITUDE = 0.03  # relative, below which steps count as equally high
_APART = 5.0  # robust standard deviations from the others


@dataclass(frozen=True, eq=False)
class MeanStep:
    """Mean of aligned unit-step responses.

    Attributes
    ----------
    output, input : ndarray, shape (N,)
        Per unit of the input; sample `edge` is the first one after the step.
    edge : int
    dt : float
    used, left_out : tuple of int
        Positions of the records in the mean, and of the outliers.
    """

    output: FloatArray
    input: FloatArray
    edge: int
    dt: float
    used: tuple[int, ...]
    left_out: tuple[int, ...]


def aligned_steps(records: tuple[Record, ...]) -> tuple[StepResponse, ...]:
    """Align all records at their steps and scale them to a unit step.

    The samples before the step are not corrected: drifts and free responses of the records add up
    to those of the mean.

    Raises
    ------
    DataError
        Records of different sample times.
    """
    common_sample_time(records)
    return tuple(unit_step(record, remove_drift=False) for record in records)


def common_sample_time(records: tuple[Record, ...]) -> float:
    """Return the sample time of all records in s; `DataError` if it differs."""
    first = records[0].dt
    for record in records:
        if abs(record.dt - first) > 1e-6 * first:
            raise DataError(
                f"{named('record', record.name)} has dt={record.dt:g} s, the first has "
                f"{first:g} s; records fitted together need the same sample time: "
                f"Record.resampled(time, input, output, dt={first:g}) interpolates"
            )
    return first


def mean_step(steps: tuple[StepResponse, ...], skip: tuple[int, ...] = ()) -> MeanStep:
    """Average unit-step responses: trimmed mean per amplitude, then by signal-to-noise.

    Parameters
    ----------
    steps : tuple of StepResponse
    skip : tuple of int
        Positions to leave out in any case; outliers are left out as well.
    """
    before = min(step.pre_step.size for step in steps)
    after = min(step.n_samples for step in steps)
    outputs = _stacked(steps)
    inputs = np.array([np.concatenate([np.zeros(before), s.input[:after]]) for s in steps])
    far = sorted({*skip, *_far_from_the_rest(outputs)})
    used = [i for i in range(len(steps)) if i not in far] or list(range(len(steps)))
    total, weight = np.zeros(before + after), 0.0
    for group in _groups([abs(steps[i].amplitude) for i in used]):
        members = [used[g] for g in group]
        share = sum(steps[i].amplitude ** 2 for i in members)
        total += share * _trimmed(outputs[members])
        weight += share
    return MeanStep(
        total / weight,
        inputs[used].mean(axis=0),
        before,
        steps[0].dt,
        tuple(used),
        tuple(i for i in far if i not in used),
    )


def _stacked(steps: tuple[StepResponse, ...]) -> FloatArray:
    """Unit-step responses at the samples that all of them have, shape (R, N)."""
    before = min(step.pre_step.size for step in steps)
    after = min(step.n_samples for step in steps)
    return np.array(
        [np.concatenate([s.pre_step[s.pre_step.size - before :], s.output[:after]]) for s in steps]
    )


def relative_gains(steps: tuple[StepResponse, ...]) -> FloatArray:
    """Gains (R,) for which one response of any shape times each is nearest to all; the middle is 1.

    Least squares in the unit of the outputs, in which the noise is the same: the first singular
    vector (Golub and Van Loan, Matrix Computations, 4th ed., section 2.4). Levels are free.
    """
    heights = np.array([step.amplitude for step in steps])
    outputs = heights[:, None] * _stacked(steps)
    centred = outputs - outputs.mean(axis=1, keepdims=True)
    first = np.linalg.svd(centred, full_matrices=False)[0][:, 0] / heights
    return np.asarray(first / middle_gain(first))


def middle_gain(gains: FloatArray) -> float:
    """Median, of an even number one of the two in the middle: their mean may be zero."""
    return float(np.sort(gains)[gains.size // 2]) or 1.0


def scaled(steps: tuple[StepResponse, ...], ratios: FloatArray) -> tuple[StepResponse, ...]:
    """Divide responses by relative gains, as if the steps had been higher by them."""
    return tuple(
        replace(
            step,
            output=step.output / ratio,
            pre_step=step.pre_step / ratio,
            amplitude=step.amplitude * ratio,
        )
        for step, ratio in zip(steps, ratios.tolist(), strict=True)
    )


def repeatability(
    steps: tuple[StepResponse, ...],
    mean: MeanStep,
    model: FloatArray,
    delay: float,
    own: FloatArray,
) -> Repeatability:
    """Compare every record with the common model, shifted and scaled.

    Parameters
    ----------
    steps : tuple of StepResponse
    mean : MeanStep
    model : ndarray, shape (N,)
        Response of the common model to the mean step.
    delay : float
        Its dead time in s.
    own : ndarray, shape (N, q)
        Further effects in each record beside a drift: a level, hum, a free response.
    """
    found = []
    for step in steps:
        n = min(step.n_samples, mean.output.size - mean.edge)
        output = np.concatenate([step.pre_step[step.pre_step.size - mean.edge :], step.output[:n]])
        found.append(own_step_response(output, model, mean.edge + delay / mean.dt, own, mean.dt))
    return compared(
        distinct(step.name for step in steps),
        np.array([step.edge.amplitude for step in steps]),
        found,
        mean.used,
        delay,
    )


def compared(
    names: tuple[str, ...],
    amplitudes: FloatArray,
    own: Sequence[OwnResponse],
    used: tuple[int, ...],
    delay: float,
) -> Repeatability:
    """Test whether records differ by more than the noise in each.

    Parameters
    ----------
    names : tuple of str
    amplitudes : ndarray, shape (R,)
    own : sequence of OwnResponse
        Every record compared with the common model.
    used : tuple of int
        Positions of the records in the mean.
    delay : float
        Dead time of the common model, in s.
    """
    shifts = np.array([one.shift for one in own])
    errors = np.array([one.error for one in own])
    gains = np.array([one.gain for one in own], dtype=np.float64)
    gain_errors = np.array([one.gain_error for one in own], dtype=np.float64)
    lags = np.array([one.lag for one in own], dtype=np.float64)
    lag_errors = np.array([one.lag_error for one in own], dtype=np.float64)
    kept = np.array(used)
    chi_square, p_value = homogeneity(shifts[kept], errors[kept])
    trend, trend_error = _trend(np.abs(amplitudes[kept]), shifts[kept], errors[kept])
    return Repeatability(
        names=names,
        amplitudes=amplitudes,
        delays=delay + shifts,
        errors=errors,
        gains=gains,
        gain_errors=gain_errors,
        lags=lags,
        lag_errors=lag_errors,
        fit_percent=np.array([one.followed for one in own], dtype=np.float64),
        chi_square=chi_square,
        p_value=p_value,
        gain_test=homogeneity(gains[kept], gain_errors[kept]),
        lag_test=homogeneity(np.log(lags[kept]), lag_errors[kept]),
        trend=trend,
        trend_error=trend_error,
        outlying=tuple(name for i, name in enumerate(names) if i not in used),
        gains_alone=np.array([one.gain_alone for one in own]),
        gain_alone_errors=np.array([one.gain_alone_error for one in own]),
    )


def widened(
    fit: OutputErrorEstimate, repeats: Repeatability, used: tuple[int, ...]
) -> OutputErrorEstimate:
    """Add the standard error of the mean if records differ by more than their noise."""
    if repeats.p_value >= 0.01:
        return fit
    between = float(repeats.delays[list(used)].std(ddof=1)) / np.sqrt(len(used))
    return replace(
        fit,
        low=max(fit.low - Z_95 * between, 0.0),
        high=fit.high + Z_95 * between,
        std=float(np.hypot(fit.std, between)),
    )


def delay_outliers(result: Repeatability, used: tuple[int, ...]) -> tuple[int, ...]:
    """Positions of records with an outlying delay."""
    delays = result.delays[list(used)]
    centre = float(np.median(delays))
    scale = np.maximum(mad_sigma(delays), result.errors)
    return tuple(i for i in used if abs(result.delays[i] - centre) > _APART * scale[i])


def _trimmed(values: FloatArray) -> FloatArray:
    """Mean without the largest and smallest tenth at every sample (for five records or more)."""
    cut = max(int(_TRIM * len(values)), 1) if len(values) >= 5 else 0
    return np.asarray(np.sort(values, axis=0)[cut : len(values) - cut].mean(axis=0))


def _groups(amplitudes: list[float]) -> list[list[int]]:
    """Positions of records with the same amplitude, within 3 %."""
    groups: list[list[int]] = []
    for i in np.argsort(amplitudes):
        last = groups[-1][0] if groups else None
        if last is not None and amplitudes[i] <= amplitudes[last] * (1 + _SAME_AMPLITUDE):
            groups[-1].append(int(i))
        else:
            groups.append([int(i)])
    return groups


def _far_from_the_rest(outputs: FloatArray) -> list[int]:
    """Records with an outlying distance from the median response."""
    if len(outputs) < 4:
        return []
    distance = np.sqrt(np.mean((outputs - np.median(outputs, axis=0)) ** 2, axis=1))
    # Distances are positive and skewed, so their logarithms are compared.
    size = np.log(np.maximum(distance, 1e-300))
    scale = max(mad_sigma(size), 0.15)
    return [int(i) for i in np.flatnonzero(size - np.median(size) > _APART * scale)]


def _trend(amplitudes: FloatArray, shifts: FloatArray, errors: FloatArray) -> tuple[float, float]:
    """Slope of the delays over the amplitudes and its standard error; zeros if there is none.

    Scatter beyond the errors is estimated about the line: about the mean, the trend itself would
    increase its error, and ten records or fewer could never show one.
    """
    weight = errors**-2
    centre = float(np.sum(weight * amplitudes) / np.sum(weight))
    spread = float(np.sum(weight * (amplitudes - centre) ** 2))
    if np.ptp(amplitudes) <= _SAME_AMPLITUDE * float(np.max(amplitudes)) or amplitudes.size < 3:
        return 0.0, 0.0
    mean = float(np.sum(weight * shifts) / np.sum(weight))
    slope = float(np.sum(weight * (amplitudes - centre) * shifts)) / spread
    left = shifts - mean - slope * (amplitudes - centre)
    inflation = max(float(np.sum(weight * left**2)) / (amplitudes.size - 2), 1.0)
    return slope, float(np.sqrt(inflation / spread))
