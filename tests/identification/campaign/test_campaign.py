"""Many records: table, statistics, final model, and one bad record among them."""

import control as ct
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import ctrl_realize as cr
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


def test_a_delay_that_grows_with_the_step_raises_the_alarm():
    slow = [
        named(step_record(noise=1e-3, seed=s, amplitude=a, delay=37 + 2 * a), f"{a:g}_{s}")
        for a in (4.0, 16.0)
        for s in range(4)
    ]
    flags = cr.identify_campaign(slow, method="scan", order=3, max_delay=120).flags
    assert [flag.code for flag in flags] == ["amplitude_trend"]
    assert "longer for larger steps" in str(flags[0])


def test_the_final_model_is_the_best_record_at_the_common_delay(campaign):
    system = campaign.system
    assert isinstance(system, ct.StateSpace)
    assert system.delay == round(campaign.statistics().mean)
    scan = campaign.best.system.fit
    again = cr.realize(scan.impulse, 3, delay=system.delay, samples=1000, feedthrough=True)
    assert_array_equal(system.A, again.A)
