"""From the record of a step to least-squares problems: where to stop, what weighs how much."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ctrl_realize.numerics.output_error.step_data import (
    StepData,
    fixed_regressors,
    step_data,
    stop_at,
    window,
)
from ctrl_realize.numerics.separable.varpro import KnownFactor

EDGE, DELAY, LAG, DT = 200, 40, 60.0, 0.5


def data(*, height: float = 2.0, noise: float = 1e-3, quantum: float = 0.0) -> StepData:
    """One lag of 60 samples, 40 samples after a step at sample 200 of 1400."""
    k = np.arange(1400.0)
    after = np.clip(k - EDGE - DELAY, 0, None)
    y = height * -np.expm1(-after / LAG) + noise * np.random.default_rng(0).standard_normal(k.size)
    y = np.round(y / quantum) * quantum if quantum else y
    return step_data(y, 1.0 * (k >= EDGE), DT, [(EDGE, 1)])


def reached(part: float) -> float:
    return EDGE + DELAY - LAG * np.log1p(-part)


@pytest.mark.parametrize("height", [2.0, -2.0])
@pytest.mark.parametrize("part", [0.1, 0.3, 0.63, 0.9])
def test_a_fit_stops_where_a_part_of_the_excursion_is_made(height, part):
    # means over nine samples; near its start the response is too short to stop in
    assert stop_at(data(height=height), part) == pytest.approx(reached(part), abs=5)


def weights(made: StepData) -> tuple[np.ndarray, np.ndarray]:
    found = window(made, 1400, KnownFactor())
    return found.bins.width, np.square(found.problem.root_weight)


def test_means_weigh_what_they_hold_and_of_coarsely_rounded_samples_hardly_more():
    width, weight = weights(data())
    np.testing.assert_allclose(weight, width)
    assert width.max() > 9
    made = data(noise=1e-4, quantum=0.05)
    assert made.coarse
    width, weight = weights(made)
    assert weight[width == 1] == pytest.approx(1.0)
    assert weight.max() < 2.0
    assert weight[np.argmax(width)] > 1.8


def test_regressors_are_a_level_a_drift_that_may_end_and_the_hum():
    made = replace(data(), drift=0.1)
    level, slope = fixed_regressors(made).T
    np.testing.assert_array_equal(level, 1.0)
    np.testing.assert_allclose(np.diff(slope), 1 / 1400)
    assert slope[EDGE] == 0
    ended = fixed_regressors(replace(made, ending=True))[:, 1]
    np.testing.assert_allclose(ended[EDGE + 2 * EDGE :], ended[-1])
    np.testing.assert_array_equal(ended[: EDGE + 2 * EDGE], slope[: EDGE + 2 * EDGE])
    assert fixed_regressors(replace(made, hum=[0.1])).shape == (1400, 4)


def test_hum_is_found_at_rest_and_taken_off_before_the_noise_is_measured():
    k = np.arange(1400.0)
    line = 0.05 * np.sin(2 * np.pi * 0.063 * k + 1)
    made = step_data(data().output + line, 1.0 * (k >= EDGE), DT, [(EDGE, 1)])
    assert made.hum == pytest.approx([0.063], rel=1e-3)
    assert made.sigma == pytest.approx(1e-3, rel=0.2)
    assert made.motion.crossing == pytest.approx(data().motion.crossing, abs=2)
    # rounding is not less noise than it is
    coarse = np.round((data().output + line) / 0.02) * 0.02
    found = step_data(coarse, 1.0 * (k >= EDGE), DT, [(EDGE, 1)])
    assert found.sigma >= 0.02 / np.sqrt(12) * (1 - 1e-9)


def test_a_record_that_begins_while_the_plant_moves_has_a_free_response_of_its_own():
    k = np.arange(1400.0)
    moving = data().output + 0.8 * np.exp(-k / LAG)
    made = step_data(moving, 1.0 * (k >= EDGE), DT, [(EDGE, 1)])
    assert made.relaxing
    assert made.drift == 0.0
    # a rough curve is taken off before the noise is measured: of 0.8 little is left
    assert 0.8e-3 < made.sigma < 6e-3
    assert made.motion.crossing == pytest.approx(data().motion.crossing, abs=3)
    found = window(made, 1400, KnownFactor())
    means, every = found.problem.stretches, found.own
    assert found.columns.shape == (1400, 0)
    np.testing.assert_array_equal(every.edges, [0, 1400])
    np.testing.assert_allclose(every.clock, DT * np.arange(1400))
    np.testing.assert_array_equal(every.regressors, np.ones((1400, 1)))
    np.testing.assert_array_equal(means.edges, [0, found.bins.first.size])
    np.testing.assert_allclose(means.clock, found.bins.average(DT * np.arange(1400.0)))
    np.testing.assert_array_equal(means.regressors, np.ones((found.bins.first.size, 1)))
    assert window(data(), 1400, KnownFactor()).own is None
