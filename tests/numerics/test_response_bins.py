"""Means over bins that grow with the distance from where a response begins."""

from __future__ import annotations

import numpy as np
import pytest

from ctrl_realize.numerics.signals.bins import Bins, response_bins


def test_means_are_those_of_the_samples_of_each_bin():
    bins = Bins(np.array([0, 1, 4]), np.array([1, 3, 2]))
    values = np.array([5.0, 1.0, 2.0, 6.0, 7.0, 9.0, 100.0])  # the last is in no bin
    assert bins.average(values).tolist() == [5.0, 3.0, 8.0]
    both = np.stack([values, -2 * values], axis=1)
    assert bins.average(both).tolist() == [[5.0, -10.0], [3.0, -6.0], [8.0, -16.0]]


def test_bins_are_4_percent_of_the_distance_from_the_first_motion_wide():
    bins = response_bins(2000, [100], 20)
    away = np.abs(bins.first[12:] - 120)
    width = bins.width[12:]
    # single samples as far as two are more than 4 %, that is within 50 samples
    assert np.all(width[away < 50] == 1)
    assert np.all(width[:-1] <= np.maximum(0.04 * away[:-1], 1))
    # widths go up by 19 %, or from 1 to 2, 2 to 3, 3 to 4 and 4 to 5
    wide = away[:-1] >= 75
    assert np.all(width[:-1][wide] > 0.04 * away[:-1][wide] / 1.34)
    # few of them are different, and none is beyond 4 % of the 1880 samples that are left
    assert width[:-1].max() <= 75
    assert len(set(width.tolist())) <= 20
    assert bins.width.sum() == 2000


@pytest.mark.parametrize("edges", [[0], [1], [7, 9], [100, 101, 300]])
def test_every_sample_is_in_one_bin(edges):
    bins = response_bins(500, edges, 30)
    inside = np.concatenate(
        [np.arange(f, f + w) for f, w in zip(bins.first, bins.width, strict=True)]
    )
    assert inside.tolist() == list(range(500))
