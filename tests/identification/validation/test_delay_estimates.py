"""Ways to find one dead time, held against each other: simulated data, and views by hand."""

from dataclasses import replace

import control as ct
import numpy as np
import pytest

import ctrl_realize as cr
from ctrl_realize.identification.validation.delay_estimates_result import (
    DelayComparison,
    DelayEstimate,
)
from tests import measured
from tests.rigs import R2

DT = 0.01


def operating_record(plant=R2, delay=12.4, n=800, seed=0):
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.choice([-1.0, 1.0], n // 10), 10)
    y = cr.delayed_ss(plant, dead_time=delay * DT, dt=DT).simulate(u)
    return cr.Record(DT * np.arange(n), 5 + u, 3 + y + 0.02 * rng.standard_normal(n))


def frequency_response(plant=R2, dead_time=12.4 * DT, seed=0):
    hz = np.geomspace(0.1, 20, 60)
    w = 2 * np.pi * hz
    rng = np.random.default_rng(seed)
    noise = 0.002 * (rng.standard_normal(60) + 1j * rng.standard_normal(60))
    values = plant(1j * w) * np.exp(-1j * w * dead_time) + noise
    return cr.MeasuredFRF(values, hz, std=np.full(60, 0.002))


def view(method, low, high, kind="dead time"):
    return DelayEstimate(method, "record", kind, (low + high) / 2, low, high)


@pytest.fixture(scope="module")
def both():
    return cr.validation.compare_delay_estimates(operating_record(), frf=frequency_response())


def test_random_input_and_frequency_response_are_seen_in_five_ways_that_agree(both):
    assert [(v.method, v.source) for v in both.estimates] == [
        ("output error", "record"),
        ("scan", "record"),
        ("cross-correlation", "record"),
        ("FRF fit", "FRF"),
        ("phase slope", "FRF"),
    ]
    assert both.agree
    low, high = both.common
    assert low <= 12.4 * DT <= high
    assert both.conflicts == ()
    assert "yes, on" in both.report()


def test_a_view_in_doubt_is_shown_and_does_not_count():
    views = [view("a", 1.0, 3.0), view("b", 0.5, 4.0), view("c", 0.0, 2.5, "upper bound")]
    doubted = [*views, replace(view("d", 8.0, 9.0), doubt="says so itself")]
    check = DelayComparison(tuple(doubted), 0.1)
    for each in (check, DelayComparison(tuple(views), 0.1)):
        assert (each.common, each.conflicts) == ((1.0, 2.5), ())
    assert check.rely_on == "a"
    assert "says so itself" in check.report()
    assert "narrowest" in check.report()


def test_an_output_that_knows_nothing_of_the_input_gives_no_delay():
    rng = np.random.default_rng(0)
    u, y = rng.standard_normal((2, 200))
    check = cr.validation.compare_delay_estimates(cr.Record(0.01 * np.arange(200), u, y))
    assert not check.agree
    assert check.common is None
    assert check.rely_on is None
    assert "every estimate is in doubt" in check.report()
    assert repr(check).endswith("that are in doubt>")


def test_the_motor_has_its_step_and_its_frequency_response_in_one_table(shared_data):
    folder = shared_data / "dc_motor_tacho"
    record = measured.record("dc_motor_tacho/up")
    check = cr.validation.compare_delay_estimates(record, frf=cr.read_frf(folder / "frf.csv"))
    table = check.table()
    # 2.5 ms from the step and 2.9 ms from the FRF, by the look of the data's keepers
    assert 1.8e-3 < table.loc["output error", "value"] < 3.2e-3
    assert 2.2e-3 < table.loc["FRF fit", "value"] < 3.4e-3
    assert set(table["source"]) == {"record", "FRF"}
    # Since the ripple is made white the step alone knows it to 0.7 ms, better than the FRF does.
    assert check.agree
    assert 1.9e-3 < check.common[0] < check.common[1] < 2.6e-3
    assert check.rely_on == "output error"
    assert "in doubt" in check.report()


def test_the_circuit_without_delay_is_not_given_one_by_a_scan_that_doubts_itself(shared_data):
    folder = shared_data / "rlc_zero_delay"
    record = measured.record("rlc_zero_delay/up")
    check = cr.validation.compare_delay_estimates(record, frf=cr.read_frf(folder / "frf.csv"))
    table = check.table()
    # The scan sees eight samples, and says that it cannot tell them from none.
    assert table.loc["scan", "samples"] > 4
    assert "do not show whether there is a delay" in table.loc["scan", "doubt"]
    assert check.agree
    assert check.common[1] < record.dt
    assert check.rely_on in {"output error", "FRF fit"}


def bound(method, high):
    return view(method, 0.0, high, "upper bound")


A, B = view("a", 1.0, 3.0), view("b", 2.5, 3.5)


def test_only_pairs_that_rule_each_other_out_are_in_conflict():
    late = view("late", 4.0, 5.0)
    views = [A, B, late, bound("p", 2.0), bound("q", 4.5)]
    told = DelayComparison(tuple(views), 0.5)
    assert told.common is None
    assert "no: " in told.report()
    assert "do not agree" in repr(told)
    assert told.conflicts == (("a", "late"), ("b", "late"), ("b", "p"), ("late", "p"))
    # those that touch do not
    touching = [A, view("b", 3.0, 3.5), view("c", 3.5, 4.0)]
    for order in (touching, touching[::-1]):
        check = DelayComparison(tuple(order), 0.5)
        assert [set(pair) for pair in check.conflicts] == [{"a", "c"}]
    # the interval of an upper bound begins where nothing is said: only its end counts
    check = DelayComparison((A, view("r", 3.5, 6.0, "upper bound")), 0.5)
    assert (check.common, check.conflicts) == ((1.0, 3.0), ())


def test_a_visible_onset_bounds_no_dead_time_where_the_output_moved_before():
    # 1.8 to 5 s was common to all of them, and 6.5 s true
    plant = cr.delayed_ss(ct.tf([2], [8, 1]) * ct.tf([1], [3, 1]), dead_time=6.5, dt=1.0)
    u = np.repeat(np.random.default_rng(0).choice([-1.0, 1.0], 40), 15)[:500]
    y = plant.simulate(u) + 0.2 * np.random.default_rng(1).standard_normal(500)
    found = cr.validation.compare_delay_estimates(cr.Record(np.arange(500.0), u, y))
    assert found.common[0] <= 6.5 <= found.common[1]
    assert "onset" not in [one.method for one in found.estimates]
