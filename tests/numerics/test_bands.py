"""Bands of a frequency axis: running median, and the widest stretch."""

from __future__ import annotations

import numpy as np
import pytest

from ctrl_realize.numerics.bands import running_median, widest_run


@pytest.mark.parametrize(
    ("good", "frequency", "kept"),
    [
        # one octave of 0.1...0.2 Hz against a third of one, also far below 1 Hz
        ([1, 1, 0, 1, 1, 1], [0.1, 0.2, 0.3, 0.4, 0.45, 0.5], [0, 1]),
        # as wide: more points, then the lower frequency
        ([1, 1, 0, 1, 1, 1], [1.0, 2.0, 3.0, 4.0, 6.0, 8.0], [3, 4, 5]),
        ([1, 1, 0, 1, 1], [1.0, 2.0, 3.0, 4.0, 8.0], [0, 1]),
        ([0, 1, 0, 1], [1.0, 2.0, 4.0, 8.0], [1]),
        # frequency zero counts as the first positive one
        ([1, 1, 0, 1, 1], [0.0, 1.0, 1.5, 2.0, 3.0], [3, 4]),
        ([1, 1, 1, 1, 1], [0.0, 1.0, 1.5, 2.0, 3.0], [0, 1, 2, 3, 4]),
        ([1], [0.0], [0]),
    ],
)
def test_the_run_of_most_octaves_is_kept(good, frequency, kept):
    found = widest_run(np.array(good, dtype=bool), np.array(frequency))
    assert np.flatnonzero(found).tolist() == kept


def test_a_median_runs_over_neighbours_and_repeats_the_ends():
    values = np.array([5.0, 1.0, 2.0, 9.0, 3.0, 4.0, 0.0])
    assert running_median(values, 1).tolist() == values.tolist()
    assert running_median(values, 3).tolist() == [5.0, 2.0, 2.0, 3.0, 4.0, 3.0, 0.0]
    assert running_median(values, 4).tolist() == running_median(values, 5).tolist()
    # at most as many as there are
    assert running_median(values, 99).tolist() == running_median(values, 7).tolist()
    assert running_median(values[:2], 99).tolist() == [5.0, 1.0]
