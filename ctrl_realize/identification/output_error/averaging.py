"""Average step records of one plant."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..._wording import named
from ...data import Record, StepResponse
from ...data.resampling import MAX_DENSER
from ...errors import DataError
from ...numerics.arrays import FloatArray
from ...numerics.output_error.result import OutputErrorEstimate
from ...numerics.output_error.step_data import StepData, own_regressors, step_data, step_scales
from ...numerics.signals.noise import mad_sigma
from ...numerics.signals.sample_grid import grid_step
from ...numerics.validation.own_response import OwnResponse, own_step_response
from ..step.steps import unit_step
from .repeatability import APART, SAME_AMPLITUDE

_TRIM = 0.1  # at each end: 97 % efficient in Gaussian noise; one record of ten may be an outlier


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
            # A grid that does not hold all samples moves them, by up to half of its step.
            step = grid_step(np.cumsum([0.0, *sorted({r.dt for r in records})]), MAX_DENSER)
            raise DataError(
                f"{named('record', record.name)} has dt={record.dt:g} s, the first has "
                f"{first:g} s; records fitted together need the same sample time: each as "
                f"Record.from_samples(time, input, output, dt={step:g}), which "
                "holds the input and leaves the output missing between its samples"
            )
    return first


def mean_step(steps: tuple[StepResponse, ...], used: Sequence[int]) -> StepData:
    """Average unit-step responses: trimmed mean per amplitude, then by signal-to-noise.

    Parameters
    ----------
    steps : tuple of StepResponse
    used : sequence of int
        Positions of those in the mean.

    Raises
    ------
    DataError
        The mean does not move.
    """
    before = min(step.pre_step.size for step in steps)
    after = min(step.n_samples for step in steps)
    outputs = _stacked(steps)
    inputs = np.array([np.concatenate([np.zeros(before), s.input[:after]]) for s in steps])
    total, weight = np.zeros(before + after), 0.0
    for group in _groups([abs(steps[i].amplitude) for i in used]):
        members = [used[g] for g in group]
        share = sum(steps[i].amplitude ** 2 for i in members)
        total += share * _trimmed(outputs[members])
        weight += share
    mean = inputs[list(used)].mean(axis=0)
    data = step_data(total / weight, mean, steps[0].dt, [(before, 1)])
    if data.motion is None:
        raise DataError(
            "the mean of the records does not leave its baseline by 5 standard deviations"
        )
    return data


def latest_onset(steps: tuple[StepResponse, ...], used: Sequence[int]) -> float:
    """Time in s up to which the dead time of any of some records may last; see `step_scales`.

    Without end if one of them does not visibly move.
    """
    try:
        every = [mean_step(steps, [i]) for i in used]
    except DataError:
        return float("inf")
    return max(step_scales(one, one.output.size, None).latest for one in every)


def near_the_rest(steps: tuple[StepResponse, ...]) -> tuple[int, ...]:
    """Positions of records without an outlying distance from the median response."""
    outputs = _stacked(steps)
    if len(outputs) < 4:
        return tuple(range(len(outputs)))
    distance = np.sqrt(np.mean((outputs - np.median(outputs, axis=0)) ** 2, axis=1))
    # Distances are positive and skewed, so their logarithms are compared.
    size = np.log(np.maximum(distance, 1e-300))
    scale = max(mad_sigma(size), 0.15)
    return tuple(np.flatnonzero(size - np.median(size) <= APART * scale).tolist())


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


def own_responses(
    steps: tuple[StepResponse, ...], data: StepData, fit: OutputErrorEstimate
) -> list[OwnResponse]:
    """Compare every record with the model of their mean, shifted and scaled."""
    beside = own_regressors(data, fit.poles)
    edge = data.edge
    found = []
    for step in steps:
        n = min(step.n_samples, data.output.size - edge)
        output = np.concatenate([step.pre_step[step.pre_step.size - edge :], step.output[:n]])
        start = edge + fit.dead_time / data.dt
        found.append(own_step_response(output, fit.fitted, start, beside, data.dt))
    return found


def _trimmed(values: FloatArray) -> FloatArray:
    """Mean without the largest and smallest tenth at every sample (for five records or more)."""
    cut = max(int(_TRIM * len(values)), 1) if len(values) >= 5 else 0
    return np.asarray(np.sort(values, axis=0)[cut : len(values) - cut].mean(axis=0))


def _groups(amplitudes: list[float]) -> list[list[int]]:
    """Positions of records with the same amplitude, within 3 %."""
    groups: list[list[int]] = []
    for i in np.argsort(amplitudes):
        last = groups[-1][0] if groups else None
        if last is not None and amplitudes[i] <= amplitudes[last] * (1 + SAME_AMPLITUDE):
            groups[-1].append(int(i))
        else:
            groups.append([int(i)])
    return groups
