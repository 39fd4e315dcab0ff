"""A measured input as moves: exact where it is clean, without noise and spikes where it is not."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from ctrl_realize.numerics.signals.step_sequence import input_moves

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


def test_a_ramp_in_noise_keeps_its_samples():
    ramp = NOISY + np.clip((K - 99) / 4, 0, 1) - (K >= 100)
    index, size = input_moves(ramp, [(100, 4)], N)
    assert_array_equal(index, [100, 101, 102, 103])
    assert_allclose(written(index, size)[100:103], (ramp - np.median(ramp[:100]))[100:103])
    # the last sample of the ramp is the first of the level that follows
    assert written(index, size)[103] == pytest.approx(1, abs=5 * NOISE / np.sqrt(100))


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
