"""Correlation of a residual, from its running sums."""

from __future__ import annotations

import numpy as np
import pytest

from ctrl_realize.numerics.running_residual import RunningResidual


def inflation(errors, every=20):
    residual = RunningResidual(np.exp(-1 / 1000))
    for number, error in enumerate(errors, start=1):
        residual.add(error)
        if number % every == 0:
            residual.close_sum()
    return residual.inflation


@pytest.mark.parametrize("size", [1e-9, 1.0, 1e9])
def test_white_samples_count_as_they_are_whatever_their_size(size):
    rng = np.random.default_rng(0)
    found = [inflation(size * rng.standard_normal(5000)) for _ in range(10)]
    # some 100 sums carry weight: each ratio is known to 15 %, and 1 is the least
    assert 1.0 <= np.mean(found) < 1.3


def test_samples_held_for_ten_count_as_a_tenth():
    held = np.repeat(np.random.default_rng(0).standard_normal(1000), 10)
    assert 7 < inflation(held) < 13  # known to 15 %, too


def test_inflation_is_the_ratio_of_sums_that_are_forgotten():
    residual = RunningResidual(0.5)
    residual.add(1.0)
    residual.add(2.0)
    residual.close_sum()
    # (1 + 2)^2 over 1 / 2 + 4
    assert residual.inflation == 2.0
    residual.add(-1.0)
    residual.close_sum()
    # 9 / 2 + 1 over 4.5 / 2 + 1
    assert residual.inflation == pytest.approx(5.5 / 3.25)
