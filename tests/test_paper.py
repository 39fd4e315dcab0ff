"""The paper's numbers, against its printed text."""

import numpy as np
import pytest

from ctrl_realize import paper
from ctrl_realize.numerics.statistics import trimmed_statistics


def test_table_1_gives_the_printed_delay_and_variance():
    summary = paper.table_1_statistics()
    assert round(summary.mean) == paper.DELAY == 37
    assert round(summary.variance) == paper.DELAY_VARIANCE == 2


@pytest.mark.parametrize(("ddof", "variance"), [(0, 2.042), (1, 2.104)])
def test_trimmed_table_1_has_mean_36_68_and_variance_2(ddof, variance):
    summary = paper.table_1_statistics(ddof=ddof)
    assert summary.count == 34
    assert round(summary.mean, 3) == 36.676
    assert round(summary.variance, 3) == variance


def test_95_percent_interval_of_the_trimmed_mean_is_yuens():
    summary = trimmed_statistics(paper.TABLE_1, 3)
    # Yuen by hand: winsorized std 1.5671 of 40 values, / (0.85 sqrt(40)); t(33, 0.975) = 2.0345
    ordered = np.sort(paper.TABLE_1.ravel())
    ordered[:3], ordered[-3:] = ordered[3], ordered[-4]
    by_hand = np.sqrt(np.sum((ordered - ordered.mean()) ** 2) / 39) / (0.85 * np.sqrt(40))
    assert summary.std_error == pytest.approx(by_hand, rel=1e-12)
    assert np.round(summary.interval, 1).tolist() == [36.1, 37.3]
