"""Edges of an input: where, how high, from where to where."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from ctrl_realize.numerics.edges import Edge, despike, difference_noise, find_edges


def white(n, seed=0):
    return np.random.default_rng(seed).standard_normal(n)


def levels(*pairs):
    """Levels that hold for some samples each."""
    return np.concatenate([np.full(length, value, dtype=float) for value, length in pairs])


def test_the_noise_level_does_not_see_steps_drift_and_spikes():
    assert difference_noise(2.5 * white(10_000)) == pytest.approx(2.5, rel=0.03)
    spoiled = white(10_000) + 50 * (np.arange(10_000) > 4000) + 0.01 * np.arange(10_000)
    spoiled[::100] += 40
    assert difference_noise(spoiled) == pytest.approx(1, rel=0.05)
    assert difference_noise(levels((0, 50), (3, 50))) == 0
    assert difference_noise(np.array([1.0, 4.0])) == 0
    # three samples are enough for two differences: 1, 3 about 2
    assert difference_noise(np.array([0.0, 1.0, 4.0])) == pytest.approx(1 / 0.6745 / np.sqrt(2))


def test_spikes_up_to_the_given_length_go_and_edges_stay():
    values = levels((1, 20), (9, 3), (1, 20), (5, 20))
    assert_array_equal(despike(values, 3), levels((1, 43), (5, 20)))
    assert_array_equal(despike(values, 2), values)
    assert_array_equal(despike(levels((0, 1), (5, 20)), 3), levels((0, 1), (5, 20)))
    assert despike(values, 0) is values
    assert_array_equal(despike(levels((1, 9), (7, 1), (1, 9)), 1), np.ones(19))


def test_one_clean_edge_is_described_in_full():
    assert find_edges(levels((2, 30), (5, 70)), 3, 0.5) == [Edge(30, 3.0, 2.0, 1, 0, 100)]
    assert find_edges(levels((2, 30), (-5, 70)), 0, 0.5) == [Edge(30, -7.0, 2.0, 1, 0, 100)]


def test_neighbouring_edges_bound_each_other():
    found = find_edges(levels((0, 50), (4, 60), (1, 70), (5, 80)), 3, 0.3)
    assert [(e.index, e.amplitude, e.rest) for e in found] == [
        (50, 4, 0),
        (110, -3, 4),
        (180, 4, 1),
    ]
    assert [(e.start, e.stop) for e in found] == [(0, 110), (50, 180), (110, 260)]


def test_the_end_of_a_ramp_bounds_the_edge_after_it():
    ramp = np.concatenate(
        [np.zeros(60), np.linspace(0, 10, 12)[1:-1], np.full(60, 10.0), np.zeros(60)]
    )
    found = find_edges(ramp, 3, 0.3)
    assert [(e.index, e.samples) for e in found] == [(60, 11), (130, 1)]
    assert found[1].start == 70  # last sample of the ramp's edge


@pytest.mark.parametrize("share", [0.2, 0.5, 0.9])
def test_edges_below_the_share_of_the_range_do_not_count(share):
    # heights 1, 3 and 4 of a range of 8
    found = find_edges(levels((0, 40), (1, 40), (4, 40), (8, 40)), 3, share)
    assert [e.amplitude for e in found] == [h for h in (1.0, 3.0, 4.0) if h / 8 >= share]


def test_an_edge_of_exactly_the_share_counts():
    assert len(find_edges(levels((0, 40), (2, 40), (4, 40)), 3, 0.5)) == 2
    assert len(find_edges(levels((0, 40), (2, 40), (4, 40)), 0, 0.5)) == 2
    # ten tenths, each of them rounded, are one ramp and not three
    assert len(find_edges(np.clip((np.arange(400) - 199) / 10, 0, 1), 0, 0.1)) == 1


@pytest.mark.parametrize(
    "values",
    [np.full(50, 4.0), np.zeros(50), white(500), 1e6 + 1e-5 * white(50), levels((4, 50))],
    ids=["constant", "zero", "noise", "rounding", "level"],
)
@pytest.mark.parametrize("spike", [0, 3])
def test_an_input_that_holds_still_has_no_edge(values, spike):
    assert find_edges(values, spike, 0.5) == []


def test_a_step_of_less_than_ten_sigma_of_the_range_is_noise():
    noise = 0.1 * white(400)
    assert find_edges(noise + 0.3 * (np.arange(400) >= 200), 0, 0.5) == []
    assert [e.index for e in find_edges(noise + 2.0 * (np.arange(400) >= 200), 0, 0.5)] == [200]


@pytest.mark.parametrize("seed", range(3))
def test_without_a_median_filter_ten_sigma_of_the_range_are_enough(seed):
    (found,) = find_edges(white(400, seed) + 9.0 * (np.arange(400) >= 200), 0, 0.5)
    assert found.index == 200


def test_spikes_at_the_ends_are_no_edges_beside_a_step():
    values = levels((9, 2), (1, 50), (4, 50), (-8, 2))
    assert [(e.index, e.amplitude) for e in find_edges(values, 3, 0.5)] == [(52, 3.0)]


def test_a_level_at_the_start_alone_is_the_rest_of_a_record_that_starts_at_its_step():
    for held in (1, 2, 3):
        found = find_edges(levels((0, held), (5, 60)), 3, 0.5)
        assert [(e.index, e.amplitude, e.rest) for e in found] == [(held, 5.0, 0.0)]


def test_a_record_too_short_to_have_ends_keeps_them():
    # 12 samples are no more than 4 x 3
    found = find_edges(levels((0, 2), (5, 10)), 3, 0.5)
    assert [(e.index, e.amplitude) for e in found] == [(2, 5.0)]


@given(length=st.integers(1, 60), up=st.booleans(), spike=st.integers(0, 6))
def test_a_ramp_is_measured_from_first_to_last_sample(length, up, spike):
    k = np.arange(400)
    values = (1 if up else -1) * np.clip((k - 199) / length, 0, 1)
    found = find_edges(values, spike, 0.1)
    # medians over s + 1 samples see s + 1 samples' rise, up to a tenth of the range
    assert len(found) == (length <= 10 * (spike + 1))
    if not found:
        return
    (found,) = found
    slack = int(np.ceil(0.02 * length))  # left, and reached, within 2 %
    assert abs(found.index - 200) <= slack
    assert abs(found.index + found.samples - (200 + length)) <= slack
    assert_allclose([found.rest, found.amplitude], [0, values[-1]], atol=1e-12)


def test_noise_on_a_ramp_moves_its_ends_little():
    k = np.arange(1000)
    values = 10 * np.clip((k - 499) / 20, 0, 1) + 0.02 * white(1000)
    (found,) = find_edges(values, 3, 0.1)
    # half a unit a sample; the level counts as left at 0.2
    assert abs(found.index - 500) <= 2
    assert abs(found.samples - 20) <= 3
    # medians of 40 samples or more, 1.25 sigma / sqrt(40) each
    assert_allclose([found.rest, found.amplitude], [0, 10], atol=5 * 1.25 * 0.02 * np.sqrt(2 / 40))


@given(
    scale=st.floats(1e-6, 1e6),
    offset=st.floats(-100, 100),
    spike=st.integers(0, 4),
    up=st.booleans(),
)
def test_edges_do_not_depend_on_the_unit(scale, offset, spike, up):
    base = levels((0, 40), (1, 40), (0.4, 40), (2, 40)) * (1 if up else -1)
    plain = find_edges(base, spike, 0.25)
    moved = find_edges(scale * (base + offset), spike, 0.25)
    assert [(e.index, e.samples, e.start, e.stop) for e in moved] == [
        (e.index, e.samples, e.start, e.stop) for e in plain
    ]
    assert_allclose(
        [(e.amplitude, e.rest) for e in moved],
        [(scale * e.amplitude, scale * (e.rest + offset)) for e in plain],
        rtol=1e-9,
        atol=1e-10 * scale,
    )


@pytest.mark.parametrize("scale", [1e-6, 1e6])
def test_the_ends_of_a_ramp_do_not_depend_on_the_unit(scale):
    ramp = np.clip((np.arange(400) - 199) / 100, 0, 1)
    plain, moved = find_edges(ramp, 20, 0.1)[0], find_edges(scale * ramp, 20, 0.1)[0]
    assert (moved.index, moved.samples) == (plain.index, plain.samples)


def test_a_change_in_the_last_digits_is_rounding_and_no_edge():
    assert find_edges(levels((1e6, 50), (1e6 + 1e-5, 50)), 3, 0.5) == []
    assert len(find_edges(levels((1e6, 50), (1e6 + 1e-2, 50)), 3, 0.5)) == 1


@pytest.mark.parametrize("seed", range(5))
def test_a_median_filter_takes_noise_away_so_smaller_steps_are_found(seed):
    # seven samples leave 0.47 sigma: ten of that are less than a step of five sigma
    (found,) = find_edges(white(600, seed) + 5.0 * (np.arange(600) >= 300), 3, 0.5)
    assert abs(found.index - 300) <= 2


@pytest.mark.parametrize("length", [5, 6, 8, 12])
def test_a_pulse_longer_than_a_spike_goes_up_and_down_or_not_at_all(length):
    found = find_edges(levels((0, 50), (5, length), (0, 50)), 3, 0.5)
    assert [e.index for e in found] in ([], [50, 50 + length])


def test_overshoot_of_the_drive_is_part_of_its_edge():
    values = levels((0, 60), (14, 2), (10, 60))
    (found,) = find_edges(values, 3, 0.5)
    assert (found.index, found.amplitude, found.samples) == (60, 10.0, 1)


def test_a_ramp_that_lasts_to_the_end_leads_to_the_last_sample():
    for height in (10.0, -10.0):
        ramp = height / 10 * np.clip(np.arange(60) - 49, 0, None)
        assert find_edges(ramp, 0, 0.1) == [Edge(50, height, 0.0, 10, 0, 60)]


def test_of_noise_a_median_over_three_samples_leaves_1_25_over_the_root_of_three():
    # spikes at every third sample: two in three differences are +-1
    spikes = 1.0 * (np.arange(180) % 3 == 1)
    sigma = difference_noise(spikes)
    assert sigma == pytest.approx(1 / 0.6745 / np.sqrt(2))
    assert_array_equal(despike(spikes, 1), 0.0)
    least = 10 * sigma * 1.25 / np.sqrt(3)
    step = 1.0 * (np.arange(180) >= 90)
    assert find_edges(spikes + 0.98 * least * step, 1, 0.5) == []
    assert [e.index for e in find_edges(spikes + 1.02 * least * step, 1, 0.5)] == [90]
