"""Several step records of one plant: their mean, and how far each is from the common model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.special import chdtrc

import ctrl_realize as cr
from ctrl_realize.identification.output_error.averaging import (
    MeanStep,
    aligned_steps,
    mean_step,
    repeatability,
    widened,
)
from ctrl_realize.identification.output_error.repeatability import Repeatability
from tests import rigs

TS = rigs.TS
LEVEL = np.ones((1600, 1))


def simulated(delays, amplitudes, *, noise=0.0, gains=None, names=None):
    gains = gains or [1.0] * len(delays)
    made = []
    for i, (delay, height, gain) in enumerate(zip(delays, amplitudes, gains, strict=True)):
        record = rigs.step_record(
            rigs.R3, delay=delay, amplitude=height, noise=noise, seed=i, before=300, after=1300
        )
        name = names[i] if names else ""
        made.append(cr.Record(record.time, record.input, gain * record.output, name=name))
    return aligned_steps(tuple(made))


def model_of(mean: MeanStep, delay: float):
    time = TS * (np.arange(mean.output.size) - mean.edge)
    return rigs.exact_step(rigs.R3, time - delay * TS)


def test_shifts_gains_and_names_of_exact_records_are_found():
    delays, gains = [36.0, 37.0, 38.5], [0.9, 1.0, 1.3]
    made = simulated(delays, [16.0, 8.0, -4.0], gains=gains, names=["a", "", "c"])
    mean = mean_step(made)
    found = repeatability(made, mean, model_of(mean, 37.0), 37 * TS, LEVEL)
    # linear interpolation of the model: (w Ts)^2 / 8 of the curvature, w = 50 rad/s
    assert_allclose(found.delays / TS, delays, atol=0.01)
    assert_allclose(found.gains, gains, rtol=1e-3)
    assert found.names == ("a", "record 1", "c")
    assert_allclose(found.amplitudes, [16, 8, -4])
    assert found.outlying == ()


def test_errors_and_chi_square_are_those_of_the_noise():
    noise, count = 0.01, 30
    made = simulated([37.0] * count, [16.0] * count, noise=noise)
    mean = mean_step(made)
    found = repeatability(made, mean, model_of(mean, 37.0), 37 * TS, LEVEL)
    # the scatter of 30 tells sigma to 13 %
    assert np.std(found.delays, ddof=1) == pytest.approx(np.mean(found.errors), rel=0.4)
    slope = np.gradient(model_of(mean, 37.0)) / TS
    line = np.linspace(0, 1, slope.size)
    columns = np.stack([-slope, model_of(mean, 37.0), np.ones(slope.size), line], axis=1)
    expected = noise * np.sqrt(np.linalg.inv(columns.T @ columns)[0, 0])
    assert_allclose(found.errors, expected, rtol=0.1)
    assert abs(found.delays.mean() / TS - 37) < 4 * expected / TS / np.sqrt(count)
    kept = np.array(mean.used)
    weight = found.errors[kept] ** -2
    centre = np.sum(weight * found.delays[kept]) / weight.sum()
    statistic = np.sum(weight * (found.delays[kept] - centre) ** 2)
    assert found.chi_square == pytest.approx(statistic, rel=1e-6)
    assert found.p_value == pytest.approx(chdtrc(kept.size - 1, statistic), rel=1e-6)
    assert found.p_value > 0.001


def test_what_a_record_has_for_itself_moves_its_delay_no_more_than_noise_does():
    made = simulated([37.0] * 3, [16.0] * 3, noise=1e-3)
    mean = mean_step(made)
    model = model_of(mean, 37.0)
    own = np.column_stack([LEVEL, np.exp(-np.arange(1600) / 200)])
    plain = repeatability(made, mean, model, 37 * TS, own)
    moved = []
    for i, step in enumerate(made):
        record = step.record
        extra = (i - 1) * (0.5 * np.exp(-np.arange(1600) / 200) + 2.0 * record.time)
        moved.append(cr.Record(record.time, record.input, record.output + extra))
    found = repeatability(aligned_steps(tuple(moved)), mean, model, 37 * TS, own)
    assert_allclose(found.delays, plain.delays, atol=1e-3 * TS)
    assert_allclose(found.errors, plain.errors, rtol=1e-3)


@dataclass(frozen=True)
class Fit:
    """What is widened of a fit."""

    low: float
    high: float
    std: float


def repeats_of(delays, p_value):
    n = len(delays)
    return Repeatability(
        names=("",) * n, amplitudes=np.ones(n), delays=np.array(delays), errors=np.ones(n),
        gains=np.ones(n), chi_square=0.0, p_value=p_value, trend=0.0, trend_error=0.0, outlying=(),
    )  # fmt: skip


def test_an_interval_takes_up_the_scatter_of_records_that_differ():
    fit = Fit(low=9.0, high=11.0, std=0.5)
    delays = [10.0, 12.0, 8.0, 50.0]
    between = np.std(delays[:3], ddof=1) / np.sqrt(3)
    wide = widened(fit, repeats_of(delays, 1e-6), (0, 1, 2))
    assert_allclose(
        [wide.low, wide.high, wide.std],
        [9 - 1.96 * between, 11 + 1.96 * between, np.sqrt(0.25 + between**2)],
    )
    # a delay is not negative
    assert widened(Fit(0.1, 11.0, 0.5), repeats_of(delays, 1e-6), (0, 1, 2)).low == 0
    # records that differ by noise alone leave it as it is
    assert widened(fit, repeats_of(delays, 0.01), (0, 1, 2)) is fit
    assert widened(fit, repeats_of(delays, 0.0099), (0, 1, 2)) is not fit
