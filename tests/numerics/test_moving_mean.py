"""Moving means: as a sum for every window, whatever the width and however wild the samples."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from ctrl_realize.numerics.moving_mean import moving_mean


def window_by_window(values, width):
    ahead = width // 2
    padded = np.concatenate([np.zeros(ahead), values, np.zeros(width)])
    return np.array([padded[i : i + width].sum() / width for i in range(values.size)])


@pytest.mark.parametrize("width", [1, 2, 3, 64, 255, 256, 257, 300, 999, 1000])
@pytest.mark.parametrize("size", [1000, 1001, 1024])
def test_narrow_and_wide_windows_are_the_sum_of_their_samples(width, size):
    values = np.random.default_rng(width).standard_normal(size) + 3
    # a thousand sums of numbers of 3 round by 1e-13
    assert_allclose(moving_mean(values, width), window_by_window(values, width), rtol=1e-12)
