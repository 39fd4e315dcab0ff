"""Edges of an input, its moves, and where in a long record it moves."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from ctrl_realize.numerics.signals.edges import despike, difference_noise, find_edges
from ctrl_realize.numerics.signals.excitation import beyond_order_two, lively_start
from ctrl_realize.numerics.signals.step_sequence import input_moves


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
    assert_allclose([found.baseline, found.amplitude], [0, values[-1]], atol=1e-12)


def test_edges_are_found_anywhere_in_a_long_record():
    # longer than what is looked at together; edges on, before and after where that ends
    edges = [1000, 2**20 - 1, 2**20 + 60, 2**21, 2**21 + 5000]
    signal = np.zeros(2**21 + 6000)
    for i, edge in enumerate(edges):
        signal[edge:] = (i + 1) % 2
    found = find_edges(signal, 5, 0.1)
    assert [edge.index for edge in found] == edges
    assert [edge.amplitude for edge in found] == [1.0, -1.0, 1.0, -1.0, 1.0]


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


def moving(samples: int) -> np.ndarray:
    return np.random.default_rng(1).choice([-1.0, 1.0], samples)


@pytest.mark.parametrize("level", [0.0, 1e6])
def test_the_part_that_is_fitted_begins_where_the_inputs_move(level):
    zeros = np.zeros
    assert lively_start(level + moving(5000)[None], 400) == 0
    for rest in (450, 1000, 3999):
        signal = level + np.concatenate([zeros(rest), moving(2000), zeros(3000)])
        # half of the variance there is: the stretch begins up to half its length before
        assert rest - 300 <= lively_start(signal[None], 400) <= rest + 100
    both = np.full((2, 4000), level)
    both[0, :3000] += moving(3000)
    both[1, 2000:] += moving(2000)
    assert 1600 <= lively_start(both, 400) <= 2600
    short, late = np.r_[zeros(300), moving(100)], np.r_[zeros(999), 1.0]
    assert lively_start(level + short[None], 400) == 0
    assert lively_start(level + late[None], 300) == 700


def test_what_obeys_a_recurrence_of_second_order_has_nothing_beyond_it():
    t = np.arange(1000.0)
    for signal in (np.sin(t / 7) + 3, 2 * t - 5, np.exp(-t / 300), np.sin(t / 200)):
        assert beyond_order_two([signal]) == pytest.approx(0, abs=1e-12)
    # as its docstring says
    assert beyond_order_two([np.clip(t - 100, 0, None)]) == pytest.approx(0.003, abs=5e-4)
    binary = np.repeat(np.random.default_rng(0).choice([-1.0, 1.0], 50), 20)
    assert beyond_order_two([binary]) > 0.8
    # two records of a sinusoid each: the moves over 7 samples of the slower one are beyond
    fast, slow = (np.sin(7 * omega / 2) ** 2 for omega in (1 / 7, 1 / 30))
    both = beyond_order_two([np.sin(t / 7), np.sin(t / 30)])
    assert both == pytest.approx(slow / (fast + slow), rel=0.05)  # over no whole number of periods
