"""The paper's numbers, against its printed text."""

from __future__ import annotations

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


def test_columns_of_table_1_have_the_means_computed_by_hand():
    # 361, 362, 361 and 375 are the column sums of the printed table.
    assert paper.TABLE_1.sum(axis=0).tolist() == [361, 362, 361, 375]


def test_table_1_cannot_be_changed_by_a_caller():
    with pytest.raises(ValueError, match="read-only"):
        paper.TABLE_1[0, 0] = 0


def test_settings_agree_with_each_other():
    settings = paper.SETTINGS
    assert 1 / settings.sample_time == 1280  # exact: 7.8125e-4 = 1/1280
    assert settings.hankel_rows == settings.samples // 2
    assert paper.SETUP.alias_free_hz == 1280 / 2.56
    assert abs(paper.DEAD_TIME - 28.9e-3) < 0.05e-3  # 37 samples, three digits
    assert len(paper.SETUP.step_sizes_ma) == paper.TABLE_1.shape[1]
    assert paper.SETUP.records_per_size == paper.TABLE_1.shape[0]


def test_errata_are_numbered_without_a_gap():
    assert [erratum.code for erratum in paper.ERRATA] == [f"E{k}" for k in range(1, 18)]


def test_95_percent_interval_of_the_trimmed_mean_is_yuens():
    summary = trimmed_statistics(paper.TABLE_1, 3)
    # Yuen by hand: winsorized std 1.5671 of 40 values, / (0.85 sqrt(40)); t(33, 0.975) = 2.0345
    ordered = np.sort(paper.TABLE_1.ravel())
    ordered[:3], ordered[-3:] = ordered[3], ordered[-4]
    by_hand = np.sqrt(np.sum((ordered - ordered.mean()) ** 2) / 39) / (0.85 * np.sqrt(40))
    assert summary.std_error == pytest.approx(by_hand, rel=1e-12)
    assert np.round(summary.interval, 1).tolist() == [36.1, 37.3]
