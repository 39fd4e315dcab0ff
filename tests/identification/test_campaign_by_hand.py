"""What a campaign says of its rows, and how it is run, with rows that are written by hand."""

from __future__ import annotations

import control as ct
import numpy as np
import pytest

import ctrl_realize as cr
from ctrl_realize.errors import DataError, OptionError
from ctrl_realize.identification.campaign import Campaign
from ctrl_realize.identification.campaign_row import CampaignRow
from ctrl_realize.identification.packed_model import PackedModel

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


def test_sample_times_may_differ_by_a_part_in_a_million():
    near = campaign([row(3.0, model=packed(DT * (1 + 9e-7))), row(3.0)])
    assert near.dt == DT
    apart = campaign([row(3.0, model=packed(DT * (1 + 1.1e-6))), row(3.0)])
    for ask in (lambda: apart.dt, apart.statistics, lambda: apart.best, lambda: apart.system):
        with pytest.raises(DataError, match=r"from 0\.1 s to 0\.1 s"):
            ask()


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
