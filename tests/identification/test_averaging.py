"""Several step records of one plant: their mean, and how far each is from the common model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.special import chdtrc

import ctrl_realize as cr
from ctrl_realize.errors import DataError
from ctrl_realize.identification.averaging import (
    MeanStep,
    aligned_steps,
    delay_outliers,
    mean_step,
    repeatability,
    widened,
)
from ctrl_realize.identification.delay_fit_result import Repeatability
from tests import rigs

TS = rigs.TS
LEVEL = np.ones((1600, 1))


def records(shapes, amplitudes=None, before=50, dt=0.01, names=None):
    """Steps whose responses per unit of input are the given arrays, after a rest."""
    amplitudes = amplitudes or [2.0] * len(shapes)
    made = []
    for i, (shape, height) in enumerate(zip(shapes, amplitudes, strict=True)):
        output = height * np.concatenate([np.zeros(before), shape])
        drive = height * (np.arange(output.size) >= before)
        name = names[i] if names else ""
        made.append(cr.Record(dt * np.arange(output.size), drive, output, name=name))
    return tuple(made)


def steps(*args, **kwargs):
    return aligned_steps(records(*args, **kwargs))


K = np.arange(200)
SHAPE = 1 - np.exp(-K / 20)


def test_records_of_different_sample_times_are_refused_by_name():
    slow = records([SHAPE], dt=0.02, names=["slow"])
    with pytest.raises(DataError, match=r"'slow' has dt=0.02 s, the first has 0.01 s"):
        aligned_steps(records([SHAPE]) + slow)
    # clocks that differ by rounding are the same clock
    assert len(aligned_steps(records([SHAPE]) + records([SHAPE], dt=0.01 * (1 + 1e-9)))) == 2


def spiked(count, height):
    """As many responses, each with a spike in a place of its own, so that none lies apart."""
    shapes = np.tile(SHAPE, (count, 1))
    shapes[np.arange(count), 9 * np.arange(count)] += height
    return list(shapes)


def test_the_mean_covers_what_all_records_have():
    long, short = records([SHAPE], before=80)[0], records([SHAPE[:150]], before=30)[0]
    mean = mean_step(aligned_steps((long, short)))
    assert (mean.edge, mean.dt) == (30, pytest.approx(0.01))
    assert_allclose(mean.output, np.r_[np.zeros(30), SHAPE[:150]], atol=1e-14)
    assert_allclose(mean.input, np.r_[np.zeros(30), np.ones(150)], atol=1e-14)
    assert (mean.used, mean.left_out) == ((0, 1), ())


def test_records_count_by_the_square_of_their_amplitude():
    # noise per unit of input falls with the amplitude
    mean = mean_step(steps([SHAPE, 1.2 * SHAPE], [1.0, -3.0]))
    assert_allclose(mean.output[mean.edge :], (1 + 9 * 1.2) / 10 * SHAPE, atol=1e-14)


@pytest.mark.parametrize(("second", "together"), [(2.059, True), (2.061, False)])
def test_amplitudes_within_three_percent_are_trimmed_together(second, together):
    mean = mean_step(steps(spiked(5, 1.0), [second, 2.0, 2.0, 2.0, 2.0]))
    # alone, the first record keeps its spike; one of five, it is cut off
    assert (abs(mean.output[mean.edge]) < 1e-12) == together


@pytest.mark.parametrize(("count", "left"), [(3, 1 / 3), (4, 1 / 4), (5, 0), (19, 0), (20, 0)])
def test_the_largest_and_smallest_tenth_go_from_five_records_on(count, left):
    mean = mean_step(steps(spiked(count, 1e-3)))
    places = mean.edge + 9 * np.arange(count)
    assert_allclose((mean.output[mean.edge :] - SHAPE)[places - mean.edge], 1e-3 * left, atol=1e-12)


def test_two_of_twenty_go_at_each_end():
    # squares, since of equally spaced values the mean is the same with one at each end
    shapes = [SHAPE + 1e-4 * i**2 for i in range(20)]
    mean = mean_step(steps(shapes), skip=())
    assert mean.left_out == ()
    left = 1e-4 * np.mean(np.arange(2, 18) ** 2)
    assert_allclose(mean.output[mean.edge :] - SHAPE, left, atol=1e-12)


def test_a_record_apart_from_four_others_is_left_out():
    rng = np.random.default_rng(0)
    shapes = [SHAPE + 1e-3 * rng.standard_normal(200) for _ in range(5)]
    shapes[2] = shapes[2] + 0.2 * (K > 50)
    mean = mean_step(steps(shapes))
    assert (mean.used, mean.left_out) == ((0, 1, 3, 4), (2,))
    # of three records nobody can say which is apart
    few = mean_step(steps(shapes[:3]))
    assert (few.used, few.left_out) == ((0, 1, 2), ())


def test_records_to_skip_are_skipped_unless_none_is_left():
    made = steps([SHAPE, SHAPE, 2 * SHAPE])
    mean = mean_step(made, skip=(2,))
    assert (mean.used, mean.left_out) == ((0, 1), (2,))
    assert_allclose(mean.output[mean.edge :], SHAPE, atol=1e-14)
    everything = mean_step(made, skip=(0, 1, 2))
    assert (everything.used, everything.left_out) == ((0, 1, 2), ())


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


def test_the_error_of_a_delay_does_not_hang_on_how_far_it_lies_from_the_model():
    made = simulated([37.0], [16.0], noise=0.01)
    mean = mean_step(made)
    errors = [
        repeatability(made, mean, model_of(mean, delay), delay * TS, LEVEL).errors[0]
        for delay in (37.0, 97.0)
    ]
    # the same record seen from two models; its slope is interpolated
    assert errors[1] == pytest.approx(errors[0], rel=0.01)


def test_a_drift_before_the_step_stays_in_the_record():
    # the mean has the drift of all, which is fitted with it
    (drifting,) = records([SHAPE], before=100)
    line = 0.5 * drifting.time
    (kept,) = aligned_steps((cr.Record(drifting.time, drifting.input, drifting.output + line),))
    assert kept.drift == 0.0
    assert_allclose(np.diff(kept.pre), 0.5 * 0.01 / 2.0, rtol=1e-9)


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


def test_delays_that_grow_with_the_amplitude_are_a_trend():
    amplitudes = [4.0, 8.0, 12.0, 16.0, -20.0]
    delays = [37 + 0.5 * abs(a) for a in amplitudes]
    made = simulated(delays, amplitudes, noise=1e-3)
    mean = mean_step(made)
    found = repeatability(made, mean, model_of(mean, 43.0), 43 * TS, LEVEL)
    assert found.trend / TS == pytest.approx(0.5, abs=0.05)
    # straight line, weighted, widened by what the line leaves
    weight, size = found.errors**-2, np.abs(np.array(amplitudes))
    spread = np.sum(weight * (size - np.sum(weight * size) / weight.sum()) ** 2)
    line = np.polynomial.Polynomial.fit(size, found.delays, 1, w=1 / found.errors)
    inflation = max(np.sum(weight * (found.delays - line(size)) ** 2) / 3, 1)
    assert found.trend_error == pytest.approx(np.sqrt(inflation / spread), rel=1e-9)


@pytest.mark.parametrize("amplitudes", [[16.0, 16.2, 16.4], [8.0, 16.0]])
def test_no_trend_is_told_from_one_amplitude_or_two_records(amplitudes):
    made = simulated([37.0] * len(amplitudes), amplitudes, noise=1e-3)
    mean = mean_step(made)
    found = repeatability(made, mean, model_of(mean, 37.0), 37 * TS, LEVEL)
    assert (found.trend, found.trend_error) == (0.0, 0.0)


def test_a_delay_apart_from_the_others_is_an_outlier():
    made = simulated([37.0, 37.0, 47.0, 37.0, 37.0], [16.0] * 5, noise=2e-3)
    mean = mean_step(made, skip=(2,))
    found = repeatability(made, mean, model_of(mean, 37.0), 37 * TS, LEVEL)
    assert found.outlying == ("record 2",)
    # it counts neither for the chi-square nor for the centre
    assert found.p_value > 0.001
    assert found.delays[2] / TS == pytest.approx(47, abs=0.5)
    assert delay_outliers(found, (0, 1, 2, 3, 4)) == (2,)
    assert delay_outliers(found, (0, 1, 3, 4)) == ()


def test_errors_are_those_of_the_delay_and_so_fall_with_the_gain():
    # the same noise, relative to the step, beside a response of half and of twice the size
    made = simulated([37.0] * 3, [16.0] * 3, noise=0.01, gains=[0.5, 1.0, 2.0])
    louder = []
    for step, gain in zip(made, [0.5, 1.0, 2.0], strict=True):
        record = step.record
        exact = gain * rigs.step_record(rigs.R3, amplitude=16.0, before=300, after=1300).output
        noise = (record.output - exact) / gain
        louder.append(cr.Record(record.time, record.input, exact + noise))
    made = aligned_steps(tuple(louder))
    mean = mean_step(made)
    found = repeatability(made, mean, model_of(mean, 37.0), 37 * TS, LEVEL)
    # correlation and seeds leave 10 %
    assert_allclose(found.errors / found.errors[1], [2, 1, 0.5], rtol=0.15)


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
