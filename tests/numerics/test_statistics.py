"""Trimmed statistics."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy import stats

from ctrl_realize.numerics.statistics import circle_quantile, trimmed_statistics, upper_quantile

samples = arrays(np.float64, st.integers(7, 40), elements=st.floats(-1e3, 1e3, width=32))


@given(samples)
def test_without_trimming_it_is_the_plain_mean_and_variance(values):
    summary = trimmed_statistics(values, 0)
    assert summary.mean == pytest.approx(values.mean(), rel=1e-12, abs=1e-9)
    assert summary.variance == pytest.approx(values.var(ddof=1), rel=1e-9, abs=1e-9)
    assert summary.std_error == pytest.approx(values.std(ddof=1) / np.sqrt(values.size), abs=1e-9)


@given(samples)
def test_trimmed_mean_is_that_of_scipy(values):
    expected = stats.trim_mean(values, 2.5 / values.size)  # floor(2.5) = 2 at each end
    assert trimmed_statistics(values, 2).mean == pytest.approx(expected, rel=1e-12, abs=1e-9)


def test_95_percent_intervals_cover_the_centre_of_heavy_tails():
    rng = np.random.default_rng(3)
    hits = 0
    for _ in range(400):
        low, high = trimmed_statistics(rng.standard_t(3, 40), 3).interval
        hits += low <= 0 <= high
    # Binomial: 95 % of 400 has a standard deviation of 1.1 %; three of them.
    assert 0.917 <= hits / 400 <= 0.983


@pytest.mark.parametrize("repeats", [1.3, 2, 5, 8, 40])
def test_a_complex_error_over_its_scatter_is_distributed_as_f_and_student_say(repeats):
    freedom = 2 * (repeats - 1)
    for level in (0.5, 0.95, 0.999):
        radius = circle_quantile(level, repeats)
        assert radius**2 == pytest.approx(stats.f.ppf(level, 2, freedom), rel=1e-9)
        assert upper_quantile(1 - level, repeats) == pytest.approx(stats.t.ppf(level, freedom))
