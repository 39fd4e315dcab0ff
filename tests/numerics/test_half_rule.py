"""Leads that are cancelled against lags, rule by rule (Skogestad 2003, section 5)."""

from __future__ import annotations

import numpy as np
import pytest

from ctrl_realize.numerics.state_space.process_models import half_rule


def reduced(lags, leads, dead_time, order=1):
    factor, kept, theta = half_rule(np.array(lags), np.array(leads), np.zeros(0), dead_time, order)
    return factor, kept.tolist(), theta


@pytest.mark.parametrize(
    ("lags", "leads", "dead_time", "factor", "kept"),
    [
        ([6.0, 2.0], [8.0], 1.0, 8 / 6, [2.0]),  # T1: T over tau over theta
        ([2.0, 1.0], [8.0], 2.0, 8 / 2, [1.0]),  # tau just theta
        ([2.0, 1.0], [8.0], 4.0, 8 / 4, [1.0]),  # T1a: T over theta over tau
        ([2.0, 1.0], [3.0], 4.0, 1.0, [1.0]),  # T1b: theta over T over tau
        ([9.0, 1.0], [5.0], 1.0, 5 / 9, [1.0]),  # T2: tau over T over five theta
        ([3.0], [2.0], 1.0, 1.0, [1.0]),  # T3: a smaller lag is left
        ([9.0], [2.0], 1.0, 5 / 9, [3.0]),  # T3: tau counts up to five theta
    ],
)
def test_a_lead_is_cancelled_by_its_rule(lags, leads, dead_time, factor, kept):
    found, left, theta = reduced(lags, leads, dead_time)
    assert found == pytest.approx(factor)
    assert left == pytest.approx(kept)
    assert theta == dead_time


def test_factors_of_several_leads_multiply_the_largest_lead_first():
    # 10 against 8, the largest that there is, then 3 against 2 of what is left: 2 is over theta
    factor, kept, _ = reduced([8.0, 2.0, 0.5], [3.0, 10.0], 1.0)
    assert factor == pytest.approx(10 / 8 * 3 / 2)
    assert kept == [0.5]
    # the smaller one first would take the 8, and leave the 2 to the larger
    assert factor != pytest.approx(2 / 8 * 10 / 2)
