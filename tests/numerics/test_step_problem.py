"""From the record of a step to least-squares problems: where to stop, what weighs how much."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ctrl_realize.numerics.noise_level import colouring, sine_pair
from ctrl_realize.numerics.separable_fit import KnownFactor
from ctrl_realize.numerics.step_problem import (
    StepData,
    bare_data,
    fixed_regressors,
    own_regressors,
    step_data,
    step_scales,
    stop_at,
    window,
)

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


def test_the_whole_excursion_and_an_output_at_rest_are_fitted_to_the_end():
    made = data()
    assert stop_at(made, 1.0) == 1400
    assert stop_at(replace(made, motion=None), 0.3) == 1400
    assert stop_at(replace(made, motion=replace(made.motion, span=1e3)), 0.3) == 1400


@pytest.mark.parametrize("at", [20, 21])
def test_a_short_response_is_not_smoothed_before_its_end_is_looked_for(at):
    # a fiftieth of 60 samples is one: the mean of nine makes a third of a jump a sample sooner
    made = data()
    motion = replace(made.motion, onset=0.0, crossing=0, rest=0.0, span=1.0, sign=1.0)
    y = 1.0 * (np.arange(70) >= 10 + at)
    short = replace(made, output=y, quiet=y, motion=motion, edges=[(10, 1)])
    assert stop_at(short, 0.3) == 10 + at


def test_a_response_that_starts_the_wrong_way_stops_where_it_goes_the_other():
    made = data()
    wrong = replace(made, motion=replace(made.motion, sign=-made.motion.sign))
    assert stop_at(wrong, 0.3) == stop_at(made, 0.3)


def test_a_fit_holds_ten_samples_behind_the_onset_and_three_behind_the_crossing():
    made = data()
    late = replace(made, motion=replace(made.motion, onset=700.6, crossing=0))
    assert stop_at(late, 0.3) == EDGE + 710
    late = replace(made, motion=replace(made.motion, onset=0.0, crossing=700))
    assert stop_at(late, 0.3) == EDGE + 703
    late = replace(made, motion=replace(made.motion, crossing=1300))
    assert stop_at(late, 0.3) == 1400


def test_scales_come_from_the_first_motion_and_the_63_percent_point():
    made = data()
    motion = replace(made.motion, onset=40.0, crossing=50)
    made = replace(made, motion=motion)
    scales = step_scales(made, 1400, None)
    assert scales.onset == 20.0
    assert scales.rise == pytest.approx(DT * LAG, rel=0.1)
    assert scales.length == DT * 1200
    assert scales.latest == DT * 52.5  # 5 % later than the crossing
    assert step_scales(made, 1400, 10.0).latest == 10.0
    assert step_scales(made, 1400, 100.0).latest == DT * 52.5
    near = replace(made, motion=replace(motion, onset=0.0, crossing=3))
    assert step_scales(near, 1400, None).latest == DT * 4
    assert step_scales(near, 1400, None).onset == DT / 2


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


def test_a_rest_that_jumps_between_two_levels_is_coarse_and_a_dithered_one_is_not():
    k = np.arange(1400)
    noise = np.random.default_rng(1).standard_normal(k.size)
    step = -40.0 * np.expm1(-np.clip(k - EDGE - DELAY, 0, None) / LAG)
    for level, size, coarse in ((0.5, 0.2, True), (0.0, 0.2, True), (0.5, 0.7, False)):
        y = np.round(level + step + size * noise)
        assert step_data(y, 1.0 * (k >= EDGE), DT, [(EDGE, 1)]).coarse is coarse


def test_without_rest_noise_is_taken_for_white_and_hum_is_not_looked_for():
    k = np.arange(600.0)
    y = -np.expm1(-np.clip(k - 20, 0, None) / 40) + 0.01 * np.sin(0.7 * k)
    made = step_data(y, 1.0 * (k >= 5), DT, [(5, 1)])
    assert (made.colour, made.hum, made.drift) == (1.0, [], 0.0)


def test_the_colour_of_the_noise_is_that_of_what_a_line_leaves_at_rest():
    made = data()
    assert made.colour == 1.0
    k = np.arange(1400.0)
    slow = np.convolve(np.random.default_rng(4).standard_normal(1407), np.ones(8) / 8, "valid")
    y = made.output + 0.1 * slow
    found = step_data(y, 1.0 * (k >= EDGE), DT, [(EDGE, 1)])
    rest = y[:EDGE] - np.polyval(np.polyfit(k[:EDGE], y[:EDGE], 1), k[:EDGE])
    # means of four of such samples are nearly twice as large as those of white noise
    assert found.colour > 1.7
    assert found.colour == pytest.approx(colouring(rest, found.sigma), rel=1e-9)


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


def test_every_line_of_the_hum_has_a_cosine_and_a_sine():
    columns = fixed_regressors(replace(data(), hum=[0.1, 0.03]))
    k = np.arange(1400.0)
    expected = [np.ones((1400, 1)), sine_pair(k, 0.1), sine_pair(k, 0.03)]
    np.testing.assert_array_equal(columns, np.concatenate(expected, axis=1))


def test_what_a_record_has_for_itself_ends_with_the_decay_of_the_given_poles():
    made = replace(data(), drift=0.1)
    fixed = fixed_regressors(made)
    np.testing.assert_array_equal(own_regressors(made, None), fixed)
    own = own_regressors(made, np.array([-0.03 + 0j]))
    np.testing.assert_array_equal(own[:, :2], fixed)
    np.testing.assert_allclose(own[:, 2:], np.exp(-0.03 * DT * np.arange(1400.0))[:, None])


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


def test_a_window_drives_its_models_at_every_sample_with_the_record_s_clock():
    found = window(data(), 900, KnownFactor())
    assert found.drive.dt == DT
    assert found.output.size == 900
    assert (found.problem.drive.dt, found.start) == (DT, EDGE)
    for drive in (found.drive, found.problem.drive):
        np.testing.assert_allclose(drive.moves, EDGE * DT)
        np.testing.assert_allclose(drive.sizes, 1.0)
    np.testing.assert_array_equal(found.drive.width, np.ones(900, dtype=int))
    np.testing.assert_allclose(found.drive.first, DT * np.arange(900))
    assert found.columns.shape == (900, 1)
    known = KnownFactor(np.array([-3.0 + 0j]), np.array([3.0]))
    assert window(data(), 900, known).problem.known is known


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


def test_a_rest_of_few_samples_takes_its_noise_from_the_settled_half_too():
    k = np.arange(1400.0)
    y = 0.1 * np.exp(-k / 8) - 2 * np.expm1(-np.clip(k - 60, 0, None) / LAG)
    y += 1e-3 * np.random.default_rng(5).standard_normal(k.size)
    y[700:] += 4e-3 * np.random.default_rng(6).standard_normal(700)
    made = step_data(y, 1.0 * (k >= 40), DT, [(40, 1)])
    assert made.relaxing
    # 40 samples of 1e-3 at rest, and 700 of 4.1e-3 behind
    assert made.sigma == pytest.approx(4.1e-3, rel=0.2)


def test_a_noisy_input_moves_at_its_edge_by_the_step_and_at_no_sample_before():
    made = data()
    noisy = made.input + 0.02 * np.random.default_rng(7).standard_normal(1400)
    found = window(replace(made, input=noisy), 900, KnownFactor())
    assert found.drive.moves[0] == EDGE * DT
    # means of at least eight samples
    assert found.drive.sizes[0] == pytest.approx(1.0, abs=5 * 0.02 / np.sqrt(8))
    assert found.drive.moves.size < 24


def test_a_record_without_a_step_starts_at_its_first_sample():
    y = np.arange(5.0)
    bare = bare_data(y, -y, DT, 0.3)
    assert (bare.dt, bare.input[3], bare.output[3]) == (DT, -3.0, 3.0)
    assert (bare.edges, bare.sigma, bare.quantum, bare.drift) == ([(0, 1)], 0.3, 0.0, 0.0)
    assert (bare.colour, bare.hum, bare.motion, bare.edge) == (1.0, [], None, 0)


def test_a_slope_at_rest_has_several_explanations_and_none_needs_none():
    made = data()
    assert made.explanations() == [made]
    ways = replace(made, drift=0.1).explanations()
    assert [(way.drift, way.ending, way.relaxing) for way in ways] == [
        (0.1, False, False), (0.1, True, False), (0.0, False, True),
    ]  # fmt: skip
    # a rest of less than a twentieth of what follows tells little
    short = replace(made, drift=0.1, edges=[(50, 1)]).explanations()
    assert [(way.drift, way.relaxing) for way in short[3:]] == [(0.0, False)]
