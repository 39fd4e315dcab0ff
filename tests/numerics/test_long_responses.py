"""Responses and relaxations of long records are found in pieces, and are the same."""

from __future__ import annotations

import numpy as np
from numpy.testing import assert_allclose

from ctrl_realize.numerics.relaxation import relaxation


def test_a_relaxation_is_told_by_the_rest_and_continued_to_the_end():
    k = np.arange(5000)
    exact = 3 + 0.8 * np.exp(-k / 60)
    noise = 1e-3 * np.random.default_rng(0).standard_normal(k.size)
    after = np.where(k < 400, 0, 50.0)  # what comes after the step is nobody's business here
    curve = relaxation(exact + noise + after, 400)
    # the rates that are tried lie 19 % apart; half of that turns 0.8 into 0.8 (1 +- 0.035)
    assert_allclose(curve, exact, atol=0.04)
    assert curve.size == k.size
    assert relaxation(0.001 * k + noise, 400) is None
