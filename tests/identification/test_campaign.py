"""Many records: table, statistics, final model, and one bad record among them."""

from __future__ import annotations

import functools

import control as ct
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import ctrl_realize as cr
from ctrl_realize.errors import DataError, OptionError
from tests.rigs import TS, step_record


def named(record: cr.Record, name: str) -> cr.Record:
    return cr.Record(record.time, record.input, record.output, name=name)


@pytest.fixture(scope="module")
def records() -> list[cr.Record]:
    return [
        named(step_record(noise=1e-3, seed=s, amplitude=a), f"{a:g}mA_{s}")
        for a in (4.0, 16.0)
        for s in range(4)
    ]


@pytest.fixture(scope="module")
def campaign(records) -> cr.Campaign:
    return cr.identify_campaign(records, method="paper")


def test_every_record_is_a_row_in_order(campaign, records):
    table = campaign.table()
    assert list(table.index) == [record.name for record in records]
    assert_allclose(table["amplitude"], [4.0] * 4 + [16.0] * 4, rtol=0.01)
    assert_array_equal(table["delay"], campaign.delays)
    assert_allclose(table["dead_time"], campaign.delays * TS)


def test_serial_and_parallel_give_the_same_bits(campaign, records):
    parallel = cr.identify_campaign(records, method="paper", n_jobs=2)
    for one, other in zip(campaign.rows, parallel.rows, strict=True):
        assert_array_equal(one.system.A, other.system.A)
        assert_array_equal(one.system.C, other.system.C)


def test_statistics_are_those_of_the_trimmed_delays(campaign):
    summary = campaign.statistics(trim=2)
    kept = np.sort(campaign.delays)[2:-2]
    assert_allclose([summary.mean, summary.variance], [kept.mean(), kept.var(ddof=1)])
    assert campaign.statistics().dropped == 4  # a quarter of eight at each end


def test_a_bad_record_is_a_row_with_its_error(records):
    t = TS * np.arange(2000)
    flat = cr.Record(t, np.ones(2000), t, name="flat")
    mixed = cr.identify_campaign([records[0], flat, records[1]], method="paper")
    assert [row.system is None for row in mixed.rows] == [False, True, False]
    assert mixed.rows[1].error.startswith("NoStepError: no step in the input of record 'flat'")
    assert mixed.table().loc["flat", "error"] == mixed.rows[1].error
    assert mixed.flags[0].code == "failed_records"
    assert "flat" in mixed.report()


def test_a_file_that_cannot_be_read_is_a_row_with_its_name(records, tmp_path):
    missing = functools.partial(cr.read_record, tmp_path / "gone.csv")
    mixed = cr.identify_campaign([records[0], missing], method="paper", n_jobs=2)
    assert "gone.csv" in mixed.rows[1].name
    assert "MissingFileError" in mixed.rows[1].error


def test_records_of_different_sample_times_have_no_common_delay(records):
    slow = cr.Record(records[0].time * 2, records[0].input, records[0].output, name="slow")
    mixed = cr.identify_campaign([records[0], slow], method="paper")
    with pytest.raises(DataError, match="sample times from"):
        mixed.statistics()
    assert mixed.table()["dead_time"].notna().all()


def test_a_delay_that_grows_with_the_step_raises_the_alarm():
    slow = [
        named(step_record(noise=1e-3, seed=s, amplitude=a, delay=37 + 2 * a), f"{a:g}_{s}")
        for a in (4.0, 16.0)
        for s in range(4)
    ]
    flags = cr.identify_campaign(slow, method="scan", order=3, max_delay=120).flags
    assert [flag.code for flag in flags] == ["amplitude_trend"]
    assert "longer for larger steps" in str(flags[0])


@pytest.mark.parametrize(
    ("make", "error", "match"),
    [
        (lambda: cr.identify_campaign([]), DataError, "no records"),
        (lambda: cr.identify_campaign(["a.csv"]), DataError, "records.0. is a str"),
        (lambda: cr.identify_campaign([step_record()], ordr=3), OptionError, "ordr"),
        (lambda: cr.identify_campaign([step_record()], n_jobs=0), OptionError, "n_jobs=0"),
        (lambda: cr.identify_campaign([step_record()], method="x"), OptionError, "choose one of"),
    ],
)
def test_unusable_arguments_are_refused(make, error, match):
    with pytest.raises(error, match=match):
        make()


def test_table_1_gives_the_papers_37_and_2():
    # Through the statistics that a campaign uses: 36.676 and 2.042 / 2.104.
    from ctrl_realize import paper
    from ctrl_realize.numerics.statistics import trimmed_statistics

    table = np.asarray(paper.TABLE_1, dtype=float)
    summary = trimmed_statistics(table, 3)
    assert_allclose(summary.mean, 36.676, atol=5e-4)
    assert_allclose(summary.variance, 2.104, atol=5e-4)
    assert_allclose(trimmed_statistics(table, 3, ddof=0).variance, 2.042, atol=5e-4)
    assert (round(summary.mean), round(summary.variance)) == (paper.DELAY, 2)


def test_the_final_model_is_the_best_record_at_the_common_delay(campaign):
    system = campaign.system
    assert isinstance(system, ct.StateSpace)
    assert system.delay == round(campaign.statistics().mean)
    scan = campaign.best.system.fit
    again = cr.realize(scan.impulse, 3, delay=system.delay, samples=1000, feedthrough=True)
    assert_array_equal(system.A, again.A)
