"""What a campaign says of its rows, and how it is run, with rows that are written by hand."""

from __future__ import annotations

from dataclasses import replace

import control as ct
import numpy as np
import pytest

import ctrl_realize as cr
from ctrl_realize.errors import DataError, OptionError
from ctrl_realize.identification.campaign import Campaign
from ctrl_realize.identification.campaign_row import CampaignRow
from ctrl_realize.identification.packed_model import PackedModel
from ctrl_realize.results import Flag
from ctrl_realize.wording import in_time

DT = 0.1
TIME = DT * np.arange(20)
RECORD = cr.Record(TIME, TIME > 1, TIME)


def packed(dt=DT, order=1, fit=None):
    core = ct.StateSpace(0.5 * np.eye(order), np.ones((order, 1)), np.ones((1, order)), [[0.0]], dt)
    return PackedModel.of(
        cr.DelayedStateSpace(core, 3, fit=fit, name="own", inputs=["valve"], outputs=["level"])
    )


MODEL = packed()


def row(delay, name="r", model=MODEL, **values):
    values = {"amplitude": 16.0, "misfit": 0.1, "gain": 2.0} | values
    return CampaignRow(
        name, delay=delay, dead_time=DT * delay, interval=(0.5, 0.75), model=model, **values
    )


FAILED = CampaignRow("broken", error="DataError: it is")


def campaign(rows, method="scan", sources=None, options=None):
    return Campaign(tuple(rows), sources or (RECORD,) * len(rows), method, options or {})


def of_delays(*delays):
    return campaign([row(float(delay)) for delay in delays])


def test_rows_are_those_that_have_a_model_and_those_that_failed():
    some = campaign([row(3.0), FAILED, row(4.0)])
    assert [r.delay for r in some.good] == [3.0, 4.0]
    assert some.failed == (FAILED,)
    assert some.delays.tolist() == [3.0, 4.0]
    assert repr(some) == "<Campaign: 3 records, 1 failed, method 'scan'>"
    assert repr(of_delays(3)) == "<Campaign: 1 records, method 'scan'>"
    assert [flag.code for flag in some.flags] == ["failed_records"]


def test_sample_times_may_differ_by_a_part_in_a_million():
    near = campaign([row(3.0, model=packed(DT * (1 + 9e-7))), row(3.0)])
    assert near.dt == DT
    apart = campaign([row(3.0, model=packed(DT * (1 + 1.1e-6))), row(3.0)])
    for ask in (lambda: apart.dt, apart.statistics, lambda: apart.best, lambda: apart.system):
        with pytest.raises(DataError, match=r"from 0\.1 s to 0\.1 s"):
            ask()


def test_where_all_have_failed_the_first_reason_is_told():
    with pytest.raises(DataError, match=r"none of the 2 records.*DataError: it is"):
        _ = campaign([FAILED, replace(FAILED, error="another")]).dt


@pytest.mark.parametrize(
    ("count", "dropped"), [(3, 0), (4, 2), (7, 2), (8, 4), (11, 4), (12, 6), (40, 6)]
)
def test_a_quarter_but_at_most_three_are_left_out_at_each_end(count, dropped):
    assert of_delays(*range(count)).statistics().dropped == dropped


def test_statistics_leave_out_what_is_asked_for():
    five = of_delays(1, 5, 6, 7, 90)
    assert (five.statistics(trim=1).mean, five.statistics(trim=1).variance) == (6.0, 1.0)
    assert five.statistics(trim=1, ddof=0).variance == pytest.approx(2 / 3, rel=1e-12)
    assert five.statistics(trim=0).mean == pytest.approx(21.8, rel=1e-12)
    assert five.statistics(trim=2).mean == 6.0
    with pytest.raises(DataError, match="trim=3 leaves nothing of 5"):
        five.statistics(trim=3)
    with pytest.raises(DataError, match="trim=2 leaves nothing of 4"):
        of_delays(1, 2, 3, 4).statistics(trim=2)
    for trim in (-1, 1.0):
        with pytest.raises(OptionError, match="trim="):
            five.statistics(trim=trim)


def test_the_best_row_has_the_least_misfit():
    some = campaign([row(3.0, misfit=0.2), FAILED, row(4.0, misfit=0.1), row(5.0, misfit=0.3)])
    assert some.best.delay == 4.0


def test_the_table_has_all_rows_in_their_order():
    flags = (Flag("hum", "there is hum"), Flag("drift", "and drift"))
    table = campaign([row(3.0, "a", flags=flags, model=packed(order=2)), FAILED]).table()
    assert table.index.name == "record"
    assert table.loc["a"].to_dict() == {
        "amplitude": 16.0,
        "delay": 3.0,
        "dead_time": DT * 3.0,
        "low": 0.5,
        "high": 0.75,
        "order": 2.0,
        "misfit": 0.1,
        "flags": "hum, drift",
        "error": "",
    }
    broken = table.loc["broken"]
    assert (broken["flags"], broken["error"]) == ("", "DataError: it is")
    assert broken.drop(["flags", "error"]).isna().all()
    assert list(table.index) == ["a", "broken"]
    assert campaign([FAILED]).table()["order"].dtype == float


def test_rows_are_grouped_by_two_digits_of_their_height():
    rows = [
        row(3.0, amplitude=16.2, gain=1.0),
        row(9.0, amplitude=float("nan"), gain=5.0),
        row(5.0, amplitude=15.8, gain=4.0),
        row(7.0, amplitude=-4.0, gain=np.inf),
        row(8.0, amplitude=-4.04, gain=np.inf),
        FAILED,
    ]
    groups = campaign(rows).by_amplitude()
    assert groups.index.name == "amplitude"
    np.testing.assert_array_equal(groups.index, [-4.0, 16.0, np.nan])
    # of 3 and 5: mean 4, variance 2; of 1 and 4: mean 2.5, variance 4.5
    expected = {
        "records": [2, 2, 1],
        "delay": [7.5, 4.0, 9.0],
        "std": [np.sqrt(0.5), np.sqrt(2.0), np.nan],
        "gain": [np.inf, 2.5, 5.0],
        "gain_std": [np.nan, np.sqrt(4.5), np.nan],
    }
    assert list(groups.columns) == list(expected)
    for name, values in expected.items():
        np.testing.assert_allclose(groups[name], values, rtol=1e-12)


def test_without_rows_there_are_no_groups():
    groups = campaign([FAILED]).by_amplitude()
    assert list(groups.columns) == ["records", "delay", "std", "gain", "gain_std"]
    assert len(groups) == 0


def test_the_card_tells_mean_scatter_and_best_record():
    rows = [row(float(d), f"r{d}", misfit=d / 10) for d in (1, 5, 6, 7, 90)]
    card = campaign([*rows, FAILED]).report()
    assert card.startswith("Campaign of 6 records (scan)\n")
    shown = dict(campaign([*rows, FAILED])._rows())
    summary = campaign(rows).statistics(trim=1)
    low, high = summary.interval
    assert shown["identified"] == "5 of 6 records"
    assert shown["delay, trimmed mean"] == f"6.00 samples = {in_time(0.6)} (2 of 5 left out)"
    assert shown["variance"] == "1 samples^2"
    assert shown["95 % interval of the mean"].startswith(f"{low:.2f}...{high:.2f} samples (")
    assert shown["best record"] == "r1 (misfit 0.1)"


def test_one_record_has_no_scatter():
    shown = dict(of_delays(3.12345)._rows())
    assert shown["scatter"] == "unknown: one record has none"
    assert "variance" not in shown
    assert shown["delay, trimmed mean"] == "3.12 samples = 312.3 ms (0 of 1 left out)"
