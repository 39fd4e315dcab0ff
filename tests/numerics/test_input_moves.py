"""A measured input as moves: exact where it is clean, without noise and spikes where it is not."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from ctrl_realize.numerics.input_moves import MOST_MOVES, input_moves

NOISE = 0.01
N = 1000
K = np.arange(N)
NOISY = (K >= 100) + NOISE * np.random.default_rng(0).standard_normal(N)


def written(index, size, n=N):
    """The input that the moves describe, from its first level on."""
    signal = np.zeros(n)
    np.add.at(signal, index, size)
    return np.cumsum(signal)


def test_a_clean_input_is_written_exactly_as_its_moves():
    signal = np.zeros(100)
    signal[10:], signal[40:], signal[41:] = 2.0, 1.5, 1.0
    index, size = input_moves(signal, [(10, 1), (40, 2)], 100)
    assert_array_equal(index, [10, 40, 41])
    assert_allclose(size, [2.0, -0.5, -0.5], rtol=0)


def test_a_record_that_starts_at_its_step_moves_at_its_second_sample():
    assert_array_equal(input_moves(np.r_[0.0, np.ones(99)], [(1, 1)], 100)[0], [1])
    noisy = 1 + NOISE * np.random.default_rng(0).standard_normal(100)
    noisy[0] = 0.0
    index, size = input_moves(noisy, [(1, 1)], 100)
    assert_array_equal(index, [1])
    assert size[0] == pytest.approx(np.median(noisy[1:]))


def test_noise_that_is_no_spike_counts_with_its_mean():
    # skewed noise: its median is 0.25, its mean 1 / 3
    skewed = (K >= 100) * (20 + np.minimum(K - 100, 400) / 10) + np.random.default_rng(0).random(
        N
    ) ** 2
    index, size = input_moves(skewed, [(100, 1)], N)
    level = written(index, size) + np.median(skewed[:100])
    for start, stop in zip(index, [*index[1:], N], strict=True):
        assert level[start] == pytest.approx(skewed[start:stop].mean(), rel=1e-12)


def test_moves_from_stop_on_do_not_count():
    signal = np.zeros(100)
    signal[10:], signal[40:] = 2.0, 1.5
    assert_array_equal(input_moves(signal, [(10, 1), (40, 1)], 40)[0], [10])
    assert_array_equal(input_moves(signal, [(10, 1), (40, 1)], 41)[0], [10, 40])
    # a spoiled sample behind the stop does not make the rest of the input a noisy one
    noisy = signal.copy()
    noisy[50:] += np.random.default_rng(1).standard_normal(50)
    assert_array_equal(input_moves(noisy, [(10, 1), (40, 1)], 50)[0], [10, 40])


def test_as_many_exact_moves_are_kept_as_the_fit_can_afford():
    edges = [(10, 1)]
    for moves, exact in ((MOST_MOVES, True), (MOST_MOVES + 1, False)):
        stairs = np.minimum(np.maximum(np.arange(200) - 9, 0), moves) * 1.0
        index, _ = input_moves(stairs, edges, 200)
        assert (len(index) == moves) == exact


def test_the_noise_of_an_input_is_left_out():
    index, size = input_moves(NOISY, [(100, 1)], N)
    assert_array_equal(index, [100])
    # two medians, of 100 and 900 samples: sigma 1.25 (1 / 10 + 1 / 30) / 100
    assert size[0] == pytest.approx(1.0, abs=4 * 1.25 * NOISE * np.hypot(1 / 10, 1 / 30))


def test_a_ramp_in_noise_keeps_its_samples():
    ramp = NOISY + np.clip((K - 99) / 4, 0, 1) - (K >= 100)
    index, size = input_moves(ramp, [(100, 4)], N)
    assert_array_equal(index, [100, 101, 102, 103])
    assert_allclose(written(index, size)[100:103], (ramp - np.median(ramp[:100]))[100:103])
    # the last sample of the ramp is the first of the level that follows
    assert written(index, size)[103] == pytest.approx(1, abs=5 * NOISE / np.sqrt(100))


def test_an_edge_before_the_ramp_is_over_starts_its_own_level():
    index, size = input_moves(NOISY, [(100, 50), (110, 1)], N)
    assert set(range(100, 111)) == set(index)
    assert_allclose(written(index, size)[109], NOISY[109] - np.median(NOISY[:100]))
    # a ramp that the stop cuts ends there
    assert input_moves(NOISY, [(100, 50)], 120)[0][-1] == 119


def test_an_edge_from_stop_on_is_none():
    index, _ = input_moves(NOISY, [(100, 1), (600, 1)], 600)
    assert_array_equal(index, [100])


def test_a_drooping_input_is_followed_by_means_that_grow():
    drooping = NOISY - 0.2 * (K >= 100) * (1 - np.exp(-(K - 100.0) / 150))
    index, size = input_moves(drooping, [(100, 1)], N)
    assert_array_equal(np.diff(index)[:4], [8, 8, 8, 12])  # then half as long as all before
    assert index.size == 12
    assert np.sum(size) == pytest.approx(0.8, abs=0.02)
    # each mean of n samples is right to its noise, about the droop's own mean
    clean = drooping - NOISY + (K >= 100)
    start, stop = index[3], index[4]
    assert written(index, size)[start] == pytest.approx(
        clean[start:stop].mean(), abs=4 * NOISE / np.sqrt(stop - start)
    )


@pytest.mark.parametrize("droop", [0.0, 0.05])
def test_a_level_splits_only_where_its_means_differ(droop):
    sloping = NOISY - droop * (K >= 100) * (K - 100) / 900
    index, _ = input_moves(sloping, [(100, 1)], N)
    assert (index.size > 1) == bool(droop)


def test_before_the_first_edge_there_is_one_level():
    # what an input does before its step is the rest the response starts from
    drifting = NOISY + 0.1 * np.minimum(K - 100, 0) / 100
    assert_array_equal(input_moves(drifting, [(100, 1)], N)[0], [100])


def test_a_short_level_is_one():
    # 15 samples between two edges are too few to be told apart
    edges = [(100, 1), (115, 1)]
    stairs = NOISY - 0.5 * (K >= 115) + 0.1 * ((K >= 108) & (K < 115))
    assert_array_equal(input_moves(stairs, edges, N)[0], [100, 115])
    longer = NOISY - 0.5 * (K >= 116) + 0.1 * ((K >= 108) & (K < 116))
    assert_array_equal(input_moves(longer, [(100, 1), (116, 1)], N)[0], [100, 108, 116])


@pytest.mark.parametrize("width", [1, 2, 3])
@pytest.mark.parametrize("at", [30, 97, 104, 300, 990])
def test_spikes_are_left_out(width, at):
    spoiled = NOISY.copy()
    spoiled[at : at + width] += 0.5
    index, size = input_moves(spoiled, [(100, 1)], N)
    assert_array_equal(index, [100])
    without = input_moves(NOISY, [(100, 1)], N)[1]
    # what is put in its place are medians of seven samples: at most 3 of 900 values move
    assert_allclose(size, without, atol=NOISE / 5)


def test_spikes_of_a_drooping_input_leave_its_means():
    drooping = NOISY - 0.2 * (K >= 100) * (1 - np.exp(-(K - 100.0) / 150))
    spoiled = drooping.copy()
    spoiled[[130, 300, 301]] += 3.0
    index, size = input_moves(drooping, [(100, 1)], N)
    index_spoiled, size_spoiled = input_moves(spoiled, [(100, 1)], N)
    assert_array_equal(index_spoiled, index)
    # three of eight noisy samples replaced, at most: 3 / 8 of two times three sigma
    assert_allclose(size_spoiled, size, atol=2 * 3 / 8 * 3 * NOISE)


def test_an_excursion_of_four_samples_is_followed_with_its_area():
    moved = NOISY.copy()
    moved[104:108] += 0.5
    index, size = input_moves(moved, [(100, 1)], N)
    assert index.size > 1
    area = np.sum(written(index, size)[100:116] - 1)
    # noise of sixteen samples and of the level before the edge
    assert area == pytest.approx(4 * 0.5, abs=4 * NOISE * (np.sqrt(16) + 16 * 1.25 / 10))


def test_overshoot_on_the_edge_itself_is_followed_with_its_area():
    bouncing = NOISY.copy()
    bouncing[100] += 0.5
    index, size = input_moves(bouncing, [(100, 1)], N)
    area = np.sum(written(index, size)[100:108] - 1)
    assert area == pytest.approx(0.5, abs=4 * NOISE * (np.sqrt(8) + 8 * 1.25 / 10))


def test_what_six_sigma_cover_is_noise_and_no_spike():
    spoiled = NOISY.copy()
    spoiled[300] = np.median(NOISY[297:304]) + 4 * NOISE
    moved = input_moves(spoiled, [(100, 1)], N)[1]
    assert_allclose(moved, input_moves(NOISY, [(100, 1)], N)[1], atol=NOISE / 5)


def test_the_input_is_not_touched():
    given = NOISY.copy()
    given[300] += 1
    before = given.copy()
    input_moves(given, [(100, 3)], 900)
    assert_array_equal(given, before)


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
def test_the_moves_scale_with_the_unit(scale):
    drooping = NOISY - 0.2 * (K >= 100) * (1 - np.exp(-(K - 100.0) / 150))
    index, size = input_moves(drooping, [(100, 1)], N)
    other_index, other_size = input_moves(scale * drooping, [(100, 1)], N)
    assert_array_equal(other_index, index)
    assert_allclose(other_size, scale * size, rtol=1e-9, atol=1e-12 * scale)
